#pragma once

#include "offline/builtin/figure.h"

namespace stridewire::builtin {

/// What the body above the pelvis does, radians. Everything 0 is a soldier at attention.
struct UpperBody {
  double thorax_yaw = 0.0;             ///< in the example's frame, left positive
  double thorax_roll = 0.0;            ///< likewise; positive lifts the left side
  double thorax_lean = 0.0;            ///< likewise; forward positive
  double head_yaw = 0.0;               ///< likewise; left positive
  double head_nod = 0.0;               ///< likewise; forward positive
  double arm_flexion[2] = {0.0, 0.0};  ///< indexed by Foot; forward positive
  double arm_abduction = 0.0;
  double elbow_flexion[2] = {0.0, 0.0};
};

/// Sets spine, neck, head and arms; the pelvis must be set. Yaw, roll and lean are small enough to
/// be shared out evenly over the joints of a chain.
void SetUpperBody(const UpperBody& body, double pelvis_yaw, double pelvis_roll, double pelvis_tilt,
                  FigurePose& pose);

}  // namespace stridewire::builtin
