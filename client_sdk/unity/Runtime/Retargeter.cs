using System;

namespace Stridewire
{
    /// <summary>A bone of a rig and the joint that rotates it.</summary>
    public struct RigBone
    {
        /// <summary>Index of the joint in the skeleton.</summary>
        public int Joint;

        /// <summary>Index of the joint at the end of this bone, or -1. Together with Direction, it
        /// corrects for a rest pose that differs from that of the skeleton.</summary>
        public int EndJoint;

        /// <summary>Rotation of the bone in the rest pose of the rig, which faces +z, in Unity's
        /// axes, relative to the rig.</summary>
        public Rotation Rest;

        /// <summary>Direction from the bone to its end in the rest pose of the rig, in Unity's
        /// axes.</summary>
        public Position Direction;
    }

    /// <summary>Computes the rotations of the bones of a rig from poses of a skeleton. The bones
    /// may have other lengths, axes and rest rotations than the joints.</summary>
    public sealed class Retargeter
    {
        private readonly int[] parents;
        private readonly int[] joints;
        private readonly Rotation[] rest;
        private readonly Rotation[] world;

        public Retargeter(Skeleton skeleton, RigBone[] bones)
        {
            parents = skeleton.Parents;
            world = new Rotation[parents.Length];
            joints = new int[bones.Length];
            rest = new Rotation[bones.Length];
            for (int i = 0; i < bones.Length; ++i)
            {
                RigBone bone = bones[i];
                joints[i] = bone.Joint;
                rest[i] = bone.Rest;
                if (bone.EndJoint < 0) continue;
                Position direction = Offset(skeleton, bone.Joint, bone.EndJoint);
                rest[i] = Rotation.Between(bone.Direction, UnitySpace.Convert(direction)) * rest[i];
            }
        }

        /// <summary>Computes the rotation of each bone relative to the world, in Unity's axes, from
        /// the rotations that World.Sample has written. Allocates nothing.</summary>
        public void Apply(float[] rotationsXyzw, Rotation[] bones)
        {
            for (int joint = 0; joint < parents.Length; ++joint)
            {
                int at = 4 * joint;
                Rotation local = UnitySpace.Convert(new Rotation(
                    rotationsXyzw[at], rotationsXyzw[at + 1], rotationsXyzw[at + 2],
                    rotationsXyzw[at + 3]));
                world[joint] = parents[joint] < 0 ? local : world[parents[joint]] * local;
            }
            for (int i = 0; i < joints.Length; ++i) bones[i] = world[joints[i]] * rest[i];
        }

        /// <summary>Returns the position of a joint relative to one of its ancestors in the rest
        /// pose of the skeleton.</summary>
        public static Position Offset(Skeleton skeleton, int ancestor, int joint)
        {
            Position sum = new Position();
            for (; joint != ancestor; joint = skeleton.Parents[joint])
            {
                if (joint < 0) throw new ArgumentException("the joint has no such ancestor");
                Position offset = skeleton.Offsets[joint];
                sum = new Position(sum.X + offset.X, sum.Y + offset.Y, sum.Z + offset.Z);
            }
            return sum;
        }
    }
}
