#pragma once

#include <array>
#include <optional>
#include <string>

#include "offline/complete/stride_model.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::complete {

/// Returns why a pose is not a stand with both feet side by side on the ground, for example "one
/// foot is 0.31 m ahead of the other". Returns nullopt if the pose is such a stand.
[[nodiscard]] std::optional<std::string> WhyNoStand(const Skeleton& skeleton, const LegRig& rig,
                                                    const Pose& pose);

/// Parts of a stand pose, as measured in a walk.
struct StandParts {
  PostureSample mean;           ///< Mean posture. `root_m`, `ankles` and `balls_m` are not used.
  std::array<DQuat, 2> ankles;  ///< [Foot]: rotation of the ankle while the sole is flat.
  std::array<double, 2> ball_y_m{};  ///< [Foot]: height of the ball while the sole is flat.
  double width_m = 0.0;              ///< Sideways distance between the feet.
};

/// Measures the parts of a stand in the mean strides of both feet. The average over both strides
/// cancels the swings of arms and pelvis. The sole of the fixed foot is flat while the other foot
/// swings past it.
[[nodiscard]] StandParts MeasureStandParts(const std::array<StrideModel, 2>& strides);

/// Measures the parts of a stand in all captured steps, for libraries without level, straight
/// strides. The steps may be of another kind, for example up stairs, so the lean of the trunk is
/// limited as in a walk (LimitLean). Returns nullopt if there are no captured steps.
[[nodiscard]] std::optional<StandParts> MeasureStandParts(const RawLibrary& library);

/// Composes a stand pose, with the feet side by side and the knees nearly straight.
[[nodiscard]] Pose ComposeStand(const Skeleton& skeleton, const LegRig& rig,
                                const StandParts& parts);

}  // namespace stridewire::complete
