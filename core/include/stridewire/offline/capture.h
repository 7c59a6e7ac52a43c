#pragma once

#include <string>
#include <vector>

#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// A whole recording as read from a file, already in our conventions: metres, +Y up, facing +Z at
/// identity rotations.
struct Capture {
  std::string path;   ///< As given on the command line.
  Skeleton skeleton;  ///< With its legs found.
  Clip clip;
  double unit_m = 1.0;             ///< Length of one file unit, found or given.
  int first_frame = 0;             ///< Frames before it are an artificial pose, to be left out.
  std::vector<std::string> notes;  ///< What was assumed or mended, one sentence each.
};

}  // namespace stridewire
