#pragma once

#include <vector>

#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

/// One step of the synthetic figure: the foot goes `length_m` ahead of the other one and `rise_m`
/// above it.
struct WalkerStep {
  Foot foot = Foot::kLeft;
  double length_m = 0.5;
  double rise_m = 0.0;
};

/// A plain figure with flat feet that walks, stands and jumps as told, so that a test knows every
/// contact, length and heading. Stands at (start_x, start_z), walks along `heading_rad`.
struct SyntheticWalker {
  double fps = 120.0;
  double heading_rad = 0.0;
  DVec3 start_m = DVec3(0.0);
  double stand_s = 0.6;  ///< Before and after
  double double_support_s = 0.2;
  double swing_s = 0.5;
  double pelvis_swing_rad = 0.0;  ///< Pelvis yaw to either side, once a stride
  double leg_scale = 1.0;

  /// What was generated: true times, from the first frame.
  struct Truth {
    std::vector<double> toe_off_s;
    std::vector<double> heel_strike_s;
  };
  mutable Truth truth;

  [[nodiscard]] Skeleton MakeSkeleton() const;
  [[nodiscard]] Capture Walk(const std::vector<WalkerStep>& steps) const;
  /// Stands, crouches, jumps `length_m` ahead, stands. Flight 0.4 s.
  [[nodiscard]] Capture Jump(double length_m) const;
  [[nodiscard]] Capture Stand(double seconds) const;

 private:
  struct Instant {
    DVec3 pelvis_m;  // before heading and start are applied
    DVec3 ankle_m[2];
    double pelvis_yaw_rad = 0.0;
  };
  [[nodiscard]] Capture Render(const std::vector<Instant>& instants) const;
};

/// Height of the balls of the standing figure.
inline constexpr double kWalkerBallHeightM = 0.03;

}  // namespace stridewire
