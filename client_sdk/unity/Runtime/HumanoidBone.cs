namespace Stridewire
{
    /// <summary>A bone of a humanoid rig and the joint that turns it. The names of the joints are
    /// those of the generated library, which many captures share.</summary>
    public sealed class HumanoidBone
    {
        /// <summary>The bones of a rig. A bone follows its parent.</summary>
        public static readonly HumanoidBone[] All =
        {
            new HumanoidBone("Hips", "Hips"),
            new HumanoidBone("LeftUpperLeg", "LeftUpLeg", "LeftLowerLeg", "LeftLeg"),
            new HumanoidBone("LeftLowerLeg", "LeftLeg", "LeftFoot", "LeftFoot"),
            new HumanoidBone("LeftFoot", "LeftFoot"),
            new HumanoidBone("LeftToes", "LeftToeBase"),
            new HumanoidBone("RightUpperLeg", "RightUpLeg", "RightLowerLeg", "RightLeg"),
            new HumanoidBone("RightLowerLeg", "RightLeg", "RightFoot", "RightFoot"),
            new HumanoidBone("RightFoot", "RightFoot"),
            new HumanoidBone("RightToes", "RightToeBase"),
            new HumanoidBone("Spine", "Spine"),
            new HumanoidBone("Chest", "Spine1"),
            new HumanoidBone("LeftShoulder", "LeftShoulder"),
            new HumanoidBone("LeftUpperArm", "LeftArm", "LeftLowerArm", "LeftForeArm"),
            new HumanoidBone("LeftLowerArm", "LeftForeArm", "LeftHand", "LeftHand"),
            new HumanoidBone("LeftHand", "LeftHand"),
            new HumanoidBone("RightShoulder", "RightShoulder"),
            new HumanoidBone("RightUpperArm", "RightArm", "RightLowerArm", "RightForeArm"),
            new HumanoidBone("RightLowerArm", "RightForeArm", "RightHand", "RightHand"),
            new HumanoidBone("RightHand", "RightHand"),
            new HumanoidBone("Neck", "Neck"),
            new HumanoidBone("Head", "Head"),
        };

        private HumanoidBone(string bone, string joint, string endBone = null,
                             string endJoint = null)
        {
            Bone = bone;
            Joint = joint;
            EndBone = endBone;
            EndJoint = endJoint;
        }

        /// <summary>Name of the bone in UnityEngine.HumanBodyBones.</summary>
        public string Bone { get; private set; }

        public string Joint { get; private set; }

        /// <summary>The bone at the end of this one, or null if rig and skeleton agree about the
        /// direction of this bone in their rest poses.</summary>
        public string EndBone { get; private set; }

        public string EndJoint { get; private set; }
    }
}
