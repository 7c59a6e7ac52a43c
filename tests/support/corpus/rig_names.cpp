#include "corpus/rig_names.h"

namespace stridewire::test {
namespace {

constexpr NameStyle kStyles[] = {
    {"CMU",
     "Left",
     "Right",
     {"Hips", "%UpLeg", "%Leg", "%Foot", "%ToeBase", "Spine", "Spine1", "Neck1", "Head",
      "%Shoulder", "%Arm", "%ForeArm", "%Hand"},
     "Roll"},
    {"Mixamo",
     "Left",
     "Right",
     {"mixamorig:Hips", "mixamorig:%UpLeg", "mixamorig:%Leg", "mixamorig:%Foot",
      "mixamorig:%ToeBase", "mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Neck",
      "mixamorig:Head", "mixamorig:%Shoulder", "mixamorig:%Arm", "mixamorig:%ForeArm",
      "mixamorig:%Hand"},
     "Twist"},
    {"Mixamo in glTF",
     "Left",
     "Right",
     {"mixamorig_Hips", "mixamorig_%UpLeg", "mixamorig_%Leg", "mixamorig_%Foot",
      "mixamorig_%ToeBase", "mixamorig_Spine", "mixamorig_Spine1", "mixamorig_Neck",
      "mixamorig_Head", "mixamorig_%Shoulder", "mixamorig_%Arm", "mixamorig_%ForeArm",
      "mixamorig_%Hand"},
     "Twist"},
    {"Unreal",
     "l",
     "r",
     {"pelvis", "thigh_%", "calf_%", "foot_%", "ball_%", "spine_01", "spine_02", "neck_01", "head",
      "clavicle_%", "upperarm_%", "lowerarm_%", "hand_%"},
     "_twist_01",
     true},
    {"Blender",
     "L",
     "R",
     {"hips", "thigh.%", "shin.%", "foot.%", "toe.%", "spine", "chest", "neck", "head",
      "shoulder.%", "upper_arm.%", "forearm.%", "hand.%"},
     ".001"},
    {"Rigify",
     "L",
     "R",
     {"DEF-hips", "DEF-thigh.%", "DEF-shin.%", "DEF-foot.%", "DEF-toe.%", "DEF-spine", "DEF-chest",
      "DEF-neck", "DEF-head", "DEF-shoulder.%", "DEF-upper_arm.%", "DEF-forearm.%", "DEF-hand.%"},
     ".001"},
    {"Character Creator",
     "L",
     "R",
     {"CC_Base_Hip", "CC_Base_%_Thigh", "CC_Base_%_Calf", "CC_Base_%_Foot", "CC_Base_%_ToeBase",
      "CC_Base_Waist", "CC_Base_Spine01", "CC_Base_NeckTwist01", "CC_Base_Head",
      "CC_Base_%_Clavicle", "CC_Base_%_Upperarm", "CC_Base_%_Forearm", "CC_Base_%_Hand"},
     "Twist01"},
    {"MotionBuilder",
     "Left",
     "Right",
     {"Character1_Hips", "Character1_%UpLeg", "Character1_%Leg", "Character1_%Foot",
      "Character1_%ToeBase", "Character1_Spine", "Character1_Spine1", "Character1_Neck",
      "Character1_Head", "Character1_%Shoulder", "Character1_%Arm", "Character1_%ForeArm",
      "Character1_%Hand"},
     "Roll"},
    {"VRM",
     "L",
     "R",
     {"J_Bip_C_Hips", "J_Bip_%_UpperLeg", "J_Bip_%_LowerLeg", "J_Bip_%_Foot", "J_Bip_%_ToeBase",
      "J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_Neck", "J_Bip_C_Head", "J_Bip_%_Shoulder",
      "J_Bip_%_UpperArm", "J_Bip_%_LowerArm", "J_Bip_%_Hand"},
     "_twist"},
    {"Biped",
     "L",
     "R",
     {"Bip01 Pelvis", "Bip01 % Thigh", "Bip01 % Calf", "Bip01 % Foot", "Bip01 % Toe0",
      "Bip01 Spine", "Bip01 Spine1", "Bip01 Neck", "Bip01 Head", "Bip01 % Clavicle",
      "Bip01 % UpperArm", "Bip01 % Forearm", "Bip01 % Hand"},
     "Twist"},
    {"Kinect",
     "Left",
     "Right",
     {"SpineBase", "Hip%", "Knee%", "Ankle%", "Foot%", "SpineMid", "SpineShoulder", "Neck", "Head",
      "Clavicle%", "Shoulder%", "Elbow%", "Wrist%"},
     "Twist"},
    {"Poser",
     "l",
     "r",
     {"hip", "%Thigh", "%Shin", "%Foot", "%Toe", "abdomen", "chest", "neck", "head", "%Collar",
      "%Shldr", "%ForeArm", "%Hand"},
     "Twist"},
    {"Daz",
     "l",
     "r",
     {"pelvis", "%ThighBend", "%Shin", "%Foot", "%Toe", "abdomenLower", "chestLower", "neckLower",
      "head", "%Collar", "%ShldrBend", "%ForearmBend", "%Hand"},
     "Twist"},
    {"BVH of Xsens",
     "Left",
     "Right",
     {"Hips", "%Hip", "%Knee", "%Ankle", "%Toe", "Chest", "Chest2", "Neck", "Head", "%Collar",
      "%Shoulder", "%Elbow", "%Wrist"},
     "Twist"},
    {"MakeHuman",
     "L",
     "R",
     {"root", "upperleg01.%", "lowerleg01.%", "foot.%", "toe1-1.%", "spine05", "spine03", "neck01",
      "head", "clavicle.%", "upperarm01.%", "lowerarm01.%", "wrist.%"},
     "02",
     true},
    {"Acclaim",
     "l",
     "r",
     {"root", "%femur", "%tibia", "%foot", "%toes", "lowerback", "thorax", "lowerneck", "head",
      "%clavicle", "%humerus", "%radius", "%hand"},
     "Twist"},
    {"Rokoko",
     "Left",
     "Right",
     {"Hips", "%Thigh", "%Shin", "%Foot", "%Toe", "Spine1", "Spine4", "Neck", "Head", "%Shoulder",
      "%Arm", "%ForeArm", "%Hand"},
     "Twist"},
    {"VRChat",
     "Left",
     "Right",
     {"Hips", "% leg", "% knee", "% ankle", "% toe", "Spine", "Chest", "Neck", "Head", "% shoulder",
      "% arm", "% elbow", "% wrist"},
     " twist"},
    {"anonymous", "", "", {}, "Twist"},
};

// The index in NameStyle::names and the side (0 left, 1 right, -1 none) of a part.
struct Place {
  int name;
  int side;
};

Place PlaceOf(Part part) {
  const int p = static_cast<int>(part);
  if (part == Part::kHips) return {0, -1};
  if (part <= Part::kLeftToes) return {p, 0};
  if (part <= Part::kRightToes) return {p - 4, 1};
  if (part <= Part::kHead) return {p - 4, -1};
  if (part <= Part::kLeftHand) return {p - 4, 0};
  return {p - 8, 1};
}

std::string WithSide(std::string pattern, const char* side) {
  if (const std::size_t at = pattern.find('%'); at != std::string::npos) {
    pattern.replace(at, 1, side);
  }
  return pattern;
}

std::string Derived(const NameStyle& style, std::string pattern, const std::string& suffix) {
  const std::string addition = suffix == "Twist" ? style.twist : suffix;
  const bool before_side = style.twist_before_side && pattern.ends_with('%');
  return pattern.insert(before_side ? pattern.size() - 2 : pattern.size(), addition);
}

}  // namespace

std::span<const NameStyle> NameStyles() { return kStyles; }

void NameJoints(const NameStyle& style, Rig& rig) {
  for (std::size_t j = 0; j < rig.joints.size(); ++j) {
    RigJoint& joint = rig.joints[j];
    if (style.is_anonymous()) {
      joint.name = "Joint" + std::to_string(j + 1);
      continue;
    }
    if (joint.named_after < 0) continue;
    const Place place = PlaceOf(static_cast<Part>(joint.named_after));
    std::string pattern = style.names[static_cast<std::size_t>(place.name)];
    if (!joint.suffix.empty()) pattern = Derived(style, pattern, joint.suffix);
    joint.name = WithSide(pattern, place.side == 1 ? style.right : style.left);
  }
}

}  // namespace stridewire::test
