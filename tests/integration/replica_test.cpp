// Replicas must display the same bytes as the avatar in every tick, on every instruction set.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "captured_library.h"
#include "counted_memory.h"
#include "instruction_sets.h"
#include "random.h"
#include "random_requests.h"
#include "rough_ground.h"
#include "runtime/avatar/avatar_replica.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/avatar/movement_record.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
using Bytes = std::vector<std::byte>;

std::string BytesOf(ConstPoseSpan pose) {
  std::string bytes(reinterpret_cast<const char*>(&pose.root_position_m), sizeof(Vec3));
  bytes.append(reinterpret_cast<const char*>(pose.rotations.data()), pose.rotations.size_bytes());
  return bytes;
}

bool IsSame(ConstPoseSpan a, ConstPoseSpan b) { return BytesOf(a) == BytesOf(b); }

#ifdef __SANITIZE_ADDRESS__
constexpr int kFewer = 10;  // Divisor for sanitizer builds, which are twenty times as slow.
#else
constexpr int kFewer = 1;
#endif

struct Manner {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
  double tick_s;
  int movements;  // Minimum number of movements.
};
void PrintTo(const Manner& manner, std::ostream* out) { *out << manner.name; }

// An avatar that receives all kinds of requests at random.
class RandomlyDriven {
 public:
  RandomlyDriven(Library library, Random& random)
      : random_(random),
        avatar_(std::move(library), DrawBase(random),
                {.run_time_correction = Draws(0.7),
                 .foot_planting = Draws(0.8),
                 .blend = Draws(0.8) ? BlendKind::kInertialization : BlendKind::kCubic,
                 .idle_motion = Draws(0.8),
                 .stride_variation = Draws(0.8),
                 .seed = static_cast<std::uint64_t>(random.Draw(0.0, 1000.0)),
                 .terrain = Draws(0.5) ? RoughGround(random) : nullptr}) {}

  // Changes something about the avatar between two ticks.
  void Stir() {
    if (Draws(avatar_.queue_size() == 0 ? 0.2 : 0.02)) {
      const MovementRequest request = DrawRequest(random_, avatar_);
      (void)avatar_.Enqueue(request, Draws(0.1) ? random_.Draw(0.0, 0.5) : 0.0);
    }
    if (Draws(0.002)) (void)avatar_.SetFootPlanting(!avatar_.foot_planting());
    if (Draws(0.002)) avatar_.SetTerrain(Draws(0.5) ? RoughGround(random_) : nullptr);
    if (Draws(0.0005)) avatar_.Teleport(DrawBase(random_));
    if (Draws(0.002)) avatar_.CancelQueue();
    if (Draws(0.01)) DrawLayer(random_, avatar_);
  }

  [[nodiscard]] AvatarSimulation& avatar() { return avatar_; }

 private:
  bool Draws(double likely) { return stridewire::Draws(random_, likely); }

  Random& random_;
  AvatarSimulation avatar_;
};

std::string Refusal(AvatarReplica& replica, const Bytes& record) {
  FootPlanScratch scratch(replica.library());
  const Status status = replica.Apply(record, scratch);
  return status ? "" : Describe(status.error());
}

struct Figures {
  int movements = 0;
  std::size_t records = 0;
  std::size_t states = 0;  // Bytes of records.
  std::size_t poses = 0;
};

void Advance(AvatarReplica& replica, ReplicaEvaluator& evaluator, double dt_s) {
  AvatarReplica* one = &replica;
  AvatarReplica::AdvanceAll(std::span(&one, 1), {.length_s = dt_s}, evaluator);
}

int Begun(const AvatarSimulation& avatar) {
  return static_cast<int>(std::ranges::count_if(avatar.events(), [](const AvatarEvent& event) {
    return event.type == AvatarEventType::kStarted && event.group >= 0;
  }));
}

class ReplicaLibraries : public testing::TestWithParam<Manner> {
 protected:
  void SetUp() override {
    STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
    library_ = LibraryOf(GetParam().subjects);
  }
  Library library_;
};

// One replica receives all records, another one joins later.
TEST_P(ReplicaLibraries, HasTheBytesOfTheAvatarInEveryTick) {
  const Manner& manner = GetParam();
  constexpr unsigned kSeed = 20261123;
  Random random(kSeed);
  ReplicaEvaluator evaluator(*library_);
  Figures figures;
  constexpr int kTicks = 3000;
  for (int round = 0; figures.movements < manner.movements / kFewer; ++round) {
    RandomlyDriven driven(library_, random);
    AvatarSimulation& avatar = driven.avatar();
    AvatarReplica first(library_);
    std::optional<AvatarReplica> late;
    int joins_at = 0;
    for (int tick = 0; tick < kTicks; ++tick) {
      driven.Stir();
      avatar.Advance(manner.tick_s);
      figures.movements += Begun(avatar);
      Bytes record;
      if (AppendChange(avatar, record)) {
        ++figures.records;
        EXPECT_LE(record.size(), MaxRecordBytes(*library_));
        figures.states += avatar.change().needs_state;
        ASSERT_EQ(Refusal(first, record), "") << "tick " << tick << " of " << round;
        if (late) {
          ASSERT_EQ(Refusal(*late, record), "") << "tick " << tick << " of " << round;
        }
      }
      if (tick == joins_at) {
        late.emplace(library_);
        Bytes state;
        AppendState(avatar, state);
        ASSERT_EQ(Refusal(*late, state), "") << "tick " << tick << " of " << round;
        joins_at = tick + static_cast<int>(random.Draw(1.0, 200.0));
      }
      Advance(first, evaluator, manner.tick_s);
      Advance(*late, evaluator, manner.tick_s);
      ASSERT_TRUE(IsSame(first.pose(), avatar.pose()))
          << "tick " << tick << " of " << round << ", seed " << kSeed;
      ASSERT_TRUE(IsSame(late->pose(), avatar.pose()))
          << "tick " << tick << " of " << round << " (late replica), seed " << kSeed;
      ASSERT_EQ(first.idle(), avatar.idle()) << "tick " << tick << " of " << round;
      figures.poses += 2;
    }
  }
  std::printf("%s: seed %u; %d movements, %zu records, %zu of them states; %zu poses compared\n",
              manner.name, kSeed, figures.movements, figures.records, figures.states,
              figures.poses);
  EXPECT_GT(figures.records, figures.states);
}

// Most avatars walk most of the time, so the size of these records matters most.
TEST_P(ReplicaLibraries, RecordsOfStepsAreSmall) {
  const Manner& manner = GetParam();
  constexpr unsigned kSeed = 20261124;
  Random random(kSeed);
  std::size_t steps = 0;
  std::size_t bytes = 0;
  std::size_t largest = 0;
  std::size_t states = 0;
  std::size_t state_bytes = 0;
  std::size_t largest_state = 0;
  for (int walker = 0; walker < 10; ++walker) {
    AvatarSimulation avatar(library_, BaseFrame{},
                            {.terrain = walker % 2 == 0 ? nullptr : RoughGround(random)});
    for (int tick = 0; tick < 3000; ++tick) {
      if (avatar.idle()) {
        (void)avatar.Enqueue({1, WalkRequest{.position_m = DVec3(random.Draw(0.0, 50.0), 0.0,
                                                                 random.Draw(-25.0, 25.0)),
                                             .heading_rad = random.Draw(-3.0, 3.0)}});
      }
      avatar.Advance(manner.tick_s);
      Bytes record;
      if (tick > 0 && AppendChange(avatar, record)) {
        steps += static_cast<std::size_t>(Begun(avatar));
        bytes += record.size();
        largest = std::max(largest, record.size());
      }
      if (tick % 7 != 0) continue;
      Bytes state;
      AppendState(avatar, state);
      ++states;
      state_bytes += state.size();
      largest_state = std::max(largest_state, state.size());
    }
  }
  std::printf(
      "%s: seed %u; %zu steps, %.1f bytes per step (at most %zu), %.0f per state (at most %zu)\n",
      manner.name, kSeed, steps, static_cast<double>(bytes) / static_cast<double>(steps), largest,
      static_cast<double>(state_bytes) / static_cast<double>(states), largest_state);
  ASSERT_GT(steps, 100u);
  EXPECT_LE(bytes, 400 * steps);
  EXPECT_LE(largest_state, 3072u);
  EXPECT_LT(largest_state, MaxRecordBytes(*library_));
}

// A replica on a machine with another vector width displays the same bytes.
TEST_P(ReplicaLibraries, HasTheSameBytesOnEveryInstructionSet) {
  const Manner& manner = GetParam();
  constexpr unsigned kSeed = 20261125;
  constexpr int kTicks = 400 / kFewer;
  constexpr std::size_t kAvatars = 20;
  struct Tick {
    std::vector<Bytes> records;
    std::vector<std::string> poses;
  };
  const std::vector<std::int64_t> sets = InstructionSets();
  std::printf("instruction sets compared:");
  for (const std::int64_t told_on : sets) {
    std::printf(" %s", hwy::TargetName(told_on));
    std::vector<Tick> ticks(kTicks);
    {
      const OnlyInstructionSet only(told_on);
      Random random(kSeed);
      std::vector<std::unique_ptr<RandomlyDriven>> crowd;
      for (std::size_t i = 0; i < kAvatars; ++i) {
        crowd.push_back(std::make_unique<RandomlyDriven>(library_, random));
      }
      for (Tick& tick : ticks) {
        for (const auto& driven : crowd) {
          driven->Stir();
          driven->avatar().Advance(manner.tick_s);
          (void)AppendChange(driven->avatar(), tick.records.emplace_back());
          tick.poses.push_back(BytesOf(driven->avatar().pose()));
        }
      }
    }
    for (const std::int64_t shown_on : sets) {
      const OnlyInstructionSet only(shown_on);
      std::vector<AvatarReplica> replicas(kAvatars, AvatarReplica(library_));
      std::vector<AvatarReplica*> all;
      for (AvatarReplica& replica : replicas) all.push_back(&replica);
      ReplicaEvaluator evaluator(*library_);
      for (std::size_t t = 0; t < ticks.size(); ++t) {
        for (std::size_t i = 0; i < kAvatars; ++i) {
          const Bytes& record = ticks[t].records[i];
          if (record.empty()) continue;
          ASSERT_EQ(Refusal(replicas[i], record), "");
        }
        AvatarReplica::AdvanceAll(all, {.length_s = manner.tick_s, .number = t}, evaluator);
        for (std::size_t i = 0; i < kAvatars; ++i) {
          ASSERT_TRUE(BytesOf(replicas[i].pose()) == ticks[t].poses[i])
              << hwy::TargetName(told_on) << " shown on " << hwy::TargetName(shown_on) << ", tick "
              << t << ", seed " << kSeed;
        }
      }
    }
  }
  std::printf("\n");
}

INSTANTIATE_TEST_SUITE_P(Libraries, ReplicaLibraries,
                         testing::Values(Manner{"Builtin", {}, 1.0 / 60.0, 10'000},
                                         Manner{"BuiltinAtFiveTicks", {}, 0.2, 2'000},
                                         Manner{"Subject01", {kDebianTakes}, 1.0 / 60.0, 2'000},
                                         Manner{"Subject16", {"16"}, 1.0 / 60.0, 2'000}),
                         [](const auto& tested) { return tested.param.name; });

TEST(AvatarReplica, AllocatesOnlyInItsConstructor) {
  constexpr unsigned kSeed = 20261127;
  Random random(kSeed);
  const Library library = LibraryOf({});
  RandomlyDriven driven(library, random);
  AvatarReplica replica(library);
  ReplicaEvaluator evaluator(*library);
  FootPlanScratch scratch(*library);
  Bytes record;
  for (int tick = 0; tick < 3000; ++tick) {
    driven.Stir();
    driven.avatar().Advance(1.0 / 60.0);
    record.clear();
    const bool is_changed = AppendChange(driven.avatar(), record);
    const std::size_t before = counted_memory::LiveBytes();
    counted_memory::ResetPeak();
    const bool is_taken = !is_changed || replica.Apply(record, scratch).has_value();
    Advance(replica, evaluator, 1.0 / 60.0);
    ASSERT_TRUE(is_taken);
    ASSERT_LE(counted_memory::PeakBytes(), before) << "tick " << tick << ", seed " << kSeed;
  }
}

// Damaged and foreign bytes are either rejected or evaluated to some pose, without a crash.
TEST(AvatarReplica, SurvivesDamagedRecords) {
  constexpr unsigned kSeed = 20261126;
  Random random(kSeed);
  const Library library = LibraryOf({});
  ReplicaEvaluator evaluator(*library);
  FootPlanScratch scratch(*library);
  const auto below = [&](std::size_t n) {
    return static_cast<std::size_t>(random.Draw(0.0, static_cast<double>(n)));
  };
  int refused = 0;
  int shown = 0;
  for (int round = 0; round < 20; ++round) {
    RandomlyDriven driven(library, random);
    AvatarReplica replica(library);
    for (int tick = 0; tick < 600; ++tick) {
      driven.Stir();
      driven.avatar().Advance(1.0 / 60.0);
      Bytes record;
      const bool is_changed = AppendChange(driven.avatar(), record);
      if (!is_changed) {
        if (tick % 10 != 0) continue;
        AppendState(driven.avatar(), record);
      }
      Bytes damaged = record;
      const std::size_t count = 1 + below(4);
      for (std::size_t i = 0; i < count; ++i) {
        damaged[below(damaged.size())] = static_cast<std::byte>(below(256));
      }
      if (below(4) == 0) damaged.resize(below(damaged.size()));
      if (below(8) == 0) damaged.insert(damaged.end(), 1 + below(9), std::byte{1});
      AvatarReplica other = replica;
      const bool is_taken = other.Apply(damaged, scratch).has_value();
      (is_taken ? shown : refused) += 1;
      EXPECT_EQ(other.is_known(), is_taken);
      Advance(other, evaluator, 1.0 / 60.0);
      // Records that are truncated or too long are always rejected.
      Bytes shorter = record;
      shorter.resize(below(record.size()));
      EXPECT_FALSE(AvatarReplica(replica).Apply(shorter, scratch).has_value()) << "seed " << kSeed;
      Bytes longer = record;
      longer.push_back(std::byte{0});
      EXPECT_FALSE(AvatarReplica(replica).Apply(longer, scratch).has_value()) << "seed " << kSeed;
      (void)replica.Apply(record, scratch);
      Advance(replica, evaluator, 1.0 / 60.0);
    }
  }
  std::printf("seed %u; %d refused, %d shown\n", kSeed, refused, shown);
  EXPECT_GT(refused, 100);
  EXPECT_GT(shown, 100);
}

TEST(AvatarReplica, IsUnknownBeforeAState) {
  const Library library = LibraryOf({});
  AvatarSimulation avatar(library, BaseFrame{});
  avatar.Advance(1.0 / 60.0);
  ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.5}}).has_value());
  avatar.Advance(1.0 / 60.0);
  Bytes change;
  ASSERT_TRUE(AppendChange(avatar, change));
  AvatarReplica replica(library);
  ReplicaEvaluator evaluator(*library);
  FootPlanScratch scratch(*library);
  EXPECT_FALSE(replica.is_known());
  EXPECT_EQ(replica.Apply(change, scratch).error().code, ErrorCode::kNotFound);
  Advance(replica, evaluator, 1.0 / 60.0);
  EXPECT_FALSE(replica.is_known());
}

}  // namespace
}  // namespace stridewire
