#pragma once

#include <array>
#include <string>

#include "corpus/rig.h"

namespace stridewire::test {

/// Options for writing a motion as BVH. The defaults give the plainest form.
struct BvhNotation {
  std::array<int, 3> rotation_order{2, 1, 0};  ///< Axes of the rotation channels; 0: x.
  std::array<int, 3> position_order{0, 1, 2};
  bool rotations_first = false;  ///< Rotation channels stand before position channels.
  bool positions_everywhere = false;
  bool scales = false;  ///< Scale channels, all 1, follow the others.

  std::string line_end = "\n";
  std::string separator = " ";
  std::string indent = "  ";
  int numbers_per_line = 0;  ///< Wraps rows after this number of values; 0: one line per frame.
  bool decimal_comma = false;
  bool last_line_end = true;
  bool lower_case = false;  ///< Writes keywords and channels in lower case.
  bool byte_order_mark = false;
  std::string comment;        ///< A line before HIERARCHY.
  std::string frames_text;    ///< Replaces the number after `Frames:` if not empty.
  int frame_time_digits = 7;  ///< Digits after the decimal point.
};

/// Writes a motion as BVH text. Joints keep their order below each parent.
[[nodiscard]] std::string WriteRig(const Rig& rig, const BvhNotation& notation);

}  // namespace stridewire::test
