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

// Prints one sentence on stderr. Returns the exit code.
int PrintError(const std::string& sentence, int exit_code = kExitBadInput);

// What was given (files, options, fields) is wrong: kExitBadInput, unreadable files included.
int PrintInputError(const Error& error);

// What was to be made cannot be: kExitFailure.
int PrintOutputError(const Error& error);

// Whether a file could be put at `path`: found out before the work, not after it. Only plain files
// are replaced: a rename would turn /dev/null into one.
[[nodiscard]] Status CheckOutputFile(const std::filesystem::path& path);

// Whether both name the same existing file.
[[nodiscard]] bool IsSameFile(const std::filesystem::path& a, const std::filesystem::path& b);

// Writes beside the path and renames, so that no half file is ever seen.
[[nodiscard]] Status WriteFile(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace stridewire
