// The part of UnityEngine that the sample uses, so that it can be compiled and run without Unity.
using System;
using System.Collections.Generic;

namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;

        public Vector3(float x, float y, float z)
        {
            this.x = x;
            this.y = y;
            this.z = z;
        }

        public float magnitude
        {
            get { return (float)Math.Sqrt(x * x + y * y + z * z); }
        }

        public static Vector3 operator -(Vector3 a, Vector3 b)
        {
            return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z);
        }

        public static Vector3 operator *(Vector3 a, float b)
        {
            return new Vector3(a.x * b, a.y * b, a.z * b);
        }
    }

    public struct Quaternion
    {
        public float x, y, z, w;

        public Quaternion(float x, float y, float z, float w)
        {
            this.x = x;
            this.y = y;
            this.z = z;
            this.w = w;
        }

        public static Quaternion Inverse(Quaternion q)
        {
            return new Quaternion(-q.x, -q.y, -q.z, q.w);
        }

        public static Quaternion operator *(Quaternion a, Quaternion b)
        {
            Stridewire.Rotation p = new Stridewire.Rotation(a.x, a.y, a.z, a.w) *
                                    new Stridewire.Rotation(b.x, b.y, b.z, b.w);
            return new Quaternion(p.X, p.Y, p.Z, p.W);
        }
    }

    /// <summary>A transform without a parent.</summary>
    public class Transform
    {
        public Vector3 position;
        public Quaternion rotation = new Quaternion(0, 0, 0, 1);
        public Vector3 localScale = new Vector3(1, 1, 1);
        public Vector3 eulerAngles;

        /// <summary>Valid for objects that are not rotated.</summary>
        public Vector3 InverseTransformDirection(Vector3 direction)
        {
            return direction;
        }
    }

    public class Animator
    {
        public readonly Dictionary<HumanBodyBones, Transform> Bones =
            new Dictionary<HumanBodyBones, Transform>();
        public bool enabled = true;

        public Transform GetBoneTransform(HumanBodyBones bone)
        {
            Transform found;
            return Bones.TryGetValue(bone, out found) ? found : null;
        }
    }

    public class MonoBehaviour
    {
        public readonly Transform transform = new Transform();
        public readonly Animator TheAnimator = new Animator();

        public Animator GetComponent<T>()
        {
            return TheAnimator;
        }
    }

    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type type)
        {
        }
    }

    public static class Debug
    {
        public static void LogWarning(string text)
        {
            Console.WriteLine("warning: " + text);
        }
    }

    public enum HumanBodyBones
    {
        Hips, LeftUpperLeg, RightUpperLeg, LeftLowerLeg, RightLowerLeg, LeftFoot, RightFoot, Spine,
        Chest, Neck, Head, LeftShoulder, RightShoulder, LeftUpperArm, RightUpperArm, LeftLowerArm,
        RightLowerArm, LeftHand, RightHand, LeftToes, RightToes,
    }
}
