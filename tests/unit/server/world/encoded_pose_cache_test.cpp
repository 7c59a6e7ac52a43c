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

// Encodes the poses of one tick, as PoseRows does without a cache.
class Encoder {
 public:
  explicit Encoder(const PoseQuantizations& quantizations) : quantizations_(quantizations) {
    std::vector<protocol::AvatarId> ids(kCrowd);
    std::iota(ids.begin(), ids.end(), 1u);
    ids_ = std::make_shared<const std::vector<protocol::AvatarId>>(std::move(ids));
  }

  const protocol::PoseRows& Encode(PoseMode mode, std::span<const AvatarSimulation> avatars) {
    protocol::PoseBatchInfo info;
    info.world = 1;
    info.mode = mode;
    info.joint_count = static_cast<std::uint16_t>(quantizations_.joints.size());
    EXPECT_TRUE(rows_.Begin(info, ids_, quantizations_.codecs.Find(mode)));
    for (const AvatarSimulation& avatar : avatars) {
      EXPECT_TRUE(rows_.Add(0, avatar.pose().root_position_m, avatar.pose().rotations));
    }
    return rows_;
  }

 private:
  const PoseQuantizations& quantizations_;
  protocol::PoseRows::Avatars ids_;
  protocol::PoseRows rows_;
};

// Two crowds that receive the same requests. One evaluates every pose in its tick, the other uses
// the cache.
class CachedCrowd {
 public:
  CachedCrowd(const std::shared_ptr<const MotionLibrary>& library, unsigned seed,
              std::shared_ptr<const PoseQuantizations> quantizations = nullptr,
              std::size_t avatar_count = kCrowd)
      : quantizations_(quantizations != nullptr ? std::move(quantizations)
                                                : MakePoseQuantizations(*library)),
        reference_(library, kCrowd, seed),
        cached_(library, kCrowd, seed),
        cache_(std::make_shared<PoseScratch>(library), &quantizations_->codecs),
        slots_(kCrowd),
        avatar_count_(avatar_count),
        encoder_(*quantizations_) {}

  EncodedPoseCache& cache() { return cache_; }
  std::vector<EncodedPoseCache::Slot>& slots() { return slots_; }

  void Advance() {
    reference_.Advance();
    cached_.AdvanceStates();
    ++step_;
  }

  // Requests all poses of this step and compares them with those of the reference crowd.
  void Compare(std::span<const PoseMode> modes) {
    cache_.BeginStep(step_, 1.0 / 60.0, avatar_count_);
    for (std::size_t i = 0; i < kCrowd; ++i) {
      const AvatarSimulation& avatar = cached_.avatars()[i];
      hits_ += avatar.layers().empty() && avatar.movement() != nullptr &&
               cache_.Contains(slots_[i], avatar.revision());
      cache_.Request(slots_[i], cached_.avatars()[i]);
    }
    cache_.FinishStep();
    // Roots are rounded only if they are encoded.
    const float max_error_m = modes.empty() ? 0.0f : 0.51f / protocol::kRootStepsPerM;
    for (std::size_t i = 0; i < kCrowd; ++i) {
      const Vec3 error_m =
          cache_.FindRoot(slots_[i].number()) - reference_.avatars()[i].pose().root_position_m;
      ASSERT_LE(std::max({std::abs(error_m.x), std::abs(error_m.y), std::abs(error_m.z)}),
                max_error_m)
          << "step " << step_ << ", avatar " << i;
    }
    for (const PoseMode mode : modes) {
      const protocol::PoseRows& rows = encoder_.Encode(mode, reference_.avatars());
      for (std::size_t i = 0; i < kCrowd; ++i) {
        const EncodedPoseCache::Encoded encoded = cache_.Find(slots_[i].number(), mode);
        ASSERT_TRUE(std::ranges::equal(encoded.bytes, rows.poses(i, i)))
            << "step " << step_ << ", avatar " << i << ", mode " << static_cast<int>(mode);
        ASSERT_EQ(encoded.is_uncompressed, (rows.flags(i) & protocol::kPoseUncompressed) != 0);
        uncompressed_ += encoded.is_uncompressed;
        ++compared_;
      }
    }
  }

  // Adds `count` avatars that stand still.
  void AddStanding(std::size_t count) {
    const ConstPoseSpan pose = cached_.avatars()[0].pose();
    cache_.BeginStep(step_, 1.0 / 60.0, avatar_count_);
    for (std::size_t i = 0; i < count; ++i) cache_.Store(standing_.emplace_back(), 1, pose, true);
    cache_.FinishStep();
  }

  // Returns for how many steps, from this one on, the cache contains a pose of any walking avatar.
  std::uint64_t StepsAhead() {
    std::uint64_t steps = 0;
    const auto contains = [&](std::size_t i) {
      return cached_.avatars()[i].movement() != nullptr &&
             cache_.Contains(slots_[i], cached_.avatars()[i].revision());
    };
    bool is_any = true;
    for (; is_any; ++steps) {
      cache_.BeginStep(step_ + steps, 1.0 / 60.0, avatar_count_);
      is_any = false;
      for (std::size_t i = 0; i < kCrowd; ++i) is_any |= contains(i);
    }
    cache_.BeginStep(step_, 1.0 / 60.0, avatar_count_);
    return steps - 1;
  }

  [[nodiscard]] int uncompressed() const { return uncompressed_; }
  // Poses of movements that were evaluated in an earlier step.
  [[nodiscard]] int hits() const { return hits_; }
  [[nodiscard]] int compared() const { return compared_; }

 private:
  std::shared_ptr<const PoseQuantizations> quantizations_;
  DrawnCrowd reference_;
  DrawnCrowd cached_;
  EncodedPoseCache cache_;
  std::vector<EncodedPoseCache::Slot> slots_;
  std::vector<EncodedPoseCache::Slot> standing_;
  std::size_t avatar_count_;  // as passed to BeginStep; may be larger than the crowd
  Encoder encoder_;
  std::uint64_t step_ = 100;
  int uncompressed_ = 0;
  int hits_ = 0;
  int compared_ = 0;
};

constexpr std::array kAll{PoseMode::kCompact, PoseMode::kCompactReduced, PoseMode::kCompactRoot};

// Returns quantizations that cannot represent a bent knee, so that many poses are uncompressed.
std::shared_ptr<const PoseQuantizations> QuantizationsForStraightKnees(
    const MotionLibrary& library) {
  auto quantizations = std::make_shared<PoseQuantizations>(*MakePoseQuantizations(library));
  std::vector<std::int16_t> parents;
  for (const Joint& joint : library.skeleton().joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  for (const Leg& leg : library.skeleton().legs) {
    quantizations->joints[static_cast<std::size_t>(leg.knee)].least_w = 0.98f;
  }
  quantizations->codecs =
      protocol::CompactCodecs::Make(quantizations->joints, parents, quantizations->reduced_joints)
          .value();
  return quantizations;
}

TEST(EncodedPoseCache, ReturnsTheSameBytesAsWithoutACache) {
  constexpr unsigned kSeed = 20261124;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  const auto library = LibraryOf({});
  for (const auto& [is_coarse, avatar_count] :
       {std::pair{false, kCrowd}, std::pair{true, kCrowd}, std::pair{true, std::size_t{10'000}}}) {
    CachedCrowd crowd(library, kSeed, is_coarse ? QuantizationsForStraightKnees(*library) : nullptr,
                      avatar_count);
    crowd.cache().SetModes(kAll, 1);
    for (int tick = 0; tick < 400; ++tick) {
      crowd.Advance();
      crowd.Compare(kAll);
      if (HasFatalFailure()) return;
    }
    std::printf("%d poses, %d uncompressed, %d evaluated in an earlier tick\n", crowd.compared(),
                crowd.uncompressed(), crowd.hits());
    EXPECT_GT(crowd.hits(), 2000);
    if (is_coarse) {
      EXPECT_GT(crowd.uncompressed(), 1000);
    }
  }
}

TEST(EncodedPoseCache, SupportsAnyIntervalAndSkippedTicks) {
  CachedCrowd crowd(LibraryOf({}), 5);
  int interval = 1;
  std::span<const PoseMode> modes;
  for (int tick = 0; tick < 600; ++tick) {
    if (tick % 100 == 0) {
      interval = std::array{1, 3, 2, 7, 1, 4}[static_cast<std::size_t>(tick / 100)];
      modes = std::span(kAll).first(static_cast<std::size_t>(tick / 100 % 4));
      crowd.cache().SetModes(modes, interval);
    }
    crowd.Advance();
    if (tick % interval != 0 || tick % 37 == 0) continue;
    crowd.Compare(modes);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(crowd.hits(), 500);
}

TEST(EncodedPoseCache, ReusesReleasedSlots) {
  CachedCrowd crowd(LibraryOf({}), 6);
  crowd.cache().SetModes(kAll, 1);
  for (std::size_t tick = 0; tick < 200; ++tick) {
    crowd.Advance();
    for (std::size_t i = 0; i < kCrowd; i += 3) {
      if ((tick + i) % 5 != 0) continue;
      // The slot that was released last is allocated next, by another avatar.
      crowd.slots()[i] = {};
      crowd.slots()[(i + 7) % kCrowd] = {};
    }
    crowd.Compare(kAll);
    if (HasFatalFailure()) return;
  }
}

TEST(EncodedPoseCache, StoresFewerTicksOfALargeCrowd) {
  CachedCrowd crowd(LibraryOf({}), 7, nullptr, 10'000);
  crowd.cache().SetModes(kAll, 1);
  std::uint64_t max_steps = 0;
  const auto walk = [&] {
    max_steps = 0;
    for (int tick = 0; tick < 100; ++tick) {
      crowd.Advance();
      crowd.Compare(kAll);
      if (HasFatalFailure()) return;
      max_steps = std::max(max_steps, crowd.StepsAhead());
    }
  };
  walk();
  EXPECT_EQ(max_steps, EncodedPoseCache::kMaxTicksAhead);
  crowd.AddStanding(EncodedPoseCache::kLargeCrowd + 1);
  const int hits_before = crowd.hits();
  walk();
  EXPECT_EQ(max_steps, EncodedPoseCache::kMaxTicksAhead / 2);
  EXPECT_GT(crowd.hits() - hits_before, 500);
}

TEST(EncodedPoseCache, ReturnsAFarRootForPosesThatCannotBeEncoded) {
  const auto library = LibraryOf({});
  const auto quantizations = MakePoseQuantizations(*library);
  EncodedPoseCache cache(std::make_shared<PoseScratch>(library), &quantizations->codecs);
  cache.SetModes(kAll, 1);
  Pose pose = library->stand_pose();
  std::vector<EncodedPoseCache::Slot> slots(3);
  cache.BeginStep(1, 1.0 / 60.0, slots.size());
  std::size_t i = 0;
  for (const float x :
       {2.0f * protocol::kMaxRootM, std::numeric_limits<float>::quiet_NaN(), 3.0f}) {
    pose.root_position_m.x = x;
    cache.Store(slots[i++], 1, pose, true);
  }
  cache.FinishStep();
  EXPECT_EQ(cache.FindRoot(slots[0].number()), Vec3(protocol::kMaxRootM));
  EXPECT_EQ(cache.FindRoot(slots[1].number()), Vec3(protocol::kMaxRootM));
  EXPECT_EQ(cache.FindRoot(slots[2].number()).x, 3.0f);
  EXPECT_TRUE(cache.Find(slots[0].number(), PoseMode::kCompact).bytes.empty());
  EXPECT_FALSE(cache.Find(slots[2].number(), PoseMode::kCompact).bytes.empty());
}

// An avatar at the beginning of a step of 0.6 m.
AvatarSimulation SteppingAvatar(const std::shared_ptr<const MotionLibrary>& library) {
  AvatarSimulation avatar(library, {}, {});
  EXPECT_TRUE(avatar.Enqueue({.id = 1, .movement = StepRequest{.length_m = 0.6}}));
  avatar.Advance(0.1);
  EXPECT_NE(avatar.movement(), nullptr);
  return avatar;
}

// Follows one slot through the states of the life cycle.
class EncodedPoseCacheSlot : public testing::Test {
 protected:
  static constexpr double kStepS = 1e-4;

  void Schedule(std::uint64_t revision) {
    cache_.Schedule(slot_, revision, *avatar_.movement(), avatar_.movement_time_s());
  }
  void Store(std::uint64_t revision, bool is_constant) {
    cache_.Store(slot_, revision, library_->stand_pose(), is_constant);
  }
  void Begin(std::uint64_t step) { cache_.BeginStep(step, kStepS, 1); }
  // Returns for how many steps after `step` the slot contains poses, up to 100.
  std::uint64_t StepsAfter(std::uint64_t step, std::uint64_t revision) {
    std::uint64_t steps = 0;
    for (; steps < 100; ++steps) {
      Begin(step + steps + 1);
      if (!cache_.Contains(slot_, revision)) break;
    }
    Begin(step);
    return steps;
  }

  std::shared_ptr<const MotionLibrary> library_ = LibraryOf({});
  AvatarSimulation avatar_ = SteppingAvatar(library_);
  EncodedPoseCache cache_{std::make_shared<PoseScratch>(library_), nullptr};
  EncodedPoseCache::Slot slot_;
};

TEST_F(EncodedPoseCacheSlot, IsEmptyAtFirst) {
  Begin(0);
  EXPECT_FALSE(cache_.Contains(slot_, 0));
  EXPECT_FALSE(cache_.Contains(slot_, 1));
}

TEST_F(EncodedPoseCacheSlot, ContainsTimedPosesAfterFinishStep) {
  Begin(0);
  Schedule(1);
  EXPECT_FALSE(cache_.Contains(slot_, 1)) << "scheduled";
  cache_.FinishStep();
  EXPECT_TRUE(cache_.Contains(slot_, 1)) << "timed";
  EXPECT_FALSE(cache_.Contains(slot_, 2)) << "another revision";
  const std::uint64_t steps = StepsAfter(0, 1);
  EXPECT_EQ(steps, EncodedPoseCache::PhasesOf(1) - 1);
  Begin(steps + 1);
  EXPECT_FALSE(cache_.Contains(slot_, 1)) << "all poses were used";
  Schedule(1);
  cache_.FinishStep();
  EXPECT_TRUE(cache_.Contains(slot_, 1)) << "timed again";
}

TEST_F(EncodedPoseCacheSlot, ContainsAStoredPoseForOneStepOrForever) {
  Begin(0);
  Store(1, /*is_constant=*/false);
  cache_.FinishStep();
  EXPECT_TRUE(cache_.Contains(slot_, 1));
  EXPECT_EQ(StepsAfter(0, 1), 0u);
  Begin(1);
  Store(1, /*is_constant=*/true);
  cache_.FinishStep();
  EXPECT_EQ(StepsAfter(1, 1), 100u);
  EXPECT_EQ(cache_.FindRoot(slot_.number()), library_->stand_pose().root_position_m);
  EXPECT_FALSE(cache_.Contains(slot_, 2)) << "another revision";
  Begin(2);
  Schedule(2);
  cache_.FinishStep();
  EXPECT_TRUE(cache_.Contains(slot_, 2));
  EXPECT_FALSE(cache_.Contains(slot_, 1));
}

TEST_F(EncodedPoseCacheSlot, IsEmptyAfterItWasReleasedOrForgotten) {
  Begin(0);
  Store(1, /*is_constant=*/true);
  cache_.FinishStep();
  slot_ = {};
  EXPECT_FALSE(cache_.Contains(slot_, 1)) << "released";
  Store(2, /*is_constant=*/true);
  cache_.FinishStep();
  EXPECT_TRUE(cache_.Contains(slot_, 2));
  cache_.SetModes({}, 2);
  EXPECT_FALSE(cache_.Contains(slot_, 2)) << "forgotten";
}

TEST_F(EncodedPoseCacheSlot, DoesNotInheritTheBackoffOfItsPreviousAvatar) {
  for (std::uint64_t revision = 1; revision <= 5; ++revision) {
    Begin(0);
    Schedule(revision);
    cache_.FinishStep();
  }
  const std::uint64_t with_backoff = StepsAfter(0, 5);
  EXPECT_EQ(with_backoff, EncodedPoseCache::kMaxTicksAhead / 8 - 1);
  slot_ = {};
  Schedule(6);
  cache_.FinishStep();
  EXPECT_GT(StepsAfter(0, 6), with_backoff);
}

TEST_F(EncodedPoseCacheSlot, MustNotBeUsedInTheWrongState) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  Begin(0);
  Schedule(1);
  EXPECT_DEATH(Schedule(1), "kScheduled");
  EXPECT_DEATH(Store(1, true), "kScheduled");
  EXPECT_DEATH(slot_ = {}, "kScheduled");
  EXPECT_DEATH(Begin(1), "scheduled_");
  cache_.FinishStep();
  Begin(50);
  EXPECT_DEATH((void)cache_.FindRoot(slot_.number()), "pose < state.count");
}

// Returns how many poses are evaluated in `ticks` ticks, if the avatar is interrupted every
// `interrupt_ticks` ticks.
std::uint64_t EvaluatedPoses(std::uint64_t ticks, std::uint64_t interrupt_ticks,
                             const AvatarSimulation& avatar,
                             const std::shared_ptr<PoseScratch>& scratch) {
  constexpr std::size_t kAvatarCount = 10'000;
  constexpr double kTickS = 1e-4;
  EncodedPoseCache cache(scratch, nullptr);
  cache.SetModes({}, 1);
  EncodedPoseCache::Slot slot;
  std::uint64_t evaluated = 0;
  for (std::uint64_t tick = 0; tick < ticks; ++tick) {
    const std::uint64_t revision = 1 + tick / interrupt_ticks;
    cache.BeginStep(tick, kTickS, kAvatarCount);
    if (cache.Contains(slot, revision)) continue;
    cache.Schedule(slot, revision, *avatar.movement(), avatar.movement_time_s());
    cache.FinishStep();
    for (std::uint64_t ahead = 0; cache.Contains(slot, revision); ++ahead, ++evaluated) {
      cache.BeginStep(tick + ahead + 1, kTickS, kAvatarCount);
    }
  }
  return evaluated;
}

TEST(EncodedPoseCache, WastesFewPosesOfAnAvatarThatIsInterruptedOften) {
  const auto library = LibraryOf({});
  const AvatarSimulation avatar = SteppingAvatar(library);
  const auto scratch = std::make_shared<PoseScratch>(library);
  constexpr std::uint64_t kTicks = 960;
  // Without interrupts, each pose is evaluated once. Poses after the last tick are wasted.
  EXPECT_LE(EvaluatedPoses(kTicks, kTicks, avatar, scratch), kTicks + 15);
  // With an interrupt in every tick, hardly more than two poses are evaluated per pose that is
  // used.
  EXPECT_LE(EvaluatedPoses(kTicks, 1, avatar, scratch), 2 * kTicks + kTicks / 8);
  EXPECT_LE(EvaluatedPoses(kTicks, 3, avatar, scratch), 2 * kTicks);
}

}  // namespace
}  // namespace stridewire::server
