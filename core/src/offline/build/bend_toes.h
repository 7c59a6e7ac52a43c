#pragma once

#include <array>
#include <optional>
#include <span>

#include "offline/build/grid_example.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// Toe tips may stay this far below the height at which they rest on the ground. If they were
/// raised to the full height, toes would hover in blends of steps whose toes rest at different
/// heights.
inline constexpr double kMaxToeSinkM = 0.005;

/// If the toe tip of a foot is below `height_m` (in the frame of the pose), bends the toes upward
/// until the tip is at that height, but by at most 60 degrees. Does nothing if the foot has no toe
/// joint or if the toes point straight up or down.
void RaiseToeTip(const Skeleton& skeleton, const LegRig& rig, Foot foot, double height_m,
                 PoseSpan pose);

/// Bends toes of captured steps and jumps upward where their tips are in the ground.
///
/// When people push off, their toes stay on the ground and bend by up to 60 degrees. Captured toes
/// often bend less, because their markers are close together and shift in the shoe, so the tips
/// sink by 2 to 5 cm. If planting had to lift them out of the ground, the whole foot would rise and
/// the knee would bend further than in the capture.
class ToeBender {
 public:
  /// Measures in the captured steps of a library, which must be valid, at which heights balls and
  /// toe tips rest. Borrows the skeleton.
  explicit ToeBender(const RawLibrary& library);

  /// Bends the toes of an example. Does nothing if planting does not support the legs
  /// (LegRig::is_usable) or if the example has no swing. Leaves out feet without a toe joint, and
  /// feet that are the fixed foot of no captured step, because their resting heights are unknown.
  void Bend(MovementKind kind, RawExample& example) const;
  /// Same, but for a resampled example. `cells` are those of its group. Toe tips end up at least
  /// `margin_m` above the minimum height.
  void Bend(MovementKind kind, std::span<const int> cells, const GridLayout& layout,
            double margin_m, GridExample& example) const;

 private:
  struct RestingFoot {
    double ball_height_m = 0.0;  // Of a ball that rests on level ground.
    double tip_rise_m = 0.0;     // Minimum height of the toe tip relative to a resting ball.
  };

  // Returns medians over the middles of the other foot's swings in captured steps. If the toe tip
  // is a little lower in the stand pose, uses its height there. Returns nullopt if the other foot
  // swings in no captured step.
  [[nodiscard]] std::optional<RestingFoot> MeasureFoot(const RawLibrary& library, Foot foot) const;
  // Returns the height at which the ball of a foot rests at an end of an example, whose pose is
  // `end`: RestingFoot::ball_height_m, or the actual height if the foot is not on level ground.
  [[nodiscard]] double BallHeightAt(Foot foot, ConstPoseSpan end) const;
  template <typename PoseAt, typename TimeAt>
  void BendFrames(MovementKind kind, std::span<const double> keytimes_s, int count, double margin_m,
                  PoseAt pose_at, TimeAt time_at) const;

  const Skeleton& skeleton_;
  LegRig rig_;
  std::array<std::optional<RestingFoot>, 2> feet_;  // [foot]
};

}  // namespace stridewire
