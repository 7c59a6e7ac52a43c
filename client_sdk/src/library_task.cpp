// Work on libraries that accesses the disk. Builds for WebAssembly do not contain this file.

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <system_error>

#include "library_fetch.h"

namespace stridewire::client {

namespace fs = std::filesystem;

namespace {

Expected<std::shared_ptr<const MotionLibrary>> CheckHash(
    Expected<std::shared_ptr<const MotionLibrary>> opened, const std::string& hash) {
  if (opened && (*opened)->hash() != hash) {
    return Fail(ErrorCode::kMalformed, "the library has another hash than requested");
  }
  return opened;
}

// Writes the file under a temporary name and renames it, so that readers find a complete file or
// none.
void Store(const LibraryTask& task) {
  std::error_code ignored;
  fs::create_directories(task.folder, ignored);
  const fs::path path = fs::path(task.folder) / (task.hash + ".swl");
  fs::path partial = path;
  partial += "." + std::to_string(std::random_device{}()) + ".part";
  std::ofstream out(partial, std::ios::binary);
  out.write(reinterpret_cast<const char*>(task.file.data()),
            static_cast<std::streamsize>(task.file.size()));
  out.close();
  if (out) fs::rename(partial, path, ignored);
  if (!out || ignored) fs::remove(partial, ignored);
}

}  // namespace

Expected<std::shared_ptr<const MotionLibrary>> RunLibraryTask(const LibraryTask& task) {
  if (task.file.empty()) {
    const fs::path path = fs::path(task.folder) / (task.hash + ".swl");
    std::error_code ignored;
    if (task.folder.empty() || !fs::is_regular_file(path, ignored)) {
      return Fail(ErrorCode::kNotFound, "the folder does not contain the library");
    }
    auto opened = CheckHash(MotionLibrary::Open(path), task.hash);
    if (!opened) return Fail(ErrorCode::kNotFound, "the library in the folder is damaged");
    return opened;
  }
  auto opened = CheckHash(MotionLibrary::FromBytes(task.file), task.hash);
  if (opened && !task.folder.empty()) Store(task);
  return opened;
}

}  // namespace stridewire::client
