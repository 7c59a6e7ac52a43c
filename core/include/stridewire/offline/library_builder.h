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

/// Builds a MotionLibrary from a RawLibrary. It resamples the examples of each group on a common
/// generic-time grid, aligns quaternion hemispheres, selects or averages examples as configured,
/// and solves for the interpolation weights.
struct LibraryBuilder {
  /// Returns a builder configured to keep a representative selection of captured movements: it
  /// averages movements within 5 cm of each other, drops outliers beyond five deviations and
  /// movements that the rest reproduces within 2.5 cm, and smooths what remains.
  [[nodiscard]] static LibraryBuilder Selecting();

  /// Grid cells per second of mean duration, approximately. Intervals where an example would
  /// otherwise be stored with an error above 0.45 degrees get more.
  double grid_fps = 30.0;
  /// Averages examples whose parameters all lie within this distance of each other, in metres; a
  /// radian counts as 0.5 m. Uses complete linkage. 0: averages nothing.
  double cluster_diameter = 0.0;
  /// Which examples (after averaging) to leave out; by default none.
  SelectionOptions selection;
  /// Replaces the selected examples by a smooth function of their parameters that is robust against
  /// outliers. This keeps what the examples have in common and removes individual variation.
  /// Leave-one-out pose errors determine the smoothness. Groups with fewer than 4 (d + 1) examples
  /// (d parameters) remain unchanged.
  bool smooths = false;

  struct Note {
    int group = 0;
    std::string text;
  };
  /// Output of Build: merged duplicates and parameter directions in which no example varies.
  std::vector<Note> notes;
  std::vector<GroupSelection> selections;  ///< Output of Build, one per group.

  /// Errors: kOutOfRange, kShapeMismatch or kIllConditioned; `where` names the group and example.
  [[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> Build(const RawLibrary& raw);
};

}  // namespace stridewire
