#include "runtime/library/knee_hinges.h"

#include <gtest/gtest.h>

#include <array>

#include "offline/builtin/builtin_library.h"
#include "reframing.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

std::array<Vec3, 2> HingesOf(const RawLibrary& raw) {
  return LearnKneeHinges(*LibraryBuilder{}.Build(raw).value());
}

// Stretches all knees and turns the thighs by 90 degrees about their own axes.
void StretchAndTwist(RawLibrary& library) {
  const auto change = [&](PoseSpan pose) {
    for (const Leg& leg : library.skeleton.legs) {
      const Quat quarter = glm::angleAxis(1.5707963f, Vec3(0.0f, 1.0f, 0.0f));
      Quat& hip = pose.rotations[static_cast<std::size_t>(leg.hip)];
      Quat& ankle = pose.rotations[static_cast<std::size_t>(leg.ankle)];
      hip = hip * quarter;
      pose.rotations[static_cast<std::size_t>(leg.knee)] = kIdentityQuat;
      ankle = glm::conjugate(quarter) * ankle;
    }
  };
  change(library.stand_pose);
  for (RawGroup& group : library.groups) {
    for (RawExample& example : group.examples) {
      for (int f = 0; f < example.clip.frame_count(); ++f) change(example.clip.frame(f));
    }
  }
}

TEST(LearnKneeHinges, PointToTheLeftOfTheGeneratedFigure) {
  for (const Vec3& hinge : HingesOf(GenerateBuiltinLibrary())) {
    EXPECT_NEAR(glm::length(hinge), 1.0f, 1e-6f);
    EXPECT_GT(hinge.x, 0.999f);
  }
}

TEST(LearnKneeHinges, FollowTheFramesOfTheHips) {
  const RawLibrary raw = GenerateBuiltinLibrary();
  const std::array<Vec3, 2> hinges = HingesOf(raw);
  for (const unsigned seed : {1u, 2u, 3u}) {
    const JointFrames frames = RandomFrames(raw.skeleton, seed);
    const std::array<Vec3, 2> reframed = HingesOf(Reframed(raw, frames));
    for (std::size_t f = 0; f < 2; ++f) {
      const auto hip = static_cast<std::size_t>(raw.skeleton.legs[f].hip);
      const DVec3 in_old_frame = frames[hip] * DVec3(reframed[f]);
      EXPECT_LT(glm::length(in_old_frame - DVec3(hinges[f])), 1e-5) << "seed " << seed;
    }
  }
}

TEST(LearnKneeHinges, FollowTheFeetOfTheStandIfNoKneeBends) {
  RawLibrary raw = GenerateBuiltinLibrary();
  StretchAndTwist(raw);
  for (const Vec3& hinge : HingesOf(raw)) {
    // The twist turns the thigh's own z axis to the left. The feet point slightly outward.
    EXPECT_GT(hinge.z, 0.9f);
  }
}

}  // namespace
}  // namespace stridewire
