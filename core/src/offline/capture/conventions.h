#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stridewire/offline/bvh_reader.h"

namespace stridewire {

/// Conventions that the reader assumed for a file, and the properties they were derived from.
struct FileConventions {
  std::string path;
  BvhAxis up = BvhAxis::kPlusY;
  UpSource up_source = UpSource::kOption;
  double unit_m = 1.0;
  bool unit_is_common = true;  ///< False: the unit was estimated from the legs.
  double leg_m = 0.0;          ///< Length of the legs.
  std::vector<std::string> joint_names;
};

[[nodiscard]] FileConventions ConventionsOf(const Capture& capture);

/// The conventions with which a file has to be read so that it agrees with the other files.
struct AgreedConventions {
  std::optional<BvhAxis> up;       ///< Empty: as it was read.
  std::optional<double> unit_m;    ///< Empty: as it was read.
  std::vector<std::string> notes;  ///< One sentence per difference from other files.
};

/// Compares the files of one build. `files` contains the files that could be read.
///
/// - Files with the same joint names have the same up axis. If the rest pose of a file does not
///   determine it, it is the axis of most of them. Files whose rest pose determines it count first.
/// - A file whose unit was estimated gets the unit of a file with the same joint names and a common
///   unit, if its legs are then between 0.5 and 1.2 m long.
/// - Notes state which axis or unit a file got from the others, and which of them still differ from
///   those of the first file.
[[nodiscard]] std::vector<AgreedConventions> AgreeOnConventions(
    std::span<const FileConventions> files);

}  // namespace stridewire
