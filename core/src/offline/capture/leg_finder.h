#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// A leg as the names or the shape of a skeleton show it.
struct FoundLeg {
  int hip = -1;  ///< The joint at the hip end of the thigh.
  int knee = -1;
  int ankle = -1;
  int ball = -1;  ///< Toe joint; -1: the ankle is the last joint.
};

struct FoundLegs {
  FoundLeg legs[2];         ///< Indexed by Foot.
  bool sides_known = true;  ///< False: found by shape, and which is left is a guess so far.
};

enum class Side { kNone, kLeft, kRight };
enum class LegPart { kNone, kHip, kKnee, kAnkle, kBall };

struct LegName {
  Side side = Side::kNone;
  LegPart part = LegPart::kNone;
};

/// What a joint's name says: "LeftUpLeg", "lfemur", "Bip01 L Thigh", "mixamorig:RightToeBase",
/// "foot.R". A plain "LeftHip" is the upper end of the thigh.
[[nodiscard]] LegName ReadLegName(std::string_view name);

/// The joints above and below an ankle: the knee and the hip are the nearest joints above it that
/// their names call so, or else those that end and begin a bone of some length.
[[nodiscard]] bool FindLegAbove(const std::vector<Joint>& joints, int ankle, FoundLeg& leg);

/// Both legs by their names; false if a side has none.
[[nodiscard]] bool FindLegsByName(const std::vector<Joint>& joints, FoundLegs& legs);

/// Both legs by shape: two chains that leave the same joint, of equal lengths (8 %), nearest to the
/// root and then longest. The thigh and the shin are the longest two bones in a row.
[[nodiscard]] bool FindLegsByShape(const std::vector<Joint>& joints, FoundLegs& legs);

}  // namespace stridewire
