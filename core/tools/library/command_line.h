#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "stridewire/base/error.h"

namespace stridewire {

// Exit codes; all Stridewire programs use the same.
inline constexpr int kExitSuccess = 0;
inline constexpr int kExitFailure = 1;   // Failure of the environment, for example a full disk.
inline constexpr int kExitBadInput = 2;  // Invalid input: an option, a file or one of its fields.

// Prints one line on stderr and returns `exit_code`.
int PrintError(const std::string& sentence, int exit_code = kExitBadInput);

// Prints an error in an option or input file, for example a file that cannot be read.
int PrintInputError(const Error& error);

// Prints an error that occurred while writing output.
int PrintOutputError(const Error& error);

// Checks, before the work starts, whether a file can be written at `path`. Rejects anything but a
// regular file, because renaming over /dev/null, for example, would replace the device.
[[nodiscard]] Status CheckOutputFile(const std::filesystem::path& path);

// Returns true if both paths name the same existing file.
[[nodiscard]] bool IsSameFile(const std::filesystem::path& a, const std::filesystem::path& b);

// Writes a file, so that a partial file is never visible (see ReplaceFile).
[[nodiscard]] Status WriteFile(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace stridewire
