#include "world/encoded_pose_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "captured_library.h"
#include "random_requests.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/pose_quantizations.h"

namespace stridewire::server {
namespace {

using protocol::PoseMode;

constexpr std::size_t kCrowd = 30;

// Poses encoded tick by tick, of avatars that evaluate each of their own.
class Encoder {
 public:
  explicit Encoder(const PoseCodes& codes) : codes_(codes) {
    std::vector<protocol::AvatarId> numbers(kCrowd);
    std::iota(numbers.begin(), numbers.end(), 1u);
    numbers_ = std::make_shared<const std::vector<protocol::AvatarId>>(std::move(numbers));
  }

  const protocol::PoseRows& Encode(PoseMode mode, std::span<const AvatarSimulation> avatars) {
    protocol::PoseBatchInfo info;
    info.world = 1;
    info.mode = mode;
    info.joint_count = static_cast<std::uint16_t>(codes_.joints.size());
    EXPECT_TRUE(rows_.Begin(info, numbers_, codes_.codecs.Find(mode)));
    for (const AvatarSimulation& avatar : avatars) {
      EXPECT_TRUE(rows_.Add(0, avatar.pose().root_position_m, avatar.pose().rotations));
    }
    return rows_;
  }

 private:
  const PoseCodes& codes_;
  protocol::PoseRows::Avatars numbers_;
  protocol::PoseRows rows_;
};

// Two crowds that are asked for the same: one evaluates every pose, the other is told ahead.
class Ahead {
 public:
  Ahead(const std::shared_ptr<const MotionLibrary>& library, unsigned seed,
        std::shared_ptr<const PoseCodes> codes = nullptr, std::size_t shown = kCrowd)
      : codes_(codes != nullptr ? std::move(codes) : MakePoseCodes(*library)),
        eager_(library, kCrowd, seed),
        told_(library, kCrowd, seed),
        poses_(std::make_shared<PoseScratch>(library), &codes_->codecs),
        places_(kCrowd),
        shown_(shown),
        encoder_(*codes_) {}

  EncodedPoseCache& poses() { return poses_; }
  std::vector<EncodedPoseCache::Place>& places() { return places_; }

  void Advance() {
    eager_.Advance();
    told_.AdvanceStates();
    ++step_;
  }

  // Asks for all poses of this step and holds them against those of the others.
  void Compare(std::span<const PoseMode> modes) {
    poses_.Begin(step_, 1.0 / 60.0, shown_);
    for (std::size_t i = 0; i < kCrowd; ++i) {
      const AvatarSimulation& avatar = told_.avatars()[i];
      found_ += avatar.layers().empty() && avatar.movement() != nullptr &&
                poses_.Has(places_[i], avatar.revision());
      poses_.Ask(places_[i], told_.avatars()[i]);
    }
    poses_.Finish();
    // As it is told, where it is told.
    const float most_m = modes.empty() ? 0.0f : 0.51f / protocol::kRootStepsPerM;
    for (std::size_t i = 0; i < kCrowd; ++i) {
      const Vec3 off_m = poses_.RootOf(places_[i]) - eager_.avatars()[i].pose().root_position_m;
      ASSERT_LE(std::max({std::abs(off_m.x), std::abs(off_m.y), std::abs(off_m.z)}), most_m)
          << "step " << step_ << ", avatar " << i;
    }
    for (const PoseMode mode : modes) {
      const protocol::PoseRows& rows = encoder_.Encode(mode, eager_.avatars());
      for (std::size_t i = 0; i < kCrowd; ++i) {
        const EncodedPoseCache::Encoded told = poses_.Of(places_[i], mode);
        ASSERT_TRUE(std::ranges::equal(told.bytes, rows.poses(i, i)))
            << "step " << step_ << ", avatar " << i << ", mode " << static_cast<int>(mode);
        ASSERT_EQ(told.is_wide, (rows.flags(i) & protocol::kPoseUncompressed) != 0);
        wide_ += told.is_wide;
        ++poses_compared_;
      }
    }
  }

  // So many others stand around from now on.
  void AddStanding(std::size_t count) {
    const ConstPoseSpan pose = told_.avatars()[0].pose();
    poses_.Begin(step_, 1.0 / 60.0, shown_);
    for (std::size_t i = 0; i < count; ++i) poses_.Take(standing_.emplace_back(), 1, pose, true);
    poses_.Finish();
  }

  // In how many steps from this one on somebody who walks has a pose.
  std::uint64_t StepsKept() {
    std::uint64_t steps = 0;
    const auto is_kept = [&](std::size_t i) {
      return told_.avatars()[i].movement() != nullptr &&
             poses_.Has(places_[i], told_.avatars()[i].revision());
    };
    bool is_any = true;
    for (; is_any; ++steps) {
      poses_.Begin(step_ + steps, 1.0 / 60.0, shown_);
      is_any = false;
      for (std::size_t i = 0; i < kCrowd; ++i) is_any |= is_kept(i);
    }
    poses_.Begin(step_, 1.0 / 60.0, shown_);
    return steps - 1;
  }

  [[nodiscard]] int wide() const { return wide_; }
  [[nodiscard]] int found() const { return found_; }  // of poses of movements, made before
  [[nodiscard]] int compared() const { return poses_compared_; }

 private:
  std::shared_ptr<const PoseCodes> codes_;
  DrawnCrowd eager_;
  DrawnCrowd told_;
  EncodedPoseCache poses_;
  std::vector<EncodedPoseCache::Place> places_;
  std::vector<EncodedPoseCache::Place> standing_;
  std::size_t shown_;  // as if there were so many
  Encoder encoder_;
  std::uint64_t step_ = 100;
  int wide_ = 0;
  int found_ = 0;
  int poses_compared_ = 0;
};

constexpr std::array kAll{PoseMode::kCompact, PoseMode::kCompactReduced, PoseMode::kCompactRoot};

// Codes by which a bent knee can not be told.
std::shared_ptr<const PoseCodes> CodesForStraightKnees(const MotionLibrary& library) {
  auto codes = std::make_shared<PoseCodes>(*MakePoseCodes(library));
  std::vector<std::int16_t> parents;
  for (const Joint& joint : library.skeleton().joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  for (const Leg& leg : library.skeleton().legs) {
    codes->joints[static_cast<std::size_t>(leg.knee)].least_w = 0.98f;
  }
  codes->codecs =
      protocol::CompactCodecs::Make(codes->joints, parents, codes->reduced_joints).value();
  return codes;
}

TEST(EncodedPoseCache, AreTheBytesOfEachTicksOwn) {
  constexpr unsigned kSeed = 20261124;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  const auto library = LibraryOf({});
  for (const auto& [has_wide, shown] :
       {std::pair{false, kCrowd}, std::pair{true, kCrowd}, std::pair{true, std::size_t{10'000}}}) {
    Ahead ahead(library, kSeed, has_wide ? CodesForStraightKnees(*library) : nullptr, shown);
    ahead.poses().SetModes(kAll, 1);
    for (int tick = 0; tick < 400; ++tick) {
      ahead.Advance();
      ahead.Compare(kAll);
      if (HasFatalFailure()) return;
    }
    std::printf("%d poses, %d wide; of movements %d made in an earlier tick\n", ahead.compared(),
                ahead.wide(), ahead.found());
    EXPECT_GT(ahead.found(), 2000);
    if (has_wide) {
      EXPECT_GT(ahead.wide(), 1000);
    }
  }
}

TEST(EncodedPoseCache, AreThoseOfTheTicksThatAreWanted) {
  Ahead ahead(LibraryOf({}), 5);
  int apart = 1;
  std::span<const PoseMode> modes;
  for (int tick = 0; tick < 600; ++tick) {
    if (tick % 100 == 0) {
      apart = std::array{1, 3, 2, 7, 1, 4}[static_cast<std::size_t>(tick / 100)];
      modes = std::span(kAll).first(static_cast<std::size_t>(tick / 100 % 4));
      ahead.poses().SetModes(modes, apart);
    }
    ahead.Advance();
    // Now and then one is left out.
    if (tick % apart != 0 || tick % 37 == 0) continue;
    ahead.Compare(modes);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(ahead.found(), 500);
}

TEST(EncodedPoseCache, PlacesOfWhoIsGoneAreOthers) {
  Ahead ahead(LibraryOf({}), 6);
  ahead.poses().SetModes(kAll, 1);
  for (std::size_t tick = 0; tick < 200; ++tick) {
    ahead.Advance();
    for (std::size_t i = 0; i < kCrowd; i += 3) {
      if ((tick + i) % 5 != 0) continue;
      // The place given back last is the next one's.
      ahead.places()[i] = {};
      ahead.places()[(i + 7) % kCrowd] = {};
    }
    ahead.Compare(kAll);
    if (HasFatalFailure()) return;
  }
}

TEST(EncodedPoseCache, OfVeryManyFewerTicksAreKept) {
  Ahead ahead(LibraryOf({}), 7, nullptr, 10'000);
  ahead.poses().SetModes(kAll, 1);
  std::uint64_t most = 0;
  const auto walk = [&] {
    most = 0;
    for (int tick = 0; tick < 100; ++tick) {
      ahead.Advance();
      ahead.Compare(kAll);
      if (HasFatalFailure()) return;
      most = std::max(most, ahead.StepsKept());
    }
  };
  walk();
  EXPECT_EQ(most, EncodedPoseCache::kMost);
  ahead.AddStanding(EncodedPoseCache::kMany + 1);
  const int before = ahead.found();
  walk();
  EXPECT_EQ(most, EncodedPoseCache::kMost / 2);
  EXPECT_GT(ahead.found() - before, 500);
}

TEST(EncodedPoseCache, WhoseRootCanNotBeToldIsNowhereNear) {
  const auto library = LibraryOf({});
  const auto codes = MakePoseCodes(*library);
  EncodedPoseCache poses(std::make_shared<PoseScratch>(library), &codes->codecs);
  poses.SetModes(kAll, 1);
  Pose pose = library->stand_pose();
  std::vector<EncodedPoseCache::Place> places(3);
  poses.Begin(1, 1.0 / 60.0, places.size());
  std::size_t i = 0;
  for (const float x :
       {2.0f * protocol::kMaxRootM, std::numeric_limits<float>::quiet_NaN(), 3.0f}) {
    pose.root_position_m.x = x;
    poses.Take(places[i++], 1, pose, true);
  }
  poses.Finish();
  EXPECT_EQ(poses.RootOf(places[0]), Vec3(protocol::kMaxRootM));
  EXPECT_EQ(poses.RootOf(places[1]), Vec3(protocol::kMaxRootM));
  EXPECT_EQ(poses.RootOf(places[2]).x, 3.0f);
  EXPECT_TRUE(poses.Of(places[0], PoseMode::kCompact).bytes.empty());
  EXPECT_FALSE(poses.Of(places[2], PoseMode::kCompact).bytes.empty());
}

// How many poses are made for so many ticks of an avatar whose movement gives way to another every few of them.
std::uint64_t EvaluatedIn(std::uint64_t ticks, std::uint64_t ticks_of_a_course,
                          const AvatarSimulation& avatar, const std::shared_ptr<PoseScratch>& scratch) {
  constexpr std::size_t kShown = 10'000;
  constexpr double kTickS = 1e-4;
  EncodedPoseCache poses(scratch, nullptr);
  poses.SetModes({}, 1);
  EncodedPoseCache::Place place;
  std::uint64_t evaluated = 0;
  for (std::uint64_t tick = 0; tick < ticks; ++tick) {
    const std::uint64_t revision = 1 + tick / ticks_of_a_course;
    poses.Begin(tick, kTickS, kShown);
    if (poses.Has(place, revision)) continue;
    poses.Want(place, revision, *avatar.movement(), avatar.movement_time_s());
    poses.Finish();
    for (std::uint64_t ahead = 0; poses.Has(place, revision); ++ahead, ++evaluated) {
      poses.Begin(tick + ahead + 1, kTickS, kShown);
    }
  }
  return evaluated;
}

TEST(EncodedPoseCache, OfWhoIsSentElsewhereAgainAndAgainFewAreInVain) {
  const auto library = LibraryOf({});
  AvatarSimulation avatar(library, {}, {});
  ASSERT_TRUE(avatar.Enqueue({.id = 1, .movement = StepRequest{.length_m = 0.6}}));
  avatar.Advance(0.1);
  ASSERT_NE(avatar.movement(), nullptr);
  const auto scratch = std::make_shared<PoseScratch>(library);
  constexpr std::uint64_t kTicks = 960;
  // Nobody interferes: each pose is made once, but for those after the last tick.
  EXPECT_LE(EvaluatedIn(kTicks, kTicks, avatar, scratch), kTicks + 15);
  // In every tick: hardly more than two for one, once that is known.
  EXPECT_LE(EvaluatedIn(kTicks, 1, avatar, scratch), 2 * kTicks + kTicks / 8);
  EXPECT_LE(EvaluatedIn(kTicks, 3, avatar, scratch), 2 * kTicks);
}

}  // namespace
}  // namespace stridewire::server
