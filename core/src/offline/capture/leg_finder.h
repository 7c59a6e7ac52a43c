#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// The joints of a leg, as detected from the names or the shape of a skeleton.
struct FoundLeg {
  int hip = -1;  ///< The joint at the upper end of the thigh.
  int knee = -1;
  int ankle = -1;
  int ball = -1;  ///< The toe joint; -1: there is none below the ankle.
};

struct FoundLegs {
  FoundLeg legs[2];  ///< The two legs, indexed by Foot.
  /// False if the legs were detected by shape, so that left and right may be swapped.
  bool sides_known = true;
};

enum class Side { kNone, kLeft, kRight };
enum class LegPart { kNone, kHip, kKnee, kAnkle, kBall };

struct LegName {
  Side side = Side::kNone;
  LegPart part = LegPart::kNone;
};

/// Derives side and part of the leg from a joint name: "LeftUpLeg", "lfemur", "Bip01 L Thigh",
/// "mixamorig:RightToeBase", "foot.R". "LeftHip" is the upper end of the thigh.
[[nodiscard]] LegName ReadLegName(std::string_view name);

/// Finds the other joints of a leg from its ankle. Knee and hip are the nearest joints above it
/// with matching names; without such names, the next joints at the ends of bones of non-zero
/// length. Returns false if there is no knee or hip.
[[nodiscard]] bool FindLegAbove(const std::vector<Joint>& joints, int ankle, FoundLeg& leg);

/// Detects both legs by joint names. Returns false if a side has no leg.
[[nodiscard]] bool FindLegsByName(const std::vector<Joint>& joints, FoundLegs& legs);

/// Detects both legs by shape: two chains from the same joint with equal lengths (within 8 %). Of
/// several pairs it takes the one nearest to the root, and then the longest. Thigh and shin are the
/// longest pair of successive bones.
[[nodiscard]] bool FindLegsByShape(const std::vector<Joint>& joints, FoundLegs& legs);

}  // namespace stridewire
