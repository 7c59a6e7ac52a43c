#pragma once

#include <filesystem>
#include <functional>
#include <iosfwd>

#include "stridewire/base/error.h"

namespace stridewire {

// Writes a file such that a partial file is never visible: `write` fills a temporary file next to
// `path`, which is then renamed. On failure the old file remains. Errors: those of `write`, or kIo;
// `where` is the path.
[[nodiscard]] Status ReplaceFile(const std::filesystem::path& path,
                                 const std::function<Status(std::ostream&)>& write);

}  // namespace stridewire
