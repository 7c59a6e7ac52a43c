#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"

namespace stridewire {

enum class BvhChannelKind { kPosition, kRotation, kScale };

/// Describes one column of the motion data. BvhJoint::first_channel assigns columns to joints.
struct BvhChannel {
  BvhChannelKind kind = BvhChannelKind::kPosition;
  int axis = 0;  ///< 0: x, 1: y, 2: z.
};

struct BvhJoint {
  std::string name;
  int parent = -1;            ///< -1: a root.
  int line = 0;               ///< Line number of the joint's OFFSET.
  DVec3 offset = DVec3(0.0);  ///< The joint's OFFSET, in file units.
  std::vector<BvhChannel> channels;
  int first_channel = 0;  ///< Index of the joint's first number in each row.
};

struct BvhEndSite {
  int joint = 0;
  int line = 0;
  DVec3 offset = DVec3(0.0);
};

/// The contents of a BVH file, in its own units and axes.
struct BvhFile {
  /// Parents precede their children, and the joints of each root are contiguous.
  std::vector<BvhJoint> joints;
  std::vector<BvhEndSite> end_sites;
  int channel_count = 0;
  int frame_count = 0;
  bool has_frame_time = true;  ///< False: the file has no `Frame Time`.
  double frame_time_s = 0.0;   ///< Frame time as written in the file; any finite number.
  /// Value of one unit in the last written digit of the frame time.
  double frame_time_digit_s = 0.0;
  int frame_time_line = 0;
  /// [frame * channel_count + channel]: channel values in degrees or file units.
  std::vector<float> values;
  std::vector<std::string> notes;
};

/// Parses a BVH file. Checks its syntax, but not whether it describes a person. `name` is the
/// beginning of every Error::where. ReadBvh lists the accepted deviations from the format.
[[nodiscard]] Expected<BvhFile> ParseBvhFile(std::string_view text, std::string_view name);

}  // namespace stridewire
