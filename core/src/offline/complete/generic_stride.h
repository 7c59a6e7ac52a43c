#pragma once

#include "offline/complete/posture_mix.h"
#include "offline/complete/stride_model.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire::complete {

/// Returns a stride for a person whose captures contain none. It is a stride of the library
/// `builtin`, adapted to the proportions of the person. Feet, pelvis, chest and head deviate from
/// the person's stand pose as those of the generated figure deviate from its own stand pose, and
/// the arms swing a little. The legs bend as far as the figure's, and the trunk leans as in a walk,
/// even if the person crouches in the stand pose.
[[nodiscard]] StrideModel GenericStride(const Skeleton& skeleton, const LegRig& rig,
                                        const PostureSample& stand, Foot moving);

}  // namespace stridewire::complete
