#pragma once

#include <memory>
#include <string_view>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Opens a library by the name that all programs accept: `builtin` for the generated library, or
/// the path of a file. The built-in library is generated at most once per process and stays in
/// memory. Safe to call from several threads. Errors: those of MotionLibrary::Open.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> OpenLibrary(std::string_view name);

}  // namespace stridewire
