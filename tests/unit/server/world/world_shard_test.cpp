#include "world/world_shard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>

#include "app/world_directory.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/protocol/decode.h"
#include "stridewire/protocol/pose_batch_reader.h"
#include "test_library.h"
#include "world/command_inbox.h"

namespace stridewire::server {
namespace {

using protocol::EventType;
using protocol::PoseMode;
using protocol::StatusCode;
using testing::ElementsAre;

const TickClock kClock(TickClock::Clock::time_point{}, 60.0);

struct Bench {
  explicit Bench(int shard_count = 1, int max_queue = 8)
      : world(MakeWorld()),
        shard({.world = world,
               .shard_count = shard_count,
               .max_queue = max_queue,
               .clock = kClock,
               .budget = budget,
               .metrics = metrics}) {}

  static std::shared_ptr<World> MakeWorld() {
    auto world = std::make_shared<World>();
    world->id = 3;
    world->name = "bench";
    world->library = MakeTestLibrary();
    return world;
  }

  template <typename Part>
  CommandResult Do(Part part, SessionId session = 1) {
    if constexpr (std::is_same_v<Part, SpawnPart>) {
      for (std::size_t i = 0; i < part.items.size(); ++i) {
        EXPECT_EQ(budget.Reserve(*world), AvatarBudget::Verdict::kOk);
      }
    }
    return shard.Execute({.world = world, .session = session, .seq = 1, .part = std::move(part)},
                         ++tick);
  }
  CommandResult Spawn(const std::vector<AvatarId>& ids, SessionId session = 1) {
    SpawnPart part;
    for (const AvatarId id : ids) {
      part.items.push_back({static_cast<std::uint32_t>(part.items.size()), {.avatar = id}});
    }
    return Do(std::move(part), session);
  }
  CommandResult Walk(AvatarId avatar, int steps) {
    RequestPart part;
    for (int i = 0; i < steps; ++i) {
      part.items.push_back({static_cast<std::uint32_t>(i),
                            {.avatar = avatar,
                             .request_id = static_cast<std::uint64_t>(i + 1),
                             .movement = protocol::StepMovement{.length_m = 0.4}}});
    }
    return Do(std::move(part));
  }
  void Observe(std::uint16_t full_interval, std::uint16_t quantised_interval = 0) {
    shard.SetInterest({.world = world,
                       .shard = 0,
                       .poses = {{{.interval = {.all = full_interval}, .avatars = {}},
                                  {.interval = {.all = quantised_interval}, .avatars = {}}}},
                       .events = true});
  }
  std::vector<protocol::Event> Events() {
    const auto events = shard.TakeEvents();
    return events == nullptr ? std::vector<protocol::Event>() : *events;
  }

  AvatarBudget budget{100, 100};
  ThreadMetrics metrics;
  std::shared_ptr<World> world;
  WorldShard shard;
  std::uint64_t tick = 0;
};

// A decoded frame. The copy is aligned to 8 bytes, as the decoder requires.
struct Decoded {
  explicit Decoded(const SharedFrame& frame) : bytes(*frame) {
    const auto view = protocol::ParseFrame(bytes, protocol::Sender::kServer);
    EXPECT_TRUE(view);
    auto message = protocol::DecodeMessage(*view);
    EXPECT_TRUE(message);
    batch = std::get<protocol::PoseBatch>(*message);
  }
  std::vector<std::byte> bytes;
  protocol::PoseBatch batch;
};

TEST(WorldShard, InspectsAnAvatar) {
  Bench bench;
  bench.Spawn({1});
  constexpr std::size_t kMaxSiteBytes = 100'000;
  bench.shard.Advance(++bench.tick, 1);
  const protocol::AvatarState standing = bench.shard.Inspect(1, bench.tick, kMaxSiteBytes);
  EXPECT_EQ(standing.code, StatusCode::kOk);
  EXPECT_EQ(standing.world, 3u);
  EXPECT_FALSE(standing.movement);
  EXPECT_EQ(standing.queue_size, 0u);

  bench.Walk(1, 3);
  bench.shard.Advance(bench.tick, 1);
  const double started_s = kClock.TickTime(bench.tick) - kClock.tick_s();
  for (int i = 0; i < 5; ++i) bench.shard.Advance(++bench.tick, 1);
  const protocol::AvatarState walking = bench.shard.Inspect(1, bench.tick, kMaxSiteBytes);
  EXPECT_EQ(walking.tick, bench.tick);
  EXPECT_EQ(walking.queue_size, 2u);
  ASSERT_EQ(walking.queue.size(), 2u);
  EXPECT_EQ(walking.queue[0].request_id, 2u);
  EXPECT_EQ(walking.queue[0].avatar, 1u);
  EXPECT_EQ(std::get<protocol::StepMovement>(walking.queue[0].movement).length_m, 0.4);
  ASSERT_TRUE(walking.movement);
  const protocol::CurrentMovement& movement = *walking.movement;
  EXPECT_EQ(movement.request_id, 1u);
  EXPECT_NEAR(movement.started_s, started_s, 1e-9);
  EXPECT_GT(movement.generic_time, 0.0);
  EXPECT_LT(movement.generic_time, static_cast<double>(movement.keytimes_s.size() - 1));
  EXPECT_LT(walking.server_time_s, movement.started_s + movement.keytimes_s.back());
  // The weights have the sum 1, and the weighted mean of the examples equals the applied
  // parameters. This holds for a cardinal basis without pseudoexamples.
  const std::size_t d = movement.parameter_names.size();
  ASSERT_EQ(movement.applied.size(), d);
  ASSERT_EQ(movement.sites.size(), movement.weights.size() * d);
  double sum = 0.0;
  std::vector<double> mean(d);
  for (std::size_t e = 0; e < movement.weights.size(); ++e) {
    sum += movement.weights[e];
    for (std::size_t p = 0; p < d; ++p) {
      mean[p] += static_cast<double>(movement.weights[e]) * movement.sites[e * d + p];
    }
  }
  EXPECT_NEAR(sum, 1.0, 1e-5);
  for (std::size_t p = 0; p < d; ++p) {
    EXPECT_EQ(movement.parameter_names[p], movement.applied[p].name);
    EXPECT_NEAR(mean[p], movement.applied[p].value, 1e-5);
  }

  EXPECT_TRUE(bench.shard.Inspect(1, bench.tick, 10).movement->sites.empty());
  const protocol::AvatarState missing = bench.shard.Inspect(9, bench.tick, kMaxSiteBytes);
  EXPECT_EQ(missing.code, StatusCode::kNoSuchAvatar);
  EXPECT_EQ(missing.avatar, 9u);
}

// Layers start and end at the tick of their command, as for a single avatar.
TEST(WorldShard, PlaysLayersLikeASingleAvatar) {
  const auto library = OpenLibrary("builtin").value();
  const auto world = std::make_shared<World>();
  world->id = 3;
  world->library = library;
  AvatarBudget budget(100, 100);
  ThreadMetrics metrics;
  for (const int shard_count : {1, 2}) {
    std::vector<std::unique_ptr<WorldShard>> shards;
    for (int s = 0; s < shard_count; ++s) {
      shards.push_back(std::make_unique<WorldShard>(WorldShardDef{.world = world,
                                                                  .shard = s,
                                                                  .shard_count = shard_count,
                                                                  .max_queue = 8,
                                                                  .clock = kClock,
                                                                  .budget = budget,
                                                                  .metrics = metrics}));
    }
    const auto execute = [&]<typename Part>(AvatarId avatar, std::uint64_t tick, Part part) {
      const int s = ShardOf(avatar, shard_count);
      return shards[static_cast<std::size_t>(s)]
          ->Execute({.world = world, .session = 1, .seq = 1, .part = std::move(part)}, tick)
          .accepted;
    };
    std::vector<AvatarSimulation> alone;
    for (const AvatarId avatar : {1u, 2u}) {
      ASSERT_EQ(budget.Reserve(*world), AvatarBudget::Verdict::kOk);
      ASSERT_EQ(execute(avatar, 1, SpawnPart{{{0, {.avatar = avatar}}}}), 1u);
      alone.emplace_back(library, BaseFrame{});
      const protocol::RequestItem step{
          avatar, 7, protocol::StepMovement{.length_m = 0.3 + 0.1 * avatar}, {}};
      ASSERT_EQ(execute(avatar, 1, RequestPart{{{0, step}}}), 1u);
      ASSERT_TRUE(
          alone.back().Enqueue({7, StepRequest{.length_m = 0.3 + 0.1 * avatar}}).has_value());
    }
    for (std::uint64_t tick = 1; tick <= 120; ++tick) {
      if (tick == 20 || tick == 70) {
        const bool enabled = tick == 20;
        ASSERT_EQ(execute(1, tick, LayerPart{{{0, {1, "wave", enabled, 0.75, 0.5, 1.5}}}}), 1u);
        ASSERT_EQ(execute(2, tick, LayerPart{{{0, {2, "carry", enabled}}}}), 1u);
        const int wave = library->FindLayer("wave");
        const int carry = library->FindLayer("carry");
        ASSERT_TRUE(alone[0].SetLayer({wave, enabled, 0.75, 0.5, 1.5}).has_value());
        ASSERT_TRUE(alone[1].SetLayer({carry, enabled, 1.0, 0.3, 1.0}).has_value());
      }
      for (const auto& shard : shards) shard->Advance(tick, 1);
      for (AvatarSimulation& avatar : alone) avatar.Advance(kClock.tick_s());
      for (const auto& shard : shards) {
        protocol::PoseBatchComposer composer;
        PoseDelivery delivery;
        ASSERT_TRUE(shard->Encode(PoseMode::kFull, tick, true, composer, delivery));
        const Decoded decoded(delivery.parts.at(0));
        protocol::PoseBatchReader reader(decoded.batch, nullptr);
        for (const AvatarId avatar : decoded.batch.avatars) {
          const ConstPoseSpan expected = alone[avatar - 1].pose();
          Pose pose(library->skeleton().joint_count());
          ASSERT_TRUE(protocol::DecodePose(PoseMode::kFull, reader.Next(), pose.root_position_m,
                                           pose.rotations));
          ASSERT_TRUE(std::ranges::equal(pose.rotations, expected.rotations)) << tick;
        }
      }
    }
    EXPECT_TRUE(alone[0].layers().empty());
  }
}

TEST(WorldShard, CatchesUpOnMissedTicks) {
  Bench punctual;
  Bench late;
  for (Bench* bench : {&punctual, &late}) {
    bench->Observe(1);
    bench->Spawn({1});
    bench->Walk(1, 3);
  }
  protocol::PoseBatchComposer composer;
  for (std::uint64_t tick = 10; tick <= 100; ++tick) punctual.shard.Advance(tick, 1);
  for (std::uint64_t tick = 16; tick <= 100; tick += 7) late.shard.Advance(tick, 7);
  PoseDelivery a;
  PoseDelivery b;
  ASSERT_TRUE(punctual.shard.Encode(PoseMode::kFull, 100, true, composer, a));
  ASSERT_TRUE(late.shard.Encode(PoseMode::kFull, 100, true, composer, b));
  EXPECT_EQ(*a.parts[0], *b.parts[0]);
  // Events contain the tick at which they happened, not the tick that a late shard advances to.
  const auto punctual_events = punctual.Events();
  const auto late_events = late.Events();
  EXPECT_GT(punctual_events.size(), 5u);
  EXPECT_EQ(punctual_events, late_events);
}

TEST(WorldShard, EventsHaveTheTimeOfTheirTick) {
  Bench bench;
  bench.Observe(0);
  bench.Spawn({1});
  bench.Walk(1, 1);
  for (std::uint64_t tick = 1000; tick < 1200; ++tick) {
    bench.shard.Advance(tick, 1);
    for (const protocol::Event& event : bench.Events()) {
      if (event.type == EventType::kSpawned || event.type == EventType::kAccepted) continue;
      EXPECT_EQ(event.tick, tick);
      EXPECT_LE(event.time_s, kClock.TickTime(tick) + 1e-9);
      EXPECT_GE(event.time_s, kClock.TickTime(tick - 1) - 1e-9);
    }
  }
}

TEST(WorldShard, OrdersAvatarsAndFlagsNewOnes) {
  Bench bench;
  bench.Observe(1);
  bench.Spawn({9, 2, 5});
  protocol::PoseBatchComposer composer;
  PoseDelivery delivery;
  bench.shard.Advance(bench.tick, 1);
  ASSERT_TRUE(bench.shard.Encode(PoseMode::kQuantised, bench.tick, true, composer, delivery));
  const Decoded decoded(delivery.parts.at(0));
  EXPECT_EQ(decoded.batch.info.world, 3u);
  EXPECT_EQ(decoded.batch.info.tick, bench.tick);
  EXPECT_THAT(decoded.batch.avatars, ElementsAre(2u, 5u, 9u));
  EXPECT_THAT(decoded.batch.flags, testing::Each(3));
}

TEST(WorldShard, FlagsNewAvatarsForTheLongestInterval) {
  Bench bench;
  bench.Observe(1, 5);
  bench.Spawn({1});
  const std::uint64_t spawned = bench.tick;
  protocol::PoseBatchComposer composer;
  int flagged = 0;
  for (std::uint64_t tick = spawned; tick < spawned + 20; ++tick) {
    bench.shard.Advance(tick, 1);
    PoseDelivery delivery;
    ASSERT_TRUE(bench.shard.Encode(PoseMode::kFull, tick, true, composer, delivery));
    flagged += Decoded(delivery.parts[0]).batch.flags[0] & protocol::kPoseDiscontinuity;
  }
  EXPECT_EQ(flagged, 5);
}

TEST(WorldShard, SplitsABatchThatExceedsAFrame) {
  Bench bench;
  bench.Observe(1);
  std::vector<AvatarId> ids(90);
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<AvatarId>(i + 1);
  bench.Spawn(ids);
  bench.shard.Advance(bench.tick, 1);
  protocol::PoseBatchComposer composer({1 << 20, 4096});  // 31 of these avatars per frame
  PoseDelivery delivery;
  ASSERT_TRUE(bench.shard.Encode(PoseMode::kFull, bench.tick, true, composer, delivery));
  ASSERT_GT(delivery.parts.size(), 2u);
  std::vector<AvatarId> seen;
  for (std::size_t part = 0; part < delivery.parts.size(); ++part) {
    EXPECT_LE(delivery.parts[part]->size(), 4096 + protocol::kFrameHeaderBytes);
    const Decoded decoded(delivery.parts[part]);
    EXPECT_EQ(decoded.batch.info.part, part);
    EXPECT_EQ(decoded.batch.info.parts, delivery.parts.size());
    std::ranges::copy(decoded.batch.avatars, std::back_inserter(seen));
  }
  EXPECT_EQ(seen, ids);
}

TEST(WorldShard, DeliversOneEmptyBatch) {
  Bench bench;
  bench.Observe(1);
  protocol::PoseBatchComposer composer;
  PoseDelivery delivery;
  EXPECT_FALSE(bench.shard.Encode(PoseMode::kFull, 1, true, composer, delivery));
  bench.Spawn({1});
  EXPECT_TRUE(bench.shard.Encode(PoseMode::kFull, 2, true, composer, delivery));
  bench.Do(RemovePart{{{0, 1}}});
  delivery = {};
  ASSERT_TRUE(bench.shard.Encode(PoseMode::kFull, 3, true, composer, delivery));
  EXPECT_TRUE(Decoded(delivery.parts[0]).batch.avatars.empty());
  EXPECT_FALSE(bench.shard.Encode(PoseMode::kFull, 4, true, composer, delivery));
}

TEST(WorldShard, EncodesAvatarsOfARingAndDeliversPositionsIfItIsEmpty) {
  Bench bench;
  Interest interest{.world = bench.world, .shard = 0, .poses = {}};
  PoseInterest& full = interest.poses[ModeIndex(PoseMode::kFull)];
  full.interval.subset = 1;
  const auto observe_ring = [&](double outer_m, double inner_m, bool is_one_of_several) {
    full.regions = std::make_shared<const std::vector<RegionFilter>>(
        1, RegionFilter{0.0, 0.0, outer_m, inner_m, is_one_of_several});
    bench.shard.SetInterest(interest);
  };
  SpawnPart part;
  for (AvatarId id = 1; id <= 9; ++id) {
    part.items.push_back({id, {.avatar = id, .start = {{1.0 * id, 0.0, 0.0}, 0.0}}});
  }
  bench.Do(std::move(part));
  bench.shard.Advance(++bench.tick, 1);
  protocol::PoseBatchComposer composer;
  PoseDelivery delivery;
  const auto encoded = [&] {
    std::vector<AvatarId> ids;
    for (std::size_t row = 0; row < delivery.rows->size(); ++row) {
      if (delivery.rows->has_pose(row)) ids.push_back((*delivery.rows->avatars())[row]);
    }
    return ids;
  };
  observe_ring(6.5, 3.5, true);
  ASSERT_TRUE(bench.shard.Encode(PoseMode::kFull, bench.tick, false, composer, delivery));
  EXPECT_THAT(encoded(), ElementsAre(4u, 5u, 6u));
  observe_ring(6.5, 0.0, true);
  ASSERT_TRUE(bench.shard.Encode(PoseMode::kFull, bench.tick, false, composer, delivery));
  EXPECT_THAT(encoded(), ElementsAre(1u, 2u, 3u, 4u, 5u, 6u));
  observe_ring(60.0, 50.0, true);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(bench.shard.Encode(PoseMode::kFull, bench.tick, false, composer, delivery));
    EXPECT_TRUE(encoded().empty());
    EXPECT_NE(delivery.grid, nullptr);
  }
  // If all rings have the same mode, one empty delivery is enough.
  observe_ring(0.1, 0.0, false);
  EXPECT_TRUE(bench.shard.Encode(PoseMode::kFull, bench.tick, false, composer, delivery));
  EXPECT_FALSE(bench.shard.Encode(PoseMode::kFull, bench.tick, false, composer, delivery));
}

TEST(WorldShard, RemovesAvatarsOfAnEndedSessionUnlessTheWorldIsPersistent) {
  for (const bool persistent : {false, true}) {
    Bench bench;
    bench.world->persistent = persistent;
    bench.Observe(0);
    bench.Spawn({1, 2}, 10);
    bench.Spawn({3}, 20);
    bench.Do(ReleasePart{}, 10);
    EXPECT_EQ(bench.shard.avatar_count(), persistent ? 3u : 1u);
    EXPECT_EQ(bench.budget.total(), persistent ? 3 : 1);
    EXPECT_EQ(bench.world->avatar_count.load(), persistent ? 3 : 1);
    EXPECT_EQ(std::ranges::count(bench.Events(), EventType::kRemoved, &protocol::Event::type),
              persistent ? 0 : 2);
  }
}

TEST(WorldShard, RefusedSpawnsReleaseTheirBudget) {
  Bench bench;
  bench.Spawn({1});
  const CommandResult result = bench.Spawn({1, 2});
  EXPECT_EQ(result.accepted, 1u);
  EXPECT_EQ(result.items[0].code, StatusCode::kAvatarExists);
  EXPECT_EQ(bench.budget.total(), 2);
}

TEST(WorldShard, StoresNoEventsWithoutObservers) {
  Bench bench;
  bench.Spawn({1});
  bench.Walk(1, 1);
  bench.shard.Advance(1, 1);
  EXPECT_EQ(bench.shard.TakeEvents(), nullptr);
  EXPECT_TRUE(bench.shard.interest().empty());
}

TEST(WorldShard, LimitsTheQueueOfAnAvatar) {
  Bench bench(1, 4);
  bench.Spawn({1});
  const CommandResult result = bench.Walk(1, 10);
  EXPECT_EQ(result.accepted, 4u);
  ASSERT_EQ(result.items.size(), 6u);
  EXPECT_EQ(result.items[0].index, 4u);
  EXPECT_EQ(result.items[0].code, StatusCode::kQueueFull);
  EXPECT_EQ(bench.metrics.requests_rejected.value(), 6u);
}

// Returns the encoded poses of a crowd by avatar and tick. The crowd starts over several ticks.
std::map<AvatarId, std::vector<std::vector<std::byte>>> PlayDelayedCrowd(int shard_count,
                                                                         bool is_reversed) {
  constexpr AvatarId kAvatars = 40;
  constexpr std::uint32_t kOverTicks = 3;
  AvatarBudget budget(100, 100);
  ThreadMetrics metrics;
  const auto world = Bench::MakeWorld();
  // Without idle motion, the first pose that changes belongs to the first movement.
  world->avatar_options.idle_motion = false;
  std::map<AvatarId, std::vector<std::vector<std::byte>>> poses;
  for (int s = 0; s < shard_count; ++s) {
    WorldShard shard({.world = world,
                      .shard = s,
                      .shard_count = shard_count,
                      .max_queue = 8,
                      .clock = kClock,
                      .budget = budget,
                      .metrics = metrics});
    SpawnPart spawn;
    RequestPart request{.items = {}, .over_ticks = kOverTicks};
    for (AvatarId avatar = 1; avatar <= kAvatars; ++avatar) {
      if (ShardOf(avatar, shard_count) != s) continue;
      EXPECT_EQ(budget.Reserve(*world), AvatarBudget::Verdict::kOk);
      spawn.items.push_back({avatar, {.avatar = avatar}});
      request.items.push_back(
          {avatar, {.avatar = avatar, .movement = protocol::StepMovement{.length_m = 0.4}}});
    }
    if (is_reversed) std::ranges::reverse(request.items);
    (void)shard.Execute({.world = world, .session = 1, .seq = 1, .part = spawn}, 1);
    protocol::PoseBatchComposer composer;
    for (std::uint64_t tick = 1; tick <= 30; ++tick) {
      if (tick == 2) {
        (void)shard.Execute({.world = world, .session = 1, .seq = 2, .part = request}, tick);
      }
      shard.Advance(tick, 1);
      PoseDelivery delivery;
      EXPECT_TRUE(shard.Encode(PoseMode::kFull, tick, true, composer, delivery));
      const Decoded decoded(delivery.parts.at(0));
      protocol::PoseBatchReader reader(decoded.batch, nullptr);
      for (const AvatarId avatar : decoded.batch.avatars) {
        const auto pose = reader.Next();
        poses[avatar].emplace_back(pose.begin(), pose.end());
      }
    }
  }
  EXPECT_GT(metrics.limits[static_cast<std::size_t>(Limit::kStartsPerTick)].value(), 15u);
  return poses;
}

TEST(WorldShard, DelayedStartsDependOnlyOnAvatarIds) {
  const auto one = PlayDelayedCrowd(1, false);
  std::map<std::size_t, int> starts;  // by tick
  for (const auto& [avatar, poses] : one) {
    std::size_t tick = 0;
    while (poses[tick + 1] == poses[0]) ++tick;
    EXPECT_EQ(tick, StartTickOf(avatar, 3)) << avatar;
    ++starts[tick];
  }
  ASSERT_EQ(starts.size(), 3u);
  for (const auto& [tick, count] : starts) EXPECT_LE(count, 20) << tick;
  for (const int shard_count : {1, 2, 4}) {
    for (const bool is_reversed : {false, true}) {
      EXPECT_TRUE(PlayDelayedCrowd(shard_count, is_reversed) == one) << shard_count << is_reversed;
    }
  }
}

TEST(World, SpreadsStartsEvenlyOnEveryShard) {
  constexpr std::uint32_t kOverTicks = 40;
  for (const int shard_count : {1, 2, 4, 8}) {
    std::map<std::pair<int, std::uint32_t>, int> starts;
    for (AvatarId avatar = 1; avatar <= 10'000; ++avatar) {
      const std::uint32_t tick = StartTickOf(avatar, kOverTicks);
      ASSERT_LT(tick, kOverTicks);
      ++starts[{ShardOf(avatar, shard_count), tick}];
    }
    const double mean = 10'000.0 / (kOverTicks * shard_count);
    for (const auto& [where, count] : starts) {
      EXPECT_LE(count, mean + 5.0 * std::sqrt(mean)) << where.first << " of " << shard_count;
    }
  }
  for (AvatarId avatar = 1; avatar <= 1000; ++avatar) EXPECT_EQ(StartTickOf(avatar, 1), 0u);
}

TEST(WorldInterest, ReportsDemandOnlyInDueTicks) {
  Bench bench(2);
  bench.shard.SetInterest({.world = bench.world,
                           .shard = 1,
                           .poses = {{{}, {.interval = {.all = 3, .subset = 2}, .avatars = {}}}}});
  const auto demand_of = [&](int shard, PoseMode mode, std::uint64_t tick) {
    const auto demand = bench.shard.interest().DemandOf(shard, mode, tick);
    return std::pair(demand.all, demand.subset);
  };
  EXPECT_EQ(demand_of(1, PoseMode::kQuantised, 6), std::pair(true, true));
  EXPECT_EQ(demand_of(1, PoseMode::kQuantised, 9), std::pair(true, false));
  EXPECT_EQ(demand_of(1, PoseMode::kQuantised, 8), std::pair(false, true));
  EXPECT_EQ(demand_of(1, PoseMode::kQuantised, 7), std::pair(false, false));
  EXPECT_EQ(demand_of(1, PoseMode::kFull, 6), std::pair(false, false));
  EXPECT_EQ(demand_of(0, PoseMode::kQuantised, 6), std::pair(false, false));
}

TEST(WorldShard, EncodesOnlySelectedAvatars) {
  Bench bench(2);
  protocol::PoseBatchComposer composer;
  PoseDelivery delivery;
  const auto select = [&](int shard, std::vector<AvatarId> ids) {
    bench.shard.SetInterest(
        {.world = bench.world,
         .shard = shard,
         .poses = {{{.interval = {.subset = 1},
                     .avatars = std::make_shared<const std::vector<AvatarId>>(ids)},
                    {}}}});
  };
  const auto encoded = [&] {
    EXPECT_TRUE(bench.shard.Encode(PoseMode::kFull, ++bench.tick, false, composer, delivery));
    EXPECT_TRUE(delivery.parts.empty());
    std::vector<AvatarId> avatars;
    for (std::size_t row = 0; row < delivery.rows->size(); ++row) {
      if (delivery.rows->has_pose(row)) avatars.push_back((*delivery.rows->avatars())[row]);
    }
    return avatars;
  };
  bench.Spawn({1, 2, 3, 4, 5});
  select(0, {2, 4, 77});
  select(1, {4, 5});
  EXPECT_THAT(encoded(), ElementsAre(2, 4, 5));
  EXPECT_EQ(bench.metrics.poses_encoded.value(), 3u);
  bench.Spawn({77});
  bench.Do(RemovePart{{{0, 4}}});
  EXPECT_THAT(encoded(), ElementsAre(2, 5, 77));
  select(0, {});
  EXPECT_THAT(encoded(), ElementsAre(5));
  select(1, {});
  // Observers receive one delivery without poses, because the selection has changed.
  EXPECT_THAT(encoded(), ElementsAre());
  EXPECT_FALSE(bench.shard.Encode(PoseMode::kFull, ++bench.tick, false, composer, delivery));
  EXPECT_TRUE(bench.shard.Encode(PoseMode::kFull, ++bench.tick, true, composer, delivery));
  EXPECT_THAT(Decoded(delivery.parts.at(0)).batch.avatars, ElementsAre(1, 2, 3, 5, 77));
}

TEST(World, AvatarIdsAreNeverReused) {
  World world;
  EXPECT_EQ(NextAvatarId(world), 1u);
  RecordAvatarId(world, 10);
  RecordAvatarId(world, 4);
  EXPECT_EQ(NextAvatarId(world), 11u);
  RecordAvatarId(world, ~AvatarId{0});
  EXPECT_EQ(NextAvatarId(world), 0u);
}

TEST(TickClock, ConvertsBetweenTicksAndTimes) {
  using std::chrono::nanoseconds;
  for (const double hz : {1.0, 29.97, 60.0, 1000.0}) {
    const auto epoch = TickClock::Clock::time_point(nanoseconds(123'456'789));
    const TickClock clock(epoch, hz);
    EXPECT_EQ(clock.TickAt(epoch - std::chrono::hours(1)), 0u);
    // There is no drift after years.
    for (const std::uint64_t tick : {1ull, 2ull, 59ull, 1'000'003ull, 5'000'000'000ull}) {
      EXPECT_EQ(clock.TickAt(clock.Due(tick)), tick);
      EXPECT_EQ(clock.TickAt(clock.Due(tick) - nanoseconds(1)), tick - 1);
      EXPECT_NEAR(clock.ServerTime(clock.Due(tick)), clock.TickTime(tick), 1e-6);
    }
  }
}

std::shared_ptr<const WorldTerrain> TerrainOfHeight(double height_m) {
  const auto terrain = Terrain::Make({{}, {{{0, 0}, {1, 1}, height_m}}});
  EXPECT_TRUE(terrain);
  protocol::Encoder encoder;
  const auto world_terrain = MakeWorldTerrain(3, *terrain, encoder);
  EXPECT_TRUE(world_terrain);
  return *world_terrain;
}

TEST(WorldShard, AppliesATerrainAtItsTick) {
  Bench bench;
  bench.Spawn({1});
  EXPECT_EQ(bench.shard.terrain(), nullptr);
  bench.tick = 100;
  bench.Do(TerrainPart{TerrainOfHeight(0.25), 103});
  bench.Do(TerrainPart{TerrainOfHeight(0.5), 105});
  const auto height = [&] {
    const auto terrain = bench.shard.terrain();
    return terrain == nullptr ? 0.0 : terrain->HeightAt(0.5, 0.5);
  };
  bench.shard.Advance(102, 1);
  EXPECT_EQ(height(), 0.0);
  bench.shard.Advance(103, 1);
  EXPECT_EQ(height(), 0.25);
  bench.shard.Advance(110, 7);  // a late tick
  EXPECT_EQ(height(), 0.5);
}

TEST(WorldShard, StartsWithTheTerrainOfItsWorld) {
  Bench bench;
  bench.world->terrain.Set(TerrainOfHeight(0.125));
  const WorldShard late(
      {.world = bench.world, .clock = kClock, .budget = bench.budget, .metrics = bench.metrics});
  ASSERT_NE(late.terrain(), nullptr);
  EXPECT_EQ(late.terrain()->HeightAt(0.5, 0.5), 0.125);
}

TEST(WorldDirectory, SetsTheTerrainOfAWorld) {
  Config config;
  config.library = "test";
  config.worlds["hall"] = {.library = "", .terrain = "hall.json", .persistent = false};
  Libraries libraries;
  libraries.Add("test", MakeTestLibrary());
  Terrains terrains;
  terrains.Add("hall.json", TerrainOfHeight(0.5)->terrain);
  WorldDirectory directory(config, libraries, terrains);
  const auto hall = directory.Join("hall");
  ASSERT_TRUE(hall);
  ASSERT_NE((*hall)->terrain.Get(), nullptr);
  EXPECT_EQ((*hall)->terrain.Get()->terrain->HeightAt(0.5, 0.5), 0.5);
  const auto other = directory.Join("other");
  ASSERT_TRUE(other);
  EXPECT_EQ((*other)->terrain.Get(), nullptr);

  protocol::TerrainInfo info;
  info.boxes = {{{0, 0}, {1, 1}, 0.75}};
  ASSERT_TRUE(directory.SetTerrain(**other, info));
  EXPECT_EQ((*other)->terrain.Get()->terrain->HeightAt(0.5, 0.5), 0.75);
  info.boxes[0].height_m = 1e5;
  const auto refused = directory.SetTerrain(**other, info);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, StatusCode::kOutOfRange);
  EXPECT_THAT(refused.error().text, testing::HasSubstr("boxes[0].height_m"));
  info.boxes.assign(kMaxTerrainBoxesPerCell + 1, {{0, 0}, {1, 1}, 0.5});
  EXPECT_EQ(directory.SetTerrain(**other, info).error().code, StatusCode::kLimitReached);
  EXPECT_EQ((*other)->terrain.Get()->terrain->HeightAt(0.5, 0.5), 0.75) << "unchanged";
  ASSERT_TRUE(directory.SetTerrain(**hall, std::nullopt));
  EXPECT_EQ((*hall)->terrain.Get()->terrain, nullptr);
}

TEST(WorldDirectory, CountsMembersAndRemovesEmptyWorlds) {
  Config config;
  config.library = "test";
  config.limits.max_worlds = 2;
  config.worlds["hall"] = {.library = "",
                           .terrain = "",
                           .persistent = true,
                           .idle_motion = false,
                           .stride_variation = false};
  Libraries libraries;
  libraries.Add("test", MakeTestLibrary());
  const Terrains terrains;
  WorldDirectory directory(config, libraries, terrains);
  const auto hall = directory.Join("hall");
  ASSERT_TRUE(hall);
  EXPECT_TRUE((*hall)->persistent);
  EXPECT_TRUE((*hall)->avatar_options.run_time_correction);
  EXPECT_FALSE((*hall)->avatar_options.idle_motion);
  EXPECT_FALSE((*hall)->avatar_options.stride_variation);
  EXPECT_EQ(*directory.Join("hall"), *hall);
  const auto other = directory.Join("other");
  ASSERT_TRUE(other);
  EXPECT_FALSE((*other)->persistent);
  EXPECT_TRUE((*other)->avatar_options.idle_motion);
  EXPECT_TRUE((*other)->avatar_options.stride_variation);
  EXPECT_EQ(directory.Join("third").error().code, StatusCode::kLimitReached);
  EXPECT_TRUE(directory.DropEmpty().empty());
  directory.Leave((*hall)->id);
  EXPECT_TRUE(directory.DropEmpty().empty());  // one member is left
  directory.Leave((*hall)->id);
  (*hall)->avatar_count = 1;
  EXPECT_TRUE(directory.DropEmpty().empty());  // there is no member, but an avatar
  (*hall)->avatar_count = 0;
  EXPECT_THAT(directory.DropEmpty(), ElementsAre((*hall)->id));
  EXPECT_TRUE(directory.Join("third"));
}

// Executes nothing and counts spawned avatars per session.
struct FakeExecutor {
  CommandResult operator()(const WorldCommand& command) {
    CommandResult result{.session = command.session, .seq = command.seq};
    if (const auto* spawn = std::get_if<SpawnPart>(&command.part)) {
      result.accepted = static_cast<std::uint32_t>(spawn->items.size());
      spawned[command.session] += spawn->items.size();
    } else {
      executed.push_back(command.seq);
    }
    return result;
  }
  std::map<SessionId, std::size_t> spawned;
  std::vector<protocol::Seq> executed;
};

TEST(CommandInbox, SharesSpawnsAmongSessionsAndKeepsTheOrderOfEach) {
  CommandInbox inbox(10);
  const auto push = [&](SessionId session, protocol::Seq seq, std::size_t spawns) {
    WorldCommand command{.world = nullptr, .session = session, .seq = seq, .part = RemovePart{}};
    if (spawns > 0) command.part = SpawnPart{std::vector<SpawnPart::Item>(spawns)};
    inbox.Push(std::move(command));
  };
  push(1, 1, 12);
  push(2, 1, 3);
  push(1, 2, 0);
  push(2, 2, 0);
  FakeExecutor executor;
  std::map<SessionId, std::uint32_t> accepted;
  const auto run = [&] {
    return inbox.Run([&](const WorldCommand& command) { return executor(command); },
                     [&](int, CommandResult&& result) {
                       if (result.seq == 1) accepted[result.session] = result.accepted;
                     });
  };
  EXPECT_EQ(run(), 7u);  // each session may spawn 5
  EXPECT_EQ(executor.spawned[1], 5u);
  EXPECT_EQ(executor.spawned[2], 3u);
  EXPECT_EQ(executor.executed.size(), 1u) << "command 2 of session 1 waits for its spawns";
  EXPECT_FALSE(accepted.contains(1));
  EXPECT_EQ(accepted[2], 3u);
  EXPECT_EQ(run(), 0u);
  EXPECT_EQ(executor.spawned[1], 12u);
  EXPECT_EQ(executor.executed.size(), 2u);
  EXPECT_EQ(accepted[1], 12u) << "one result for all parts";
}

TEST(AvatarBudget, EnforcesBothLimits) {
  AvatarBudget budget(2, 3);
  World a;
  World b;
  using Verdict = AvatarBudget::Verdict;
  EXPECT_EQ(budget.Reserve(a), Verdict::kOk);
  EXPECT_EQ(budget.Reserve(a), Verdict::kOk);
  EXPECT_EQ(budget.Reserve(a), Verdict::kWorldFull);
  EXPECT_EQ(budget.Reserve(b), Verdict::kOk);
  EXPECT_EQ(budget.Reserve(b), Verdict::kServerFull);
  EXPECT_EQ(b.avatar_count.load(), 1);
  budget.Release(a);
  EXPECT_EQ(budget.Reserve(b), Verdict::kOk);
}

}  // namespace
}  // namespace stridewire::server
