#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

/// The recordings to test with, beside the project; not part of it.
inline std::filesystem::path MocapDir() { return STRIDEWIRE_MOCAP_DIR; }

/// All BVH files of a folder below MocapDir(), by name; empty if it is not there.
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

/// 01_01 or 01_03: beside the project, or Debian's assimp-testmodels; empty if neither is there.
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
