// Small parts of a session: reply cache, event replay, rate limit, session directory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "session/event_replay.h"
#include "session/reply_cache.h"
#include "session/session_directory.h"
#include "session/token_bucket.h"

namespace stridewire::server {
namespace {

using testing::ElementsAre;

SharedFrame FrameOf(std::size_t bytes) {
  return std::make_shared<const std::vector<std::byte>>(bytes);
}

TEST(ReplyCache, AcceptsEachCommandOnceAndInOrder) {
  ReplyCache cache(10, 1000);
  EXPECT_EQ(cache.last_seq(), 0u);
  EXPECT_EQ(cache.Classify(1), ReplyCache::Verdict::kNew);
  EXPECT_EQ(cache.Classify(2), ReplyCache::Verdict::kGap);
  cache.Begin(1);
  EXPECT_EQ(cache.last_seq(), 1u);
  EXPECT_EQ(cache.Classify(1), ReplyCache::Verdict::kPending);
  EXPECT_EQ(cache.Classify(2), ReplyCache::Verdict::kNew);
  cache.Begin(2);
  const SharedFrame second = FrameOf(10);
  EXPECT_EQ(cache.Store(2, second, 5), 0u);  // commands may be answered in any order
  EXPECT_EQ(cache.Classify(1), ReplyCache::Verdict::kPending);
  EXPECT_EQ(cache.Classify(2), ReplyCache::Verdict::kAnswered);
  EXPECT_EQ(cache.Find(2).reply, second);
  EXPECT_EQ(cache.Find(2).joined, 5u);
}

TEST(ReplyCache, ForgetsTheOldestReplyBeyondMaxCount) {
  ReplyCache cache(3, 1000);
  for (protocol::Seq seq = 1; seq <= 5; ++seq) {
    cache.Begin(seq);
    cache.Store(seq, FrameOf(1), 0);
  }
  EXPECT_EQ(cache.Classify(1), ReplyCache::Verdict::kForgotten);
  EXPECT_EQ(cache.Classify(2), ReplyCache::Verdict::kForgotten);
  EXPECT_EQ(cache.Classify(3), ReplyCache::Verdict::kAnswered);
  EXPECT_EQ(cache.Classify(6), ReplyCache::Verdict::kNew);
}

TEST(ReplyCache, ForgetsTheOldestReplyBeyondMaxBytesButKeepsTheLast) {
  ReplyCache cache(100, 1000);
  for (protocol::Seq seq = 1; seq <= 50; ++seq) {
    cache.Begin(seq);
    cache.Store(seq, FrameOf(300), 0);
    EXPECT_LE(cache.bytes(), 1000u);
  }
  cache.Begin(51);
  cache.Store(51, FrameOf(5000), 0);
  EXPECT_EQ(cache.Classify(51), ReplyCache::Verdict::kAnswered);
  EXPECT_EQ(cache.Classify(50), ReplyCache::Verdict::kForgotten);
}

TEST(ReplyCache, NeverForgetsPendingCommands) {
  ReplyCache cache(2, 10);
  cache.Begin(1);
  for (protocol::Seq seq = 2; seq <= 9; ++seq) {
    cache.Begin(seq);
    EXPECT_EQ(cache.Store(seq, FrameOf(100), 0), 0u);
  }
  EXPECT_EQ(cache.Classify(1), ReplyCache::Verdict::kPending);
  EXPECT_EQ(cache.Store(1, FrameOf(100), 0), 8u);
  EXPECT_EQ(cache.Classify(9), ReplyCache::Verdict::kAnswered);
}

TEST(EventReplay, ReturnsMessagesAfterANumber) {
  EventReplay replay(1000);
  for (std::uint64_t number = 1; number <= 4; ++number) replay.Add({number, 2, true, FrameOf(100)});
  std::vector<std::uint64_t> numbers;
  replay.ForEachAfter(2, [&](EventReplay::Stored& stored) { numbers.push_back(stored.number); });
  EXPECT_THAT(numbers, ElementsAre(3u, 4u));
  EXPECT_EQ(replay.TakeDropped(), 0u);
}

TEST(EventReplay, IsBoundedAndCountsDroppedUnsentEvents) {
  EventReplay replay(250);
  replay.Add({1, 7, true, FrameOf(100)});
  replay.Add({2, 5, false, FrameOf(100)});
  replay.Add({3, 3, false, FrameOf(100)});
  EXPECT_EQ(replay.TakeDropped(), 0u);  // message 1 was sent
  replay.Add({4, 1, false, FrameOf(100)});
  EXPECT_EQ(replay.TakeDropped(), 5u);
  EXPECT_EQ(replay.TakeDropped(), 0u);
  EXPECT_LE(replay.bytes(), 250u);
  EventReplay none(0);
  none.Add({1, 2, false, FrameOf(8)});
  EXPECT_EQ(none.TakeDropped(), 2u);
  EXPECT_EQ(none.bytes(), 0u);
}

TEST(TokenBucket, LimitsRateAndBurst) {
  TokenBucket bucket(10.0, 5.0);
  EXPECT_TRUE(bucket.Take(5.0));
  EXPECT_FALSE(bucket.Take(1.0));
  bucket.AdvanceTime(0.25);
  EXPECT_TRUE(bucket.Take(2.0));
  EXPECT_FALSE(bucket.Take(1.0));  // half a token is left
  bucket.AdvanceTime(0.20);        // an earlier time has no effect
  EXPECT_FALSE(bucket.Take(1.0));
  bucket.AdvanceTime(100.0);
  EXPECT_FALSE(bucket.Take(5.5));
  EXPECT_TRUE(bucket.Take(5.0));
}

TEST(SessionDirectory, DistributesSessionsAndFindsThemByToken) {
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

TEST(SessionDirectory, EnforcesLimits) {
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
