#include "offline/extract/contacts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stridewire {
namespace {

constexpr double kFps = 120.0;

// Returns tracks of a standing figure, in which tests then move a foot.
BodyTracks StandingTracks(int frames) {
  BodyTracks tracks;
  tracks.frames = {0, frames};
  tracks.fps = kFps;
  const auto count = static_cast<std::size_t>(frames);
  for (int f = 0; f < 2; ++f) {
    const double x = f == 0 ? 0.1 : -0.1;
    tracks.feet[f].ankle_m.assign(count, DVec3(x, 0.09, 0.0));
    tracks.feet[f].ball_m.assign(count, DVec3(x, 0.04, 0.12));
    tracks.feet[f].toe_tip_m.assign(count, DVec3(x, 0.03, 0.2));
  }
  tracks.pelvis_m.assign(count, DVec3(0.0, 0.95, 0.0));
  tracks.pelvis_speed_m_s.assign(count, 0.0);
  tracks.pelvis_yaw_rad.assign(count, 0.0);
  return tracks;
}

// Adds `offset(i)` to all points of a foot.
template <typename Offset>
void Move(BodyTracks::FootTrajectory& foot, Offset offset) {
  for (auto* points : {&foot.ankle_m, &foot.ball_m, &foot.toe_tip_m}) {
    for (std::size_t i = 0; i < points->size(); ++i) (*points)[i] += offset(static_cast<int>(i));
  }
}

// Moves a foot 0.6 m ahead at constant speed during [begin, end), lifted by `lift_m`.
auto Swing(int begin, int end, double lift_m) {
  return [=](int i) {
    const double u = std::clamp(static_cast<double>(i - begin) / (end - begin), 0.0, 1.0);
    return DVec3(0.0, lift_m * std::sin(std::numbers::pi * u), 0.6 * u);
  };
}

TEST(FindContacts, SplitsContactsAtASwing) {
  BodyTracks tracks = StandingTracks(240);
  Move(tracks.feet[0], Swing(100, 150, 0.1));
  const FootContacts contacts = FindContacts(tracks);
  ASSERT_EQ(contacts.foot(Foot::kLeft).size(), 2u);
  EXPECT_EQ(contacts.foot(Foot::kLeft)[0].frames.begin, 0);
  EXPECT_NEAR(contacts.foot(Foot::kLeft)[0].frames.end, 100, 3);
  EXPECT_NEAR(contacts.foot(Foot::kLeft)[1].frames.begin, 150, 3);
  EXPECT_EQ(contacts.foot(Foot::kLeft)[1].frames.end, 240);
  EXPECT_NEAR(contacts.foot(Foot::kLeft)[1].ball_height_m, 0.04, 1e-9);
  ASSERT_EQ(contacts.foot(Foot::kRight).size(), 1u);
  EXPECT_EQ(contacts.foot(Foot::kRight)[0].frames, (FrameRange{0, 240}));
}

TEST(FindContacts, DetectsContactOfASinglePoint) {
  // The foot rolls over the toes: ankle and ball rise and move, but the toe tip rests.
  BodyTracks tracks = StandingTracks(120);
  for (std::size_t i = 60; i < 120; ++i) {
    const double moved = (static_cast<double>(i) - 60.0) / kFps * 2.0;
    tracks.feet[1].ankle_m[i] += DVec3(0.0, moved, moved);
    tracks.feet[1].ball_m[i] += DVec3(0.0, moved, moved);
  }
  const FootContacts contacts = FindContacts(tracks);
  ASSERT_EQ(contacts.foot(Foot::kRight).size(), 1u);
  EXPECT_EQ(contacts.foot(Foot::kRight)[0].frames, (FrameRange{0, 120}));
}

TEST(FindContacts, IgnoresSlowRaisedFeetOnASingleFloor) {
  // The foot is held 20 cm above the floor for a quarter of a second.
  BodyTracks tracks = StandingTracks(360);
  Move(tracks.feet[0], [](int i) {
    if (i < 100 || i >= 170) return DVec3(0.0);
    const double ramp = std::min({(i - 100) / 20.0, (170 - i) / 20.0, 1.0});
    return DVec3(0.0, 0.2 * ramp, 0.0);
  });
  const FootContacts contacts = FindContacts(tracks);
  ASSERT_EQ(contacts.foot(Foot::kLeft).size(), 2u);
}

// Moves the pelvis ahead by `ahead_m` during [begin, end).
void MovePelvis(BodyTracks& tracks, int begin, int end, double ahead_m) {
  for (int i = 0; i < tracks.size(); ++i) {
    const double u = std::clamp(static_cast<double>(i - begin) / (end - begin), 0.0, 1.0);
    tracks.pelvis_m[static_cast<std::size_t>(i)].z += ahead_m * u;
  }
}

TEST(FindContacts, IgnoresTheHeightOnBlocks) {
  // The foot steps onto a block of 30 cm and stays there, and the figure shifts its weight to it.
  BodyTracks tracks = StandingTracks(360);
  MovePelvis(tracks, 100, 200, 0.35);
  Move(tracks.feet[0], [](int i) {
    const double u = std::clamp((i - 100) / 40.0, 0.0, 1.0);
    return DVec3(0.0, 0.3 * u, 0.4 * u);
  });
  const FootContacts contacts = FindContacts(tracks);
  ASSERT_EQ(contacts.foot(Foot::kLeft).size(), 2u);
  EXPECT_NEAR(contacts.foot(Foot::kLeft)[1].frames.begin, 140, 4);
  EXPECT_NEAR(contacts.foot(Foot::kLeft)[1].ball_height_m, 0.34, 1e-6);
}

TEST(FindContacts, IgnoresAFootThatHovers) {
  // The figure stands on its right foot, with the left one still in the air for two seconds.
  for (const double lift : {0.08, 0.15, 0.4}) {
    for (const double ahead : {0.0, 0.3}) {
      BodyTracks tracks = StandingTracks(480);
      Move(tracks.feet[0], [&](int i) {
        const double ramp = std::clamp(std::min((i - 100) / 12.0, (380 - i) / 12.0), 0.0, 1.0);
        return DVec3(0.0, lift * ramp, ahead * ramp);
      });
      const FootContacts contacts = FindContacts(tracks);
      ASSERT_EQ(contacts.foot(Foot::kLeft).size(), 2u) << lift << " " << ahead;
      EXPECT_NEAR(contacts.foot(Foot::kLeft)[0].frames.end, 106, 8) << lift;
      EXPECT_NEAR(contacts.foot(Foot::kLeft)[1].frames.begin, 374, 8) << lift;
      EXPECT_EQ(contacts.foot(Foot::kRight).size(), 1u) << lift;
    }
  }
}

TEST(FindContacts, IgnoresFeetThatHangInTheAir) {
  // Both feet rise at a constant speed, hang still 40 cm above the ground and sink again.
  BodyTracks tracks = StandingTracks(480);
  const auto rise = [](int i) {
    const double ramp = std::clamp(std::min((i - 100) / 40.0, (380 - i) / 40.0), 0.0, 1.0);
    return DVec3(0.0, 0.4 * ramp, 0.0);
  };
  for (BodyTracks::FootTrajectory& foot : tracks.feet) Move(foot, rise);
  for (int i = 0; i < tracks.size(); ++i) tracks.pelvis_m[static_cast<std::size_t>(i)] += rise(i);
  const FootContacts contacts = FindContacts(tracks);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    ASSERT_EQ(contacts.foot(foot).size(), 2u);
    EXPECT_NEAR(contacts.foot(foot)[0].frames.end, 103, 6);
    EXPECT_NEAR(contacts.foot(foot)[1].frames.begin, 377, 6);
  }
}

TEST(FindContacts, IgnoresFeetBesideOrAboveThePelvis) {
  BodyTracks tracks = StandingTracks(240);
  for (DVec3& pelvis : tracks.pelvis_m) pelvis.y = 0.15;
  const FootContacts contacts = FindContacts(tracks);
  EXPECT_TRUE(contacts.foot(Foot::kLeft).empty());
  EXPECT_TRUE(contacts.foot(Foot::kRight).empty());
}

TEST(FindContacts, KeepsAFootThatTheGroundLifts) {
  // The left foot swings while the ground lifts the right one by 10 cm.
  BodyTracks tracks = StandingTracks(240);
  Move(tracks.feet[0], Swing(100, 150, 0.1));
  const auto lift = [](int i) {
    return DVec3(0.0, 0.1 * std::clamp((i - 105) / 40.0, 0.0, 1.0), 0.0);
  };
  for (BodyTracks::FootTrajectory& foot : tracks.feet) Move(foot, lift);
  for (int i = 0; i < tracks.size(); ++i) tracks.pelvis_m[static_cast<std::size_t>(i)] += lift(i);
  const FootContacts contacts = FindContacts(tracks);
  ASSERT_EQ(contacts.foot(Foot::kRight).size(), 1u);
  EXPECT_EQ(contacts.foot(Foot::kRight)[0].frames, (FrameRange{0, 240}));
  EXPECT_EQ(contacts.foot(Foot::kLeft).size(), 2u);
}

TEST(FindContacts, FillsShortGapsAndDropsShortContacts) {
  // A marker jumps for three frames (25 ms) while the foot stands, which is not a gap. The foot
  // rests for five frames (42 ms) in a long swing, which is not a contact.
  BodyTracks tracks = StandingTracks(400);
  Move(tracks.feet[0], [](int i) { return DVec3(0.0, 0.0, i >= 50 && i < 53 ? 0.05 : 0.0); });
  Move(tracks.feet[1], [](int i) {
    const int moving = std::clamp(i - 200, 0, 40) + std::clamp(i - 245, 0, 40);
    return DVec3(0.0, 0.0, 0.02 * moving);
  });
  ContactOptions options;
  options.smooth_s = 0.0;
  const FootContacts contacts = FindContacts(tracks, options);
  EXPECT_EQ(contacts.foot(Foot::kLeft).size(), 1u);
  ASSERT_EQ(contacts.foot(Foot::kRight).size(), 2u);
  EXPECT_NEAR(contacts.foot(Foot::kRight)[0].frames.end, 200, 2);
  EXPECT_NEAR(contacts.foot(Foot::kRight)[1].frames.begin, 285, 2);
}

TEST(FindContacts, IsEmptyWithoutFrames) {
  const FootContacts contacts = FindContacts(StandingTracks(0));
  EXPECT_TRUE(contacts.foot(Foot::kLeft).empty());
  EXPECT_TRUE(contacts.foot(Foot::kRight).empty());
}

TEST(SmoothPath, PreservesLinesAndTheNumberOfPoints) {
  std::vector<DVec3> line;
  for (int i = 0; i < 20; ++i) line.emplace_back(i, 2.0 * i, -i);
  const std::vector<DVec3> smooth = SmoothPath(line, 5);
  ASSERT_EQ(smooth.size(), line.size());
  for (std::size_t i = 2; i + 2 < line.size(); ++i) {
    EXPECT_NEAR(glm::length(smooth[i] - line[i]), 0.0, 1e-9) << i;
  }
  const std::vector<double> speed = PathSpeed(line, 10.0);
  for (const double s : speed) EXPECT_NEAR(s, 10.0 * std::sqrt(6.0), 1e-9);
}

}  // namespace
}  // namespace stridewire
