using System;
using System.Collections.Generic;
using Stridewire;
using UnityEngine;

/// <summary>Spawns an avatar and animates the humanoid rig of this object with its poses. If a goal
/// is set, the avatar walks there whenever it stands elsewhere. When the object is enabled, the rig
/// must be in its T-pose and face its own +z. The rig is scaled so that its legs are as long as
/// those of the skeleton, because otherwise feet would slide.</summary>
[RequireComponent(typeof(Animator))]
public sealed class HumanoidAvatar : MonoBehaviour
{
    public string host = "127.0.0.1";
    public int port = 7420;
    public string world = "plaza";
    public uint avatar = 1;
    public Transform goal;

    private const float GoalRadius = 0.3f;

    private readonly float[] rotations = new float[4 * 256];
    private Client client;
    private World joined;
    private Retargeter retargeter;
    private Transform hips;
    private Transform[] bones;
    private Rotation[] boneRotations;
    private bool isIdle;

    private void OnEnable()
    {
        client = new Client(new ClientOptions { Respawn = true });
        client.Connect(host, port);
        joined = client.Join(world);
        Vector3 at = transform.position;
        joined.Spawn(avatar, UnitySpace.Convert(new Position(at.x, at.y, at.z)));
        joined.Observe();
    }

    private void OnDisable()
    {
        client.Dispose();
        retargeter = null;
    }

    private void LateUpdate()
    {
        Stridewire.Event e;
        while (client.PollEvent(out e))
        {
            if (e.Type == EventType.WorldJoined && retargeter == null) Bind(joined.GetSkeleton());
            if (e.Type == EventType.Idle && e.Avatar == avatar) isIdle = true;
            if (e.Status != Status.Ok) Debug.LogWarning("Stridewire: " + e.Text);
        }
        double time;
        PoseInfo pose;
        if (retargeter == null || !client.TryGetRenderTime(out time) ||
            !joined.Sample(avatar, time, rotations, out pose))
        {
            return;
        }
        Position root = UnitySpace.Convert(pose.RootPosition);
        hips.position = new Vector3((float)root.X, (float)root.Y, (float)root.Z);
        retargeter.Apply(rotations, boneRotations);
        for (int i = 0; i < bones.Length; ++i)
        {
            Rotation q = boneRotations[i];
            bones[i].rotation = new Quaternion(q.X, q.Y, q.Z, q.W);
        }
        if (goal != null && isIdle) WalkToGoal();
    }

    private void WalkToGoal()
    {
        Vector3 to = goal.position - hips.position;
        if (to.x * to.x + to.z * to.z < GoalRadius * GoalRadius) return;
        Vector3 at = goal.position;
        // In Unity, positive angles turn clockwise; in Stridewire, counterclockwise.
        double heading = -goal.eulerAngles.y * Math.PI / 180.0;
        joined.WalkTo(avatar, UnitySpace.Convert(new Position(at.x, at.y, at.z)), heading);
        isIdle = false;
    }

    /// <summary>Connects the bones of the rig, in its rest pose, with the joints.</summary>
    private void Bind(Skeleton skeleton)
    {
        Animator animator = GetComponent<Animator>();
        animator.enabled = false;
        var used = new List<Transform>();
        var rigBones = new List<RigBone>();
        foreach (HumanoidBone each in HumanoidBone.All)
        {
            Transform bone = Find(animator, each.Bone);
            int joint = skeleton.Find(each.Joint);
            if (bone == null || joint < 0) continue;
            Quaternion rest = Quaternion.Inverse(transform.rotation) * bone.rotation;
            var rigBone = new RigBone
            {
                Joint = joint,
                EndJoint = -1,
                Rest = new Rotation(rest.x, rest.y, rest.z, rest.w),
            };
            Transform end = each.EndBone == null ? null : Find(animator, each.EndBone);
            if (end != null && skeleton.Find(each.EndJoint) >= 0)
            {
                Vector3 direction =
                    transform.InverseTransformDirection(end.position - bone.position);
                rigBone.EndJoint = skeleton.Find(each.EndJoint);
                rigBone.Direction = new Position(direction.x, direction.y, direction.z);
            }
            used.Add(bone);
            rigBones.Add(rigBone);
        }
        bones = used.ToArray();
        boneRotations = new Rotation[bones.Length];
        hips = Find(animator, "Hips");
        Scale(animator, skeleton);
        retargeter = new Retargeter(skeleton, rigBones.ToArray());
    }

    private void Scale(Animator animator, Skeleton skeleton)
    {
        Transform hip = Find(animator, "LeftUpperLeg");
        Transform knee = Find(animator, "LeftLowerLeg");
        Transform ankle = Find(animator, "LeftFoot");
        int kneeJoint = skeleton.Find("LeftLeg");
        int ankleJoint = skeleton.Find("LeftFoot");
        if (kneeJoint < 0 || ankleJoint < 0) return;
        float rigLeg = (knee.position - hip.position).magnitude +
                       (ankle.position - knee.position).magnitude;
        double leg = skeleton.Offsets[kneeJoint].Length + skeleton.Offsets[ankleJoint].Length;
        transform.localScale *= (float)leg / rigLeg;
    }

    private static Transform Find(Animator animator, string bone)
    {
        return animator.GetBoneTransform(
            (HumanBodyBones)Enum.Parse(typeof(HumanBodyBones), bone));
    }
}
