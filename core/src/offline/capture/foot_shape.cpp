#include "offline/capture/foot_shape.h"

#include <algorithm>
#include <vector>

#include "base/check.h"
#include "offline/capture/leg_chain.h"

namespace stridewire {
namespace {

// If an End Site is closer to the ankle than this, in leg lengths, it is the ball of the foot.
constexpr double kFootEndIsBall = 0.2;
// The ball is at this fraction of the way from ankle to toe tip.
constexpr double kBallShare = 2.0 / 3.0;
// A foot is assumed to be flat in this fraction of the frames, those with the slowest ankle.
constexpr double kSlowShare = 0.25;
// A foot without bones gets a toe tip this far ahead of the ankle and below it, in leg lengths.
constexpr double kFootAhead = 0.24;
constexpr double kFootBelow = 0.07;
// A foot is flat in the rest pose if the vector from ankle to toes has at least this forward and at
// most this upward component, as fractions of its length.
constexpr double kRestForward = 0.7;
constexpr double kRestUp = 0.2;

// The frames in which the sole of a foot is flat.
class FlatFoot {
 public:
  // `foot` is the vector from the ankle to the toes in the frame of the ankle; zero if unknown.
  FlatFoot(const BvhFigure& figure, bool rest_stands, int ankle, const DVec3& foot)
      : figure_(figure) {
    const double length = glm::length(foot);
    if (rest_stands && foot.z >= kRestForward * length && foot.y <= kRestUp * length) {
      frames_.push_back(kRest);
      return;
    }
    const int first = figure.first_frame;
    const int count = figure.clip.frame_count() - first;
    STRIDEWIRE_CHECK(count > 0);
    std::vector<DVec3> path;
    for (int f = 0; f < count; ++f) path.push_back(PositionOf(first + f, ankle));
    std::vector<double> speeds;
    for (int f = 0; f < count; ++f) {
      const DVec3& before = path[static_cast<std::size_t>(std::max(f - 1, 0))];
      speeds.push_back(
          glm::length(path[static_cast<std::size_t>(std::min(f + 1, count - 1))] - before));
    }
    std::vector<double> sorted = speeds;
    const auto slow = sorted.begin() + static_cast<std::ptrdiff_t>(kSlowShare * (count - 1));
    std::nth_element(sorted.begin(), slow, sorted.end());
    for (int f = 0; f < count; ++f) {
      if (speeds[static_cast<std::size_t>(f)] <= *slow) frames_.push_back(first + f);
    }
  }

  // Returns the mean of a world vector over the frames, in the frame of a joint. `vector_in(f)`
  // returns the vector in frame f.
  template <typename VectorIn>
  [[nodiscard]] DVec3 MeanInFrameOf(int joint, const VectorIn& vector_in) const {
    DVec3 sum(0.0);
    for (const int f : frames_) sum += glm::conjugate(RotationOf(f, joint)) * vector_in(f);
    return sum / static_cast<double>(frames_.size());
  }

  // Converts a vector from the frame of `joint` to the frame of `in_joint`, after removing its
  // vertical component in the world.
  [[nodiscard]] DVec3 Flat(int joint, const DVec3& v, int in_joint) const {
    return MeanInFrameOf(in_joint, [&](int f) {
      const DVec3 world = RotationOf(f, joint) * v;
      return DVec3(world.x, 0.0, world.z);
    });
  }

  // Returns the horizontal direction that the pelvis faces in frame f.
  [[nodiscard]] DVec3 Forward(int f) const {
    if (f == kRest) return {0.0, 0.0, 1.0};
    const DVec3 left =
        PositionOf(f, figure_.legs.legs[0].hip) - PositionOf(f, figure_.legs.legs[1].hip);
    const DVec3 forward(-left.z, 0.0, left.x);
    const double length = glm::length(forward);
    return length > 0.0 ? forward / length : DVec3(0.0, 0.0, 1.0);
  }

 private:
  static constexpr int kRest = -1;  // The rest pose with identity rotations.

  [[nodiscard]] DQuat RotationOf(int frame, int joint) const {
    DQuat rotation(1.0, 0.0, 0.0, 0.0);
    if (frame == kRest) return rotation;
    for (int j = joint; j >= 0; j = figure_.joints[Index(j)].parent) {
      rotation = DQuat(figure_.clip.frame(frame).rotations[Index(j)]) * rotation;
    }
    return rotation;
  }

  [[nodiscard]] DVec3 PositionOf(int frame, int joint) const {
    const ConstPoseSpan pose = figure_.clip.frame(frame);
    DVec3 position(0.0);
    for (int j = joint; j >= 0; j = figure_.joints[Index(j)].parent) {
      position = DQuat(pose.rotations[Index(j)]) * position;
      position += DVec3(j == 0 ? pose.root_position_m : figure_.joints[Index(j)].offset_m);
    }
    return position;
  }

  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }

  const BvhFigure& figure_;
  std::vector<int> frames_;
};

}  // namespace

void SetFootShape(BvhFigure& figure, bool rest_stands, const FoundLeg& found, Leg& leg) {
  STRIDEWIRE_CHECK(found.hip >= 0 && found.hip < found.knee && found.knee < found.ankle);
  STRIDEWIRE_CHECK(found.ball < 0 || found.ball >= found.ankle);
  leg.hip = found.hip;
  leg.knee = found.knee;
  leg.ankle = found.ankle;
  const double beyond_ball = 1.0 / kBallShare - 1.0;
  if (found.ball >= 0) {
    leg.ball = found.ball;
    const DVec3 tip = figure.FarthestTip(found.ball);
    if (glm::length(tip) > 0.0) {
      leg.toe_tip_offset_m = Vec3(tip);
      return;
    }
    const DVec3 foot = figure.FootVector(found);
    const FlatFoot flat(figure, rest_stands, found.ankle, foot);
    leg.toe_tip_offset_m = Vec3(beyond_ball * flat.Flat(found.ankle, foot, found.ball));
    return;
  }
  leg.ball = found.ankle;
  const double leg_m = ChainLength(figure.joints, found.hip, found.ankle);
  DVec3 tip = figure.FarthestTip(found.ankle);
  const FlatFoot flat(figure, rest_stands, found.ankle, tip);
  if (glm::length(tip) < 1e-6) {
    tip = leg_m * flat.MeanInFrameOf(found.ankle, [&](int f) {
      return kFootAhead * flat.Forward(f) - DVec3(0.0, kFootBelow, 0.0);
    });
    figure.notes.push_back(
        "a foot has neither a toe joint nor an End Site; its length is taken as 0.24 leg lengths");
  } else if (glm::length(tip) < kFootEndIsBall * leg_m) {
    leg.ball_offset_m = Vec3(tip);
    leg.toe_tip_offset_m = Vec3(tip + beyond_ball * flat.Flat(found.ankle, tip, found.ankle));
    return;
  }
  leg.ball_offset_m = Vec3(tip - (1.0 - kBallShare) * flat.Flat(found.ankle, tip, found.ankle));
  leg.toe_tip_offset_m = Vec3(tip);
}

}  // namespace stridewire
