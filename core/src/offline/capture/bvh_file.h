#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"

namespace stridewire {

/// One number of a frame: which joint it drives is told by the joint's `first_channel`.
struct BvhChannel {
  bool is_rotation = false;
  int axis = 0;  ///< 0 x, 1 y, 2 z
};

struct BvhJoint {
  std::string name;
  int parent = -1;
  int line = 0;               ///< Where its OFFSET stands.
  DVec3 offset = DVec3(0.0);  ///< File units
  std::vector<BvhChannel> channels;
  int first_channel = 0;  ///< Its first number in a frame's row.
};

struct BvhEndSite {
  int joint = 0;
  int line = 0;
  DVec3 offset = DVec3(0.0);
};

/// A BVH file as it stands, in its own units and axes.
struct BvhFile {
  std::vector<BvhJoint> joints;
  std::vector<BvhEndSite> end_sites;
  int channel_count = 0;
  int frame_count = 0;
  double frame_time_s = 0.0;        ///< As written; may be anything finite.
  double frame_time_digit_s = 0.0;  ///< One unit of its last written digit.
  int frame_time_line = 0;
  std::vector<float> values;  ///< [frame * channel_count + channel]; degrees and file units
  std::vector<std::string> notes;
};

/// Checks the form alone. `name` begins every `where`.
[[nodiscard]] Expected<BvhFile> ParseBvhFile(std::string_view text, std::string_view name);

}  // namespace stridewire
