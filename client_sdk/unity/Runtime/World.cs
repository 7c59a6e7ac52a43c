using System;

namespace Stridewire
{
    /// <summary>A joined world. Each command returns its number. Events that it causes contain this
    /// number as Event.Command. Each request of a movement returns its id, which events of the
    /// movement contain as Event.RequestId.</summary>
    public sealed unsafe partial class World
    {
        private readonly Client client;

        internal World(Client client, uint id, string name, ulong command)
        {
            this.client = client;
            Id = id;
            Name = name;
            JoinCommand = command;
        }

        /// <summary>Number of the world. Events of the world contain it as Event.World.</summary>
        public uint Id { get; private set; }

        public string Name { get; private set; }

        /// <summary>Number of the command that joins this world.</summary>
        public ulong JoinCommand { get; private set; }

        /// <summary>Leaves the world. The server removes the avatars that this client has spawned
        /// in it, unless the world is persistent.</summary>
        public ulong Leave()
        {
            ulong command;
            Client.Check(Abi.stridewire_client_leave_world(client.Handle, Id, &command));
            return command;
        }

        // Avatars.

        /// <summary>Spawns an avatar. With the id 0, the server chooses an id and reports it in an
        /// event of the type Item.</summary>
        public ulong Spawn(uint avatar, Position position, double headingRad = 0.0)
        {
            stridewire_spawn spawn = MakeSpawn(avatar, position, headingRad);
            ulong command;
            Client.Check(
                Abi.stridewire_client_spawn(client.Handle, Id, &spawn, (UIntPtr)1, &command));
            return command;
        }

        /// <summary>Moves an avatar at once. It drops its requests and stands.</summary>
        public ulong Teleport(uint avatar, Position position, double headingRad = 0.0)
        {
            stridewire_spawn place = MakeSpawn(avatar, position, headingRad);
            ulong command;
            Client.Check(
                Abi.stridewire_client_teleport(client.Handle, Id, &place, (UIntPtr)1, &command));
            return command;
        }

        public ulong Remove(uint avatar)
        {
            ulong command;
            Client.Check(
                Abi.stridewire_client_remove(client.Handle, Id, &avatar, (UIntPtr)1, &command));
            return command;
        }

        /// <summary>Drops the requests of an avatar that have not started. A walk ends after its
        /// current step.</summary>
        public ulong Cancel(uint avatar)
        {
            ulong command;
            Client.Check(
                Abi.stridewire_client_cancel(client.Handle, Id, &avatar, (UIntPtr)1, &command));
            return command;
        }

        /// <summary>Starts, changes or ends a layer, which plays on top of the movements.</summary>
        public ulong SetLayer(uint avatar, string layer, bool enabled = true, double weight = 1.0,
                              double blendS = 0.3, double speed = 1.0)
        {
            ulong command;
            fixed (byte* name = Client.Utf8(layer))
            {
                stridewire_layer native = default(stridewire_layer);
                native.avatar = avatar;
                native.name = name;
                native.fade_out = Client.ToByte(!enabled);
                native.weight = weight;
                native.blend_s = blendS;
                native.speed = speed;
                Client.Check(Abi.stridewire_client_set_layers(
                    client.Handle, Id, &native, (UIntPtr)1, &command));
            }
            return command;
        }

        // Poses.

        /// <summary>Subscribes to the poses of some avatars, or of all if avatars is null or empty.
        /// Returns the number of the subscription.</summary>
        public uint Observe(PoseMode mode = PoseMode.Quantised, uint[] avatars = null,
                            int everyNTicks = 1, bool withEvents = false)
        {
            stridewire_observation native = default(stridewire_observation);
            native.mode = mode;
            native.every_n_ticks = checked((ushort)everyNTicks);
            native.with_events = Client.ToByte(withEvents);
            uint subscription;
            fixed (uint* ids = avatars)
            {
                native.avatars = ids;
                native.avatar_count = (UIntPtr)(avatars == null ? 0 : avatars.Length);
                Client.Check(Abi.stridewire_client_observe(
                    client.Handle, Id, &native, &subscription, null));
            }
            return subscription;
        }

        public ulong StopObserving(uint subscription)
        {
            ulong command;
            Client.Check(
                Abi.stridewire_client_stop_observing(client.Handle, subscription, &command));
            return command;
        }

        /// <summary>Samples a pose at a server time (Client.TryGetRenderTime). Writes four numbers
        /// (x, y, z, w) per joint to the array. The first rotation is relative to the world, the
        /// others are relative to the parent joint. Returns false if no pose is known. Allocates
        /// nothing.</summary>
        public bool Sample(uint avatar, double timeS, float[] rotationsXyzw, out PoseInfo pose)
        {
            fixed (float* rotations = rotationsXyzw)
            {
                stridewire_pose native = MakePose(rotations, rotationsXyzw);
                Client.Check(Abi.stridewire_client_sample_pose(
                    client.Handle, Id, avatar, timeS, &native));
                return Read(&native, out pose);
            }
        }

        /// <summary>Gets the newest received pose, like Sample.</summary>
        public bool Latest(uint avatar, float[] rotationsXyzw, out PoseInfo pose)
        {
            fixed (float* rotations = rotationsXyzw)
            {
                stridewire_pose native = MakePose(rotations, rotationsXyzw);
                Client.Check(
                    Abi.stridewire_client_latest_pose(client.Handle, Id, avatar, &native));
                return Read(&native, out pose);
            }
        }

        /// <summary>Gets the oldest stored pose after a tick, like Sample. With the tick
        /// ulong.MaxValue, gets the oldest stored pose.</summary>
        public bool Next(uint avatar, ulong afterTick, float[] rotationsXyzw, out PoseInfo pose)
        {
            fixed (float* rotations = rotationsXyzw)
            {
                stridewire_pose native = MakePose(rotations, rotationsXyzw);
                Client.Check(Abi.stridewire_client_next_pose(
                    client.Handle, Id, avatar, afterTick, &native));
                return Read(&native, out pose);
            }
        }

        /// <summary>Writes the ids of the avatars whose poses the client receives. Returns their
        /// number, which can exceed the length of the array.</summary>
        public int ListAvatars(uint[] avatars)
        {
            UIntPtr count;
            fixed (uint* ids = avatars)
            {
                Status status = Abi.stridewire_client_list_avatars(
                    client.Handle, Id, ids, (UIntPtr)avatars.Length, &count);
                if (status != Status.BufferTooSmall) Client.Check(status);
            }
            return (int)count;
        }

        /// <summary>Returns the skeleton of all avatars of this world. Throws NotReady before the
        /// event WorldJoined.</summary>
        public Skeleton GetSkeleton()
        {
            stridewire_skeleton native;
            stridewire_joint[] joints = new stridewire_joint[Abi.MaxJoints];
            fixed (stridewire_joint* first = joints)
            {
                stridewire_skeleton_buffers buffers = default(stridewire_skeleton_buffers);
                buffers.joints = first;
                buffers.joint_capacity = (UIntPtr)joints.Length;
                Status status = Abi.stridewire_client_get_skeleton(
                    client.Handle, Id, &native, &buffers);
                // The end sites do not fit, because no buffer was passed for them.
                if (status != Status.BufferTooSmall) Client.Check(status);
                int count = (int)native.joint_count;
                string[] names = new string[count];
                int[] parents = new int[count];
                Position[] offsets = new Position[count];
                for (int i = 0; i < count; ++i)
                {
                    names[i] = Client.FromUtf8(first[i].name);
                    parents[i] = first[i].parent;
                    float* offset = first[i].offset_m;
                    offsets[i] = new Position(offset[0], offset[1], offset[2]);
                }
                return new Skeleton(names, parents, offsets, native.tick_hz,
                                    Client.FromUtf8(native.library_hash));
            }
        }

        /// <summary>Returns the names of the layers of the world's library, for example
        /// "wave".</summary>
        public string[] GetLayers()
        {
            const int capacity = 64;
            stridewire_layer_name[] names = new stridewire_layer_name[capacity];
            UIntPtr count;
            fixed (stridewire_layer_name* first = names)
            {
                Client.Check(Abi.stridewire_client_list_layers(
                    client.Handle, Id, first, (UIntPtr)capacity, &count));
                string[] result = new string[(int)count];
                for (int i = 0; i < result.Length; ++i) result[i] = Client.FromUtf8(first[i].name);
                return result;
            }
        }

        private static stridewire_spawn MakeSpawn(uint avatar, Position position, double headingRad)
        {
            stridewire_spawn spawn = default(stridewire_spawn);
            spawn.avatar = avatar;
            Write(position, spawn.position_m);
            spawn.heading_rad = headingRad;
            return spawn;
        }

        private static stridewire_movement MakeMovement(uint avatar, MovementType type,
                                                        Interrupt interrupt)
        {
            stridewire_movement movement = default(stridewire_movement);
            movement.avatar = avatar;
            movement.type = type;
            movement.interrupt = interrupt;
            return movement;
        }

        private static stridewire_pose MakePose(float* rotations, float[] rotationsXyzw)
        {
            stridewire_pose pose = default(stridewire_pose);
            pose.rotations_xyzw = rotations;
            pose.joint_capacity = (UIntPtr)(rotationsXyzw.Length / 4);
            return pose;
        }

        private static bool Read(stridewire_pose* native, out PoseInfo pose)
        {
            pose.Kind = native->kind;
            pose.JointCount = (int)native->joint_count;
            pose.Tick = native->tick;
            pose.TimeS = native->time_s;
            pose.HeldS = native->held_s;
            float* root = native->root_position_m;
            pose.RootPosition = new Position(root[0], root[1], root[2]);
            pose.Discontinuity = native->discontinuity != 0;
            pose.Segment = native->segment;
            pose.Standing = native->standing != 0;
            pose.Detail = (PoseDetail)native->detail;
            return native->kind != PoseKind.Missing;
        }

        private static void Write(Position position, double* numbers)
        {
            numbers[0] = position.X;
            numbers[1] = position.Y;
            numbers[2] = position.Z;
        }

        private ulong Request(ref stridewire_movement movement)
        {
            movement.request_id = client.NextRequest();
            fixed (stridewire_movement* first = &movement)
            {
                Client.Check(Abi.stridewire_client_request(
                    client.Handle, Id, first, (UIntPtr)1, null));
            }
            return movement.request_id;
        }
    }
}
