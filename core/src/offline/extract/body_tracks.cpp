#include "offline/extract/body_tracks.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

constexpr double kPelvisSmoothS = 0.06;
// If the hip joints are horizontally closer than this, they determine no direction.
constexpr double kHipsApartM = 0.01;

// Returns the yaw of the pelvis, or `fallback_rad` if the line between the hip joints is vertical.
// The yaw is computed from positions, because the axes of the root's frame may have any direction.
double PelvisYaw(const Skeleton& skeleton, ConstPoseSpan pose, double fallback_rad) {
  const auto hip = [&](Foot foot) {
    return DVec3(PointPosition(skeleton, pose, skeleton.leg(foot).hip, Vec3(0.0f)));
  };
  const DVec3 left = hip(Foot::kLeft) - hip(Foot::kRight);
  return std::hypot(left.x, left.z) < kHipsApartM ? fallback_rad : std::atan2(-left.z, left.x);
}

// Returns the indices of all joints except the root and the joints of the legs.
std::vector<std::size_t> TrunkJoints(const Skeleton& skeleton) {
  const auto count = static_cast<std::size_t>(skeleton.joint_count());
  std::vector<char> in_leg(count, 0);
  for (const Leg& leg : skeleton.legs) in_leg[static_cast<std::size_t>(leg.hip)] = 1;
  std::vector<std::size_t> joints;
  for (std::size_t j = 1; j < count; ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    if (in_leg[parent]) in_leg[j] = 1;
    if (!in_leg[j]) joints.push_back(j);
  }
  return joints;
}

}  // namespace

double LegLength(const Skeleton& skeleton) {
  double length = 0.0;
  for (const Leg& leg : skeleton.legs) {
    for (int joint = leg.ankle; joint > leg.hip;) {
      const Joint& bone = skeleton.joints[static_cast<std::size_t>(joint)];
      length += 0.5 * glm::length(bone.offset_m);
      joint = bone.parent;
    }
  }
  return length;
}

std::vector<DVec3> SmoothPath(const std::vector<DVec3>& path, int window) {
  const int reach = window / 2;
  const int count = static_cast<int>(path.size());
  if (reach < 1 || count == 0) return path;
  std::vector<DVec3> smooth(path.size());
  DVec3 sum(0.0);
  const auto at = [&](int i) -> const DVec3& {
    return path[static_cast<std::size_t>(std::clamp(i, 0, count - 1))];
  };
  for (int i = -reach; i <= reach; ++i) sum += at(i);
  for (int i = 0; i < count; ++i) {
    smooth[static_cast<std::size_t>(i)] = sum / static_cast<double>(2 * reach + 1);
    sum += at(i + reach + 1) - at(i - reach);
  }
  return smooth;
}

std::vector<double> PathSpeed(const std::vector<DVec3>& path, double fps) {
  const std::size_t count = path.size();
  std::vector<double> speed(count, 0.0);
  for (std::size_t i = 0; i < count && count > 1; ++i) {
    const std::size_t before = i == 0 ? 0 : i - 1;
    const std::size_t after = std::min(i + 1, count - 1);
    speed[i] = glm::length(path[after] - path[before]) * fps / static_cast<double>(after - before);
  }
  return speed;
}

BodyTracks TrackBody(const Skeleton& skeleton, const Clip& clip, int first_frame) {
  BodyTracks tracks;
  tracks.fps = clip.fps;
  tracks.frames = {std::min(first_frame, clip.frame_count()), clip.frame_count()};
  const auto count = static_cast<std::size_t>(tracks.frames.size());
  tracks.pelvis_m.reserve(count);
  tracks.pelvis_yaw_rad.reserve(count);
  tracks.leg_length_m = LegLength(skeleton);
  const std::vector<std::size_t> trunk = TrunkJoints(skeleton);
  std::vector<Vec3> positions(static_cast<std::size_t>(skeleton.joint_count()));
  std::vector<Quat> rotations(positions.size());
  double yaw_rad = 0.0;
  for (int f = tracks.frames.begin; f < tracks.frames.end; ++f) {
    const ConstPoseSpan pose = clip.frame(f);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const Leg& leg = skeleton.leg(foot);
      BodyTracks::FootTrajectory& track = tracks.feet[static_cast<int>(foot)];
      track.ankle_m.emplace_back(PointPosition(skeleton, pose, leg.ankle, Vec3(0.0f)));
      track.ball_m.emplace_back(BallPosition(skeleton, pose, foot));
      track.toe_tip_m.emplace_back(PointPosition(skeleton, pose, leg.ball, leg.toe_tip_offset_m));
    }
    tracks.pelvis_m.emplace_back(pose.root_position_m);
    if (!trunk.empty()) {
      ForwardKinematics(skeleton, pose, positions, rotations);
      // Bones are weighted by their length, so that the many short bones of the fingers do not
      // dominate.
      DVec3 sum(0.0);
      double weight = 0.0;
      for (const std::size_t joint : trunk) {
        const double length = glm::length(skeleton.joints[joint].offset_m);
        sum += length * DVec3(positions[joint]);
        weight += length;
      }
      tracks.trunk_m.push_back(weight > 0.0 ? sum / weight : DVec3(pose.root_position_m));
    }
    const double frame_yaw_rad = PelvisYaw(skeleton, pose, yaw_rad);
    yaw_rad = f == tracks.frames.begin ? frame_yaw_rad : UnwrapAngle(frame_yaw_rad, yaw_rad);
    tracks.pelvis_yaw_rad.push_back(yaw_rad);
  }
  STRIDEWIRE_CHECK(tracks.pelvis_m.size() == count);
  const int window = static_cast<int>(std::lround(kPelvisSmoothS * clip.fps));
  tracks.pelvis_speed_m_s = PathSpeed(SmoothPath(tracks.pelvis_m, window), clip.fps);
  return tracks;
}

}  // namespace stridewire
