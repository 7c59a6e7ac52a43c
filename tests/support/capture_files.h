#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "stridewire/offline/bvh_reader.h"
#include "test_paths.h"

namespace stridewire {

/// Returns all BVH files in a folder below MocapDir(), sorted by name; empty if it does not exist.
inline std::vector<std::filesystem::path> MocapFiles(const std::string& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (std::filesystem::directory_iterator it(MocapDir() / folder, error), end; !error && it != end;
       it.increment(error)) {
    if (it->path().extension() == ".bvh") files.push_back(it->path());
  }
  std::ranges::sort(files);
  return files;
}

/// Returns the path of 01_01.bvh or 01_03.bvh, from the external captures or from Debian's package
/// assimp-testmodels; empty if neither is available.
inline std::filesystem::path ModelFile(const std::string& name) {
  for (const std::filesystem::path& folder :
       {MocapDir() / "cmu/01", std::filesystem::path("/usr/share/assimp/models/BVH")}) {
    if (std::filesystem::exists(folder / name)) return folder / name;
  }
  return {};
}

}  // namespace stridewire

#define STRIDEWIRE_SKIP_WITHOUT(files) \
  if ((files).empty())                 \
  GTEST_SKIP() << "no captures in " << ::stridewire::MocapDir().string() << " (" #files ")"
