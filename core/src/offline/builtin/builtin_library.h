#pragma once

#include "stridewire/base/math.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// The heel's contact point in the frame of a generated figure's ankle (joint LeftFoot or
/// RightFoot), metres. Ball and toe tip are in `Skeleton::legs`.
inline constexpr Vec3 kBuiltinHeelOffsetM = Vec3(0.0f, -0.06825f, -0.06f);

/// The default library: a person of 1.75 m who walks any way, climbs stairs and jumps, made of formulas, so
/// that nothing has to be downloaded. The same bytes on every machine; well under a second.
///
///   step_left   15 examples (start_z, end_z): every pair of the states 0, 0.35, 0.55, 0.75 m but
///               still to still; keytimes start, toe-off, heel-strike, end
///   step_right  their mirror images
///   jump        0.3, 0.7, 1.1, 1.5 m; keytimes start, lowest of the crouch, toe-off, landing,
///               lowest of the absorption, end
///
/// and general steps, each kind a left group and its mirror image:
///
///   backward   8 (start_z, end_z): pairs of 0, 0.2, 0.4 m, forward steps run backward in time
///   turning   31 (start_x, start_z, end_z, turn): pairs of 0, 0.4, 0.75 m with 0 and 40 degrees either
///              way, 60 on the spot; after an open turn the feet stand wider, hence start_x
///   aside     16 (start_x, start_z, end_x, end_z): 0 and 0.3 m further aside than standing, 0 and
///              0.4 m ahead, at either end
///   up, down  30 each (start_y, start_z, end_y, end_z, turn): by 0.125 and 0.25 m a foot, from and to
///              level ground and on stairs, 35 degrees either way
///
/// A state is the pose in the middle of double support with the feet a length apart, and one
/// velocity; every example that ends in a state ends in exactly that pose, and every one that
/// starts in it starts so (mirrored with the leading foot), so steps join without a seam.
///
/// Feet come first (heel, flat, ball, toe tip, each exactly fixed), then the pelvis, then the legs
/// by inverse kinematics, then the rest of the body (paper, Section 6, for the set of steps).
/// Angles, timing and segments: Winter, Biomechanics and Motor Control of Human Movement; Perry and
/// Burnfield, Gait Analysis; Grieve and Gear 1966 (cadence), as rounded in textbooks.
[[nodiscard]] RawLibrary GenerateBuiltinLibrary();

}  // namespace stridewire
