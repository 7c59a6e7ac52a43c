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

/// Measurements of a walk from which a stand pose is composed.
struct StandParts {
  PostureSample mean;                ///< Mean posture; its root and feet are not used.
  std::array<DQuat, 2> ankles;       ///< [Foot]: rotation of the ankle while the sole is flat.
  std::array<double, 2> ball_y_m{};  ///< [Foot]: height of the ball while the sole is flat.
  double width_m = 0.0;              ///< Sideways distance between the feet.
};

/// Measures a StandParts in the mean strides of both feet. Over both strides, the swings of arms
/// and pelvis cancel out. The soles are flat in the middle of single support.
[[nodiscard]] StandParts MeasureStandParts(const std::array<StrideModel, 2>& strides);

/// Measures a StandParts in all captured steps of a library, for libraries without level strides
/// straight ahead. Returns nullopt if the steps do not show the soles of both feet flat on the
/// ground.
[[nodiscard]] std::optional<StandParts> MeasureStandParts(const RawLibrary& library);

/// Composes a stand pose with the feet side by side and nearly straight knees.
[[nodiscard]] Pose ComposeStand(const Skeleton& skeleton, const LegRig& rig,
                                const StandParts& parts);

}  // namespace stridewire::complete
