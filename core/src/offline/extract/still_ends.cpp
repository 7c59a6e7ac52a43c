#include "offline/extract/still_ends.h"

#include <algorithm>
#include <vector>

#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

constexpr double kStillM = 0.005;  // Maximum motion of a joint per frame in a still pose.
// The pose jumps between two frames if a joint moves at least kJumpM. It must also move at least
// kJumpFactor times as far as between the second of these frames and the next one.
constexpr double kJumpM = 0.05;
constexpr double kJumpFactor = 4.0;

class PoseSteps {
 public:
  PoseSteps(const Skeleton& skeleton, const Clip& clip)
      : skeleton_(skeleton),
        clip_(clip),
        from_(static_cast<std::size_t>(skeleton.joint_count())),
        to_(from_.size()),
        rotations_(from_.size()) {}

  // Returns the largest distance that a joint moves between two frames.
  double Between(int from, int to) {
    ForwardKinematics(skeleton_, clip_.frame(from), from_, rotations_);
    ForwardKinematics(skeleton_, clip_.frame(to), to_, rotations_);
    double most = 0.0;
    for (std::size_t j = 0; j < from_.size(); ++j) {
      most = std::max(most, static_cast<double>(glm::length(to_[j] - from_[j])));
    }
    return most;
  }

 private:
  const Skeleton& skeleton_;
  const Clip& clip_;
  std::vector<Vec3> from_;
  std::vector<Vec3> to_;
  std::vector<Quat> rotations_;
};

// Returns the first frame after a still pose that starts at `begin` and ends with a jump. Returns
// `begin` if there is no such jump before `end`. With direction -1, counts frames backward.
int SkipStillPose(PoseSteps& steps, int begin, int end, int direction) {
  for (int i = begin; i != end && i + direction != end && i + 2 * direction != end;
       i += direction) {
    const double step = steps.Between(i, i + direction);
    if (step < kStillM) continue;
    const double next = steps.Between(i + direction, i + 2 * direction);
    return step > kJumpM && step > kJumpFactor * next ? i + direction : begin;
  }
  return begin;
}

}  // namespace

FrameRange WithoutStillEnds(const Skeleton& skeleton, const Clip& clip, int first_frame) {
  PoseSteps steps(skeleton, clip);
  FrameRange frames{first_frame, clip.frame_count()};
  if (frames.size() < 1) return frames;
  frames.begin = SkipStillPose(steps, frames.begin, frames.end, 1);
  frames.end = SkipStillPose(steps, frames.end - 1, frames.begin - 1, -1) + 1;
  return frames;
}

}  // namespace stridewire
