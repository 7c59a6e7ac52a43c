// Sessions over real sockets: handshake, commands, resuming.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <set>

#include "test_server.h"

namespace stridewire {
namespace {

using namespace std::chrono_literals;
using protocol::AvatarId;
using protocol::ErrorNotice;
using protocol::EventType;
using protocol::PoseMode;
using protocol::Reply;
using protocol::StatusCode;
using server::Limit;
using server::ThreadMetrics;
using testing::ElementsAre;

std::vector<std::byte> Encoded(const protocol::Message& message) {
  std::vector<std::byte> frame;
  EXPECT_TRUE(protocol::Encoder().Encode(message, frame));
  return frame;
}

TEST(ServerSession, AnswersHelloWithWelcome) {
  TestServer server;
  RawClient client = server.Connect();
  const auto welcome = client.SayHello();
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->protocol, 1);
  EXPECT_NE(welcome->session, 0u);
  EXPECT_GE(welcome->resume_token.size(), protocol::kMinResumeTokenBytes);
  EXPECT_FALSE(welcome->resumed);
  EXPECT_EQ(welcome->last_seq, 0u);
  EXPECT_EQ(welcome->tick_hz, 60.0);
  EXPECT_EQ(welcome->limits.max_queue, 256u);
  EXPECT_EQ(welcome->limits.max_items, protocol::kMaxItems);
}

struct BadGreeting {
  const char* name;
  std::vector<std::byte> bytes;
  StatusCode code;
};

std::vector<BadGreeting> BadGreetings() {
  const std::vector<std::byte> hello = Encoded(protocol::Hello{.client_name = "test"});
  const auto changed = [&](std::size_t at, unsigned char value) {
    std::vector<std::byte> bytes = hello;
    bytes[at] = std::byte{value};
    return bytes;
  };
  std::vector<std::byte> garbage(4096);
  std::mt19937 random(20261121);
  for (std::byte& byte : garbage) byte = static_cast<std::byte>(random());
  std::vector<std::byte> torn = hello;
  std::fill(torn.begin() + protocol::kFrameHeaderBytes, torn.end(), std::byte{0xff});
  return {
      {"bad magic", changed(0, 'X'), StatusCode::kMalformed},
      {"unknown frame version", changed(4, 9), StatusCode::kVersionMismatch},
      {"unknown type", changed(6, 200), StatusCode::kUnsupported},
      {"a server's message", changed(6, 64), StatusCode::kMalformed},
      {"flags", changed(12, 1), StatusCode::kMalformed},
      {"a length beyond its limit", changed(10, 0x7f), StatusCode::kLimitReached},
      {"garbage", garbage, StatusCode::kMalformed},
      {"an invalid payload", torn, StatusCode::kMalformed},
      {"not a Hello", Encoded(protocol::Ping{.nonce = 1}), StatusCode::kUnexpectedMessage},
      {"an unsupported protocol version",
       Encoded(protocol::Hello{.protocol_min = 7, .protocol_max = 9, .client_name = "test"}),
       StatusCode::kVersionMismatch},
  };
}

TEST(ServerSession, RejectsInvalidHandshakesWithAReason) {
  TestServer server;
  for (const BadGreeting& greeting : BadGreetings()) {
    SCOPED_TRACE(greeting.name);
    RawClient client = server.Connect();
    client.SendBytes(greeting.bytes);
    const auto notice = client.Await<ErrorNotice>();
    ASSERT_TRUE(notice);
    EXPECT_TRUE(notice->fatal);
    EXPECT_EQ(notice->code, greeting.code) << notice->text;
    EXPECT_FALSE(notice->text.empty());
    EXPECT_TRUE(client.AwaitClose());
  }
  // The server still accepts other clients.
  RawClient client = server.Connect();
  EXPECT_TRUE(client.SayHello());
}

TEST(ServerSession, RejectsLargeFramesBeforeHello) {
  TestServer server;
  RawClient client = server.Connect();
  // A Request may have 16 MiB, but before Hello its header alone closes the connection.
  std::vector<std::byte> frame =
      Encoded(protocol::Request{.seq = 1, .world = 1, .items = Steps(1, 2000, 0.5)});
  frame.resize(64);
  client.SendBytes(frame);
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kLimitReached);
  EXPECT_EQ(server.metrics().Sum(Limit::kFrameBytes), 1u);
}

TEST(ServerSession, ClosesAHandshakeAfterItsTimeout) {
  server::Config config = TestConfig();
  config.limits.handshake_timeout_s = 0.1;
  TestServer server(config);
  RawClient client = server.Connect();
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kTimeout);
  EXPECT_TRUE(client.AwaitClose());
  EXPECT_EQ(server.metrics().Sum(Limit::kHandshakeTimeout), 1u);
}

TEST(ServerSession, ClosesAnIdleConnection) {
  server::Config config = TestConfig();
  config.limits.idle_timeout_s = 0.2;
  TestServer server(config);
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kTimeout);
  EXPECT_EQ(server.metrics().Sum(Limit::kIdleTimeout), 1u);
}

TEST(ServerSession, AnswersPing) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  client.Send(protocol::Ping{.nonce = 42, .time_s = 1.5});
  const auto pong = client.Await<protocol::Pong>();
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->nonce, 42u);
  EXPECT_EQ(pong->time_s, 1.5);
  EXPECT_GT(pong->server_time_s, 0.0);
}

TEST(ServerSession, AnswersInspectAvatar) {
  TestServer server(TestConfig(3));
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("plaza");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}, {.avatar = 2}, {.avatar = 3}}));
  ASSERT_TRUE(client.Request(world->world, Steps(2, 30, 0.4)));
  const auto ask = [&](protocol::WorldId in, protocol::AvatarId avatar, std::uint64_t nonce) {
    client.Send(protocol::InspectAvatar{nonce, in, avatar});
    return client.Await<protocol::AvatarState>();
  };
  const auto walking = ask(world->world, 2, 7);
  ASSERT_TRUE(walking);
  EXPECT_EQ(walking->nonce, 7u);
  EXPECT_EQ(walking->avatar, 2u);
  ASSERT_TRUE(walking->movement);
  EXPECT_EQ(walking->movement->request_id + walking->queue_size, 30u);
  EXPECT_EQ(walking->queue.size(), protocol::kMaxInspectedRequests);
  const auto standing = ask(world->world, 3, 8);
  ASSERT_TRUE(standing);
  EXPECT_FALSE(standing->movement);
  EXPECT_EQ(ask(world->world, 99, 9)->code, StatusCode::kNoSuchAvatar);
  EXPECT_EQ(ask(world->world + 1, 2, 10)->code, StatusCode::kNotJoined);

  // Many requests at once: each gets an answer, and those beyond the limit are refused.
  constexpr std::uint64_t kQuestions = 1000;
  for (std::uint64_t i = 1; i <= kQuestions; ++i) {
    client.Send(protocol::InspectAvatar{i, world->world, 2});
  }
  std::uint64_t refused = 0;
  for (std::uint64_t i = 1; i <= kQuestions; ++i) {
    const auto state = client.Await<protocol::AvatarState>();
    ASSERT_TRUE(state) << i;
    EXPECT_TRUE(state->code == StatusCode::kOk || state->code == StatusCode::kLimitReached);
    refused += state->code == StatusCode::kLimitReached ? 1 : 0;
  }
  EXPECT_LT(refused, kQuestions);
}

TEST(ServerSession, WalksAnAvatarAndSendsItsEvents) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("plaza");
  ASSERT_TRUE(world);
  EXPECT_EQ(world->name, "plaza");
  EXPECT_EQ(world->library_hash.size(), 32u);
  EXPECT_EQ(world->skeleton.joints.size(), 7u);

  const auto spawned = client.Spawn(world->world, {{.avatar = 7, .start = {{1, 0, 2}, 0.5}}});
  ASSERT_TRUE(spawned);
  EXPECT_EQ(spawned->code, StatusCode::kOk);
  EXPECT_EQ(spawned->accepted, 1u);
  ASSERT_EQ(spawned->items.size(), 1u);
  EXPECT_EQ(spawned->items[0].avatar, 7u);

  ASSERT_EQ(client.Observe(world->world, 1, PoseMode::kFull)->code, StatusCode::kOk);
  const auto requested = client.Request(world->world, Steps(7, 2, 0.4));
  ASSERT_TRUE(requested);
  EXPECT_EQ(requested->accepted, 2u);
  EXPECT_TRUE(requested->items.empty());

  std::vector<EventType> types;
  std::vector<protocol::Event> events;
  std::uint64_t last_tick = 0;
  std::size_t batches = 0;
  while (types.empty() || types.back() != EventType::kIdle ||
         std::ranges::count(types, EventType::kFinished) < 3) {
    auto message = client.Receive();
    ASSERT_TRUE(message);
    if (const auto* message_events = std::get_if<protocol::Events>(&*message)) {
      EXPECT_EQ(message_events->world, world->world);
      for (const protocol::Event& event : message_events->events) {
        EXPECT_EQ(event.avatar, 7u);
        types.push_back(event.type);
        events.push_back(event);
      }
    } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&*message)) {
      EXPECT_GT(batch->info.tick, last_tick);
      EXPECT_DOUBLE_EQ(batch->info.server_time_s, static_cast<double>(batch->info.tick) / 60.0);
      last_tick = batch->info.tick;
      ++batches;
      ASSERT_THAT(batch->avatars, ElementsAre(7u));
    }
  }
  EXPECT_GT(batches, 10u);
  // Two requested steps and the step with which the avatar comes to a stand.
  std::erase_if(types, [](EventType type) { return type == EventType::kFootStrike; });
  // The avatar may have been idle before the request arrived.
  std::erase(types, EventType::kIdle);
  std::erase(types, EventType::kSpawned);
  EXPECT_THAT(types, ElementsAre(EventType::kAccepted, EventType::kAccepted, EventType::kStarted,
                                 EventType::kFinished, EventType::kStarted, EventType::kFinished,
                                 EventType::kStarted, EventType::kFinished));
  const auto started = std::ranges::find(events, EventType::kStarted, &protocol::Event::type);
  EXPECT_EQ(started->request_id, 1u);
  EXPECT_GT(started->requested.size(), 0u);
  EXPECT_EQ(started->requested.size(), started->applied.size());
  const auto finished = std::ranges::find(events, EventType::kFinished, &protocol::Event::type);
  EXPECT_NE(finished->base.position_m, DVec3(1, 0, 2));
  EXPECT_TRUE(std::ranges::is_sorted(events, {}, &protocol::Event::tick));
}

// Events of requests within and beyond the range of the examples.
TEST(ServerSession, ReportsGroupAndExtrapolation) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("plaza");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  ASSERT_EQ(client.Observe(world->world, 1, PoseMode::kFull)->code, StatusCode::kOk);
  // The first movement may start before the reply; the others start later.
  std::vector<protocol::RequestItem> items = Steps(1, 3, 0.3);
  std::get<protocol::StepMovement>(items[2].movement) = {.length_m = 5.0, .allow_nearest = true};
  ASSERT_EQ(client.Request(world->world, items)->accepted, 3u);

  std::map<protocol::RequestId, protocol::Event> started;
  while (!started.contains(2) || !started.contains(3)) {
    auto message = client.Receive();
    ASSERT_TRUE(message);
    const auto* message_events = std::get_if<protocol::Events>(&*message);
    if (message_events == nullptr) continue;
    for (const protocol::Event& event : message_events->events) {
      if (event.type == EventType::kStarted) started.emplace(event.request_id, event);
    }
  }
  const protocol::Event& inside = started.at(2);
  EXPECT_GE(inside.group, 0);
  EXPECT_FALSE(inside.extrapolated);
  EXPECT_FALSE(inside.clamped);
  EXPECT_EQ(inside.requested, inside.applied);
  const protocol::Event& beyond = started.at(3);
  EXPECT_GE(beyond.group, 0);
  EXPECT_NE(beyond.group, inside.group);  // the other foot
  EXPECT_TRUE(beyond.extrapolated);
  EXPECT_TRUE(beyond.clamped);
  ASSERT_EQ(beyond.requested.size(), 2u);
  EXPECT_NEAR(beyond.requested[1].value, 5.0, 1e-9);
  EXPECT_GT(beyond.applied[1].value,
            0.5);  // the test library has steps of 0.6 m; the hull is extended by 10 %
  EXPECT_LT(beyond.applied[1].value, 0.66);
}

TEST(ServerSession, ChoosesUnusedAvatarIds) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  const auto reply =
      client.Spawn(world->world, {{.avatar = 5}, {.avatar = 0}, {.avatar = 0}, {.avatar = 5}});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->accepted, 3u);
  ASSERT_EQ(reply->items.size(), 4u);
  EXPECT_EQ(reply->items[0].avatar, 5u);
  EXPECT_EQ(reply->items[1].avatar, 6u);
  EXPECT_EQ(reply->items[2].avatar, 7u);
  EXPECT_EQ(reply->items[3].code, StatusCode::kAvatarExists);
}

TEST(ServerSession, TeleportsLivingAvatars) {
  TestServer server;
  auto [owner, world] = server.Enter("w");
  auto [other, joined] = server.Enter("w");
  ASSERT_TRUE(world && joined);
  ASSERT_TRUE(owner.Spawn(world->world, {{.avatar = 1}}));
  ASSERT_TRUE(owner.Request(world->world, Steps(1, 3, 0.4)));
  ASSERT_TRUE(other.Observe(world->world, 1, protocol::PoseMode::kFull));
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(other.Await<protocol::PoseBatch>());

  // Another session may move the avatar. It remains with its owner.
  const protocol::Placement place{{10.0, 0.0, 5.0}, 1.0};
  const auto items = [&](protocol::AvatarId avatar) {
    return std::vector<protocol::SpawnItem>{{.avatar = avatar, .start = place, .teleport = true}};
  };
  std::vector<std::pair<protocol::RequestId, protocol::RequestOutcome>> ended;
  std::uint64_t jumped_tick = 0;
  bool is_flagged = false;
  bool has_reply = false;
  other.Send(protocol::Spawn{.seq = other.NextSeq(), .world = world->world, .items = items(1)});
  while (!has_reply || jumped_tick == 0 || ended.size() < 3) {
    const auto message = other.Receive();
    ASSERT_TRUE(message);
    if (const auto* reply = std::get_if<Reply>(&*message)) {
      EXPECT_EQ(reply->accepted, 1u);
      has_reply = true;
    } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&*message)) {
      ASSERT_EQ(batch->avatars.size(), 1u);
      float x_m = 0.0f;
      std::memcpy(&x_m, batch->poses.data(), sizeof x_m);
      if (jumped_tick != 0 || x_m < 9.0f) continue;
      jumped_tick = batch->info.tick;
      EXPECT_NEAR(x_m, 10.0f, 0.1f);
      is_flagged = (batch->flags[0] & protocol::kPoseDiscontinuity) != 0;
    } else if (const auto* events = std::get_if<protocol::Events>(&*message)) {
      for (const protocol::Event& event : events->events) {
        if (event.outcome != protocol::RequestOutcome::kNone) {
          ended.emplace_back(event.request_id, event.outcome);
        }
      }
    }
  }
  EXPECT_TRUE(is_flagged);
  EXPECT_EQ(ended, (std::vector<std::pair<protocol::RequestId, protocol::RequestOutcome>>{
                       {1, protocol::RequestOutcome::kCancelled},
                       {2, protocol::RequestOutcome::kCancelled},
                       {3, protocol::RequestOutcome::kCancelled}}));

  for (const protocol::AvatarId unknown : {0u, 2u}) {
    const auto reply = other.Spawn(world->world, items(unknown));
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->accepted, 0u);
    ASSERT_EQ(reply->items.size(), 1u);
    EXPECT_EQ(reply->items[0].code, StatusCode::kNoSuchAvatar);
  }
  EXPECT_EQ(server.metrics().Sum(&ThreadMetrics::avatars), 1);
  owner.Send(protocol::Goodbye{.code = StatusCode::kOk, .text = ""});
  EXPECT_TRUE(Eventually([&] { return server.metrics().Sum(&ThreadMetrics::avatars) == 0; }));
}

TEST(ServerSession, RejectsItemsIndividually) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  const auto spawned =
      client.Spawn(world->world, {{.avatar = 1}, {.avatar = 2, .start = {{1e9, 0, 0}, 0}}});
  ASSERT_TRUE(spawned);
  EXPECT_EQ(spawned->accepted, 1u);
  EXPECT_EQ(spawned->items[1].code, StatusCode::kOutOfRange);

  std::vector<protocol::RequestItem> items = Steps(1, 1, 0.5);
  items.push_back({.avatar = 9, .request_id = 77, .movement = protocol::StandMovement{1.0}});
  items.push_back({.avatar = 1, .request_id = 78, .movement = protocol::StandMovement{-1.0}});
  const auto requested = client.Request(world->world, items);
  ASSERT_TRUE(requested);
  EXPECT_EQ(requested->code, StatusCode::kOk);
  EXPECT_EQ(requested->accepted, 1u);
  ASSERT_EQ(requested->items.size(), 2u);
  EXPECT_EQ(requested->items[0].index, 1u);
  EXPECT_EQ(requested->items[0].request_id, 77u);
  EXPECT_EQ(requested->items[0].code, StatusCode::kNoSuchAvatar);
  EXPECT_EQ(requested->items[1].index, 2u);
  EXPECT_EQ(requested->items[1].code, StatusCode::kOutOfRange);
}

TEST(ServerSession, CancelsQueuesAndRemovesAvatars) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}, {.avatar = 2}}));
  ASSERT_TRUE(client.Request(world->world, Steps(1, 100, 0.5)));
  client.Send(
      protocol::CancelQueue{.seq = client.NextSeq(), .world = world->world, .avatars = {1, 3}});
  const auto cancelled = client.Await<Reply>();
  ASSERT_TRUE(cancelled);
  EXPECT_EQ(cancelled->accepted, 1u);
  ASSERT_EQ(cancelled->items.size(), 1u);
  EXPECT_EQ(cancelled->items[0].code, StatusCode::kNoSuchAvatar);
  client.Send(protocol::Remove{.seq = client.NextSeq(), .world = world->world, .avatars = {2, 1}});
  const auto removed = client.Await<Reply>();
  ASSERT_TRUE(removed);
  EXPECT_EQ(removed->accepted, 2u);
  EXPECT_TRUE(Eventually([&] { return server.metrics().Sum(&ThreadMetrics::avatars) == 0; }));
}

TEST(ServerSession, RejectsCommandsThatAreInvalidInItsState) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto code = [&](const auto& command) {
    client.Send(command);
    const auto reply = client.Await<Reply>();
    return reply ? reply->code : StatusCode::kInternal;
  };
  const auto seq = [&] { return client.NextSeq(); };
  EXPECT_EQ(code(protocol::Spawn{.seq = seq(), .world = 1, .items = {{}}}), StatusCode::kNotJoined);
  EXPECT_EQ(code(protocol::LeaveWorld{.seq = seq(), .world = 1}), StatusCode::kNotJoined);
  EXPECT_EQ(code(protocol::Observe{.seq = seq(), .world = 1, .subscription = 1, .avatars = {}}),
            StatusCode::kNotJoined);
  EXPECT_EQ(code(protocol::StopObserving{.seq = seq(), .subscription = 1}),
            StatusCode::kNoSuchSubscription);
  const auto world = client.Join("w", protocol::Role::kObserver);
  ASSERT_TRUE(world);
  EXPECT_EQ(code(protocol::JoinWorld{.seq = seq(), .name = "w"}), StatusCode::kAlreadyJoined);
  EXPECT_EQ(code(protocol::Spawn{.seq = seq(), .world = world->world, .items = {{}}}),
            StatusCode::kNotAllowed);
  EXPECT_EQ(client.Observe(world->world, 1, PoseMode::kFull)->code, StatusCode::kOk);
  EXPECT_EQ(client.Observe(world->world, 1, PoseMode::kFull)->code,
            StatusCode::kSubscriptionExists);
}

TEST(ServerSession, JoinsWorldsWithAnyName) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  for (const std::string& name :
       {std::string("../etc"), std::string("Caf\xc3\xa9 \"1\""),
        std::string("\xe5\xba\x83\xe5\xa0\xb4 \xf0\x9f\x9a\xb6"), std::string(64, 'x')}) {
    const auto world = client.Join(name);
    ASSERT_TRUE(world) << name;
    EXPECT_EQ(world->name, name);
  }
}

TEST(ServerSession, ClosesTheConnectionOnASecondHello) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  client.Send(protocol::Hello{.client_name = "again"});
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kUnexpectedMessage);
  EXPECT_TRUE(client.AwaitClose());
}

TEST(ServerSession, ExecutesARepeatedCommandOnce) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  const protocol::Spawn spawn{.seq = client.NextSeq(), .world = world->world, .items = {{}}};
  client.Send(spawn);
  const auto first = client.Await<Reply>();
  client.Send(spawn);
  const auto second = client.Await<Reply>();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(*first, *second);
  EXPECT_EQ(server.metrics().Sum(&ThreadMetrics::avatars), 1u);

  client.Send(protocol::Spawn{.seq = spawn.seq + 2, .world = world->world, .items = {{}}});
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kBadSequence);
  EXPECT_EQ(notice->seq, spawn.seq + 2);
}

TEST(ServerSession, ResumesAfterALostConnection) {
  TestServer server;
  RawClient client = server.Connect();
  const auto welcome = client.SayHello();
  ASSERT_TRUE(welcome);
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  ASSERT_TRUE(client.Observe(world->world, 1, PoseMode::kQuantised));
  std::uint64_t last_number = 0;
  ASSERT_TRUE(client.Await<protocol::PoseBatch>([&](const protocol::Message& message) {
    if (const auto* events = std::get_if<protocol::Events>(&message)) last_number = events->number;
  }));
  // The connection is lost directly after this command, and so is the reply.
  const protocol::Request request{
      .seq = client.NextSeq(), .world = world->world, .items = Steps(1, 3, 0.4)};
  client.Send(request);
  ASSERT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::requests_accepted) == 3; }));
  client.Abort();
  ASSERT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_detached) == 1; }));

  RawClient again = server.Connect();
  const auto back = again.SayHello(welcome->resume_token, last_number);
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->resumed);
  EXPECT_EQ(back->session, welcome->session);
  EXPECT_EQ(back->last_seq, request.seq);
  EXPECT_EQ(back->resume_token, welcome->resume_token);
  const auto info = again.Await<protocol::WorldInfo>();
  ASSERT_TRUE(info);
  EXPECT_EQ(info->seq, 0u);
  EXPECT_EQ(info->world, world->world);

  // The repeated command is answered, and it was executed once.
  again.Send(request);
  std::set<std::uint64_t> numbers;
  std::size_t accepted = 0;
  std::size_t batches = 0;
  bool is_answered = false;
  while (!is_answered || batches == 0 || accepted < 3) {
    const auto message = again.Receive();
    ASSERT_TRUE(message);
    if (const auto* events = std::get_if<protocol::Events>(&*message)) {
      EXPECT_GT(events->number, last_number);
      EXPECT_TRUE(numbers.insert(events->number).second);
      for (const auto& event : events->events) accepted += event.type == EventType::kAccepted;
    } else if (const auto* reply = std::get_if<Reply>(&*message)) {
      EXPECT_EQ(reply->seq, request.seq);
      EXPECT_EQ(reply->accepted, 3u);
      is_answered = true;
    } else if (std::holds_alternative<protocol::PoseBatch>(*message)) {
      ++batches;
    }
  }
  EXPECT_EQ(accepted, 3u);
  EXPECT_EQ(server.metrics().Sum(&ThreadMetrics::requests_accepted), 3u);
  EXPECT_EQ(server.metrics().Sum(&ThreadMetrics::sessions_resumed), 1u);
  EXPECT_EQ(*numbers.begin(), last_number + 1);
}

TEST(ServerSession, ReplacesAHalfOpenConnection) {
  TestServer server;
  RawClient old = server.Connect();
  const auto welcome = old.SayHello();
  ASSERT_TRUE(welcome);
  RawClient fresh = server.Connect();
  const auto back = fresh.SayHello(welcome->resume_token);
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->resumed);
  const auto notice = old.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kReplaced);
  EXPECT_TRUE(old.AwaitClose());
  fresh.Send(protocol::Ping{.nonce = 1});
  EXPECT_TRUE(fresh.Await<protocol::Pong>());
}

TEST(ServerSession, EndsAfterTheResumeWindow) {
  server::Config config = TestConfig();
  config.limits.resume_window_s = 0.05;
  config.worlds["kept"] = {.library = "", .persistent = true};
  TestServer server(config);
  RawClient client = server.Connect();
  const auto welcome = client.SayHello();
  ASSERT_TRUE(welcome);
  const auto passing = client.Join("passing");
  const auto kept = client.Join("kept");
  ASSERT_TRUE(passing && kept);
  ASSERT_EQ(client.Spawn(passing->world, {{}, {}, {}})->accepted, 3u);
  ASSERT_EQ(client.Spawn(kept->world, {{}, {}})->accepted, 2u);
  client.Abort();
  // Its avatars are removed, except in a persistent world.
  ASSERT_TRUE(Eventually([&] { return server.metrics().Sum(&ThreadMetrics::avatars) == 2; }));
  ASSERT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_ended) == 1; }));
  RawClient again = server.Connect();
  const auto back = again.SayHello(welcome->resume_token);
  ASSERT_TRUE(back);
  EXPECT_FALSE(back->resumed);
  EXPECT_NE(back->session, welcome->session);
  EXPECT_EQ(back->last_seq, 0u);
}

TEST(ServerSession, EndsAfterGoodbye) {
  TestServer server;
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{}}));
  client.Send(protocol::Goodbye{});
  EXPECT_TRUE(client.AwaitClose());
  EXPECT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_ended) == 1; }));
  EXPECT_TRUE(Eventually([&] { return server.metrics().Sum(&ThreadMetrics::avatars) == 0; }));
}

TEST(ServerSession, StartsANewSessionAfterARestart) {
  auto server = std::make_unique<TestServer>();
  RawClient client = server->Connect();
  const auto welcome = client.SayHello();
  ASSERT_TRUE(welcome);
  server::Config config = TestConfig();
  config.listen.port = server->port();
  EXPECT_TRUE(server->DrainAndJoin());
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kShuttingDown);
  EXPECT_TRUE(client.AwaitClose());
  server = nullptr;

  // The server can use the same port at once, although old connections are still closing.
  TestServer restarted(config);
  RawClient again = restarted.Connect();
  const auto back = again.SayHello(welcome->resume_token);
  ASSERT_TRUE(back);
  EXPECT_FALSE(back->resumed);
  EXPECT_TRUE(again.Join("w"));
}

TEST(ServerSession, SurvivesMutatedFrames) {
  const unsigned seed = std::random_device()();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
  TestServer server;
  const std::vector<std::vector<std::byte>> frames = {
      Encoded(protocol::JoinWorld{.seq = 1, .name = "w"}),
      Encoded(protocol::Spawn{.seq = 2, .world = 1, .items = {{.avatar = 1}, {.avatar = 2}}}),
      Encoded(protocol::Request{.seq = 3, .world = 1, .items = Steps(1, 4, 0.5)}),
      Encoded(protocol::Observe{.seq = 4, .world = 1, .subscription = 1, .avatars = {1}}),
      Encoded(protocol::Ping{.nonce = 1}),
  };
  for (int round = 0; round < 200; ++round) {
    RawClient client = server.Connect();
    ASSERT_TRUE(client.SayHello());
    for (const std::vector<std::byte>& frame : frames) {
      std::vector<std::byte> mutated = frame;
      const unsigned flips = random() % 3;
      for (unsigned i = 0; i < flips; ++i) {
        mutated[random() % mutated.size()] = static_cast<std::byte>(random());
      }
      client.SendBytes(mutated);
    }
  }
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  EXPECT_TRUE(client.Join("after"));
}

protocol::TerrainInfo Slab(double height_m) {
  protocol::TerrainInfo info;
  info.height_field = protocol::HeightFieldInfo{{-2, -2}, 0.5, 3, 2, {0, 0.5f, 0, 1, 0, 0.25f}};
  info.boxes = {{{0, 0}, {1, 2}, height_m}};
  return info;
}

TEST(ServerSession, SendsTheTerrainToAllSessionsOfAWorld) {
  server::Config config = TestConfig();
  config.shards = 3;
  TestServer server(config);
  RawClient controller = server.Connect();
  RawClient observer = server.Connect();
  ASSERT_TRUE(controller.SayHello() && observer.SayHello());
  const auto world = controller.Join("hall");
  ASSERT_TRUE(world && observer.Join("hall", protocol::Role::kObserver));
  const auto set = [&](const std::optional<protocol::TerrainInfo>& terrain) {
    controller.Send(protocol::SetTerrain{
        .seq = controller.NextSeq(), .world = world->world, .terrain = terrain});
    return controller.Await<Reply>();
  };
  const auto reply = set(Slab(0.5));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->code, StatusCode::kOk) << reply->text;
  EXPECT_EQ(reply->accepted, 1u);
  const protocol::WorldTerrain terrain{world->world, Slab(0.5)};
  EXPECT_EQ(observer.Await<protocol::WorldTerrain>(), terrain);

  // A client that joins later receives the terrain, too.
  RawClient late = server.Connect();
  ASSERT_TRUE(late.SayHello());
  ASSERT_TRUE(late.Join("hall"));
  EXPECT_EQ(late.Await<protocol::WorldTerrain>(), terrain);

  const auto refused = set(Slab(20'000.0));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, StatusCode::kOutOfRange);
  EXPECT_THAT(refused->text, testing::HasSubstr("boxes[0].height_m"));
  ASSERT_TRUE(set(std::nullopt));
  EXPECT_EQ(observer.Await<protocol::WorldTerrain>(),
            (protocol::WorldTerrain{world->world, std::nullopt}));

  observer.Send(protocol::SetTerrain{.seq = observer.NextSeq(), .world = world->world});
  const auto not_allowed = observer.Await<Reply>();
  ASSERT_TRUE(not_allowed);
  EXPECT_EQ(not_allowed->code, StatusCode::kNotAllowed);
}

TEST(ServerSession, SendsTheCurrentTerrainWhenResumed) {
  TestServer server;
  RawClient other = server.Connect();
  ASSERT_TRUE(other.SayHello());
  const auto world = other.Join("hall");
  RawClient client = server.Connect();
  const auto welcome = client.SayHello();
  ASSERT_TRUE(world && welcome && client.Join("hall"));
  for (const std::optional<protocol::TerrainInfo>& terrain :
       {std::optional(Slab(0.25)), std::optional<protocol::TerrainInfo>()}) {
    client.Abort();
    other.Send(
        protocol::SetTerrain{.seq = other.NextSeq(), .world = world->world, .terrain = terrain});
    ASSERT_TRUE(other.Await<Reply>());
    client = server.Connect();
    const auto back = client.SayHello(welcome->resume_token);
    ASSERT_TRUE(back && back->resumed);
    EXPECT_EQ(client.Await<protocol::WorldTerrain>(),
              (protocol::WorldTerrain{world->world, terrain}));
  }
}

// A session that controls one avatar.
class ServerSessionOfOne : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(client_.SayHello());
    const auto world = client_.Join("hall");
    ASSERT_TRUE(world);
    world_ = world->world;
    ASSERT_TRUE(client_.Spawn(world_, {{1, {}}}));
  }

  TestServer server_;
  RawClient client_ = server_.Connect();
  protocol::WorldId world_ = 0;
};

TEST_F(ServerSessionOfOne, AcceptsWalksOnlyWithTheirFeature) {
  protocol::WalkMovement walk{DVec3(0.5, 0.0, 2.0), 1.0, {DVec3(0.0, 0.0, 1.0)}, 1.0};
  const auto reply = client_.Request(world_, {{1, 7, walk}});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->accepted, 1u) << (reply->items.empty() ? "" : reply->items[0].text);
  walk.speed_m_s = 9.0;
  const auto too_fast = client_.Request(world_, {{1, 8, walk}});
  ASSERT_TRUE(too_fast);
  ASSERT_EQ(too_fast->items.size(), 1u);
  EXPECT_EQ(too_fast->items[0].code, StatusCode::kOutOfRange);
}

TEST_F(ServerSessionOfOne, InterruptsMovements) {
  ASSERT_TRUE(client_.Request(
      world_, {{1, 7, protocol::StandMovement{100.0}}, {1, 8, protocol::StandMovement{1.0}}}));
  const protocol::RequestItem now{1, 9, protocol::StepMovement{.length_m = 0.3},
                                  protocol::Interrupt::kNow};
  const auto reply = client_.Request(world_, {now});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->accepted, 1u);
  // Without the interrupt, the first stand would last for 90 s.
  std::vector<protocol::RequestId> finished;
  while (finished.size() < 2) {
    const auto events = client_.Await<protocol::Events>();
    ASSERT_TRUE(events);
    for (const protocol::Event& event : events->events) {
      if (event.type == protocol::EventType::kFinished && event.request_id != 0) {
        finished.push_back(event.request_id);
      }
    }
  }
  EXPECT_EQ(finished, (std::vector<protocol::RequestId>{7, 9}));
}

TEST_F(ServerSessionOfOne, ReachesOrRejectsExactFootprints) {
  protocol::StepMovement far{.at_m = DVec3(0.1, 0.0, 5.0), .heading_rad = 0.0, .exact_only = true};
  protocol::StepMovement near = far;
  near.at_m->z = 0.45;
  ASSERT_TRUE(client_.Request(world_, {{1, 7, far}, {1, 8, near}}));
  std::vector<protocol::Event> heard;
  while (heard.empty() || heard.back().type != protocol::EventType::kFinished) {
    const auto events = client_.Await<protocol::Events>();
    ASSERT_TRUE(events);
    for (const protocol::Event& event : events->events) {
      if (event.request_id != 0 && event.type != protocol::EventType::kAccepted) {
        heard.push_back(event);
      }
    }
  }
  ASSERT_EQ(heard.size(), 4u);  // rejected; started, foot-strike, finished
  const protocol::Event& rejected = heard[0];
  EXPECT_EQ(rejected.type, protocol::EventType::kRejected);
  EXPECT_EQ(rejected.request_id, 7u);
  EXPECT_EQ(rejected.code, StatusCode::kOutOfRange);
  EXPECT_TRUE(rejected.reason.starts_with("the footprint is out of reach: ")) << rejected.reason;
  EXPECT_GT(rejected.position_m.z, 0.5);
  EXPECT_LT(rejected.position_m.z, 2.0);
  EXPECT_EQ(heard[3].request_id, 8u);
  EXPECT_NEAR(heard[2].position_m.z, 0.45, 1e-3);
}

// Requests a rejected step again in the terms of the rejection, which must then be in reach.
TEST_F(ServerSessionOfOne, RejectsStepsAndJumpsOutOfReachUnlessTheNearestIsAllowed) {
  using protocol::JumpMovement;
  using protocol::StepMovement;
  const auto hear = [&](std::vector<protocol::RequestItem> items, protocol::RequestId last) {
    std::vector<protocol::Event> heard;
    EXPECT_TRUE(client_.Request(world_, std::move(items)));
    const auto is_last = [&](const protocol::Event& event) {
      return event.request_id == last && (event.type == protocol::EventType::kRejected ||
                                          event.type == protocol::EventType::kFinished);
    };
    while (std::ranges::none_of(heard, is_last)) {
      const auto events = client_.Await<protocol::Events>();
      if (!events) break;
      for (const protocol::Event& event : events->events) {
        if (event.type == protocol::EventType::kRejected ||
            event.type == protocol::EventType::kStarted) {
          if (event.request_id != 0) heard.push_back(event);
        } else if (is_last(event)) {
          heard.push_back(event);
        }
      }
    }
    return heard;
  };
  const auto rejected = hear({{1, 7, StepMovement{.length_m = 2.0}},
                              {1, 8, JumpMovement{.length_m = 4.0}},
                              {1, 9, StepMovement{.length_m = 1.3, .exact_only = true}},
                              {1, 10, StepMovement{.at_m = DVec3(0.0, 0.0, 3.0)}}},
                             10);
  ASSERT_EQ(rejected.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(rejected[i].type, protocol::EventType::kRejected);
    EXPECT_EQ(rejected[i].request_id, 7 + i);
    EXPECT_EQ(rejected[i].code, StatusCode::kOutOfRange);
    EXPECT_GT(rejected[i].missed_m, i == 2 ? 0.001 : 0.2);
    EXPECT_FALSE(rejected[i].reason.empty());
  }
  const protocol::NearestMovement step = rejected[0].nearest;
  EXPECT_NEAR(step.length_m + rejected[0].missed_m, 2.0, 1e-6);
  EXPECT_GT(step.side_m, 0.05);
  const protocol::NearestMovement jump = rejected[1].nearest;
  EXPECT_NEAR(jump.length_m + rejected[1].missed_m, 4.0, 1e-6);
  EXPECT_EQ(jump.side_m, 0.0);
  EXPECT_NEAR(rejected[1].position_m.z, jump.length_m, 1e-6);
  EXPECT_LT(rejected[2].nearest.length_m, 1.3);
  EXPECT_NEAR(rejected[3].position_m.z + rejected[3].missed_m, 3.0, 0.1);

  const auto played = hear({{1, 11, StepMovement{.length_m = step.length_m}},
                            {1, 12, StepMovement{.length_m = 2.0, .allow_nearest = true}},
                            {1, 13, JumpMovement{.length_m = 4.0, .allow_nearest = true}},
                            {1, 14, JumpMovement{.length_m = jump.length_m}}},
                           14);
  ASSERT_EQ(played.size(), 5u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(played[i].type, protocol::EventType::kStarted);
    EXPECT_EQ(played[i].request_id, 11 + i);
  }
  EXPECT_TRUE(played[1].clamped && played[2].clamped);
}

TEST_F(ServerSessionOfOne, ReportsWalkingSpeedsThatTheLibraryDoesNotHave) {
  const auto walk = [](double z_m, std::optional<double> speed_m_s) {
    return protocol::WalkMovement{DVec3(0.0, 0.0, z_m), 0.0, {}, speed_m_s};
  };
  const auto reply = client_.Request(
      world_, {{1, 7, walk(1.0, std::nullopt)}, {1, 8, walk(7.0, 0.7)}, {1, 9, walk(13.0, 4.0)}});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->code, StatusCode::kOk);
  EXPECT_EQ(reply->accepted, 3u);
  EXPECT_TRUE(reply->items.empty());
  EXPECT_TRUE(reply->text.starts_with("items[2].speed_m_s: the library walks at ")) << reply->text;
  std::map<protocol::RequestId, protocol::Event> accepted;
  std::map<protocol::RequestId, protocol::Event> arrived;
  while (arrived.size() < 3) {
    const auto events = client_.Await<protocol::Events>();
    ASSERT_TRUE(events);
    for (const protocol::Event& event : events->events) {
      ASSERT_NE(event.type, protocol::EventType::kRejected) << event.reason;
      if (event.type == protocol::EventType::kAccepted) accepted[event.request_id] = event;
      if (event.type == protocol::EventType::kFinished &&
          event.kind == protocol::MovementKind::kStand) {
        arrived[event.request_id] = event;
      }
    }
  }
  EXPECT_EQ(accepted[7].speed_m_s, 0.0);
  EXPECT_EQ(accepted[8].speed_m_s, 0.7);
  EXPECT_FALSE(accepted[8].clamped);
  EXPECT_TRUE(accepted[9].clamped);
  const double fastest_m_s = accepted[9].speed_m_s;
  EXPECT_GT(fastest_m_s, 0.8);
  EXPECT_LT(fastest_m_s, 2.5);
  EXPECT_EQ(arrived[7].speed_m_s, 0.0) << "too few steps";
  EXPECT_NEAR(arrived[8].speed_m_s, 0.7, 0.07);
  EXPECT_NEAR(arrived[9].speed_m_s, fastest_m_s, 0.05 * fastest_m_s);
}

TEST(ServerSession, AcceptsLayersOnlyWithTheirFeature) {
  server::Config config = TestConfig();
  config.shards = 3;
  config.library = "builtin";
  TestServer server(config);
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("hall");
  ASSERT_TRUE(world);
  EXPECT_EQ(world->layers, (std::vector<std::string>{"wave", "carry"}));
  ASSERT_TRUE(client.Spawn(world->world, {{1, {}}, {2, {}}, {3, {}}}));
  const auto set = [](RawClient& who, protocol::WorldId id,
                      std::vector<protocol::LayerItem> items) {
    who.Send(protocol::SetLayers{.seq = who.NextSeq(), .world = id, .items = std::move(items)});
    return who.Await<Reply>();
  };
  const auto reply = set(client, world->world,
                         {{1, "wave"},
                          {9, "wave"},
                          {2, "dance"},
                          {3, "carry", true, 2.0},
                          {3, "carry", true, 1.0, 11.0},
                          {2, "wave", true, 1.0, 0.3, 0.0},
                          {3, "carry"},
                          {2, "carry", false}});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->code, StatusCode::kOk);
  EXPECT_EQ(reply->accepted, 3u);
  std::vector<std::pair<std::uint32_t, StatusCode>> refused;
  for (const protocol::ReplyItem& item : reply->items) refused.emplace_back(item.index, item.code);
  EXPECT_EQ(refused,
            (std::vector<std::pair<std::uint32_t, StatusCode>>{{1, StatusCode::kNoSuchAvatar},
                                                               {2, StatusCode::kNoMovement},
                                                               {3, StatusCode::kOutOfRange},
                                                               {4, StatusCode::kOutOfRange},
                                                               {5, StatusCode::kOutOfRange}}));

  // The state contains the next landing of each foot and the active layers.
  const protocol::WalkMovement walk{DVec3(0.0, 0.0, 3.0), 0.0, {}, std::nullopt};
  EXPECT_EQ(client.Request(world->world, {{3, 7, walk}})->accepted, 1u);
  const auto inspect = [&](protocol::AvatarId avatar) {
    client.Send(protocol::InspectAvatar{.nonce = avatar, .world = world->world, .avatar = avatar});
    return client.Await<protocol::AvatarState>();
  };
  auto state = inspect(3);
  while (state && (!state->movement || state->movement->landings.empty())) state = inspect(3);
  ASSERT_TRUE(state);
  ASSERT_EQ(state->movement->landings.size(), 1u);
  EXPECT_GT(state->movement->landings[0].position_m.z, 0.05);
  EXPECT_LT(state->movement->landings[0].position_m.z, 1.2);
  EXPECT_EQ(state->movement->landings[0].foot,
            state->movement->kind == protocol::MovementKind::kStepLeft
                ? protocol::FootSide::kLeft
                : protocol::FootSide::kRight);
  ASSERT_EQ(state->layers.size(), 1u);
  EXPECT_EQ(state->layers[0].layer, "carry");
  EXPECT_GE(state->layers[0].weight, 0.0);
  EXPECT_LE(state->layers[0].weight, 1.0);
  EXPECT_FALSE(state->layers[0].is_ending);

  RawClient observer = server.Connect();
  ASSERT_TRUE(observer.SayHello() && observer.Join("hall", protocol::Role::kObserver));
  const auto not_allowed = set(observer, world->world, {{1, "wave"}});
  ASSERT_TRUE(not_allowed);
  EXPECT_EQ(not_allowed->code, StatusCode::kNotAllowed);
}

TEST(ServerSession, SetsPlanting) {
  server::Config config = TestConfig();
  config.shards = 3;
  config.library = "builtin";
  TestServer server(config);
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("hall");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{1, {}}, {2, {}}, {3, {}}}));
  const auto set = [&](RawClient& who, std::vector<protocol::AvatarId> avatars, bool enabled) {
    who.Send(protocol::SetPlanting{
        .seq = who.NextSeq(), .world = world->world, .avatars = avatars, .enabled = enabled});
    return who.Await<Reply>();
  };
  const auto is_enabled = [&](protocol::AvatarId avatar) {
    client.Send(protocol::InspectAvatar{.nonce = avatar, .world = world->world, .avatar = avatar});
    const auto state = client.Await<protocol::AvatarState>();
    EXPECT_TRUE(state && state->code == StatusCode::kOk);
    return state->planting_enabled;
  };
  const auto reply = set(client, {1, 9, 3}, false);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->code, StatusCode::kOk);
  EXPECT_EQ(reply->accepted, 2u);
  ASSERT_EQ(reply->items.size(), 1u);
  EXPECT_EQ(reply->items[0].index, 1u);
  EXPECT_EQ(reply->items[0].code, StatusCode::kNoSuchAvatar);
  EXPECT_FALSE(is_enabled(1));
  EXPECT_TRUE(is_enabled(2));
  EXPECT_FALSE(is_enabled(3));

  const protocol::StepMovement must{.foot = protocol::FootChoice::kLeft,
                                    .at_m = DVec3(0.1, 0.0, 0.3),
                                    .heading_rad = 0.0,
                                    .exact_only = true};
  const auto sliding = client.Request(world->world, {{1, 7, must}, {2, 8, must}});
  ASSERT_TRUE(sliding);
  EXPECT_EQ(sliding->accepted, 1u);
  ASSERT_EQ(sliding->items.size(), 1u);
  EXPECT_EQ(sliding->items[0].code, StatusCode::kNoMovement);
  ASSERT_TRUE(set(client, {1}, true));
  EXPECT_TRUE(is_enabled(1));
  EXPECT_EQ(client.Request(world->world, {{1, 9, must}})->accepted, 1u);

  RawClient observer = server.Connect();
  ASSERT_TRUE(observer.SayHello() && observer.Join("hall", protocol::Role::kObserver));
  EXPECT_EQ(set(observer, {1}, false)->code, StatusCode::kNotAllowed);
}

TEST_F(ServerSessionOfOne, StepsToAFootprint) {
  const protocol::StepMovement step{
      .foot = protocol::FootChoice::kLeft, .at_m = DVec3(0.1, 0.0, 0.3), .heading_rad = 0.0};
  const auto reply = client_.Request(world_, {{1, 7, step}});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->accepted, 1u) << (reply->items.empty() ? "" : reply->items[0].text);
}

}  // namespace
}  // namespace stridewire
