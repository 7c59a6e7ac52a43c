#pragma once

#include "offline/complete/posture_mix.h"
#include "offline/complete/stride_model.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire::complete {

/// Returns a stride for a person whose captures contain none. It is a stride of the library
/// `builtin`, converted to the proportions of the person. Pelvis and feet deviate from the person's
/// stand pose as those of the generated figure deviate from its own stand pose. The trunk stays as
/// in the stand pose, and the arms swing a little.
[[nodiscard]] StrideModel GenericStride(const Skeleton& skeleton, const LegRig& rig,
                                        const PostureSample& stand, Foot moving);

}  // namespace stridewire::complete
