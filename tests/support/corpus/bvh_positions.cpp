#include "corpus/bvh_positions.h"

#include <sstream>
#include <stdexcept>

#include "corpus/figure.h"

namespace stridewire::test {
namespace {

DQuat Rotation(char axis, double degrees) {
  const double angle = degrees * kDegree;
  return axis == 'X' ? AboutX(angle) : axis == 'Y' ? AboutY(angle) : AboutZ(angle);
}

}  // namespace

BvhPositions::BvhPositions(std::string_view text) {
  std::istringstream in{std::string(text)};
  std::vector<int> open;  // -1 for an End Site.
  std::size_t channels = 0;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "ROOT" || word == "JOINT") {
      Joint joint;
      std::getline(words >> std::ws, joint.name);
      joint.parent = open.empty() ? -1 : open.back();
      open.push_back(static_cast<int>(joints_.size()));
      joints_.push_back(std::move(joint));
    } else if (word == "End") {
      open.push_back(-1);
    } else if (word == "}" && !open.empty()) {
      open.pop_back();
    } else if (word == "OFFSET" && !open.empty() && open.back() >= 0) {
      DVec3& offset = joints_[static_cast<std::size_t>(open.back())].offset;
      words >> offset.x >> offset.y >> offset.z;
    } else if (word == "CHANNELS" && !open.empty()) {
      Joint& joint = joints_[static_cast<std::size_t>(open.back())];
      words >> word;
      while (words >> word) joint.channels.push_back(word);
      channels += joint.channels.size();
    } else if (word == "Frame") {
      words >> word >> frame_time_s_;
    } else if (frame_time_s_ > 0.0 && !word.empty()) {
      std::istringstream numbers(line);
      std::vector<double> row;
      for (double number = 0.0; numbers >> number;) row.push_back(number);
      if (row.size() != channels) throw std::runtime_error("wrong number of values: " + line);
      frames_.push_back(std::move(row));
    }
  }
  if (frames_.empty()) throw std::runtime_error("the text is not BVH");
}

int BvhPositions::Find(std::string_view name) const {
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    if (joints_[j].name == name) return static_cast<int>(j);
  }
  return -1;
}

std::vector<DVec3> BvhPositions::At(int frame) const {
  std::vector<DVec3> positions(joints_.size());
  std::vector<DQuat> world(joints_.size());
  const double* value = frames_[static_cast<std::size_t>(frame)].data();
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Joint& joint = joints_[j];
    DVec3 position = joint.offset;
    DQuat rotation(1.0, 0.0, 0.0, 0.0);
    for (const std::string& channel : joint.channels) {
      if (channel.ends_with("position")) {
        position[channel[0] - 'X'] = *value++;
      } else {
        rotation = rotation * Rotation(channel[0], *value++);
      }
    }
    const auto parent = static_cast<std::size_t>(joint.parent);
    const bool is_root = joint.parent < 0;
    positions[j] = is_root ? position : positions[parent] + world[parent] * position;
    world[j] = is_root ? rotation : world[parent] * rotation;
  }
  return positions;
}

DVec3 BvhPositions::At(int frame, std::string_view name) const {
  const int joint = Find(name);
  if (joint < 0) throw std::runtime_error("no joint " + std::string(name));
  return At(frame)[static_cast<std::size_t>(joint)];
}

}  // namespace stridewire::test
