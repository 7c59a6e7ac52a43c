#pragma once

#include <filesystem>
#include <functional>
#include <iosfwd>

#include "stridewire/base/error.h"

namespace stridewire {

// Replaces a file, so that other programs never see a partial file. `write` fills a temporary file
// next to `path`, which is then renamed. On failure the old file remains. Errors: those of `write`,
// or kIo. Error::where is the path.
[[nodiscard]] Status ReplaceFile(const std::filesystem::path& path,
                                 const std::function<Status(std::ostream&)>& write);

}  // namespace stridewire
