#pragma once

#include <memory>
#include <string>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Benchmarks of whole crowds on a library.
void RegisterCrowd(const std::string& name, const std::shared_ptr<const MotionLibrary>& library);

/// What observers of a crowd of its avatars cost.
void RegisterObservers(const std::string& name,
                       const std::shared_ptr<const MotionLibrary>& library);

/// What crowds cost with other numbers of examples and joints.
void RegisterScaledCrowds();

}  // namespace stridewire
