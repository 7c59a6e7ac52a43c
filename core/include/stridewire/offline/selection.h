#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Which of the examples found go into a library.
struct SelectionOptions {
  /// Every step left out must be made by the ones kept within this: mean distance of its joints at
  /// equal generic times, and how far the hull of the ones kept (grown by 10 %) misses its
  /// parameters, metres (a radian counts 0.5 m). 0: no step is left out.
  double max_pose_error_m = 0.0;
  /// Steps whose poses or durations miss what all others make of their parameters by this many
  /// deviations (1.4826 MAD) more than is usual are outliers. 0: none is. Only steps inside the hull of
  /// the others, in groups of at least eight, and at most one in ten: what lies at the edge is rare, not
  /// wrong.
  double outlier_deviations = 0.0;
};

/// What became of an example.
enum class ExampleFate : std::uint8_t {
  kKept,       ///< Stands in the library
  kAveraged,   ///< Stands in the library as part of an average
  kRedundant,  ///< Left out: the ones kept make it, or an average it would be part of
  kOutlier     ///< Left out: unlike all others
};

/// "kept", "averaged", "redundant", "outlier".
[[nodiscard]] std::string_view ExampleFateName(ExampleFate fate);

struct SelectedExample {
  std::string source;
  bool mirrored = false;
  ExampleFate fate = ExampleFate::kKept;
  int example = -1;      ///< Index in the library's group; -1: left out
  double error_m = 0.0;  ///< Of one left out: how far what is made of its parameters is from it
  std::string reason;    ///< A sentence
};

/// What was selected of a group, in the order of the examples found.
struct GroupSelection {
  int group = 0;
  MovementKind kind = MovementKind::kStepLeft;
  std::vector<SelectedExample> examples;
  /// What the examples stored were made smooth by (LibraryBuilder::smooths); 0: they are as captured.
  double ridge = 0.0;
  double ridge_radius = 0.0;  ///< Of the radial functions, in spreads of the parameters

  [[nodiscard]] int Count(ExampleFate fate) const;
};

}  // namespace stridewire
