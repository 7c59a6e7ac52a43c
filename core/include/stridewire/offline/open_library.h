#pragma once

#include <memory>
#include <string_view>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// A library as every command line names it: `builtin` is generated, anything else is a file.
/// Errors as MotionLibrary::Open.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> OpenLibrary(std::string_view name);

}  // namespace stridewire
