#pragma once

#include <array>
#include <optional>
#include <string>

#include "offline/complete/stride_model.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::complete {

/// Returns why a pose is not a stand with both feet side by side on the ground, for example "one
/// foot is 0.31 m ahead of the other". Returns nullopt if it is one.
[[nodiscard]] std::optional<std::string> WhyNoStand(const Skeleton& skeleton, const LegRig& rig,
                                                    const Pose& pose);

/// What is needed to compose a stand pose.
struct StandParts {
  PostureSample mean;                ///< Mean posture; its root and feet are not used.
  std::array<DQuat, 2> ankles;       ///< [Foot]: rotation of the ankle with the sole on the ground.
  std::array<double, 2> ball_y_m{};  ///< [Foot]: height of the resting ball.
  double width_m = 0.0;              ///< Sideways distance of the feet.
};

/// Returns the mean posture of strides, in which the swings of arms and pelvis cancel out, and the
/// soles in the middle of single support, when they are flat.
[[nodiscard]] StandParts PartsOf(const std::array<StrideModel, 2>& strides);

/// The same for all steps of a library, if there are no level strides straight ahead. Returns
/// nullopt if there are no steps.
[[nodiscard]] std::optional<StandParts> PartsOf(const RawLibrary& library);

/// Composes a stand pose with the feet side by side and knees that are nearly straight.
[[nodiscard]] Pose ComposeStand(const Skeleton& skeleton, const LegRig& rig,
                                const StandParts& parts);

}  // namespace stridewire::complete
