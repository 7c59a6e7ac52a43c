#pragma once

#include <cstddef>
#include <vector>

#include "offline/complete/posture_mix.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire::complete {

/// The joints that turn the trunk, the head and the arms.
struct UpperBodyChains {
  struct UpperArm {
    std::size_t joint = 0;  ///< The joint at the shoulder, which moves the upper arm.
    bool is_left = false;
  };
  /// From the child of the root up to the chest, which is the joint at which the arms branch off.
  /// Empty if the arms branch off at the root, or were not found.
  std::vector<std::size_t> trunk;
  std::vector<std::size_t> head;  ///< From the child of the chest up to the head.
  /// The first bone of each arm, from the chest outward, that is long enough to be an upper arm.
  /// Has either two elements or none.
  std::vector<UpperArm> upper_arms;
};

/// Finds the chains of a skeleton by their shape in the stand pose. All chains are empty unless
/// exactly two upper arms are found.
[[nodiscard]] UpperBodyChains FindUpperBodyChains(const Skeleton& skeleton,
                                                  const PostureSample& stand);

/// World rotations by which the parts of an upper body deviate from a reference posture.
struct UpperBodyTurn {
  DQuat pelvis{1.0, 0.0, 0.0, 0.0};
  DQuat chest{1.0, 0.0, 0.0, 0.0};
  DQuat head{1.0, 0.0, 0.0, 0.0};
};

/// Turns pelvis, chest and head of `reference` and writes the rotations of root, trunk and head to
/// `sample`. The joints between them get a share of the difference, so that the spine bends evenly.
void TurnUpperBody(const Skeleton& skeleton, const UpperBodyChains& chains,
                   const PostureSample& reference, const UpperBodyTurn& turn,
                   PostureSample& sample);

/// Rotates an arm about the sideways axis of the body. Positive angles move it forward.
void SwingArm(const Skeleton& skeleton, const UpperBodyChains::UpperArm& arm, double forward_rad,
              PostureSample& sample);

/// Returns a posture whose trunk leans forward by at most 6 degrees and back by at most 4, which
/// suits a stand and a walk. Head and arms keep their directions. If the arms were not found, the
/// lean cannot be measured, and the posture is returned unchanged.
[[nodiscard]] PostureSample LimitLean(const Skeleton& skeleton, const UpperBodyChains& chains,
                                      const PostureSample& sample);

}  // namespace stridewire::complete
