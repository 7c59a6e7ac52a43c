#pragma once

#include <vector>

#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

/// One step of the synthetic figure: the foot lands `length_m` ahead of the other foot and `rise_m`
/// above it.
struct WalkerStep {
  Foot foot = Foot::kLeft;
  double length_m = 0.5;
  double rise_m = 0.0;
};

/// A simple figure with flat feet that walks, stands and jumps, with known contacts, lengths and
/// headings. It starts at `start_m` and walks in the direction `heading_rad`.
struct SyntheticWalker {
  double fps = 120.0;
  double heading_rad = 0.0;
  DVec3 start_m = DVec3(0.0);
  double stand_s = 0.6;  ///< Standing time before and after the movement.
  double double_support_s = 0.2;
  double swing_s = 0.5;
  double pelvis_swing_rad = 0.0;  ///< Amplitude of the pelvis yaw, once per stride.
  double leg_scale = 1.0;
  double slope = 0.0;  ///< Rise of the ground per metre along z, before `heading_rad` is applied.

  /// The true contact times of the last generated capture, since its first frame.
  struct Truth {
    std::vector<double> toe_off_s;
    std::vector<double> heel_strike_s;
  };
  mutable Truth truth;

  [[nodiscard]] Skeleton MakeSkeleton() const;
  [[nodiscard]] Capture Walk(const std::vector<WalkerStep>& steps) const;
  /// Stands, crouches, jumps `length_m` ahead with a flight of 0.4 s, and stands again.
  [[nodiscard]] Capture Jump(double length_m) const;
  [[nodiscard]] Capture Stand(double seconds) const;
  /// Runs straight ahead at 2.7 m/s, with both feet off the ground for 0.1 s between stances.
  [[nodiscard]] Capture Run(int steps) const;

 private:
  struct Instant {
    DVec3 pelvis_m;  // Before `heading_rad` and `start_m` are applied.
    DVec3 ankle_m[2];
    double pelvis_yaw_rad = 0.0;
  };
  [[nodiscard]] Capture Render(std::vector<Instant> instants) const;
};

/// Removes the travel of the root along z, like an export "in place".
void RemoveTravel(Capture& capture);

/// Puts a still pose before a capture: the joints unrotated, the root at its first position,
/// lowered by `lower_m`.
void PrependStillPose(int frames, double lower_m, Capture& capture);

/// Height of the balls of the standing figure above the ground.
inline constexpr double kWalkerBallHeightM = 0.03;

}  // namespace stridewire
