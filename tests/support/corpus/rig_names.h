#pragma once

#include <span>
#include <string_view>

#include "corpus/rig.h"

namespace stridewire::test {

/// The joint names of a program or data set. `%` is a placeholder for the side.
struct NameStyle {
  const char* label;
  const char* left;
  const char* right;
  /// Hips, upper leg, lower leg, foot, toes, spine, chest, neck, head, shoulder, upper arm, forearm
  /// and hand. If empty, joints are numbered.
  std::array<const char*, 13> names;
  const char* twist;  ///< Text that is added to the name of a twist joint.
  /// True: this text is before the side ("thigh_twist_01_l"). False: it is at the end.
  bool twist_before_side = false;

  [[nodiscard]] bool is_anonymous() const { return names[0] == nullptr; }
};

[[nodiscard]] std::span<const NameStyle> NameStyles();

/// Renames the parts of the figure and the joints derived from them. Other joints keep their names,
/// unless the style is anonymous.
void NameJoints(const NameStyle& style, Rig& rig);

}  // namespace stridewire::test
