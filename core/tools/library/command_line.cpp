#include "command_line.h"

#include <unistd.h>

#include <cstdio>
#include <ostream>
#include <system_error>

#include "offline/base/replace_file.h"

namespace stridewire {

int PrintError(const std::string& sentence, int exit_code) {
  std::fprintf(stderr, "stridewire-library: %s\n", sentence.c_str());
  return exit_code;
}

int PrintInputError(const Error& error) { return PrintError(Describe(error), kExitBadInput); }

int PrintOutputError(const Error& error) { return PrintError(Describe(error), kExitFailure); }

Status CheckOutputFile(const std::filesystem::path& path) {
  std::error_code ignored;
  const std::filesystem::file_status status = std::filesystem::status(path, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    return Fail(ErrorCode::kIo, "exists and is not a regular file", path.string());
  }
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  if (!std::filesystem::is_directory(folder, ignored)) {
    return Fail(ErrorCode::kIo, "the folder does not exist", path.string());
  }
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    return Fail(ErrorCode::kIo, "the folder is not writable", path.string());
  }
  return {};
}

bool IsSameFile(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code failed;
  return std::filesystem::equivalent(a, b, failed) && !failed;
}

Status WriteFile(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  return ReplaceFile(path, [&](std::ostream& out) -> Status {
    out.write(reinterpret_cast<const char*>(bytes.data()),
              static_cast<std::streamsize>(bytes.size()));
    return {};
  });
}

}  // namespace stridewire
