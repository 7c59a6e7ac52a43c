#include "command_line.h"

#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <system_error>

namespace stridewire {

int Complain(const std::string& sentence, int exit_code) {
  std::fprintf(stderr, "stridewire-library: %s\n", sentence.c_str());
  return exit_code;
}

int Complain(const Error& error) {
  // What the operating system refuses is a failure; everything else is input to be mended.
  return Complain(Describe(error), error.code == ErrorCode::kIo ? kExitFailure : kExitBadInput);
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
      return Fail(ErrorCode::kIo, "the file cannot be written", path.string());
    }
  }
  std::error_code failed;
  std::filesystem::rename(partial, path, failed);
  if (failed) {
    std::error_code ignored;
    std::filesystem::remove(partial, ignored);
    return Fail(ErrorCode::kIo, "the file cannot be put in its place", path.string());
  }
  return {};
}

}  // namespace stridewire
