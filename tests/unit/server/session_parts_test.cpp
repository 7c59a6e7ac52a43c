// The small parts of a session: what was answered, what may be sent again, how much is afforded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "session/event_replay.h"
#include "session/reply_cache.h"
#include "session/session_directory.h"
#include "session/token_bucket.h"

namespace stridewire::server {
namespace {

using testing::ElementsAre;
using Known = ReplyCache::Verdict;

SharedFrame FrameOf(std::size_t bytes) {
  return std::make_shared<const std::vector<std::byte>>(bytes);
}

TEST(ReplyCache, TakesCommandsInOrderAndOnce) {
  ReplyCache memory(10, 1000);
  EXPECT_EQ(memory.last_seq(), 0u);
  EXPECT_EQ(memory.Classify(1), Known::kNew);
  EXPECT_EQ(memory.Classify(2), Known::kGap);
  memory.Take(1);
  EXPECT_EQ(memory.last_seq(), 1u);
  EXPECT_EQ(memory.Classify(1), Known::kPending);
  EXPECT_EQ(memory.Classify(2), Known::kNew);
  memory.Take(2);
  const SharedFrame second = FrameOf(10);
  EXPECT_EQ(memory.Remember(2, second, 5), 0u);  // answers may come in any order
  EXPECT_EQ(memory.Classify(1), Known::kPending);
  EXPECT_EQ(memory.Classify(2), Known::kAnswered);
  EXPECT_EQ(memory.Find(2).reply, second);
  EXPECT_EQ(memory.Find(2).joined, 5u);
}

TEST(ReplyCache, ForgetsTheOldestBeyondItsCount) {
  ReplyCache memory(3, 1000);
  for (protocol::Seq seq = 1; seq <= 5; ++seq) {
    memory.Take(seq);
    memory.Remember(seq, FrameOf(1), 0);
  }
  EXPECT_EQ(memory.Classify(1), Known::kForgotten);
  EXPECT_EQ(memory.Classify(2), Known::kForgotten);
  EXPECT_EQ(memory.Classify(3), Known::kAnswered);
  EXPECT_EQ(memory.Classify(6), Known::kNew);
}

TEST(ReplyCache, ForgetsTheOldestBeyondItsBytesButKeepsTheLast) {
  ReplyCache memory(100, 1000);
  for (protocol::Seq seq = 1; seq <= 50; ++seq) {
    memory.Take(seq);
    memory.Remember(seq, FrameOf(300), 0);
    EXPECT_LE(memory.bytes(), 1000u);
  }
  memory.Take(51);
  memory.Remember(51, FrameOf(5000), 0);
  EXPECT_EQ(memory.Classify(51), Known::kAnswered);
  EXPECT_EQ(memory.Classify(50), Known::kForgotten);
}

TEST(ReplyCache, NeverForgetsWhatIsNotAnswered) {
  ReplyCache memory(2, 10);
  memory.Take(1);
  for (protocol::Seq seq = 2; seq <= 9; ++seq) {
    memory.Take(seq);
    EXPECT_EQ(memory.Remember(seq, FrameOf(100), 0), 0u);
  }
  EXPECT_EQ(memory.Classify(1), Known::kPending);
  EXPECT_EQ(memory.Remember(1, FrameOf(100), 0), 8u);
  EXPECT_EQ(memory.Classify(9), Known::kAnswered);
}

TEST(EventReplay, GivesBackWhatCameAfterANumber) {
  EventReplay replay(1000);
  for (std::uint64_t number = 1; number <= 4; ++number)
    replay.Keep({number, 2, true, FrameOf(100)});
  std::vector<std::uint64_t> numbers;
  replay.ForEachAfter(2, [&](EventReplay::Kept& kept) { numbers.push_back(kept.number); });
  EXPECT_THAT(numbers, ElementsAre(3u, 4u));
  EXPECT_EQ(replay.TakeForgotten(), 0u);
}

TEST(EventReplay, IsBoundedAndCountsOnlyWhatNobodyGot) {
  EventReplay replay(250);
  replay.Keep({1, 7, true, FrameOf(100)});
  replay.Keep({2, 5, false, FrameOf(100)});
  replay.Keep({3, 3, false, FrameOf(100)});
  EXPECT_EQ(replay.TakeForgotten(), 0u);  // 1 had been sent
  replay.Keep({4, 1, false, FrameOf(100)});
  EXPECT_EQ(replay.TakeForgotten(), 5u);
  EXPECT_EQ(replay.TakeForgotten(), 0u);
  EXPECT_LE(replay.bytes(), 250u);
  EventReplay none(0);
  none.Keep({1, 2, false, FrameOf(8)});
  EXPECT_EQ(none.TakeForgotten(), 2u);
  EXPECT_EQ(none.bytes(), 0u);
}

TEST(TokenBucket, LetsThroughRateAndBurst) {
  TokenBucket bucket(10.0, 5.0);
  EXPECT_TRUE(bucket.Take(5.0));
  EXPECT_FALSE(bucket.Take(1.0));
  bucket.AdvanceTime(0.25);
  EXPECT_TRUE(bucket.Take(2.0));
  EXPECT_FALSE(bucket.Take(1.0));  // half a one is left
  bucket.AdvanceTime(0.20);        // time does not go back
  EXPECT_FALSE(bucket.Take(1.0));
  bucket.AdvanceTime(100.0);
  EXPECT_FALSE(bucket.Take(5.5));
  EXPECT_TRUE(bucket.Take(5.0));
}

TEST(SessionDirectory, SpreadsSessionsAndFindsThemByToken) {
  SessionDirectory directory(Limits(), 3);
  Limit reached{};
  std::vector<SessionDirectory::Entry> entries;
  for (int i = 0; i < 6; ++i) entries.push_back(*directory.Open("a", reached));
  std::array<int, 3> per_shard{};
  for (const auto& entry : entries) {
    ++per_shard[static_cast<std::size_t>(entry.shard)];
    EXPECT_GE(entry.identity.token.size(), protocol::kMinResumeTokenBytes);
    const auto* found = directory.Find(entry.identity.token);
    ASSERT_NE(found, nullptr);
    EXPECT_EQ(found->identity.id, entry.identity.id);
  }
  EXPECT_THAT(per_shard, ElementsAre(2, 2, 2));
  std::vector<std::byte> wrong = entries[0].identity.token;
  wrong[31] ^= std::byte{1};
  EXPECT_EQ(directory.Find(wrong), nullptr);
  directory.Close(entries[0].identity.id);
  directory.Close(entries[0].identity.id);
  EXPECT_EQ(directory.Find(entries[0].identity.token), nullptr);
  EXPECT_EQ(directory.CountOf("a"), 5);
  directory.Restore(entries[0].shard, entries[0].identity);
  directory.Restore(entries[0].shard, entries[0].identity);
  EXPECT_EQ(directory.CountOf("a"), 6);
  EXPECT_NE(directory.Find(entries[0].identity.token), nullptr);
}

TEST(SessionDirectory, KeepsItsLimits) {
  Limits limits;
  limits.max_sessions = 3;
  limits.max_sessions_per_address = 2;
  SessionDirectory directory(limits, 1);
  Limit reached{};
  const auto first = directory.Open("a", reached);
  ASSERT_TRUE(first && directory.Open("a", reached));
  EXPECT_FALSE(directory.Open("a", reached));
  EXPECT_EQ(reached, Limit::kSessionsPerAddress);
  ASSERT_TRUE(directory.Open("b", reached));
  EXPECT_FALSE(directory.Open("c", reached));
  EXPECT_EQ(reached, Limit::kSessions);
  directory.Close(first->identity.id);
  EXPECT_TRUE(directory.Open("a", reached));
}

}  // namespace
}  // namespace stridewire::server
