#pragma once

#include <memory>
#include <string>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Registers benchmarks of whole crowds with a library.
void RegisterCrowd(const std::string& name, const std::shared_ptr<const MotionLibrary>& library);

/// Registers benchmarks of the cost of observers of a crowd.
void RegisterObservers(const std::string& name,
                       const std::shared_ptr<const MotionLibrary>& library);

/// Registers benchmarks of crowds with libraries that have other numbers of examples and joints.
void RegisterScaledCrowds();

}  // namespace stridewire
