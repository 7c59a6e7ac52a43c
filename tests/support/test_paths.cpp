#include "test_paths.h"

namespace stridewire {

std::filesystem::path SourceDir() { return STRIDEWIRE_SOURCE_DIR; }

std::filesystem::path MocapDir() { return SourceDir() / ".." / "shared" / "mocap"; }

}  // namespace stridewire
