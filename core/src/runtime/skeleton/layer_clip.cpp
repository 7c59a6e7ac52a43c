#include "runtime/skeleton/layer_clip.h"

#include <algorithm>

namespace stridewire {

bool IsLayerName(std::string_view name) {
  const auto is_fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !name.empty() && name.size() <= kMaxLayerNameBytes &&
         std::all_of(name.begin(), name.end(), is_fine);
}

std::vector<bool> JointsOfLegs(const Skeleton& skeleton) {
  const std::size_t joints = skeleton.joints.size();
  std::vector<bool> of_legs(joints, false);
  std::vector<bool> below_hip(joints, false);
  of_legs[0] = true;
  for (const Leg& leg : skeleton.legs) {
    for (const int end : {leg.hip, leg.knee, leg.ankle, leg.ball}) {
      for (int j = end; j >= 0; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
        of_legs[static_cast<std::size_t>(j)] = true;
      }
    }
    below_hip[static_cast<std::size_t>(leg.hip)] = true;
  }
  for (std::size_t j = 1; j < joints; ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    below_hip[j] = below_hip[j] || below_hip[parent];
    of_legs[j] = of_legs[j] || below_hip[j];
  }
  return of_legs;
}

}  // namespace stridewire
