#pragma once

#include <string>
#include <vector>

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// A recording read from a file and converted to Stridewire's conventions: metres, +Y up, facing +Z
/// at identity rotations.
struct Capture {
  std::string path;   ///< The path as passed to the reader.
  Skeleton skeleton;  ///< Its legs are set.
  Clip clip;
  double unit_m = 1.0;             ///< Length of one file unit in metres, detected or given.
  int first_frame = 0;             ///< Frames before this one hold an artificial pose; skip them.
  std::vector<std::string> notes;  ///< Assumptions and repairs, one sentence each.
};

}  // namespace stridewire
