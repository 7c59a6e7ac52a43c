#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "stridewire/base/error.h"

namespace stridewire {

// Exit codes every Stridewire program uses.
inline constexpr int kExitDone = 0;
inline constexpr int kExitFailure = 1;
inline constexpr int kExitBadInput = 2;

// Prints one sentence on stderr. Returns the exit code that goes with the error.
int Complain(const Error& error);
int Complain(const std::string& sentence, int exit_code = kExitBadInput);

// Writes beside the path and renames, so that no half file is ever seen.
[[nodiscard]] Status WriteFile(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace stridewire
