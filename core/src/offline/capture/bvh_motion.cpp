#include "offline/capture/bvh_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/trig.h"
#include "offline/capture/file_axis.h"

namespace stridewire {
namespace {

DQuat AxisTurn(int axis, double degrees) {
  // remainder() is exact and reduces the argument to the range of base/trig.h. It is slow, and few
  // angles need it.
  const double reduced = std::fabs(degrees) <= 360.0 ? degrees : std::remainder(degrees, 720.0);
  const double half = reduced * (0.5 * std::numbers::pi / 180.0);
  DQuat q(Cos(half), 0.0, 0.0, 0.0);
  (axis == 0 ? q.x : axis == 1 ? q.y : q.z) = Sin(half);
  return q;
}

}  // namespace

BvhMotion::BvhMotion(const BvhFile& file) : file_(file), has_positions_(file.joints.size()) {
  for (std::size_t j = 0; j < file.joints.size(); ++j) {
    const BvhJoint& joint = file.joints[j];
    bool is_set = false;
    for (std::size_t c = 0; c < joint.channels.size(); ++c) {
      if (joint.channels[c].kind != BvhChannelKind::kPosition) continue;
      for (int f = 0; f < file.frame_count && !is_set; ++f) {
        is_set = joint.parent < 0 || ValueAt(f, joint.first_channel + static_cast<int>(c)) != 0.0;
      }
    }
    has_positions_[j] = is_set;
  }
}

double BvhMotion::ValueAt(int frame, int channel) const {
  return file_.values[Index(frame) * Index(file_.channel_count) + Index(channel)];
}

bool BvhMotion::HasPositions(int joint) const { return has_positions_[Index(joint)]; }

DVec3 BvhMotion::LocalPosition(int frame, int joint) const {
  const BvhJoint& source = file_.joints[Index(joint)];
  DVec3 position = source.offset;
  if (!has_positions_[Index(joint)]) return position;
  for (std::size_t c = 0; c < source.channels.size(); ++c) {
    if (source.channels[c].kind != BvhChannelKind::kPosition) continue;
    position[source.channels[c].axis] = ValueAt(frame, source.first_channel + static_cast<int>(c));
  }
  return position;
}

DQuat BvhMotion::LocalRotation(int frame, int joint) const {
  const BvhJoint& source = file_.joints[Index(joint)];
  DQuat rotation(1.0, 0.0, 0.0, 0.0);
  for (std::size_t c = 0; c < source.channels.size(); ++c) {
    if (source.channels[c].kind != BvhChannelKind::kRotation) continue;
    rotation = rotation * AxisTurn(source.channels[c].axis,
                                   ValueAt(frame, source.first_channel + static_cast<int>(c)));
  }
  return rotation;
}

DVec3 BvhMotion::MeanPosition(int joint, int first_frame) const {
  if (!HasPositions(joint)) return file_.joints[Index(joint)].offset;
  DVec3 sum(0.0);
  for (int f = first_frame; f < file_.frame_count; ++f) sum += LocalPosition(f, joint);
  return sum / static_cast<double>(file_.frame_count - first_frame);
}

double BvhMotion::Deviation(int joint, int first_frame, const DVec3& mean) const {
  double largest = 0.0;
  if (!HasPositions(joint)) return largest;
  for (int f = first_frame; f < file_.frame_count; ++f) {
    largest = std::max(largest, glm::distance(LocalPosition(f, joint), mean));
  }
  return largest;
}

FigureShape BvhMotion::ShapeOf(int begin, int end, int sampled_frames) const {
  std::vector<Joint> joints;
  for (int j = begin; j < end; ++j) {
    const BvhJoint& source = file_.joints[Index(j)];
    const bool is_root = source.parent < 0;
    joints.push_back({source.name, is_root ? -1 : source.parent - begin,
                      is_root ? Vec3(0.0f) : Vec3(MeanPosition(j, 0))});
  }
  FigureShape shape = RestShape(std::move(joints));
  std::vector<DQuat> world(shape.joints.size());
  const int step = std::max(1, file_.frame_count / sampled_frames);
  for (int f = 0; f < file_.frame_count; f += step) {
    std::vector<DVec3>& pose = shape.poses.emplace_back(shape.joints.size());
    for (int j = begin; j < end; ++j) {
      const std::size_t i = Index(j - begin);
      const DVec3 position = LocalPosition(f, j);
      const DQuat rotation = LocalRotation(f, j);
      if (shape.joints[i].parent < 0) {
        pose[i] = position;
        world[i] = rotation;
      } else {
        const std::size_t parent = Index(shape.joints[i].parent);
        pose[i] = pose[parent] + world[parent] * position;
        world[i] = world[parent] * rotation;
      }
    }
  }
  return shape;
}

}  // namespace stridewire
