#pragma once

#include <filesystem>

namespace stridewire {

/// Returns the root of the project's sources.
[[nodiscard]] std::filesystem::path SourceDir();

/// Returns the folder of the external captures for tests. They are not part of the project, so the
/// folder may be absent.
[[nodiscard]] std::filesystem::path MocapDir();

}  // namespace stridewire
