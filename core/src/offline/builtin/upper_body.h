#pragma once

#include "offline/builtin/figure.h"

namespace stridewire::builtin {

/// Angles of the body above the pelvis in radians. Those of thorax and head are relative to the
/// heading of the body and to the vertical. With all angles 0, the figure stands at attention.
struct UpperBody {
  double thorax_yaw = 0.0;   ///< Positive is left.
  double thorax_roll = 0.0;  ///< Positive lifts the left side.
  double thorax_lean = 0.0;  ///< Positive is forward.
  double head_yaw = 0.0;     ///< Positive is left.
  double head_nod = 0.0;     ///< Positive is forward.
  /// Flexion of each arm, indexed by Foot; positive is forward.
  double arm_flexion[2] = {0.0, 0.0};
  double arm_abduction = 0.0;            ///< Of both arms; positive is away from the body.
  double elbow_flexion[2] = {0.0, 0.0};  ///< Indexed by Foot; positive bends the elbow.
};

/// Sets the rotations of spine, neck, head and arms. The angles of the pelvis must be those of
/// pose.rotations[kHips], relative to the heading. All angles are so small that they can be
/// distributed evenly over the joints of a chain.
void SetUpperBody(const UpperBody& body, double pelvis_yaw, double pelvis_roll, double pelvis_tilt,
                  FigurePose& pose);

}  // namespace stridewire::builtin
