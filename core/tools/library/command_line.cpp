#include "command_line.h"

#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <system_error>

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
  const std::filesystem::path partial = path.string() + ".part" + std::to_string(::getpid());
  {
    std::ofstream out(partial, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()),
              static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) {
      std::error_code ignored;
      std::filesystem::remove(partial, ignored);
      return Fail(ErrorCode::kIo, "cannot write the file", path.string());
    }
  }
  std::error_code failed;
  std::filesystem::rename(partial, path, failed);
  if (failed) {
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);
    return Fail(ErrorCode::kIo, "cannot rename the temporary file to this path", path.string());
  }
  return {};
}

}  // namespace stridewire
