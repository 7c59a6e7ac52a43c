#pragma once

#include <array>
#include <span>

#include "stridewire/base/math.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

class MotionLibrary;

/// Returns the hinge axis of each knee, indexed by Foot: a unit vector in the frame of the hip
/// joint. A positive rotation about it moves the shank backward.
///
/// The axis is the mean normal of the leg's plane over all examples, weighted by how far the knee
/// is bent. Knees bend in one direction only, so the normals also give the sign. If a knee hardly
/// bends on average over the examples, its axis points to the left of the foot in the stand pose.
/// The result does not depend on the orientation of the joints' own frames.
///
/// Requires a library whose groups and stand pose are loaded. Returns zero vectors for a leg that
/// is not a chain of hip, knee and ankle.
[[nodiscard]] std::array<Vec3, 2> LearnKneeHinges(const MotionLibrary& library);

/// Computes the hinges from the frames of clips, for use before a library has been built.
[[nodiscard]] std::array<Vec3, 2> LearnKneeHinges(const Skeleton& skeleton,
                                                  ConstPoseSpan stand_pose,
                                                  std::span<const Clip* const> clips);

}  // namespace stridewire
