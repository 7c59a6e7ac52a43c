#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Decides which extracted examples become part of a library.
struct SelectionOptions {
  /// Largest error, in metres, with which the kept examples must reproduce every example that is
  /// left out. The error is the mean joint distance at equal generic times. It also includes the
  /// distance of the parameters from the hull of the kept examples, grown by 10 %; a radian counts
  /// as 0.5 m. 0: leaves out nothing.
  double max_pose_error_m = 0.0;
  /// Threshold for outliers, in robust deviations (1.4826 MAD) above the typical error. The error
  /// of a step compares its poses and duration with those the other examples predict for its
  /// parameters. Only steps inside the hull of the others can be outliers, since steps at the edge
  /// are rare rather than wrong. Applies to groups of at least eight and drops at most one in ten.
  /// 0: drops nothing.
  double outlier_deviations = 0.0;
};

/// The result of the selection for one example.
enum class ExampleFate : std::uint8_t {
  kKept,       ///< Stored in the library.
  kAveraged,   ///< Stored in the library as part of an average.
  kRedundant,  ///< Left out: the kept examples reproduce it, or the average that contains it.
  kOutlier     ///< Left out: it differs too much from all others.
};

/// Returns "kept", "averaged", "redundant" or "outlier".
[[nodiscard]] std::string_view ExampleFateName(ExampleFate fate);

struct SelectedExample {
  std::string source;
  bool mirrored = false;
  ExampleFate fate = ExampleFate::kKept;
  int example = -1;      ///< Index in the group of the library; -1: left out.
  double error_m = 0.0;  ///< If left out: its distance from the movement synthesized in its place.
  std::string reason;    ///< One sentence.
};

/// The result of the selection for one group. Examples are in the order of extraction.
struct GroupSelection {
  int group = 0;
  MovementKind kind = MovementKind::kStepLeft;
  std::vector<SelectedExample> examples;
  /// Ridge parameter that was used to smooth the stored examples (LibraryBuilder::smooths). 0: the
  /// examples are stored as captured.
  double ridge = 0.0;
  double ridge_radius = 0.0;  ///< Radius of the smoothing kernel, in spreads of the parameters.

  [[nodiscard]] int Count(ExampleFate fate) const;
};

}  // namespace stridewire
