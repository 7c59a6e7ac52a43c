// client_test.exe layout: prints the sizes and offsets of the structs of the C API.
// client_test.exe GROUP PORT: runs a group of tests with a live server and prints "passed".
using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Linq;
using System.Reflection;
using System.Runtime.InteropServices;
using Stridewire;
using UnityEngine;

static class ClientTest
{
    private const double WaitS = 30.0;
    private static int port;

    static int Main(string[] arguments)
    {
        if (arguments[0] == "layout")
        {
            PrintLayout();
            return 0;
        }
        port = int.Parse(arguments[1]);
        switch (arguments[0])
        {
            case "requests": Requests(); break;
            case "poses": Poses(); break;
            case "errors": Errors(); break;
            case "lifetime": Lifetime(); break;
            case "sample": Sample(); break;
            default: return 2;
        }
        Console.WriteLine("passed");
        return 0;
    }

    static void PrintLayout()
    {
        foreach (Type type in typeof(Client).Assembly.GetTypes())
        {
            if (!type.IsValueType || !type.Name.StartsWith("stridewire_")) continue;
            Console.WriteLine("{0} {1}", type.Name, Marshal.SizeOf(type));
            foreach (FieldInfo field in type.GetFields())
            {
                Console.WriteLine("{0}.{1} {2}", type.Name, field.Name,
                                  Marshal.OffsetOf(type, field.Name));
            }
        }
    }

    static void Require(bool condition, string what)
    {
        if (!condition) throw new Exception("failed: " + what);
    }

    static void RequireEqual<T>(T actual, T expected, string what)
    {
        Require(EqualityComparer<T>.Default.Equals(actual, expected),
                what + ": expected " + expected + ", got " + actual);
    }

    /// Waits for the first event that satisfies the condition.
    static Stridewire.Event Wait(Client client, string what, Func<Stridewire.Event, bool> wanted)
    {
        Stopwatch time = Stopwatch.StartNew();
        while (time.Elapsed.TotalSeconds < WaitS)
        {
            Stridewire.Event e;
            while (client.PollEvent(out e))
            {
                if (wanted(e)) return e;
            }
            client.WaitEvent(0.1);
        }
        throw new Exception("no event: " + what + ". " + client.LastError);
    }

    static Stridewire.Event WaitReply(Client client, ulong command)
    {
        return Wait(client, "reply", e => e.Type == EventType.Reply && e.Command == command);
    }

    static Client Connect()
    {
        var client = new Client();
        client.Connect("127.0.0.1", port);
        return client;
    }

    static void Requests()
    {
        using (Client client = Connect())
        {
            World world = client.Join("requests");
            ulong spawn = world.Spawn(0, new Position(0, 0, 0));
            Stridewire.Event chosen =
                Wait(client, "item", e => e.Type == EventType.Item && e.Command == spawn);
            uint avatar = chosen.Avatar;
            Require(avatar != 0, "the server chooses an id");
            RequireEqual(chosen.World, world.Id, "world");

            var ends = new Dictionary<ulong, Stridewire.Event>();
            Func<ulong, Stridewire.Event> waitEnd = request =>
            {
                if (!ends.ContainsKey(request))
                {
                    Wait(client, "end of a request", e =>
                    {
                        if (e.Outcome != Outcome.None) ends.Add(e.RequestId, e);
                        return e.Outcome != Outcome.None && e.RequestId == request;
                    });
                }
                return ends[request];
            };
            ulong step = world.Step(avatar, 0.5, Foot.Left);
            ulong footprint = world.StepTo(avatar, new Position(-0.1, 0, 0.9), Foot.Right, 0.0);
            ulong far = world.Step(avatar, 5.0);
            ulong stand = world.Stand(avatar, 100.0);
            RequireEqual(waitEnd(step).Outcome, Outcome.Completed, "step");
            RequireEqual(waitEnd(footprint).Outcome, Outcome.Completed, "footprint");
            RequireEqual(waitEnd(far).Outcome, Outcome.Rejected, "far step");
            RequireEqual(waitEnd(far).Status, Status.OutOfRange, "status of the far step");
            Require(waitEnd(far).NearestLengthM > 0.3, "the nearest step is in the event");
            Require(waitEnd(far).Text.Length > 10, "the event has a text");
            ulong walk = world.WalkTo(avatar, new Position(0, 0, 9), 0.0,
                                      new[] { new Position(0, 0, 4) }, 1.2, Interrupt.Now);
            RequireEqual(waitEnd(stand).Outcome, Outcome.Replaced, "stand");
            ulong queued = world.Stand(avatar, 1.0);
            world.Cancel(avatar);
            RequireEqual(waitEnd(queued).Outcome, Outcome.Cancelled, "queued stand");
            RequireEqual(waitEnd(walk).Outcome, Outcome.Cancelled, "walk");
            ulong jump = world.Jump(avatar, 0.5, allowNearest: true);
            world.Teleport(avatar, new Position(5, 0, 5));
            RequireEqual(waitEnd(jump).Outcome, Outcome.Cancelled, "jump");
            stand = world.Stand(avatar, 100.0);
            world.Remove(avatar);
            RequireEqual(waitEnd(stand).Outcome, Outcome.Removed, "stand of a removed avatar");
        }
    }

    static void Poses()
    {
        using (Client client = Connect())
        {
            World world = client.Join("poses");
            world.Spawn(3, new Position(1, 0, 2));
            uint subscription = world.Observe(PoseMode.Movement, new uint[] { 3 });
            RequireEqual(WaitReply(client, world.JoinCommand).Status, Status.Ok, "join");
            Require(world.GetLayers().Contains("wave"), "layers");
            RequireEqual(WaitReply(client, world.SetLayer(3, "wave")).Status, Status.Ok, "layer");
            Skeleton skeleton = world.GetSkeleton();
            RequireEqual(skeleton.Names.Length, skeleton.Parents.Length, "joints");
            RequireEqual(skeleton.Parents[0], -1, "root");
            RequireEqual(skeleton.TickHz, 60.0, "tick rate");

            var rotations = new float[4 * skeleton.Names.Length];
            var pose = default(PoseInfo);
            double time = 0.0;
            for (int tries = 0; tries < 100; ++tries)
            {
                client.WaitEvent(0.05);
                if (client.TryGetRenderTime(out time) &&
                    world.Sample(3, time, rotations, out pose))
                {
                    break;
                }
                System.Threading.Thread.Sleep(50);
            }
            RequireEqual(pose.JointCount, skeleton.Names.Length, "joints of the pose");
            Require(pose.Kind != PoseKind.Missing, "pose");
            Require(Math.Abs(pose.RootPosition.X - 1.0) < 0.2, "x of the root");
            Require(pose.RootPosition.Y > 0.7, "y of the root");
            for (int i = 0; i < rotations.Length; i += 4)
            {
                float sum = 0;
                for (int k = i; k < i + 4; ++k) sum += rotations[k] * rotations[k];
                Require(Math.Abs(sum - 1.0) < 1e-3, "unit quaternion");
            }
            Require(world.Latest(3, rotations, out pose), "latest pose");
            RequireEqual(pose.Kind, PoseKind.Raw, "kind of the latest pose");
            Require(world.Next(3, ulong.MaxValue, rotations, out pose), "oldest pose");
            Require(!world.Next(4, ulong.MaxValue, rotations, out pose), "unknown avatar");
            var ids = new uint[2];
            RequireEqual(world.ListAvatars(ids), 1, "avatars");
            RequireEqual(ids[0], 3u, "avatar");

            Require(world.Latest(3, rotations, out pose), "pose before a teleport");
            uint segment = pose.Segment;
            RequireEqual(WaitReply(client, world.Teleport(3, new Position(4, 0, 2))).Status,
                         Status.Ok, "teleport");
            for (int tries = 0; tries < 100 && pose.Segment == segment; ++tries)
            {
                System.Threading.Thread.Sleep(50);
                client.TryGetRenderTime(out time);
                Require(world.Sample(3, time, rotations, out pose), "pose during a teleport");
                RequireEqual(pose.Segment == segment, pose.RootPosition.X < 2.5, "segment");
            }
            Require(pose.RootPosition.X > 2.5, "the avatar is at its new place");

            AllocatesNothing(client, world, rotations);
            FollowsRig(skeleton, rotations);
            RequireEqual(WaitReply(client, world.StopObserving(subscription)).Status, Status.Ok,
                         "stop observing");
            RequireEqual(WaitReply(client, world.Leave()).Status, Status.Ok, "leave");
        }
    }

    /// A frame that allocates 16 bytes would fill the 4 MiB nursery of the collector.
    static void AllocatesNothing(Client client, World world, float[] rotations)
    {
        GC.Collect();
        int before = GC.CollectionCount(0);
        for (int i = 0; i < 400000; ++i)
        {
            Stridewire.Event e;
            double time;
            PoseInfo pose;
            client.PollEvent(out e);
            if (client.TryGetRenderTime(out time)) world.Sample(3, time, rotations, out pose);
        }
        RequireEqual(GC.CollectionCount(0), before, "collections");
    }

    /// A rig whose bones have other axes and another rest pose points in the same directions.
    static void FollowsRig(Skeleton skeleton, float[] rotations)
    {
        int knee = skeleton.Find("LeftLeg");
        int ankle = skeleton.Find("LeftFoot");
        var rest = new Rotation(0.5f, 0.5f, -0.5f, 0.5f);
        var forward = new Position(0, -0.6, 0.8);  // The rig's lower leg points ahead at rest.
        var retargeter = new Retargeter(skeleton, new[]
        {
            new RigBone { Joint = knee, EndJoint = ankle, Rest = rest, Direction = forward },
        });
        var bones = new Rotation[1];
        retargeter.Apply(rotations, bones);
        Rotation world = Rotation.Identity;
        for (int joint = knee; joint >= 0; joint = skeleton.Parents[joint])
        {
            world = new Rotation(rotations[4 * joint], rotations[4 * joint + 1],
                                 rotations[4 * joint + 2], rotations[4 * joint + 3]) * world;
        }
        Position expected = UnitySpace.Convert(world * skeleton.Offsets[ankle]);
        var unrest = new Rotation(-rest.X, -rest.Y, -rest.Z, rest.W);
        Position actual = bones[0] * unrest * forward;
        double length = skeleton.Offsets[ankle].Length;
        Require(Math.Abs(actual.X - expected.X / length) < 1e-4 &&
                Math.Abs(actual.Y - expected.Y / length) < 1e-4 &&
                Math.Abs(actual.Z - expected.Z / length) < 1e-4, "direction of the lower leg");
        Require(actual.Y < -0.9, "the lower leg points down");
    }

    static void Errors()
    {
        using (Client client = Connect())
        {
            World world = client.Join("errors");
            WaitReply(client, world.Spawn(7, new Position()));
            RequireEqual(WaitReply(client, world.Spawn(7, new Position())).Status,
                         Status.AvatarExists, "same id");
            RequireEqual(WaitReply(client, world.Teleport(8, new Position())).Status,
                         Status.NoSuchAvatar, "unknown id");
            try
            {
                world.Stand(7, double.NaN);
                Require(false, "NaN is rejected");
            }
            catch (StridewireException e)
            {
                RequireEqual(e.Status, Status.OutOfRange, "NaN");
                Require(e.Message.StartsWith("out_of_range: "), "message");
            }
            world.Observe();
            WaitReply(client, world.SetLayer(7, "wave"));
            var small = new float[4];
            PoseInfo pose;
            try
            {
                for (int i = 0; i < 100 && !world.Latest(7, small, out pose); ++i)
                {
                    System.Threading.Thread.Sleep(50);
                }
                Require(false, "a small array is rejected");
            }
            catch (StridewireException e)
            {
                RequireEqual(e.Status, Status.BufferTooSmall, "small array");
            }
            World observed = client.Join("observed", Role.Observer);
            RequireEqual(WaitReply(client, observed.Spawn(1, new Position())).Status,
                         Status.NotAllowed, "observer");
            client.Dispose();
            try
            {
                world.Observe();
                Require(false, "a disposed client is rejected");
            }
            catch (ObjectDisposedException)
            {
            }
        }
        using (var client = new Client())
        {
            client.Connect(new ServerAddress { Host = "127.0.0.1", Port = 1 },
                           new ServerAddress { Host = "localhost", Port = port });
            Stridewire.Event failed =
                Wait(client, "failure", e => e.Type == EventType.ConnectFailed);
            Require(failed.Text.StartsWith("127.0.0.1:1: "), "the text contains the address");
            Stridewire.Event connected =
                Wait(client, "second server", e => e.Type == EventType.Connected);
            RequireEqual(connected.Text, "localhost:" + port, "second server");
        }
        using (var client = new Client())
        {
            client.Connect("127.0.0.1", 1);
            Stridewire.Event failed =
                Wait(client, "failure", e => e.Type == EventType.ConnectFailed);
            RequireEqual(failed.Status, Status.ConnectFailed, "no server");
            RequireEqual(client.State, ClientState.Connecting, "state");
        }
    }

    /// A call keeps the native client alive.
    static void Lifetime()
    {
        Type abi = typeof(Client).Assembly.GetType("Stridewire.Abi");
        int calls = 0;
        foreach (MethodInfo method in abi.GetMethods())
        {
            foreach (ParameterInfo parameter in method.GetParameters())
            {
                if (parameter.Name != "client" || method.Name.EndsWith("create")) continue;
                bool isDestroy = method.Name.EndsWith("destroy");
                RequireEqual(typeof(SafeHandle).IsAssignableFrom(parameter.ParameterType),
                             !isDestroy, method.Name);
                ++calls;
            }
        }
        Require(calls > 20, "functions of a client");

        var client = new Client();
        bool hasEvent = true;
        var waiting = new System.Threading.Thread(() => hasEvent = client.WaitEvent(1.0));
        waiting.Start();
        System.Threading.Thread.Sleep(300);
        client.Dispose();
        RequireEqual(client.State, ClientState.Idle, "state of a disposed client");
        waiting.Join();
        Require(!hasEvent, "a wait ends after the client was disposed");
        client.Dispose();
    }

    /// Runs the sample with a rig of bones in a T-pose.
    static void Sample()
    {
        var rig = new HumanoidAvatar { port = port, world = "sample" };
        var heights = new Dictionary<HumanBodyBones, Vector3>
        {
            { HumanBodyBones.Hips, new Vector3(0, 1.8f, 0) },
            { HumanBodyBones.LeftUpperLeg, new Vector3(-0.2f, 1.8f, 0) },
            { HumanBodyBones.LeftLowerLeg, new Vector3(-0.2f, 1.0f, 0) },
            { HumanBodyBones.LeftFoot, new Vector3(-0.2f, 0.2f, 0) },
        };
        foreach (KeyValuePair<HumanBodyBones, Vector3> each in heights)
        {
            rig.TheAnimator.Bones.Add(each.Key, new Transform { position = each.Value });
        }
        rig.goal = new Transform { position = new Vector3(0, 0, 1.5f) };
        Call(rig, "OnEnable");
        Stopwatch time = Stopwatch.StartNew();
        Transform hips = rig.TheAnimator.Bones[HumanBodyBones.Hips];
        while (hips.position.z < 1.2f && time.Elapsed.TotalSeconds < WaitS)
        {
            System.Threading.Thread.Sleep(16);
            Call(rig, "LateUpdate");
        }
        Call(rig, "OnDisable");
        Require(hips.position.z > 1.2f, "the rig walks to the goal");
        Require(hips.position.y > 0.7f && hips.position.y < 1.2f, "height of the hips");
        Require(rig.transform.localScale.x < 0.7f, "the rig is scaled to the legs");
    }

    static void Call(object target, string method)
    {
        target.GetType()
            .GetMethod(method, BindingFlags.Instance | BindingFlags.NonPublic)
            .Invoke(target, null);
    }
}
