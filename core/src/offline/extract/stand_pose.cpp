#include "offline/extract/stand_pose.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/base/horizontal_distance.h"
#include "offline/base/statistics.h"
#include "offline/extract/foot_paths.h"
#include "offline/extract/normalise.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

constexpr double kWindowS = 0.1;  // Speeds are averaged over this time to reduce noise.
constexpr double kSameGroundM = 0.03;
// The following penalties are added to the mean joint speed in m/s.
//
// Penalty per metre by which one foot is in front of the other.
constexpr double kStridePerM = 2.0;
// Penalty per metre by which the pelvis is lower than in usual standing.
constexpr double kCrouchPerM = 4.0;
// Penalty per metre of horizontal distance between the pelvis and the feet, and between the head
// and the pelvis.
constexpr double kLeanPerM = 2.0;
// Penalty per metre by which the heights of ankle and toe tip above the ball differ from those of a
// flat foot. Deviations below kFlatM are ignored.
constexpr double kTiltPerM = 4.0;
constexpr double kFlatM = 0.015;

double StandHeight(const BodyTracks& tracks) {
  std::vector<double> heights;
  heights.reserve(tracks.pelvis_m.size());
  for (const DVec3& p : tracks.pelvis_m) heights.push_back(p.y);
  return Percentile(std::move(heights), 75.0);
}

// Returns the deviation from an upright posture, in which the pelvis is above the ankles and the
// highest joint is above the pelvis. A still pose need not be upright: people are also still in a
// crouch before a jump, or while they reach for a bar.
double Lean(const Skeleton& skeleton, const std::vector<Vec3>& positions) {
  const DVec3 pelvis(positions[0]);
  const auto at = [&](int joint) { return DVec3(positions[static_cast<std::size_t>(joint)]); };
  const DVec3 ankles =
      0.5 * (at(skeleton.leg(Foot::kLeft).ankle) + at(skeleton.leg(Foot::kRight).ankle));
  const auto top = std::max_element(positions.begin(), positions.end(),
                                    [](const Vec3& a, const Vec3& b) { return a.y < b.y; });
  return HorizontalDistance(pelvis, ankles) + HorizontalDistance(DVec3(*top), pelvis);
}

// Returns how far a foot is from being flat, in metres. A foot that does not move need not be flat:
// people also rest on their heels or toes, for example after a fall.
double Tilt(const FootPaths& foot, int frame) {
  double tilt_m = 0.0;
  for (const std::size_t point : {FootPaths::kAnkle, FootPaths::kToeTip}) {
    const double above_m = foot.Height(point, frame) - foot.Height(FootPaths::kBall, frame);
    tilt_m += std::max(0.0, std::fabs(above_m - foot.flat_height_m[point]) - kFlatM);
  }
  return tilt_m;
}

}  // namespace

std::optional<Extraction::Stand> FindStand(const Skeleton& skeleton, const Clip& clip,
                                           const BodyTracks& tracks, const FootContacts& contacts,
                                           const Ground& ground,
                                           const std::vector<double>& heading_rad) {
  const int count = tracks.size();
  STRIDEWIRE_CHECK(heading_rad.size() == static_cast<std::size_t>(count));
  STRIDEWIRE_CHECK(tracks.frames.end <= clip.frame_count());
  const std::vector<char> standing[2] = {StandingFrames(contacts.feet[0], count),
                                         StandingFrames(contacts.feet[1], count)};
  const int reach = std::max(1, static_cast<int>(std::lround(0.5 * kWindowS * clip.fps)));
  const double stand_height = StandHeight(tracks);
  const FootPaths feet[2] = {MakeFootPaths(tracks.feet[0], clip.fps, kWindowS),
                             MakeFootPaths(tracks.feet[1], clip.fps, kWindowS)};
  const auto joints = static_cast<std::size_t>(skeleton.joint_count());
  std::vector<Vec3> before(joints);
  std::vector<Vec3> after(joints);
  std::vector<Quat> rotations(joints);
  std::optional<double> best;
  int best_frame = 0;
  for (int i = reach; i + reach < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!standing[0][k] || !standing[1][k]) continue;
    const DVec3 apart =
        RotateYaw(-heading_rad[k], tracks.feet[0].ball_m[k] - tracks.feet[1].ball_m[k]);
    if (std::fabs(apart.y - ground.ball_height_m[0] + ground.ball_height_m[1]) > kSameGroundM) {
      continue;
    }
    const int frame = tracks.frames.begin + i;
    ForwardKinematics(skeleton, clip.frame(frame - reach), before, rotations);
    ForwardKinematics(skeleton, clip.frame(frame + reach), after, rotations);
    double moved = 0.0;
    for (std::size_t j = 0; j < joints; ++j) moved += glm::length(after[j] - before[j]);
    const double speed = moved / static_cast<double>(joints) * clip.fps / (2.0 * reach);
    const double unrest = speed + kStridePerM * std::fabs(apart.z) +
                          kCrouchPerM * std::max(0.0, stand_height - tracks.pelvis_m[k].y) +
                          kLeanPerM * Lean(skeleton, after) +
                          kTiltPerM * (Tilt(feet[0], i) + Tilt(feet[1], i));
    if (!best || unrest < *best) {
      best = unrest;
      best_frame = i;
    }
  }
  if (!best) return std::nullopt;
  const int frame = tracks.frames.begin + best_frame;
  double below = 0.0;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    for (const Contact& contact : contacts.foot(foot)) {
      if (contact.frames.begin <= best_frame && best_frame < contact.frames.end) {
        below += 0.5 * ground.Below(foot, contact.ball_height_m);
      }
    }
  }
  const Clip cut = NormaliseClip(clip, {frame, frame + 1},
                                 heading_rad[static_cast<std::size_t>(best_frame)], below);
  Extraction::Stand stand;
  stand.pose.root_position_m = cut.root_positions_m[0];
  stand.pose.rotations = cut.rotations;
  stand.unrest = *best;
  stand.tilt_m = Tilt(feet[0], best_frame) + Tilt(feet[1], best_frame);
  return stand;
}

}  // namespace stridewire
