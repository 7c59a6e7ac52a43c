#pragma once

#include "stridewire/base/math.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// Contact point of the heel of the generated figure in metres, in the frame of the ankle (joints
/// LeftFoot and RightFoot). Ball and toe tip are in `Skeleton::legs`.
inline constexpr Vec3 kBuiltinHeelOffsetM = Vec3(0.0f, -0.06825f, -0.06f);

/// Generates the default library: a person of 1.75 m who walks in all directions, climbs stairs and
/// jumps. It is computed from formulas in well under a second, so no data has to be downloaded. The
/// result has the same bytes on every machine.
///
///   step_left   15 examples (start_z, end_z): every pair of the states 0, 0.35, 0.55, 0.75 m
///               except standing to standing; keytimes start, toe-off, heel-strike, end
///   step_right  their mirror images
///   jump        0.3, 0.7, 1.1, 1.5 m; keytimes start, lowest point of the crouch, toe-off,
///               landing, lowest point of the absorption, end
///
/// General steps. Each kind has a left group and its mirror image:
///
///   backward   8 (start_z, end_z): pairs of 0, 0.2, 0.4 m; forward steps reversed in time
///   turning   31 (start_x, start_z, end_z, turn): pairs of 0, 0.4, 0.75 m with turns of 0 and 40
///             degrees to both sides, 60 on the spot. After a turn outwards the feet are wider
///             apart, which start_x describes.
///   sideways  16 (start_x, start_z, end_x, end_z): 0 and 0.3 m wider than standing and 0 and 0.4 m
///             ahead, at either end
///   up, down  30 each (start_y, start_z, end_y, end_z, turn): 0.125 and 0.25 m per foot, from
///             and to level ground and on stairs, turns of 35 degrees to both sides
///
/// A state is a pose and a velocity in the middle of double support. It depends on the distances
/// between the feet and on the style of the step (StepStyle). All examples that end in a state and
/// do not turn have the same final pose. All examples that start in it have this pose as their
/// initial pose (mirrored if the other foot leads). Steps of one style therefore follow each other
/// without discontinuity.
///
/// First the feet are placed. The part of a foot on which it stands (heel, sole, ball or toe tip)
/// stays exactly fixed on the ground. Then the pelvis follows, then the legs by inverse kinematics,
/// then the rest of the body. The set of steps is that of the paper, Section 6. Angles, timing and
/// segments are rounded values from textbooks: Winter, Biomechanics and Motor Control of Human
/// Movement; Perry and Burnfield, Gait Analysis. The code cites the sources of other numbers. The
/// design is explained in docs/decisions/0036-the-generated-walk-follows-biomechanics.md.
[[nodiscard]] RawLibrary GenerateBuiltinLibrary();

}  // namespace stridewire
