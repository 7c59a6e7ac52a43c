#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <vector>

#include "random_requests.h"
#include "test_library.h"

namespace stridewire {
namespace {

constexpr double kStepS = 1.0 / 60.0;

class RequestOutcomes : public testing::Test {
 protected:
  RequestOutcomes() { Watch(); }

  void Enqueue(const MovementRequest& request) { ASSERT_TRUE(avatar_.Enqueue(request)); }

  // Advances and stores the events.
  void Watch(int ticks = 1) {
    for (int i = 0; i < ticks; ++i) {
      avatar_.Advance(kStepS);
      for (const AvatarEvent& event : avatar_.events()) {
        if (event.outcome == RequestOutcome::kNone) continue;
        EXPECT_FALSE(outcomes_.contains(event.request_id)) << "request " << event.request_id;
        outcomes_[event.request_id] = event.outcome;
        last_ = event;
      }
    }
  }

  std::map<std::uint64_t, RequestOutcome> outcomes_;
  AvatarEvent last_;
  AvatarSimulation avatar_{MakeTestLibrary(), {}};
};

using Outcomes = std::map<std::uint64_t, RequestOutcome>;

TEST_F(RequestOutcomes, ReportsCompletedAndRejectedRequests) {
  Enqueue({1, StepRequest{.length_m = 0.4}});
  Enqueue({2, StepRequest{.length_m = 5.0}});
  Enqueue({3, StandRequest{0.1}});
  Watch(300);
  EXPECT_EQ(outcomes_, (Outcomes{{1, RequestOutcome::kCompleted},
                                 {2, RequestOutcome::kRejected},
                                 {3, RequestOutcome::kCompleted}}));
}

TEST_F(RequestOutcomes, ReportsCancelledRequestsAtTheNextAdvance) {
  Enqueue({1, StandRequest{0.2}});
  Watch();
  for (std::uint64_t id = 2; id < 102; ++id) Enqueue({id, StepRequest{.length_m = 0.4}});
  EXPECT_EQ(avatar_.CancelQueue(), 100);
  Watch();
  EXPECT_EQ(outcomes_.size(), 100u);
  EXPECT_EQ(outcomes_[57], RequestOutcome::kCancelled);
  EXPECT_EQ(last_.type, AvatarEventType::kDropped);
  EXPECT_STREQ(last_.reason, "the request was cancelled");
  Watch(60);
  EXPECT_EQ(outcomes_[1], RequestOutcome::kCompleted);
}

TEST_F(RequestOutcomes, ReportsReplacedRequests) {
  Enqueue({1, StandRequest{100.0}});
  Enqueue({2, StepRequest{.length_m = 0.4}});
  Watch();
  Enqueue({3, StepRequest{.length_m = 0.2}, Interrupt::kNow});
  Watch(200);
  EXPECT_EQ(outcomes_, (Outcomes{{1, RequestOutcome::kReplaced},
                                 {2, RequestOutcome::kReplaced},
                                 {3, RequestOutcome::kCompleted}}));
}

// A request that follows a redirected step must not be lost.
TEST_F(RequestOutcomes, PlaysRequestsAfterARedirectedStep) {
  Enqueue({1, StepRequest{.foot = Foot::kLeft, .length_m = 0.4}});
  Watch(2);
  while (avatar_.movement_time_s() < 0.35 * avatar_.movement()->duration_s()) Watch();
  Enqueue({2, StepRequest{.foot = Foot::kLeft, .length_m = 0.3}, Interrupt::kNow});
  Enqueue({3, StepRequest{.length_m = 0.3}});
  Watch();
  EXPECT_TRUE(avatar_.change().is_redirected);
  Watch(300);
  EXPECT_EQ(outcomes_, (Outcomes{{1, RequestOutcome::kReplaced},
                                 {2, RequestOutcome::kCompleted},
                                 {3, RequestOutcome::kCompleted}}));
}

TEST_F(RequestOutcomes, EndsADroppedWalkAfterItsCurrentStep) {
  Enqueue({1, WalkRequest{.position_m = DVec3(0.0, 0.0, 10.0)}});
  Watch(100);
  avatar_.CancelQueue();
  Watch();
  EXPECT_TRUE(outcomes_.empty());
  Watch(200);
  EXPECT_EQ(outcomes_, (Outcomes{{1, RequestOutcome::kCancelled}}));
  EXPECT_EQ(last_.type, AvatarEventType::kDropped);
}

TEST_F(RequestOutcomes, ReportsWhatATeleportDrops) {
  Enqueue({1, StepRequest{.length_m = 0.4}});
  Enqueue({2, StepRequest{.length_m = 0.4}});
  Watch(10);
  avatar_.Teleport({DVec3(1.0, 0.0, 2.0), 0.5});
  Watch();
  EXPECT_EQ(outcomes_,
            (Outcomes{{1, RequestOutcome::kCancelled}, {2, RequestOutcome::kCancelled}}));
}

TEST_F(RequestOutcomes, DoNotReportTakenRequests) {
  Enqueue({1, WalkRequest{.position_m = DVec3(0.0, 0.0, 10.0)}});
  Enqueue({2, StandRequest{1.0}});
  Watch(100);
  avatar_.DropAll(RequestOutcome::kRemoved);
  const std::vector<DroppedRequest> dropped = avatar_.TakeDropped();
  ASSERT_EQ(dropped.size(), 2u);
  EXPECT_EQ(dropped[0].id, 1u);
  EXPECT_EQ(dropped[1].id, 2u);
  EXPECT_EQ(dropped[1].outcome, RequestOutcome::kRemoved);
}

// Each accepted request has exactly one outcome, even if it is interrupted or cancelled, or if its
// avatar teleports. No event with its id follows the outcome.
TEST(RequestOutcome, IsReportedExactlyOnce) {
  constexpr int kAvatars = 24;
  constexpr int kTicks = 1500;
  const auto library = MakeTestLibrary();
  for (unsigned seed = 1; seed <= kAvatars; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    AvatarSimulation avatar(library, DrawBase(random));
    std::map<std::uint64_t, int> ends;  // by request
    std::map<RequestOutcome, int> outcomes;
    const auto end = [&](std::uint64_t id, RequestOutcome outcome) {
      ASSERT_TRUE(ends.contains(id)) << "request " << id;
      ASSERT_EQ(++ends[id], 1) << "request " << id;
      ++outcomes[outcome];
    };
    std::uint64_t next_id = 1;
    const auto advance = [&] {
      avatar.Advance(Draws(random, 0.05) ? 1.0 : kStepS);
      for (const AvatarEvent& event : avatar.events()) {
        if (event.request_id == 0) {
          ASSERT_EQ(event.outcome, RequestOutcome::kNone);
          continue;
        }
        ASSERT_EQ(ends.at(event.request_id), 0)
            << "request " << event.request_id << " has an event after its end";
        if (event.outcome != RequestOutcome::kNone) end(event.request_id, event.outcome);
      }
    };
    for (int tick = 0; tick < kTicks; ++tick) {
      while (avatar.queue_size() < 5 && Draws(random, 0.1)) {
        MovementRequest request = DrawRequest(random, avatar);
        request.id = next_id;
        if (Draws(random, 0.2)) {
          if (auto* step = std::get_if<StepRequest>(&request.movement)) step->allow_nearest = false;
        }
        if (!avatar.Enqueue(request)) continue;
        ends[next_id++] = 0;
      }
      if (Draws(random, 0.01)) (void)avatar.CancelQueue();
      if (Draws(random, 0.005)) avatar.Teleport(DrawBase(random));
      if (Draws(random, 0.005)) (void)avatar.SetFootPlanting(!avatar.foot_planting());
      if (Draws(random, 0.02)) {
        for (const DroppedRequest& dropped : avatar.TakeDropped()) end(dropped.id, dropped.outcome);
      }
      advance();
      if (HasFatalFailure()) return;
    }
    if (seed % 2 == 0) {
      avatar.DropAll(RequestOutcome::kRemoved);
      for (const DroppedRequest& dropped : avatar.TakeDropped()) end(dropped.id, dropped.outcome);
    } else {
      while (!avatar.idle() && !HasFatalFailure()) advance();
    }
    for (const auto& [id, count] : ends) ASSERT_EQ(count, 1) << "request " << id;
    for (const RequestOutcome outcome :
         {RequestOutcome::kCompleted, RequestOutcome::kCancelled, RequestOutcome::kReplaced}) {
      EXPECT_GT(outcomes[outcome], 0) << static_cast<int>(outcome);
    }
  }
}

}  // namespace
}  // namespace stridewire
