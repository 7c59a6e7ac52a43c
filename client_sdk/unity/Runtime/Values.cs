using System;

namespace Stridewire
{
    /// <summary>A position in metres. +y is up. Stridewire's axes are right-handed and those of
    /// Unity left-handed, see UnitySpace.</summary>
    public struct Position
    {
        public double X, Y, Z;

        public Position(double x, double y, double z)
        {
            X = x;
            Y = y;
            Z = z;
        }

        public double Length
        {
            get { return Math.Sqrt(X * X + Y * Y + Z * Z); }
        }

        public override string ToString()
        {
            return string.Format(
                System.Globalization.CultureInfo.InvariantCulture,
                "({0:0.000}, {1:0.000}, {2:0.000})", X, Y, Z);
        }
    }

    /// <summary>A unit quaternion.</summary>
    public struct Rotation
    {
        public float X, Y, Z, W;

        public Rotation(float x, float y, float z, float w)
        {
            X = x;
            Y = y;
            Z = z;
            W = w;
        }

        public static Rotation Identity
        {
            get { return new Rotation(0, 0, 0, 1); }
        }

        /// <summary>The rotation b followed by the rotation a.</summary>
        public static Rotation operator *(Rotation a, Rotation b)
        {
            return new Rotation(
                a.W * b.X + a.X * b.W + a.Y * b.Z - a.Z * b.Y,
                a.W * b.Y - a.X * b.Z + a.Y * b.W + a.Z * b.X,
                a.W * b.Z + a.X * b.Y - a.Y * b.X + a.Z * b.W,
                a.W * b.W - a.X * b.X - a.Y * b.Y - a.Z * b.Z);
        }

        public static Position operator *(Rotation q, Position v)
        {
            double x = 2.0 * (q.Y * v.Z - q.Z * v.Y);
            double y = 2.0 * (q.Z * v.X - q.X * v.Z);
            double z = 2.0 * (q.X * v.Y - q.Y * v.X);
            return new Position(
                v.X + q.W * x + q.Y * z - q.Z * y,
                v.Y + q.W * y + q.Z * x - q.X * z,
                v.Z + q.W * z + q.X * y - q.Y * x);
        }

        /// <summary>The shortest rotation between two directions, which need not have length 1.
        /// </summary>
        public static Rotation Between(Position from, Position to)
        {
            double lengths = Math.Sqrt(Dot(from, from) * Dot(to, to));
            if (lengths < 1e-12) return Identity;
            double w = lengths + Dot(from, to);
            Position axis = Cross(from, to);
            if (w < 1e-6 * lengths)  // Opposite directions: rotate about any perpendicular axis.
            {
                w = 0.0;
                axis = Math.Abs(from.X) < Math.Abs(from.Y) ? new Position(0, -from.Z, from.Y)
                                                           : new Position(-from.Z, 0, from.X);
            }
            double norm = Math.Sqrt(Dot(axis, axis) + w * w);
            return new Rotation((float)(axis.X / norm), (float)(axis.Y / norm),
                                (float)(axis.Z / norm), (float)(w / norm));
        }

        private static double Dot(Position a, Position b)
        {
            return a.X * b.X + a.Y * b.Y + a.Z * b.Z;
        }

        private static Position Cross(Position a, Position b)
        {
            return new Position(
                a.Y * b.Z - a.Z * b.Y, a.Z * b.X - a.X * b.Z, a.X * b.Y - a.Y * b.X);
        }
    }

    /// <summary>Converts between Stridewire's axes and those of Unity, which have the opposite x.
    /// The conversion is the same in both directions. A heading changes its sign.</summary>
    public static class UnitySpace
    {
        public static Position Convert(Position p)
        {
            return new Position(-p.X, p.Y, p.Z);
        }

        public static Rotation Convert(Rotation q)
        {
            return new Rotation(q.X, -q.Y, -q.Z, q.W);
        }
    }

    /// <summary>A pose without the rotations of its joints, which are in an array of the caller.
    /// </summary>
    public struct PoseInfo
    {
        public PoseKind Kind;
        public int JointCount;
        /// <summary>Tick of the last received pose at or before TimeS.</summary>
        public ulong Tick;
        /// <summary>Server time of this pose in seconds.</summary>
        public double TimeS;
        /// <summary>PoseKind.Held and Extrapolated: seconds since the pose of Tick.</summary>
        public double HeldS;
        /// <summary>World position of joint 0.</summary>
        public Position RootPosition;
        /// <summary>PoseKind.Raw: true if clients must not interpolate between the pose before and
        /// this one.</summary>
        public bool Discontinuity;
        /// <summary>Poses with equal segments belong to one continuous motion. Poses with different
        /// segments must not be blended.</summary>
        public uint Segment;
        /// <summary>True: the avatar stands and has no request.</summary>
        public bool Standing;
        public PoseDetail Detail;
    }

    /// <summary>Describes how the render time adapts to the connection. Times that are not known
    /// yet are 0.</summary>
    public struct Playout
    {
        /// <summary>Delay of the render time behind the server time in seconds.</summary>
        public double DelayS;
        /// <summary>The delay that DelayS approaches.</summary>
        public double TargetDelayS;
        /// <summary>Mean lateness of pose messages relative to the fastest one, in seconds.
        /// </summary>
        public double JitterS;
        /// <summary>Server time that has passed since the newest pose message, in seconds.
        /// </summary>
        public double NewestAgeS;
        /// <summary>Number of sampled poses.</summary>
        public ulong DisplayedPoses;
        /// <summary>Number of poses that were sampled after the newest received pose and
        /// extrapolated from it.</summary>
        public ulong ExtrapolatedPoses;
        /// <summary>Number of poses that were sampled after the extrapolated motion had stopped.
        /// </summary>
        public ulong HeldPoses;
    }

    /// <summary>The joints of all avatars of a world. A joint follows its parent in the arrays.
    /// </summary>
    public sealed class Skeleton
    {
        internal Skeleton(string[] names, int[] parents, Position[] offsets, double tickHz,
                          string libraryHash)
        {
            Names = names;
            Parents = parents;
            Offsets = offsets;
            TickHz = tickHz;
            LibraryHash = libraryHash;
        }

        public string[] Names { get; private set; }

        /// <summary>Index of the parent of each joint, -1 for joint 0, which is the root.</summary>
        public int[] Parents { get; private set; }

        /// <summary>Position of each joint relative to its parent.</summary>
        public Position[] Offsets { get; private set; }

        /// <summary>Ticks per second of the server.</summary>
        public double TickHz { get; private set; }

        public string LibraryHash { get; private set; }

        /// <summary>Returns the index of the joint with this name, or -1.</summary>
        public int Find(string name)
        {
            return Array.IndexOf(Names, name);
        }
    }
}
