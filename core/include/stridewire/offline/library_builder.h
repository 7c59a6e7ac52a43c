#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/offline/raw_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Determines which of the extracted examples LibraryBuilder keeps.
struct SelectionOptions {
  /// Maximum error of an example that is not kept: the mean distance between its joints and those
  /// of the movement blended from the kept examples, at equal generic times. It is also the maximum
  /// distance of the example's parameters from the hull of the kept examples, after that hull has
  /// been enlarged by 10 %. In metres; one radian counts as 0.5 m. 0 keeps every example.
  double max_pose_error_m = 0.0;
  /// For each example, the other examples predict its pose and duration from its parameters. The
  /// example is an outlier if its pose error exceeds the median of the group, or if its duration
  /// error differs from the median, by more than this number of deviations. A deviation is 1.4826
  /// times the median absolute deviation, but at least 2 mm for poses and 5 ms for durations. Only
  /// examples inside the hull of the others are tested, because examples at the border of the hull
  /// are rare, not wrong. At most one example in ten is removed, so groups of fewer than ten are
  /// not tested. 0 disables the test.
  double outlier_deviations = 0.0;
};

/// How LibraryBuilder uses an extracted example.
enum class ExampleFate : std::uint8_t {
  kKept,       ///< Stored as a separate example.
  kAveraged,   ///< Stored as part of an average.
  kRedundant,  ///< Not stored, because the kept examples reproduce it.
  kOutlier     ///< Not stored, because it differs from what the other examples predict.
};

/// Returns "kept", "averaged", "redundant" or "outlier".
[[nodiscard]] std::string_view ExampleFateName(ExampleFate fate);

/// Describes how LibraryBuilder used one extracted example, and why.
struct SelectedExample {
  std::string source;  ///< RawExample::source.
  bool mirrored = false;
  ExampleFate fate = ExampleFate::kKept;
  int example = -1;  ///< Index in the library's group; -1 if not stored.
  /// If not stored: mean distance between its joints and those of the movement that is blended for
  /// its parameters, in metres. For kRedundant, the movement is blended from the kept examples, for
  /// kOutlier from the other examples.
  double error_m = 0.0;
  std::string reason;  ///< One sentence.
};

/// The selection of one group, in the order of RawGroup::examples.
struct GroupSelection {
  int group = 0;  ///< Index in RawLibrary::groups.
  MovementKind kind = MovementKind::kStepLeft;
  std::vector<SelectedExample> examples;
  /// Ridge factor with which the stored examples were smoothed (LibraryBuilder::smooths). 0 if they
  /// are stored as captured.
  double ridge = 0.0;
  /// Radius of the radial functions of the smoothing, in units of Parameter::scale; 0 without
  /// smoothing.
  double ridge_radius = 0.0;

  /// Number of examples with this fate.
  [[nodiscard]] int Count(ExampleFate fate) const;
};

/// Builds a MotionLibrary from a RawLibrary. It resamples the examples of each group on a common
/// generic-time grid, aligns quaternion hemispheres, selects or averages examples as configured,
/// and solves for the interpolation weights.
struct LibraryBuilder {
  /// Returns a builder that is configured to store all captured movements. It only averages
  /// duplicates (see `cluster_diameter`) and bends toes upward where they are below the ground.
  [[nodiscard]] static LibraryBuilder KeepingAll();
  /// Returns a builder that is configured to keep a representative selection of captured movements.
  /// It drops outliers beyond five deviations, and averages movements whose parameters are within 5
  /// cm of each other. It then drops movements whose poses the others reproduce within 2.5 cm.
  /// Finally, it smooths the kept movements and bends toes upward where they are below the ground.
  [[nodiscard]] static LibraryBuilder Selecting();

  /// Approximate number of grid cells per second of mean duration. A group has more cells if an
  /// example would otherwise be stored with a mean error above 0.45 degrees.
  double grid_fps = 30.0;
  /// Examples are averaged if their parameters are within this distance of each other, in metres; a
  /// radian counts as 0.5 m. They are grouped by complete-linkage clustering. With 0, only
  /// duplicates within 1 mm are averaged.
  double cluster_diameter = 0.0;
  /// Determines which examples are dropped: outliers before averaging, redundant examples after it.
  /// By default, none are dropped.
  SelectionOptions selection;
  /// True: the selected examples are replaced with a smooth function of their parameters. It
  /// contains what the examples have in common, without individual variation. Leave-one-out pose
  /// errors determine the smoothness. Groups of d parameters with fewer than 4 (d + 1) examples are
  /// excluded. In steps, jolts of trunk, head and arms are smoothed as well, and groups of straight
  /// steps get variants (MotionGroup). Generated groups (RawGroup::is_completed) remain unchanged.
  bool smooths = false;
  /// True: toes bend upward where their tips are below the ground. This does not apply to generated
  /// groups (RawGroup::is_completed).
  bool bends_toes = false;

  struct Note {
    int group = 0;  ///< Index in RawLibrary::groups.
    std::string text;
  };
  /// Output of Build: notes on examples that were averaged, dropped or smoothed, and on parameters
  /// that are equal in all examples.
  std::vector<Note> notes;
  /// Output of Build, one per group that has examples.
  std::vector<GroupSelection> selections;

  /// Errors: those of Skeleton::Validate and Clip::Validate. kOutOfRange, kShapeMismatch or
  /// kIllConditioned for groups. kInvalidArgument, kOutOfRange, kShapeMismatch or kLimitExceeded
  /// for layers. Those of MotionLibrary::FromBytes if the result exceeds a limit of library files.
  /// If a group, an example or a layer is the cause, Error::where contains it.
  [[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> Build(const RawLibrary& raw);
};

}  // namespace stridewire
