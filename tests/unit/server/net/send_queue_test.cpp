#include "net/send_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace stridewire::server {
namespace {

using protocol::PoseMode;
using testing::ElementsAre;

SharedFrame Frame(std::size_t bytes, int mark = 0) {
  return std::make_shared<const std::vector<std::byte>>(bytes, static_cast<std::byte>(mark));
}

struct BatchDef {
  int shard = 0;
  WorldId world = 1;
  int parts = 1;
  std::size_t bytes = 100;
  PoseMode mode = PoseMode::kFull;
};

// A batch of five avatars. Each byte of its frames is the number of the tick.
PoseFrames Batch(int tick, const BatchDef& def = {}) {
  PoseFrames batch{
      .world = def.world, .mode = def.mode, .shard = def.shard, .avatar_count = 5, .frames = {}};
  for (int i = 0; i < def.parts; ++i) batch.frames.push_back(Frame(def.bytes, tick));
  return batch;
}

std::vector<int> Marks(const SendQueue::Gathered& gathered) {
  std::vector<int> marks;
  for (const SharedFrame& frame : gathered.frames) marks.push_back(static_cast<int>((*frame)[0]));
  return marks;
}

TEST(SendQueue, SendsControlInOrderAndBeforePoses) {
  SendQueue queue(1000, 4);
  EXPECT_EQ(queue.PushPoses(Batch(50)), 0u);
  queue.PushControl(Frame(10, 1));
  queue.PushControl(Frame(10, 2));
  SendQueue::Gathered out;
  queue.Gather(1 << 20, out);
  EXPECT_THAT(Marks(out), ElementsAre(1, 2, 50));
  EXPECT_EQ(out.stream_frames, 1u);
  EXPECT_EQ(out.bytes, 120u);
  EXPECT_EQ(out.poses, 5u);
  EXPECT_EQ(out.batches, 1u);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.control_bytes(), 0u);
}

TEST(SendQueue, SendsTheLatestTerrainAfterControl) {
  SendQueue queue(1000, 4);
  queue.PushTerrain(1, Frame(5000, 10));
  queue.PushTerrain(2, Frame(10, 20));
  queue.PushTerrain(1, Frame(5000, 11));
  queue.PushTerrain(3, Frame(10, 30));
  queue.DropTerrain(3);
  EXPECT_EQ(queue.control_bytes(), 0u) << "terrain does not use the budget of events";
  EXPECT_EQ(queue.PushPoses(Batch(50)), 0u);
  for (int i = 1; i <= 3; ++i) queue.PushControl(Frame(10, i));
  SendQueue::Gathered out;
  queue.Gather(20,
               out);  // The third message does not fit. It could be the WorldInfo of the terrain.
  EXPECT_THAT(Marks(out), ElementsAre(1, 2, 50));
  queue.Gather(1 << 20, out);
  EXPECT_THAT(Marks(out), ElementsAre(3, 11));
  EXPECT_FALSE(queue.empty());
  queue.Gather(1 << 20, out);
  EXPECT_THAT(Marks(out), ElementsAre(20));
  EXPECT_TRUE(queue.empty());
}

TEST(SendQueue, KeepsTheLatestTicksForASlowObserver) {
  SendQueue queue(1000, 3);
  std::size_t dropped = 0;
  for (int tick = 1; tick <= 100; ++tick) {
    dropped += queue.PushPoses(Batch(tick));
    EXPECT_LE(queue.waiting_pose_frames(), 3u);
  }
  EXPECT_EQ(dropped, 97u);
  SendQueue::Gathered out;
  queue.Gather(1 << 20, out);
  EXPECT_THAT(Marks(out), ElementsAre(98, 99, 100));
}

TEST(SendQueue, CountsUnsentPartsOfADroppedBatch) {
  SendQueue queue(1000, 1);
  EXPECT_EQ(queue.PushPoses(Batch(1, {.parts = 4})), 0u);
  SendQueue::Gathered out;
  queue.Gather(150, out);  // two parts: the second one exceeds max_bytes
  EXPECT_EQ(out.frames.size(), 2u);
  EXPECT_EQ(out.poses, 0u);
  EXPECT_EQ(queue.PushPoses(Batch(2)), 2u);
  queue.Gather(1000, out);
  EXPECT_THAT(Marks(out), ElementsAre(2));
}

TEST(SendQueue, DropsOnlyBatchesOfTheSameWorldShardAndMode) {
  SendQueue queue(1000, 2);
  EXPECT_EQ(queue.PushPoses(Batch(1)), 0u);
  EXPECT_EQ(queue.PushPoses(Batch(1, {.shard = 1})), 0u);
  EXPECT_EQ(queue.PushPoses(Batch(1, {.world = 2})), 0u);
  EXPECT_EQ(queue.PushPoses(Batch(1, {.mode = PoseMode::kQuantised})), 0u);
  EXPECT_EQ(queue.PushPoses(Batch(2)), 0u);
  EXPECT_EQ(queue.PushPoses(Batch(3)), 1u);
  EXPECT_EQ(queue.waiting_pose_frames(), 5u);
  queue.DropPoses(1, PoseMode::kFull);
  EXPECT_EQ(queue.waiting_pose_frames(), 2u);
  queue.DropAllPoses();
  EXPECT_TRUE(queue.empty());
}

TEST(SendQueue, TakesBatchesFromAllShardsInTurn) {
  SendQueue queue(1000, 8);
  for (int shard = 0; shard < 4; ++shard) {
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ(queue.PushPoses(Batch(10 * shard + i, {.shard = shard})), 0u);
    }
  }
  // Each call has room for one batch. Four calls take the oldest batch of each shard.
  std::set<int> first;
  SendQueue::Gathered out;
  for (int turn = 0; turn < 4; ++turn) {
    queue.Gather(1, out);
    ASSERT_EQ(out.frames.size(), 1u);
    first.insert(Marks(out)[0]);
  }
  EXPECT_THAT(first, ElementsAre(0, 10, 20, 30));
}

TEST(SendQueue, NeitherControlNorPosesStarve) {
  SendQueue queue(1 << 20, 4);
  for (int i = 0; i < 1000; ++i) queue.PushControl(Frame(1000));
  EXPECT_EQ(queue.PushPoses(Batch(7)), 0u);
  SendQueue::Gathered out;
  queue.Gather(10'000, out);
  EXPECT_EQ(out.frames.size(), 11u);
  EXPECT_EQ(Marks(out).back(), 7);
  EXPECT_FALSE(queue.empty());
}

TEST(SendQueue, RejectsEventsBeyondTheBudgetButNotReplies) {
  SendQueue queue(1000, 4);
  EXPECT_TRUE(queue.PushEvents(Frame(600)));
  EXPECT_FALSE(queue.PushEvents(Frame(401)));
  EXPECT_TRUE(queue.PushEvents(Frame(400)));
  queue.PushControl(Frame(500));
  EXPECT_EQ(queue.control_bytes(), 1500u);
  EXPECT_FALSE(queue.PushEvents(Frame(1)));
}

TEST(SendQueue, SendsMovementsInOrderOrDropsAllOfAShard) {
  SendQueue queue(100, 4);
  queue.PushControl(Frame(90, 1));  // does not use the budget of movements
  EXPECT_EQ(queue.PushMovements(1, 0, Frame(30, 10)), 0u);
  EXPECT_EQ(queue.PushMovements(1, 1, Frame(30, 20)), 0u);
  EXPECT_EQ(queue.PushMovements(1, 0, Frame(30, 11)), 0u);
  EXPECT_EQ(queue.movement_bytes(), 90u);
  // This frame exceeds the budget. It is lost with the two waiting frames of the same shard.
  EXPECT_EQ(queue.PushMovements(1, 0, Frame(30, 12)), 3u);
  EXPECT_EQ(queue.movement_bytes(), 30u);
  EXPECT_EQ(queue.PushMovements(2, 0, Frame(30, 30)), 0u);
  EXPECT_EQ(queue.PushMovements(1, 1, Frame(30, 21)), 0u);
  EXPECT_EQ(queue.PushPoses(Batch(50)), 0u);
  SendQueue::Gathered out;
  queue.Gather(1000, out);
  EXPECT_THAT(Marks(out), ElementsAre(1, 20, 30, 21, 50));
  EXPECT_EQ(out.bytes, 90u + 90u + 100u);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.PushMovements(1, 0, Frame(30, 13)), 0u);
  EXPECT_EQ(queue.PushMovements(2, 0, Frame(30, 31)), 0u);
  EXPECT_FALSE(queue.empty());
  queue.DropMovements(1);
  queue.Gather(1, out);
  EXPECT_THAT(Marks(out), ElementsAre(31));
  EXPECT_EQ(queue.movement_bytes(), 0u);
}

TEST(SendQueue, SharesFramesBetweenConnections) {
  const PoseFrames batch = Batch(1);
  SendQueue a(1000, 4);
  SendQueue b(1000, 4);
  EXPECT_EQ(a.PushPoses(PoseFrames(batch)) + b.PushPoses(PoseFrames(batch)), 0u);
  SendQueue::Gathered out_a;
  SendQueue::Gathered out_b;
  a.Gather(1000, out_a);
  b.Gather(1000, out_b);
  EXPECT_EQ(out_a.frames[0].get(), out_b.frames[0].get());
}

}  // namespace
}  // namespace stridewire::server
