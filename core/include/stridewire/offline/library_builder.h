#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/offline/raw_library.h"
#include "stridewire/offline/selection.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Turns a RawLibrary into library bytes: one generic-time grid a group, examples resampled on it,
/// hemispheres aligned, near duplicates averaged, weights solved.
struct LibraryBuilder {
  /// One that keeps a representative selection of captured movements: those within 5 cm of each other
  /// averaged, outliers of five deviations and what the others make within 2.5 cm left out, the rest
  /// made smooth.
  [[nodiscard]] static LibraryBuilder Selecting();

  double grid_fps = 30.0;  ///< About this many grid cells a second of mean duration, more where
                           ///< an example would be stored worse than 0.45 degrees otherwise.
  /// Average examples whose parameters all lie within this of each other (complete linkage),
  /// metres (a radian counts 0.5 m). 0: none.
  double cluster_diameter = 0.0;
  /// Which of the averages to leave out; by default none.
  SelectionOptions selection;
  /// Store the examples chosen as a smooth function of their parameters has them, which all but outliers
  /// decide: what they have in common stays, what is one's own goes. How smooth is chosen by the poses of
  /// examples left out. Groups of fewer than four examples for each number of a linear function (d + 1)
  /// stay as they are.
  bool smooths = false;

  struct Note {
    int group = 0;
    std::string text;
  };
  std::vector<Note> notes;  ///< Filled by Build: merged duplicates, directions no example spans.
  std::vector<GroupSelection> selections;  ///< Filled by Build, one a group.

  /// kOutOfRange, kShapeMismatch, kIllConditioned; `where` names group and example.
  [[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> Build(const RawLibrary& raw);
};

}  // namespace stridewire
