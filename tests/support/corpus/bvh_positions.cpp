#include "corpus/bvh_positions.h"

#include <stdexcept>

#include "corpus/figure.h"

namespace stridewire::test {

BvhPositions::BvhPositions(std::string_view text) {
  Expected<BvhFile> file = ParseBvhFile(text, "text.bvh");
  if (!file) throw std::runtime_error(Describe(file.error()));
  file_ = std::move(*file);
}

int BvhPositions::Find(std::string_view name) const {
  for (std::size_t j = 0; j < file_.joints.size(); ++j) {
    if (file_.joints[j].name == name) return static_cast<int>(j);
  }
  return -1;
}

std::vector<DVec3> BvhPositions::At(int frame) const {
  std::vector<DVec3> positions(file_.joints.size());
  std::vector<DQuat> world(file_.joints.size());
  const std::size_t row =
      static_cast<std::size_t>(frame) * static_cast<std::size_t>(file_.channel_count);
  for (std::size_t j = 0; j < file_.joints.size(); ++j) {
    const BvhJoint& joint = file_.joints[j];
    DVec3 position = joint.offset;
    DQuat rotation(1.0, 0.0, 0.0, 0.0);
    std::size_t channel = row + static_cast<std::size_t>(joint.first_channel);
    for (const BvhChannel& c : joint.channels) {
      const double value = file_.values[channel++];
      if (!c.is_rotation) {
        position[c.axis] = value;
      } else {
        const double angle = value * kDegree;
        rotation = rotation * (c.axis == 0   ? AboutX(angle)
                               : c.axis == 1 ? AboutY(angle)
                                             : AboutZ(angle));
      }
    }
    if (joint.parent < 0) {
      positions[j] = position;
      world[j] = rotation;
      continue;
    }
    const auto parent = static_cast<std::size_t>(joint.parent);
    positions[j] = positions[parent] + world[parent] * position;
    world[j] = world[parent] * rotation;
  }
  return positions;
}

}  // namespace stridewire::test
