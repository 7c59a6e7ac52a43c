#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

/// Conventions that the reader assumed for a file, and what they were derived from.
struct FileConventions {
  std::string path;
  BvhAxis up = BvhAxis::kPlusY;
  UpSource up_source = UpSource::kOption;
  double unit_m = 1.0;
  bool unit_is_common = true;  ///< False: the unit was estimated from the legs.
  double leg_m = 0.0;          ///< Length of thigh plus shank, averaged over both legs.
  std::vector<std::string> joint_names;
};

[[nodiscard]] FileConventions ConventionsOf(const Capture& capture);

/// Conventions with which a file must be read so that it agrees with the other files.
struct AgreedConventions {
  std::optional<BvhAxis> up;       ///< nullopt: unchanged.
  std::optional<double> unit_m;    ///< nullopt: unchanged.
  std::vector<std::string> notes;  ///< One sentence per difference from other files.
};

/// Compares the files of one build and returns one element per file. `files` contains the files
/// that could be read.
///
/// - A file keeps its up axis if an option or its rest pose determined the axis. Any other file
///   gets the axis that most files with the same joint names have. In this vote, files whose axis
///   was determined by an option or the rest pose take precedence over those whose motion
///   determined it, and these over files whose axis was guessed.
/// - A file whose unit was estimated gets the unit of a file with the same joint names and a common
///   unit, if its legs are then between 0.5 and 1.2 m long.
/// - Notes state which axis or unit a file got from other files. They also list the files that
///   still differ from the first one.
[[nodiscard]] std::vector<AgreedConventions> AgreeOnConventions(
    std::span<const FileConventions> files);

}  // namespace stridewire
