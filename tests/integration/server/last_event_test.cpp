// Every accepted request has exactly one last event, whatever ends it.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <set>
#include <vector>

#include "random_requests.h"
#include "test_server.h"

namespace stridewire {
namespace {

using namespace std::chrono_literals;
using protocol::AvatarId;
using protocol::Event;
using protocol::EventType;
using protocol::RequestId;
using protocol::RequestOutcome;
using protocol::StatusCode;

// Observes the events of a world and counts the last events of each accepted request.
class Witness {
 public:
  Witness(const TestServer& server, const std::string& world) {
    auto [client, info] = server.Enter(world);
    client_ = std::move(client);
    world_ = info->world;
  }

  [[nodiscard]] RawClient& client() { return client_; }
  [[nodiscard]] protocol::WorldId world() const { return world_; }
  [[nodiscard]] std::size_t accepted() const { return ends_.size(); }
  [[nodiscard]] const std::map<RequestOutcome, int>& outcomes() const { return outcomes_; }

  // Reads everything that has arrived.
  void Read(std::chrono::milliseconds patience = 5ms) {
    while (const auto message = client_.Receive(patience)) Add(*message);
  }
  void Add(const protocol::Message& message) {
    const auto* lagging = std::get_if<protocol::Lagging>(&message);
    if (lagging != nullptr) {
      ASSERT_EQ(lagging->dropped_events, 0u);
    }
    const auto* events = std::get_if<protocol::Events>(&message);
    if (events == nullptr) return;
    for (const Event& event : events->events) Add(event);
  }
  // Reads until all accepted requests have ended.
  [[nodiscard]] bool AwaitEnd() {
    return Eventually([&] {
      Read(20ms);
      return open_.empty();
    });
  }
  [[nodiscard]] const std::set<RequestId>& open() const { return open_; }

 private:
  void Add(const Event& event) {
    const RequestId id = event.request_id;
    if (event.type == EventType::kAccepted) {
      ASSERT_TRUE(ends_.emplace(id, 0).second) << "request " << id << " was accepted twice";
      open_.insert(id);
      return;
    }
    if (id == 0) {
      ASSERT_EQ(event.outcome, RequestOutcome::kNone);
      return;
    }
    ASSERT_TRUE(ends_.contains(id)) << "request " << id << " was not accepted";
    ASSERT_EQ(ends_[id], 0) << "request " << id << " has an event after its last one";
    if (event.outcome == RequestOutcome::kNone) return;
    const bool is_drop =
        event.outcome >= RequestOutcome::kCancelled && event.type == EventType::kRejected;
    EXPECT_EQ(event.code == StatusCode::kDropped, is_drop);
    EXPECT_EQ(event.reason.empty(), event.type == EventType::kFinished);
    ++ends_[id];
    ++outcomes_[event.outcome];
    open_.erase(id);
  }

  RawClient client_;
  protocol::WorldId world_ = 0;
  std::map<RequestId, int> ends_;  // Number of last events by request.
  std::set<RequestId> open_;       // Requests without a last event.
  std::map<RequestOutcome, int> outcomes_;
};

constexpr AvatarId kAvatars = 8;

protocol::RequestItem DrawItem(Random& random, AvatarId avatar, RequestId id) {
  using namespace protocol;
  RequestItem item{.avatar = avatar, .request_id = id};
  const double kind = random.Draw(0.0, 1.0);
  if (kind < 0.5) {
    StepMovement step{.length_m = random.Draw(0.0, 0.9),
                      .turn_rad = random.Draw(-0.4, 0.4),
                      .allow_nearest = Draws(random, 0.7)};
    if (Draws(random, 0.3)) step.foot = FootChoice::kLeft;
    if (Draws(random, 0.1)) step = {.length_m = 0.5, .exact_only = true};
    item.movement = step;
  } else if (kind < 0.7) {
    item.movement = WalkMovement{
        DVec3(random.Draw(-3.0, 3.0), 0.0, random.Draw(-3.0, 3.0)), 0.0, {}, std::nullopt};
  } else if (kind < 0.8) {
    item.movement = JumpMovement{.length_m = 0.7, .allow_nearest = true};
  } else {
    item.movement = StandMovement{random.Draw(0.0, 0.5)};
  }
  if (Draws(random, 0.3)) {
    item.interrupt =
        Draws(random, 0.7) ? protocol::Interrupt::kNow : protocol::Interrupt::kAfterMovement;
  }
  return item;
}

// A controller that sends random commands and loses its connection now and then. It counts the
// requests that the server has accepted.
class Controller {
 public:
  Controller(const TestServer& server, Random& random, RequestId& next_id)
      : server_(server), random_(random), next_id_(next_id) {
    Open();
  }

  void Act() {
    const auto avatar = static_cast<AvatarId>(random_.Draw(1.0, kAvatars + 1.0));
    const double what = random_.Draw(0.0, 1.0);
    if (what < 0.25) {
      Send(protocol::Spawn{
          .seq = 0, .world = world_, .items = {{avatar, {DVec3(avatar, 0.0, 0.0), 0.0}}}});
    } else if (what < 0.75) {
      protocol::Request request{.seq = 0, .world = world_, .items = {}};
      const int count = static_cast<int>(random_.Draw(1.0, 6.0));
      for (int i = 0; i < count; ++i) {
        request.items.push_back(DrawItem(
            random_, static_cast<AvatarId>(random_.Draw(1.0, kAvatars + 1.0)), next_id_++));
      }
      Send(request);
    } else if (what < 0.83) {
      Send(protocol::CancelQueue{.seq = 0, .world = world_, .avatars = {avatar}});
    } else if (what < 0.91) {
      Send(protocol::Remove{.seq = 0, .world = world_, .avatars = {avatar}});
    } else if (what < 0.92) {
      Send(protocol::Spawn{
          .seq = 0, .world = world_, .items = {{avatar, {DVec3(0.0, 0.0, avatar), 1.0}, true}}});
    } else if (what < 0.93) {
      Send(protocol::SetPlanting{
          .seq = 0, .world = world_, .avatars = {avatar}, .enabled = Draws(random_, 0.5)});
    } else if (what < 0.95) {
      Leave();
    } else if (what < 0.98) {
      Resume();
    } else {
      End();
    }
  }

  // Waits for the replies to all commands.
  void Settle() {
    while (unanswered_ > 0) {
      const auto message = client_.Receive();
      ASSERT_TRUE(message);
      Hear(*message);
    }
  }
  [[nodiscard]] std::size_t accepted() const { return accepted_; }

 private:
  void Open() {
    client_ = server_.Connect();
    const auto welcome = client_.SayHello();
    ASSERT_TRUE(welcome);
    token_ = welcome->resume_token;
    Join();
  }
  void Join() {
    const auto info = client_.Join("stage");
    ASSERT_TRUE(info);
    world_ = info->world;
  }
  template <typename Message>
  void Send(Message message) {
    message.seq = client_.NextSeq();
    last_seq_ = message.seq;
    client_.Send(message);
    ++unanswered_;
    is_request_[message.seq] = std::is_same_v<Message, protocol::Request>;
  }
  void Hear(const protocol::Message& message) {
    const auto* reply = std::get_if<protocol::Reply>(&message);
    if (reply == nullptr) return;
    EXPECT_EQ(reply->code, StatusCode::kOk);
    --unanswered_;
    if (is_request_.at(reply->seq)) accepted_ += reply->accepted;
  }
  // Leaves the world, which removes the avatars of this session, and joins it again.
  void Leave() {
    Settle();
    Send(protocol::LeaveWorld{.seq = 0, .world = world_});
    Settle();
    Join();
  }
  void Resume() {
    Settle();
    client_.Abort();
    client_ = server_.Connect();
    client_.set_last_seq(last_seq_);
    const auto welcome = client_.SayHello(token_);
    ASSERT_TRUE(welcome && welcome->resumed);
  }
  // Ends the session. The server removes its avatars at once or, if it only loses the connection,
  // when the session cannot be resumed any more.
  void End() {
    Settle();
    if (Draws(random_, 0.5)) {
      client_.Send(protocol::Goodbye{.code = StatusCode::kOk, .text = ""});
      EXPECT_TRUE(client_.AwaitClose());
    } else {
      client_.Abort();
    }
    Open();
  }

  const TestServer& server_;
  Random& random_;
  RequestId& next_id_;
  RawClient client_;
  std::vector<std::byte> token_;
  protocol::WorldId world_ = 0;
  protocol::Seq last_seq_ = 0;
  int unanswered_ = 0;
  std::size_t accepted_ = 0;
  std::map<protocol::Seq, bool> is_request_;
};

TEST(LastEvent, FollowsEveryAcceptedRequestExactlyOnce) {
  const char* given = std::getenv("STRIDEWIRE_TEST_SEED");
  const unsigned seed =
      given != nullptr ? static_cast<unsigned>(std::strtoul(given, nullptr, 10)) : 1u;
  std::printf("seed %u\n", seed);
  SCOPED_TRACE("seed " + std::to_string(seed));
  server::Config config = TestConfig(2);
  config.limits.resume_window_s = 0.5;
  TestServer server(config);
  Witness witness(server, "stage");
  Random random(seed);
  RequestId next_id = 1;
  std::vector<Controller> controllers;
  for (int i = 0; i < 3; ++i) controllers.emplace_back(server, random, next_id);
  for (int round = 0; round < 180; ++round) {
    const int commands = static_cast<int>(random.Draw(1.0, 5.0));
    for (int i = 0; i < commands; ++i) {
      controllers[static_cast<std::size_t>(random.Draw(0.0, 3.0))].Act();
    }
    witness.Read(10ms);
    if (HasFatalFailure()) return;
  }
  std::size_t accepted = 0;
  for (Controller& controller : controllers) {
    controller.Settle();
    accepted += controller.accepted();
  }
  // Long queues would take minutes. Requests that have not ended yet must end with their avatars.
  const auto until = std::chrono::steady_clock::now() + 3s;
  while (std::chrono::steady_clock::now() < until) witness.Read(5ms);
  protocol::Remove rest{.seq = witness.client().NextSeq(), .world = witness.world(), .avatars = {}};
  for (AvatarId avatar = 1; avatar <= kAvatars; ++avatar) rest.avatars.push_back(avatar);
  witness.client().Send(rest);
  EXPECT_TRUE(witness.AwaitEnd()) << witness.open().size() << " requests have no last event, "
                                  << "the first is " << *witness.open().begin();
  EXPECT_EQ(witness.accepted(), accepted);
  EXPECT_GT(accepted, 200u);
  for (const RequestOutcome outcome :
       {RequestOutcome::kCompleted, RequestOutcome::kRejected, RequestOutcome::kCancelled,
        RequestOutcome::kReplaced, RequestOutcome::kRemoved}) {
    EXPECT_GT(witness.outcomes().count(outcome), 0u) << "outcome " << static_cast<int>(outcome);
  }
}

// One command can drop very many requests. A shard spreads their events over ticks if there are
// more than kMaxDroppedPerTick (16,384).
TEST(LastEvent, FollowsEveryRequestOfALargeCancellation) {
  constexpr AvatarId kCrowd = 100;
  constexpr int kRequests = 200;
  TestServer server(TestConfig(1));
  Witness witness(server, "stage");
  RawClient& client = witness.client();
  protocol::Spawn spawn{.seq = client.NextSeq(), .world = witness.world(), .items = {}};
  protocol::CancelQueue cancel{.seq = 0, .world = witness.world(), .avatars = {}};
  for (AvatarId avatar = 1; avatar <= kCrowd; ++avatar) {
    spawn.items.push_back({avatar, {DVec3(avatar, 0.0, 0.0), 0.0}});
    cancel.avatars.push_back(avatar);
  }
  client.Send(spawn);
  RequestId id = 1;
  for (int part = 0; part < 4; ++part) {
    protocol::Request request{.seq = client.NextSeq(), .world = witness.world(), .items = {}};
    for (AvatarId avatar = 1; avatar <= kCrowd; ++avatar) {
      for (int i = 0; i < kRequests / 4; ++i) {
        request.items.push_back(
            {.avatar = avatar, .request_id = id++, .movement = protocol::StandMovement{100.0}});
      }
    }
    client.Send(request);
  }
  EXPECT_TRUE(Eventually([&] {
    witness.Read();
    return witness.accepted() == kCrowd * kRequests;
  })) << witness.accepted();
  cancel.seq = client.NextSeq();
  client.Send(cancel);
  client.Send(protocol::Remove{
      .seq = client.NextSeq(), .world = witness.world(), .avatars = cancel.avatars});
  EXPECT_TRUE(witness.AwaitEnd());
  EXPECT_EQ(witness.outcomes().at(RequestOutcome::kCancelled), kCrowd * (kRequests - 1));
  EXPECT_EQ(witness.outcomes().at(RequestOutcome::kRemoved), static_cast<int>(kCrowd));
}

}  // namespace
}  // namespace stridewire
