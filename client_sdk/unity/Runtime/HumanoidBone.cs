using System.Collections.Generic;

namespace Stridewire
{
    /// <summary>A bone of a humanoid rig and the joint that rotates it. The names of the joints are
    /// those of the generated library, which many captures share.</summary>
    public sealed class HumanoidBone
    {
        /// <summary>The bones of a rig. A bone follows its parent.</summary>
        public static readonly HumanoidBone[] All = MakeAll();

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

        /// <summary>The bone at the end of this one, or null if the direction of this bone in the
        /// rest pose is the same in rig and skeleton.</summary>
        public string EndBone { get; private set; }

        public string EndJoint { get; private set; }

        private static HumanoidBone[] MakeAll()
        {
            var bones = new List<HumanoidBone> { new HumanoidBone("Hips", "Hips") };
            foreach (string side in new[] { "Left", "Right" })
            {
                bones.Add(new HumanoidBone(side + "UpperLeg", side + "UpLeg", side + "LowerLeg",
                                           side + "Leg"));
                bones.Add(new HumanoidBone(side + "LowerLeg", side + "Leg", side + "Foot",
                                           side + "Foot"));
                bones.Add(new HumanoidBone(side + "Foot", side + "Foot"));
                bones.Add(new HumanoidBone(side + "Toes", side + "ToeBase"));
            }
            bones.Add(new HumanoidBone("Spine", "Spine"));
            bones.Add(new HumanoidBone("Chest", "Spine1"));
            foreach (string side in new[] { "Left", "Right" })
            {
                bones.Add(new HumanoidBone(side + "Shoulder", side + "Shoulder"));
                bones.Add(new HumanoidBone(side + "UpperArm", side + "Arm", side + "LowerArm",
                                           side + "ForeArm"));
                bones.Add(new HumanoidBone(side + "LowerArm", side + "ForeArm", side + "Hand",
                                           side + "Hand"));
                bones.Add(new HumanoidBone(side + "Hand", side + "Hand"));
            }
            bones.Add(new HumanoidBone("Neck", "Neck"));
            bones.Add(new HumanoidBone("Head", "Head"));
            return bones.ToArray();
        }
    }
}
