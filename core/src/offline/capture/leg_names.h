#pragma once

#include <string_view>

namespace stridewire {

enum class Side { kNone, kLeft, kRight };
enum class LegPart { kNone, kHip, kKnee, kAnkle, kBall };

struct LegName {
  Side side = Side::kNone;
  LegPart part = LegPart::kNone;
};

/// Derives side and part of the leg from a joint name. Prefixes are ignored:
/// "LeftUpLeg", "mixamorig_LeftUpLeg", "J_Bip_L_Foot", "Bip01 L Thigh", "calf_l", "KneeRight",
/// "lfemur". "LeftHip" is the upper end of the thigh. Names of helper joints (twist, roll, IK) and
/// of tips have no part. A name without a side has no part either.
[[nodiscard]] LegName ReadLegName(std::string_view name);

/// Returns the side that a joint name contains as a separate word: "LeftHand", "eye.R".
[[nodiscard]] Side ReadSide(std::string_view name);

/// Returns true for names of helper joints of a rig: twist and roll bones, IK targets and tips.
[[nodiscard]] bool IsHelperName(std::string_view name);

/// Returns true for names of joints that cannot belong to a leg, such as arms, hair and clothes.
[[nodiscard]] bool IsNameOutsideLegs(std::string_view name);

/// Returns true for names of hands: "LeftHand", "r_wrist", "paw.L".
[[nodiscard]] bool IsHandName(std::string_view name);

/// Returns true for names of the trunk and of the head: "Spine1", "Chest", "Head".
[[nodiscard]] bool IsTrunkName(std::string_view name);

}  // namespace stridewire
