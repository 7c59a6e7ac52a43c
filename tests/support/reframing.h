#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "random.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// [joint]: rotation from the new to the old frame of a joint.
using JointFrames = std::vector<DQuat>;

/// Returns one random rotation per joint, uniformly distributed.
inline JointFrames RandomFrames(const Skeleton& skeleton, unsigned seed) {
  Random random(seed);
  JointFrames frames;
  for (std::size_t j = 0; j < skeleton.joints.size(); ++j) {
    // Shoemake, Uniform Random Rotations, 1992.
    const double share = random.Draw(0.0, 1.0);
    const double a = random.Draw(0.0, 2.0 * std::numbers::pi);
    const double b = random.Draw(0.0, 2.0 * std::numbers::pi);
    frames.emplace_back(std::sqrt(share) * std::cos(b), std::sqrt(1.0 - share) * std::sin(a),
                        std::sqrt(1.0 - share) * std::cos(a), std::sqrt(share) * std::sin(b));
  }
  return frames;
}

/// Expresses a skeleton in other joint frames. With reframed poses, every point keeps its position
/// in the world.
inline Skeleton Reframed(Skeleton skeleton, const JointFrames& frames) {
  const auto turn = [&](int joint, Vec3& v) {
    v = Vec3(glm::conjugate(frames[static_cast<std::size_t>(joint)]) * DVec3(v));
  };
  for (Joint& joint : skeleton.joints) {
    if (joint.parent >= 0) turn(joint.parent, joint.offset_m);
  }
  for (EndSite& site : skeleton.end_sites) turn(site.joint, site.offset_m);
  for (Leg& leg : skeleton.legs) {
    turn(leg.ball, leg.ball_offset_m);
    turn(leg.ball, leg.toe_tip_offset_m);
  }
  return skeleton;
}

/// Same for the rotations of a pose of the original `skeleton`.
inline void Reframe(const Skeleton& skeleton, const JointFrames& frames, PoseSpan pose) {
  for (std::size_t j = 0; j < frames.size(); ++j) {
    const int parent = skeleton.joints[j].parent;
    DQuat rotation = DQuat(pose.rotations[j]) * frames[j];
    if (parent >= 0) rotation = glm::conjugate(frames[static_cast<std::size_t>(parent)]) * rotation;
    pose.rotations[j] = Quat(glm::normalize(rotation));
  }
}

inline void Reframe(const Skeleton& skeleton, const JointFrames& frames, Clip& clip) {
  for (int f = 0; f < clip.frame_count(); ++f) Reframe(skeleton, frames, clip.frame(f));
}

/// Same for a whole capture.
inline Capture Reframed(Capture capture, const JointFrames& frames) {
  Reframe(capture.skeleton, frames, capture.clip);
  capture.skeleton = Reframed(capture.skeleton, frames);
  return capture;
}

/// Same for a whole library.
inline RawLibrary Reframed(RawLibrary library, const JointFrames& frames) {
  Reframe(library.skeleton, frames, library.stand_pose);
  for (RawGroup& group : library.groups) {
    for (RawExample& example : group.examples) Reframe(library.skeleton, frames, example.clip);
  }
  for (RawLayer& layer : library.layers) Reframe(library.skeleton, frames, layer.clip);
  library.skeleton = Reframed(library.skeleton, frames);
  return library;
}

}  // namespace stridewire
