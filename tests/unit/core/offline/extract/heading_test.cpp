#include "offline/extract/heading.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stridewire {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kFps = 120.0;
constexpr int kStepFrames = 66;

// A walk with a heel-strike every 66 frames. The pelvis yaws by `swing_rad` once per stride, around
// a heading that turns with `turn_rad_s`.
struct Walk {
  BodyTracks tracks;
  FootContacts contacts;
  double turn_rad_s = 0.0;
  [[nodiscard]] double TrueHeading(int i) const { return 0.4 + turn_rad_s * i / kFps; }
};

Walk MakeWalk(int steps, double swing_rad, double turn_rad_s) {
  Walk walk;
  walk.turn_rad_s = turn_rad_s;
  walk.tracks.fps = kFps;
  const int frames = steps * kStepFrames;
  walk.tracks.frames = {0, frames};
  for (int i = 0; i < frames; ++i) {
    walk.tracks.pelvis_m.emplace_back(0.0);
    walk.tracks.pelvis_yaw_rad.push_back(
        walk.TrueHeading(i) + swing_rad * std::sin(std::numbers::pi * i / kStepFrames + 0.3));
  }
  for (int k = 0; k < steps; ++k) {
    const int strike = 20 + k * kStepFrames;
    walk.contacts.feet[k % 2].push_back({{strike, std::min(strike + 85, frames)}, 0.04});
  }
  return walk;
}

TEST(StrideHeading, RemovesPelvisOscillation) {
  const Walk walk = MakeWalk(8, 10.0 * kDegree, 0.0);
  const std::vector<double> heading = StrideHeading(walk.tracks, walk.contacts);
  ASSERT_EQ(heading.size(), static_cast<std::size_t>(walk.tracks.size()));
  for (int i = kStepFrames; i < walk.tracks.size() - kStepFrames; ++i) {
    EXPECT_NEAR(heading[static_cast<std::size_t>(i)], 0.4, 0.3 * kDegree) << i;
  }
}

TEST(StrideHeading, FollowsTurnsWithoutWrapping) {
  const Walk walk = MakeWalk(24, 8.0 * kDegree, 40.0 * kDegree);
  const std::vector<double> heading = StrideHeading(walk.tracks, walk.contacts);
  for (int i = kStepFrames; i < walk.tracks.size() - kStepFrames; ++i) {
    EXPECT_NEAR(heading[static_cast<std::size_t>(i)], walk.TrueHeading(i), 0.5 * kDegree) << i;
  }
  EXPECT_GT(heading.back() - heading.front(), 7.0);  // More than a full turn.
}

TEST(StrideHeading, IsMoreAccurateThanThePelvisNearTheEnds) {
  const Walk walk = MakeWalk(8, 10.0 * kDegree, 20.0 * kDegree);
  const std::vector<double> heading = StrideHeading(walk.tracks, walk.contacts);
  for (const int from_end : {kStepFrames / 2, 3 * kStepFrames / 4}) {
    for (const int i : {from_end, walk.tracks.size() - 1 - from_end}) {
      EXPECT_NEAR(heading[static_cast<std::size_t>(i)], walk.TrueHeading(i), 2.0 * kDegree) << i;
    }
  }
}

TEST(StrideHeading, EqualsTheYawOfAStandingFigure) {
  BodyTracks tracks;
  tracks.fps = kFps;
  tracks.frames = {0, 50};
  tracks.pelvis_m.assign(50, DVec3(0.0));
  tracks.pelvis_yaw_rad.assign(50, -2.2);
  FootContacts contacts;
  for (auto& foot : contacts.feet) foot.push_back({{0, 50}, 0.04});
  for (const double heading : StrideHeading(tracks, contacts)) EXPECT_NEAR(heading, -2.2, 1e-9);
}

}  // namespace
}  // namespace stridewire
