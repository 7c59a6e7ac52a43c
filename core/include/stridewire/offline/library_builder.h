#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/offline/raw_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Turns a RawLibrary into library bytes: one generic-time grid a group, examples resampled on it,
/// hemispheres aligned, near duplicates averaged, weights solved.
struct LibraryBuilder {
  double grid_fps = 30.0;  ///< About this many grid cells a second of mean duration, more where
                           ///< an example would be stored worse than 0.45 degrees otherwise.
  /// Average examples whose parameters all lie within this of each other (complete linkage),
  /// metres (a radian counts 0.5 m). 0: none.
  double cluster_diameter = 0.0;

  struct Note {
    int group = 0;
    std::string text;
  };
  std::vector<Note> notes;  ///< Filled by Build: merged duplicates, directions no example spans.

  /// kOutOfRange, kShapeMismatch, kIllConditioned; `where` names group and example.
  [[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> Build(const RawLibrary& raw);
};

}  // namespace stridewire
