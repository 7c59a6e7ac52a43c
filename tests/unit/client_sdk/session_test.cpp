#include "session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "stridewire/protocol/decode.h"
#include "test_world.h"

namespace stridewire::client {
namespace {

using protocol::Message;
using State = Session::State;

/// Simulates server and clock without sockets and threads.
class SessionTest : public testing::Test {
 protected:
  void Use(const SessionOptions& options) { session_ = std::make_unique<Session>(options); }

  void SetUp() override { Use({}); }

  /// Lets the next attempt to connect succeed and returns the Hello.
  protocol::Hello Connect() {
    for (int i = 0; i < 1000 && !session_->ConnectDue(now_s_); ++i) now_s_ += 0.01;
    EXPECT_TRUE(session_->ConnectDue(now_s_));
    session_->StartConnecting(now_s_);
    session_->OnConnected(now_s_);
    reader_.emplace(protocol::Sender::kClient);
    const auto sent = Sent();
    EXPECT_EQ(sent.size(), 1u);
    return sent.empty() ? protocol::Hello{} : std::get<protocol::Hello>(sent[0]);
  }

  void Ready(bool resumed = false) {
    Connect();
    Receive(test_world::Welcome(resumed));
    EXPECT_EQ(session_->state(), State::kReady);
  }

  /// Connects and joins world "plaza", which has server id 5.
  stridewire_world Joined() {
    EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
    Ready();
    stridewire_world world = 0;
    EXPECT_EQ(session_->JoinWorld("plaza", protocol::Role::kController, world, command_),
              STRIDEWIRE_OK);
    AnswerJoin();
    return world;
  }

  /// Answers the pending JoinWorld.
  void AnswerJoin(protocol::WorldId server_id = 5) {
    const auto sent = Sent();
    ASSERT_GE(sent.size(), 1u);
    const auto& join = std::get<protocol::JoinWorld>(sent[0]);
    Receive(test_world::WorldInfo(join.seq, server_id, join.name));
    Receive(test_world::Ok(join.seq));
  }

  template <typename M>
  void Receive(const M& message) {
    std::vector<std::byte> frame;
    const Status status = encoder_.Encode(message, frame);
    ASSERT_TRUE(status) << Describe(status.error());
    session_->OnBytes(frame, now_s_);
  }

  /// Returns the messages sent since the last call, except pings.
  std::vector<Message> Sent() {
    std::vector<Message> messages;
    std::vector<std::byte> bytes;
    while (session_->TakeOutput(bytes)) {
      session_->OnOutputWritten();
      std::span<const std::byte> rest(bytes);
      for (;;) {
        auto frame = reader_->Next(rest);
        EXPECT_TRUE(frame) << Describe(frame.error());
        if (!frame || !*frame) break;
        auto message = protocol::DecodeMessage(**frame);
        EXPECT_TRUE(message) << Describe(message.error());
        if (!message) break;
        if (std::holds_alternative<protocol::Ping>(*message)) {
          ++pings_;
        } else {
          messages.push_back(std::move(*message));
        }
      }
    }
    return messages;
  }

  std::vector<stridewire_event> Events() {
    std::vector<stridewire_event> events(session_->events().size());
    session_->events().Take(events);
    return events;
  }
  std::vector<int> EventTypes() {
    std::vector<int> types;
    for (const auto& event : Events()) types.push_back(event.type);
    return types;
  }

  static protocol::Spawn SpawnOf(std::vector<std::uint32_t> avatars) {
    protocol::Spawn spawn;
    for (const std::uint32_t a : avatars) spawn.items.push_back({a, {DVec3(a, 0.0, 0.0), 0.5}});
    return spawn;
  }
  static protocol::Request StepOf(std::uint32_t avatar, std::uint64_t request_id) {
    protocol::StepMovement step;
    step.length_m = 0.6;
    return {0, 0, {{avatar, request_id, step}}};
  }
  static protocol::Reply SpawnReply(const protocol::Spawn& spawn) {
    protocol::Reply reply =
        test_world::Ok(spawn.seq, static_cast<std::uint32_t>(spawn.items.size()));
    for (std::uint32_t i = 0; i < spawn.items.size(); ++i) {
      reply.items.push_back({i, spawn.items[i].avatar, 0, protocol::StatusCode::kOk, ""});
    }
    return reply;
  }

  std::unique_ptr<Session> session_;
  double now_s_ = 1.0;
  std::uint64_t command_ = 0;
  std::optional<protocol::FrameReader> reader_;
  protocol::Encoder encoder_;
  int pings_ = 0;
};

TEST_F(SessionTest, JoinsAWorld) {
  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  const protocol::Hello hello = Connect();
  EXPECT_TRUE(hello.resume_token.empty());
  stridewire_world world = 0;
  // A command before Welcome waits.
  EXPECT_EQ(session_->JoinWorld("plaza", protocol::Role::kObserver, world, command_),
            STRIDEWIRE_OK);
  EXPECT_TRUE(Sent().empty());
  Receive(test_world::Welcome());
  AnswerJoin();
  EXPECT_THAT(EventTypes(),
              testing::ElementsAre(STRIDEWIRE_EVENT_CONNECTED, STRIDEWIRE_EVENT_WORLD_JOINED,
                                   STRIDEWIRE_EVENT_REPLY));
  ASSERT_NE(session_->FindWorld(world), nullptr);
  EXPECT_EQ(session_->FindWorld(world)->skeleton().joints.size(), 3u);
}

TEST_F(SessionTest, EarlyCommandsWaitForTheWorldInOrder) {
  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  stridewire_world world = 0;
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->JoinWorld("plaza", protocol::Role::kController, world, command_), 0);
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1, 2}), command_), 0);
  EXPECT_EQ(session_->Request(world, StepOf(1, 10), command_), 0);
  EXPECT_EQ(session_->Observe(world, {}, subscription, command_), 0);
  Ready();
  AnswerJoin();
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 3u);
  EXPECT_EQ(std::get<protocol::Spawn>(sent[0]).seq, 2u);
  EXPECT_EQ(std::get<protocol::Spawn>(sent[0]).world, 5u);
  EXPECT_EQ(std::get<protocol::Request>(sent[1]).seq, 3u);
  EXPECT_EQ(std::get<protocol::Observe>(sent[2]).seq, 4u);
  EXPECT_EQ(std::get<protocol::Observe>(sent[2]).subscription, subscription);
}

TEST_F(SessionTest, ResendsUnansweredCommandsWithTheirSeq) {
  const stridewire_world world = Joined();
  for (std::uint64_t r = 1; r <= 4; ++r) {
    EXPECT_EQ(session_->Request(world, StepOf(1, r), command_), STRIDEWIRE_OK);
  }
  const auto first = Sent();
  ASSERT_EQ(first.size(), 4u);
  Receive(test_world::Ok(std::get<protocol::Request>(first[1]).seq));  // answers the second only
  (void)Events();
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "pulled", now_s_);
  EXPECT_EQ(session_->Request(world, StepOf(1, 5), command_),
            STRIDEWIRE_OK);  // without a connection

  const protocol::Hello hello = Connect();
  EXPECT_EQ(hello.resume_token, test_world::Welcome().resume_token);
  Receive(test_world::Welcome(true));
  Receive(test_world::WorldInfo(0, 5, "plaza"));
  const auto again = Sent();
  ASSERT_EQ(again.size(), 4u);
  EXPECT_EQ(std::get<protocol::Request>(again[0]), std::get<protocol::Request>(first[0]));
  EXPECT_EQ(std::get<protocol::Request>(again[1]), std::get<protocol::Request>(first[2]));
  EXPECT_EQ(std::get<protocol::Request>(again[2]), std::get<protocol::Request>(first[3]));
  EXPECT_EQ(std::get<protocol::Request>(again[3]).seq, 6u);  // the new command
  EXPECT_EQ(session_->Statistics().commands_resent, 3u);
  for (const auto& m : again) Receive(test_world::Ok(std::get<protocol::Request>(m).seq));
  Receive(test_world::Ok(std::get<protocol::Request>(again[0]).seq));  // a second Reply is ignored

  EXPECT_THAT(EventTypes(),
              testing::ElementsAre(STRIDEWIRE_EVENT_CONNECTION_LOST, STRIDEWIRE_EVENT_CONNECTED,
                                   STRIDEWIRE_EVENT_REPLY, STRIDEWIRE_EVENT_REPLY,
                                   STRIDEWIRE_EVENT_REPLY, STRIDEWIRE_EVENT_REPLY));
  EXPECT_EQ(session_->Statistics().commands_waiting, 0u);
}

// Simulates a correct server with random losses. Each command is executed and answered once, in
// order.
TEST_F(SessionTest, CommandsAreExecutedOnceDespiteConnectionLosses) {
  const std::uint64_t seed = 77;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  const stridewire_world world = Joined();
  (void)Events();
  constexpr std::uint64_t kCommands = 500;
  std::uint64_t given = 0;
  std::vector<std::uint64_t> done;
  std::set<protocol::Seq> taken;
  protocol::Seq last_seq = 1;  // of JoinWorld
  std::uint64_t replies = 0;
  int breaks = 0;
  for (int round = 0; round < 20'000 && replies < kCommands; ++round) {
    while (given < kCommands && random() % 3 != 0) {
      ASSERT_EQ(session_->Request(world, StepOf(1, given + 1), command_), STRIDEWIRE_OK);
      ++given;
    }
    for (const Message& m : Sent()) {
      const auto& request = std::get<protocol::Request>(m);
      if (random() % 8 == 0) break;  // the remaining messages are lost
      if (request.seq <= last_seq) {
        ASSERT_TRUE(taken.contains(request.seq));
      } else {
        ASSERT_EQ(request.seq, last_seq + 1) << "a gap";
        last_seq = request.seq;
        taken.insert(request.seq);
        done.push_back(request.items[0].request_id);
      }
      if (random() % 4 != 0) Receive(test_world::Ok(request.seq));  // otherwise the Reply is lost
    }
    // With TCP, losses occur only together with the connection.
    session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
    ++breaks;
    Ready(true);
    Receive(test_world::WorldInfo(0, 5, "plaza"));
    for (const auto& event : Events()) replies += event.type == STRIDEWIRE_EVENT_REPLY;
  }
  EXPECT_EQ(replies, kCommands);
  ASSERT_EQ(done.size(), kCommands);
  for (std::uint64_t i = 0; i < kCommands; ++i) EXPECT_EQ(done[i], i + 1);
  EXPECT_GT(breaks, 50);
}

TEST_F(SessionTest, RestoresWorldsAndSubscriptionsAfterALostSession) {
  const stridewire_world world = Joined();
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->Observe(world, {}, subscription, command_), STRIDEWIRE_OK);
  const std::uint64_t observe_command = command_;
  EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), STRIDEWIRE_OK);
  const std::uint64_t request_command = command_;
  (void)Sent();  // both are unanswered when the server stops
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  EXPECT_EQ(session_->Request(world, StepOf(1, 2), command_), STRIDEWIRE_OK);
  (void)Events();

  EXPECT_EQ(Connect().resume_token, test_world::Welcome().resume_token);
  Receive(test_world::Welcome(false));
  AnswerJoin(9);  // the new server assigns another id
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 2u);
  const auto& observe = std::get<protocol::Observe>(sent[0]);
  EXPECT_EQ(observe.seq, 2u);
  EXPECT_EQ(observe.world, 9u);
  EXPECT_EQ(observe.subscription, subscription);
  EXPECT_EQ(std::get<protocol::Request>(sent[1]).items[0].request_id, 2u);
  Receive(test_world::Ok(2));
  Receive(test_world::Ok(3));

  const auto events = Events();
  std::vector<int> types;
  for (const auto& e : events) types.push_back(e.type);
  ASSERT_THAT(types, testing::ElementsAre(STRIDEWIRE_EVENT_CONNECTED, STRIDEWIRE_EVENT_SESSION_LOST,
                                          STRIDEWIRE_EVENT_REPLY, STRIDEWIRE_EVENT_WORLD_JOINED,
                                          STRIDEWIRE_EVENT_REPLY, STRIDEWIRE_EVENT_REPLY));
  EXPECT_EQ(events[0].resumed, 0);
  EXPECT_EQ(events[2].command, request_command);  // the outcome is unknown
  EXPECT_EQ(events[2].status, STRIDEWIRE_SESSION_LOST);
  EXPECT_EQ(events[3].world, world);  // the application uses the same number as before
  EXPECT_EQ(events[4].command, observe_command);
  EXPECT_EQ(events[4].status, STRIDEWIRE_OK);
}

TEST_F(SessionTest, RespawnsAvatarsAtTheirLastBaseFrames) {
  SessionOptions options;
  options.respawn = true;
  Use(options);
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1, 2, 3}), command_), STRIDEWIRE_OK);
  Receive(SpawnReply(std::get<protocol::Spawn>(Sent().at(0))));
  protocol::Event finished;
  finished.type = protocol::EventType::kFinished;
  finished.avatar = 1;
  finished.base = {DVec3(4.0, 0.0, 7.0), 1.25};
  protocol::Event removed;
  removed.type = protocol::EventType::kRemoved;
  removed.avatar = 2;
  protocol::Event other = finished;
  other.avatar = 44;  // belongs to another client
  Receive(protocol::Events{5, 1, 100, {finished, removed, other}});
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  (void)Events();

  Ready(false);
  AnswerJoin();
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 1u);
  const auto& spawn = std::get<protocol::Spawn>(sent[0]);
  ASSERT_EQ(spawn.items.size(), 2u);
  EXPECT_EQ(spawn.items[0], (protocol::SpawnItem{1, finished.base}));
  EXPECT_EQ(spawn.items[1], (protocol::SpawnItem{3, {DVec3(3.0, 0.0, 0.0), 0.5}}));

  // One avatar still exists, which is not an error. Replies to own commands cause no events.
  protocol::Reply reply = SpawnReply(spawn);
  reply.items[0].code = protocol::StatusCode::kAvatarExists;
  Receive(reply);
  EXPECT_THAT(EventTypes(),
              testing::ElementsAre(STRIDEWIRE_EVENT_CONNECTED, STRIDEWIRE_EVENT_SESSION_LOST,
                                   STRIDEWIRE_EVENT_WORLD_JOINED));

  // Lose the session again before the Reply.
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(false);
  AnswerJoin();
  EXPECT_EQ(std::get<protocol::Spawn>(Sent().at(0)).items.size(), 2u);
}

TEST_F(SessionTest, DoesNotRespawnByDefault) {
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_OK);
  Receive(SpawnReply(std::get<protocol::Spawn>(Sent().at(0))));
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(false);
  AnswerJoin();
  EXPECT_TRUE(Sent().empty());
}

TEST_F(SessionTest, IgnoresEventsThatWereAlreadyReceived) {
  const stridewire_world world = Joined();
  (void)Events();
  protocol::Event idle;
  idle.type = protocol::EventType::kIdle;
  idle.avatar = 1;
  Receive(protocol::Events{5, 1, 10, {idle}});
  Receive(protocol::Events{5, 2, 11, {idle}});
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  EXPECT_EQ(Connect().last_events_number, 2u);
  Receive(test_world::Welcome(true));
  Receive(test_world::WorldInfo(0, 5, "plaza"));
  Receive(protocol::Events{5, 2, 11, {idle}});
  Receive(protocol::Events{5, 3, 12, {idle}});
  int idles = 0;
  for (const auto& event : Events()) {
    if (event.type != STRIDEWIRE_EVENT_IDLE) continue;
    ++idles;
    EXPECT_EQ(event.world, world);
  }
  EXPECT_EQ(idles, 3);
}

TEST_F(SessionTest, AResumeIsADiscontinuity) {
  const stridewire_world world = Joined();
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->Observe(world, {}, subscription, command_), STRIDEWIRE_OK);
  Receive(test_world::Ok(std::get<protocol::Observe>(Sent().at(0)).seq));
  session_->OnBytes(test_world::PoseFrame(5, 60, {{1}}), now_s_);
  session_->OnBytes(test_world::PoseFrame(5, 61, {{1}}), now_s_);
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(true);
  Receive(test_world::WorldInfo(0, 5, "plaza"));
  session_->OnBytes(test_world::PoseFrame(5, 90, {{1}}), now_s_);
  session_->OnBytes(test_world::PoseFrame(5, 91, {{1}}), now_s_);
  const PoseHistory* history = session_->FindWorld(world)->Find(1);
  ASSERT_NE(history, nullptr);
  ASSERT_EQ(history->size(), 4u);
  EXPECT_FALSE(history->stamp(1).discontinuity);
  EXPECT_TRUE(history->stamp(2).discontinuity);
  EXPECT_FALSE(history->stamp(3).discontinuity);
  EXPECT_EQ(session_->Statistics().batches_missing, 0u);
}

TEST_F(SessionTest, DiscardsPosesAfterALostSession) {
  const stridewire_world world = Joined();
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->Observe(world, {}, subscription, command_), STRIDEWIRE_OK);
  Receive(test_world::Ok(std::get<protocol::Observe>(Sent().at(0)).seq));
  session_->OnBytes(test_world::PoseFrame(5, 6000, {{1}}), now_s_);
  EXPECT_TRUE(session_->clock().ready());
  const std::uint32_t segment = session_->FindWorld(world)->Find(1)->stamp(0).segment;
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(false);
  EXPECT_FALSE(session_->clock().ready());
  EXPECT_EQ(session_->FindWorld(world)->Find(1), nullptr);
  AnswerJoin();
  session_->OnBytes(test_world::PoseFrame(5, 3, {{1}}), now_s_);  // ticks start again
  ASSERT_NE(session_->FindWorld(world)->Find(1), nullptr);
  EXPECT_TRUE(session_->FindWorld(world)->Find(1)->stamp(0).discontinuity);
  EXPECT_NE(session_->FindWorld(world)->Find(1)->stamp(0).segment, segment);
}

protocol::TerrainInfo Slab(double height_m) {
  protocol::TerrainInfo info;
  info.height_field = protocol::HeightFieldInfo{{-2, -2}, 0.5, 3, 2, {0, 0.5f, 0, 1, 0, 0.25f}};
  info.boxes = {{{0, 0}, {1, 2}, height_m}};
  return info;
}

TEST_F(SessionTest, StoresTheLastTerrainOfAWorld) {
  const stridewire_world world = Joined();
  (void)Events();
  EXPECT_FALSE(session_->TerrainOf(world));
  Receive(protocol::WorldTerrain{5, std::nullopt});  // unchanged: no event
  Receive(protocol::WorldTerrain{6, Slab(0.5)});     // belongs to another client
  EXPECT_TRUE(Events().empty());
  Receive(protocol::WorldTerrain{5, Slab(0.5)});
  Receive(protocol::WorldTerrain{5, Slab(0.5)});
  EXPECT_EQ(session_->TerrainOf(world), Slab(0.5));
  const auto events = Events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].type, STRIDEWIRE_EVENT_TERRAIN);
  EXPECT_EQ(events[0].world, world);

  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(true);
  EXPECT_TRUE(session_->TerrainOf(world)) << "resumed: it is still that";
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  (void)Events();
  Ready(false);
  EXPECT_FALSE(session_->TerrainOf(world)) << "the server sends it again in a new session";
  EXPECT_THAT(EventTypes(), testing::Contains(int{STRIDEWIRE_EVENT_TERRAIN}));
}

TEST_F(SessionTest, SendsTerrainFootprintsAndWalks) {
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->SetTerrain(world, {0, 0, Slab(0.25)}, command_), STRIDEWIRE_OK);
  protocol::Request request = StepOf(1, 9);
  request.items[0].movement =
      protocol::StepMovement{.at_m = DVec3(1.0, 0.25, -2.0), .heading_rad = 0.5};
  EXPECT_EQ(session_->Request(world, request, command_), STRIDEWIRE_OK);
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(std::get<protocol::SetTerrain>(sent[0]), (protocol::SetTerrain{2, 5, Slab(0.25)}));
  EXPECT_EQ(std::get<protocol::Request>(sent[1]).items[0].movement, request.items[0].movement);

  protocol::Request walk = StepOf(1, 10);
  walk.items[0].movement =
      protocol::WalkMovement{DVec3(1.0, 0.0, 2.0), 0.5, {DVec3(0.0, 0.0, 1.0)}, 1.25};
  EXPECT_EQ(session_->Request(world, walk, command_), STRIDEWIRE_OK);
  const auto walks = Sent();
  ASSERT_EQ(walks.size(), 1u);
  EXPECT_EQ(std::get<protocol::Request>(walks[0]).items[0].movement, walk.items[0].movement);

  protocol::SetTerrain bad{0, 0, Slab(0.25)};
  bad.terrain->height_field->heights_m.pop_back();
  EXPECT_NE(session_->SetTerrain(world, bad, command_), STRIDEWIRE_OK);
  EXPECT_THAT(session_->last_text(), testing::HasSubstr("heights_m"));
}

TEST_F(SessionTest, SendsExactFootprints) {
  protocol::Request request = StepOf(1, 9);
  protocol::StepMovement step{
      .at_m = DVec3(1.0, 0.25, -2.0), .heading_rad = 0.5, .exact_only = true};
  request.items[0].movement = step;
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->Request(world, request, command_), STRIDEWIRE_OK);
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(std::get<protocol::Request>(sent[0]).items, request.items);
}

TEST_F(SessionTest, ReportsWhatARejectedStepMissed) {
  const stridewire_world world = Joined();
  (void)Events();
  protocol::Event rejected{.type = protocol::EventType::kRejected,
                           .avatar = 41,
                           .request_id = 9,
                           .kind = protocol::MovementKind::kStepRight,
                           .foot = protocol::FootSide::kRight,
                           .position_m = DVec3(1.0, 0.0, 2.0),
                           .code = protocol::StatusCode::kOutOfRange,
                           .reason = "the step is out of reach",
                           .missed_m = 0.5,
                           .missed_rad = 0.25,
                           .nearest = {.length_m = 0.75,
                                       .side_m = 0.125,
                                       .height_m = -0.5,
                                       .turn_rad = 0.375,
                                       .heading_rad = 1.5}};
  protocol::Event arrived{
      .type = protocol::EventType::kFinished, .avatar = 41, .request_id = 10, .speed_m_s = 1.25};
  Receive(protocol::Events{5, 1, 100, {rejected, arrived}});
  const auto events = Events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].type, STRIDEWIRE_EVENT_REJECTED);
  EXPECT_EQ(events[0].status, STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(events[0].world, world);
  EXPECT_EQ(events[0].foot, STRIDEWIRE_FOOT_RIGHT);
  EXPECT_EQ(events[0].position_m[2], 2.0);
  EXPECT_EQ(events[0].missed_m, 0.5);
  EXPECT_EQ(events[0].missed_rad, 0.25);
  EXPECT_EQ(events[0].nearest_length_m, 0.75);
  EXPECT_EQ(events[0].nearest_side_m, 0.125);
  EXPECT_EQ(events[0].nearest_height_m, -0.5);
  EXPECT_EQ(events[0].nearest_turn_rad, 0.375);
  EXPECT_EQ(events[0].nearest_heading_rad, 1.5);
  EXPECT_EQ(events[0].speed_m_s, 0.0);
  EXPECT_EQ(events[1].speed_m_s, 1.25);
  EXPECT_EQ(events[1].missed_m, 0.0);
}

TEST_F(SessionTest, SendsPlanting) {
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->SetPlanting(world, {0, 0, {4, 5}, false}, command_), STRIDEWIRE_OK);
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(std::get<protocol::SetPlanting>(sent[0]).avatars,
            (std::vector<protocol::AvatarId>{4, 5}));
  EXPECT_FALSE(std::get<protocol::SetPlanting>(sent[0]).enabled);
}

TEST_F(SessionTest, ObservesMovementsAfterFetchingTheLibrary) {
  const stridewire_world world = Joined();
  (void)Events();
  std::uint32_t subscription = 0;
  // The library hash of the test world is not valid.
  EXPECT_EQ(session_->Observe(world, {.mode = protocol::PoseMode::kMovement, .avatars = {}},
                              subscription, command_),
            STRIDEWIRE_OK);
  EXPECT_TRUE(Sent().empty());
  auto events = Events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].command, command_);
  EXPECT_EQ(events[0].status, STRIDEWIRE_UNSUPPORTED);

  protocol::WorldInfo info = test_world::WorldInfo(0, 5, "plaza");
  info.library_hash = std::string(32, 'a');
  Receive(info);
  EXPECT_EQ(session_->Observe(world, {.mode = protocol::PoseMode::kMovement, .avatars = {}},
                              subscription, command_),
            STRIDEWIRE_OK);
  EXPECT_TRUE(Sent().empty());
  auto task = session_->TakeLibraryTask();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->hash, info.library_hash);
  session_->OnLibraryTask(task->hash, RunLibraryTask(*task));
  auto sent = Sent();
  ASSERT_EQ(sent.size(), 1u);
  const auto question = std::get<protocol::FetchLibrary>(sent[0]);
  EXPECT_EQ(question.hash, info.library_hash);
  EXPECT_EQ(question.offset, 0u);

  // An invalid library ends the Observe. Movements that arrive later are ignored.
  Receive(protocol::LibraryPiece{.nonce = question.nonce,
                                 .hash = question.hash,
                                 .total_bytes = 100,
                                 .bytes = std::vector<std::byte>(100)});
  task = session_->TakeLibraryTask();
  ASSERT_TRUE(task);
  EXPECT_TRUE(Events().empty());
  session_->OnLibraryTask(task->hash, RunLibraryTask(*task));
  EXPECT_TRUE(Sent().empty());
  events = Events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].command, command_);
  EXPECT_EQ(events[0].status, STRIDEWIRE_MALFORMED);
  Receive(protocol::Movements{.world = 5, .step = 1});
  EXPECT_EQ(session_->state(), State::kReady);
}

TEST_F(SessionTest, LimitsUnansweredCommands) {
  SessionOptions options;
  options.max_commands = 10;
  Use(options);
  const stridewire_world world = Joined();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), 0);
  EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), STRIDEWIRE_COMMANDS_FULL);
  Receive(test_world::Ok(2));
  EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), STRIDEWIRE_OK);

  options = {};
  options.max_command_bytes = 64 * 1024;
  Use(options);
  const stridewire_world other = Joined();
  std::vector<std::uint32_t> crowd(10'000, 1);
  EXPECT_EQ(session_->Remove(other, {0, 0, crowd}, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->Remove(other, {0, 0, crowd}, command_), STRIDEWIRE_COMMANDS_FULL);
  EXPECT_LE(session_->Statistics().buffered_bytes, 2u << 20);
}

TEST_F(SessionTest, LimitsSentCommandsToTheReplyMemory) {
  SessionOptions options;
  options.max_commands = 100;
  Use(options);
  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  Connect();
  protocol::Welcome welcome = test_world::Welcome();
  welcome.limits.reply_memory = 4;
  Receive(welcome);
  stridewire_world world = 0;
  EXPECT_EQ(session_->JoinWorld("plaza", protocol::Role::kController, world, command_), 0);
  AnswerJoin();
  for (int i = 0; i < 50; ++i) EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), 0);
  EXPECT_EQ(Sent().size(), 4u);
  Receive(test_world::Ok(2));
  Receive(test_world::Ok(4));
  EXPECT_EQ(Sent().size(), 2u);
}

TEST_F(SessionTest, RejectsInvalidArgumentsAndNamesThem) {
  const stridewire_world world = Joined();
  protocol::Request nan = StepOf(1, 1);
  std::get<protocol::StepMovement>(nan.items[0].movement).length_m = std::nan("");
  EXPECT_EQ(session_->Request(world, nan, command_), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_THAT(session_->last_text(), testing::HasSubstr("length_m"));
  EXPECT_EQ(session_->Request(world, StepOf(0, 1), command_), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(session_->Request(world, StepOf(1, 0), command_), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_NE(session_->Spawn(world, {}, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->Spawn(77, SpawnOf({1}), command_), STRIDEWIRE_NO_SUCH_WORLD);
  std::uint32_t subscription = 0;
  protocol::Observe never;
  never.every_n_ticks = 0;
  EXPECT_EQ(session_->Observe(world, never, subscription, command_), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(session_->StopObserving(9, command_), STRIDEWIRE_NO_SUCH_SUBSCRIPTION);
  stridewire_world second = 0;
  EXPECT_EQ(session_->JoinWorld("plaza", protocol::Role::kObserver, second, command_),
            STRIDEWIRE_ALREADY_JOINED);
  EXPECT_NE(session_->JoinWorld("", protocol::Role::kObserver, second, command_), STRIDEWIRE_OK);
  EXPECT_NE(session_->JoinWorld(std::string(65, 'x'), protocol::Role::kObserver, second, command_),
            STRIDEWIRE_OK);
  EXPECT_TRUE(Sent().empty());
}

TEST_F(SessionTest, ARefusedJoinEndsWaitingCommands) {
  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  Ready();
  stridewire_world world = 0;
  EXPECT_EQ(session_->JoinWorld("nowhere", protocol::Role::kObserver, world, command_), 0);
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_OK);
  protocol::Reply refusal = test_world::Ok(1);
  refusal.code = protocol::StatusCode::kNoSuchWorld;
  refusal.text = "there is no world \"nowhere\"";
  (void)Sent();
  Receive(refusal);
  const auto events = Events();
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[1].status, STRIDEWIRE_NO_SUCH_WORLD);
  EXPECT_EQ(events[2].status, STRIDEWIRE_NOT_JOINED);
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_NOT_JOINED);
  EXPECT_EQ(session_->JoinWorld("nowhere", protocol::Role::kObserver, world, command_),
            STRIDEWIRE_OK);
}

TEST_F(SessionTest, LeavesAWorld) {
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->LeaveWorld(world, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_NOT_JOINED);
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 1u);
  Receive(test_world::Ok(std::get<protocol::LeaveWorld>(sent[0]).seq));
  EXPECT_EQ(session_->FindWorld(world), nullptr);
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_NO_SUCH_WORLD);
  EXPECT_EQ(session_->Statistics().commands_waiting, 0u);
}

// The server answers LeaveWorld at once, but a Spawn only after the next tick.
TEST_F(SessionTest, RepliesMayArriveAfterTheReplyToLeaveWorld) {
  const stridewire_world world = Joined();
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_OK);
  const std::uint64_t spawn = command_;
  EXPECT_EQ(session_->Remove(world, {0, 0, {2}}, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->Observe(world, {}, subscription, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->StopObserving(subscription, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->LeaveWorld(world, command_), STRIDEWIRE_OK);
  const std::uint64_t leave = command_;
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 5u);
  (void)Events();
  Receive(test_world::Ok(std::get<protocol::LeaveWorld>(sent[4]).seq));
  Receive(SpawnReply(std::get<protocol::Spawn>(sent[0])));
  Receive(test_world::Ok(std::get<protocol::Remove>(sent[1]).seq));
  Receive(test_world::Ok(std::get<protocol::Observe>(sent[2]).seq));
  protocol::Reply stopped = test_world::Ok(std::get<protocol::StopObserving>(sent[3]).seq);
  stopped.code = protocol::StatusCode::kNoSuchSubscription;
  Receive(stopped);
  EXPECT_EQ(session_->state(), State::kReady);
  const auto events = Events();
  ASSERT_EQ(events.size(), 5u);
  for (const auto& event : events) {
    EXPECT_EQ(event.type, STRIDEWIRE_EVENT_REPLY);
    EXPECT_EQ(event.status, STRIDEWIRE_OK);
  }
  EXPECT_EQ(events[0].command, leave);
  EXPECT_EQ(events[1].command, spawn);
  EXPECT_EQ(session_->Statistics().commands_waiting, 0u);
}

TEST_F(SessionTest, LosesTheSessionAfterTheReplyToLeaveWorld) {
  const stridewire_world world = Joined();
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->Observe(world, {}, subscription, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->LeaveWorld(world, command_), STRIDEWIRE_OK);
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 2u);
  (void)Events();
  Receive(test_world::Ok(std::get<protocol::LeaveWorld>(sent[1]).seq));
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(false);
  std::vector<int> statuses;
  for (const auto& event : Events()) {
    if (event.type == STRIDEWIRE_EVENT_REPLY) statuses.push_back(event.status);
  }
  EXPECT_THAT(statuses, testing::ElementsAre(STRIDEWIRE_OK, STRIDEWIRE_SESSION_LOST));
  EXPECT_EQ(session_->Statistics().commands_waiting, 0u);
}

TEST_F(SessionTest, StopObservingDiscardsThePoses) {
  const stridewire_world world = Joined();
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->Observe(world, {}, subscription, command_), STRIDEWIRE_OK);
  Receive(test_world::Ok(std::get<protocol::Observe>(Sent().at(0)).seq));
  session_->OnBytes(test_world::PoseFrame(5, 1, {{1}}), now_s_);
  EXPECT_EQ(session_->StopObserving(subscription, command_), STRIDEWIRE_OK);
  session_->OnBytes(test_world::PoseFrame(5, 2, {{1}}),
                    now_s_);  // sent before the server handled the command
  EXPECT_EQ(session_->FindWorld(world)->Find(1), nullptr);
  EXPECT_EQ(std::get<protocol::StopObserving>(Sent().at(0)).subscription, subscription);
  // A lost session does not restore the subscription.
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(false);
  AnswerJoin();
  EXPECT_TRUE(Sent().empty());
}

TEST_F(SessionTest, ReportsRefusedItemsAndChosenIds) {
  const stridewire_world world = Joined();
  (void)Events();
  EXPECT_EQ(session_->Spawn(world, SpawnOf({0, 2}), command_), STRIDEWIRE_OK);
  const auto spawn = std::get<protocol::Spawn>(Sent().at(0));
  protocol::Reply reply = test_world::Ok(spawn.seq, 1);
  reply.items = {{0, 17, 0, protocol::StatusCode::kOk, ""},
                 {1, 2, 0, protocol::StatusCode::kAvatarExists, "avatar 2 is there"}};
  Receive(reply);
  const auto events = Events();
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].type, STRIDEWIRE_EVENT_ITEM);
  EXPECT_EQ(events[0].avatar, 17u);
  EXPECT_EQ(events[0].status, STRIDEWIRE_OK);
  EXPECT_EQ(events[1].status, STRIDEWIRE_AVATAR_EXISTS);
  EXPECT_STREQ(events[1].text, "avatar 2 is there");
  EXPECT_EQ(events[2].type, STRIDEWIRE_EVENT_REPLY);
  EXPECT_EQ(events[2].command, command_);
  EXPECT_EQ(events[2].accepted, 1u);
  // The application need not look at the items to see that one of them failed.
  EXPECT_EQ(events[2].status, STRIDEWIRE_AVATAR_EXISTS);
  EXPECT_STREQ(events[2].text, "item 1: avatar 2 is there");
}

TEST_F(SessionTest, RespawnsATeleportedAvatarAtItsNewPlace) {
  SessionOptions options;
  options.respawn = true;
  Use(options);
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_OK);
  Receive(SpawnReply(std::get<protocol::Spawn>(Sent().at(0))));
  const protocol::Placement place{{9.0, 0.0, 8.0}, 0.5};
  // Avatar 2 belongs to another session.
  EXPECT_EQ(session_->Spawn(world, {0, 0, {{1, place, true}, {2, place, true}}}, command_),
            STRIDEWIRE_OK);
  Receive(SpawnReply(std::get<protocol::Spawn>(Sent().at(0))));
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  Ready(false);
  AnswerJoin();
  const auto spawn = std::get<protocol::Spawn>(Sent().at(0));
  ASSERT_EQ(spawn.items.size(), 1u);
  EXPECT_EQ(spawn.items[0], (protocol::SpawnItem{1, place}));
}

TEST_F(SessionTest, ClosesAfterPermanentErrorsAndReconnectsAfterOthers) {
  struct Case {
    protocol::StatusCode code;
    State then;
  };
  for (const Case& c : {Case{protocol::StatusCode::kUnauthorised, State::kClosed},
                        Case{protocol::StatusCode::kVersionMismatch, State::kClosed},
                        Case{protocol::StatusCode::kMalformed, State::kClosed},
                        Case{protocol::StatusCode::kReplaced, State::kClosed},
                        Case{protocol::StatusCode::kTimeout, State::kWaiting},
                        Case{protocol::StatusCode::kTooSlow, State::kWaiting},
                        Case{protocol::StatusCode::kLimitReached, State::kWaiting},
                        Case{static_cast<protocol::StatusCode>(349), State::kWaiting},
                        Case{static_cast<protocol::StatusCode>(149), State::kClosed}}) {
    Use({});
    const stridewire_world world = Joined();
    EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), STRIDEWIRE_OK);
    Receive(protocol::ErrorNotice{c.code, "so it is", true, 0});
    EXPECT_EQ(session_->state(), c.then) << static_cast<int>(c.code);
    EXPECT_EQ(session_->last_text(), "so it is");
    const auto events = Events();
    if (c.then == State::kClosed) {
      ASSERT_GE(events.size(), 2u);
      EXPECT_EQ(events.back().type, STRIDEWIRE_EVENT_CLOSED);
      EXPECT_EQ(events[events.size() - 2].type, STRIDEWIRE_EVENT_REPLY);
      EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), STRIDEWIRE_CLOSED);
      EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
    } else {
      EXPECT_EQ(events.back().type, STRIDEWIRE_EVENT_CONNECTION_LOST);
    }
  }
}

TEST_F(SessionTest, ReconnectsAfterAServerShutdown) {
  (void)Joined();
  (void)Events();
  Receive(protocol::Goodbye{protocol::StatusCode::kShuttingDown, "see you"});
  EXPECT_EQ(session_->state(), State::kWaiting);
  EXPECT_TRUE(Connect().resume_token.empty());
  Receive(test_world::Welcome(false));
  EXPECT_THAT(EventTypes(),
              testing::ElementsAre(STRIDEWIRE_EVENT_CONNECTION_LOST, STRIDEWIRE_EVENT_CONNECTED,
                                   STRIDEWIRE_EVENT_SESSION_LOST));
}

TEST_F(SessionTest, TriesAllAddressesBeforeItWaits) {
  EXPECT_EQ(session_->Open(now_s_, {"a:1", "b:2", "c:3"}), STRIDEWIRE_OK);
  for (int round = 0; round < 3; ++round) {
    for (std::size_t address = 0; address < 3; ++address) {
      ASSERT_TRUE(session_->ConnectDue(now_s_)) << round << ' ' << address;
      session_->StartConnecting(now_s_);
      EXPECT_EQ(session_->address_index(), address);
      session_->OnLost(STRIDEWIRE_CONNECT_FAILED, "refused", now_s_);
    }
    EXPECT_FALSE(session_->ConnectDue(now_s_));
    const double delay_s = session_->NextTime() - now_s_;
    EXPECT_GE(delay_s, 0.5 * Backoff::kFirstS * (1 << round));
    EXPECT_LE(delay_s, Backoff::kFirstS * (1 << round));
    now_s_ = session_->NextTime();
  }
  const auto events = Events();
  ASSERT_EQ(events.size(), 9u);
  EXPECT_EQ(events[1].type, STRIDEWIRE_EVENT_CONNECT_FAILED);
  EXPECT_STREQ(events[1].text, "b:2: refused");
}

TEST_F(SessionTest, ReturnsToTheServerThatCanResumeTheSession) {
  EXPECT_EQ(session_->Open(now_s_, {"a:1", "b:2"}), STRIDEWIRE_OK);
  session_->StartConnecting(now_s_);
  session_->OnLost(STRIDEWIRE_CONNECT_FAILED, "refused", now_s_);
  Ready();
  EXPECT_EQ(session_->address_index(), 1u);
  const auto events = Events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[1].type, STRIDEWIRE_EVENT_CONNECTED);
  EXPECT_STREQ(events[1].text, "b:2");
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  EXPECT_FALSE(session_->ConnectDue(now_s_));
  EXPECT_FALSE(Connect().resume_token.empty());
  EXPECT_EQ(session_->address_index(), 1u);
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  EXPECT_TRUE(session_->ConnectDue(now_s_));  // The session tries the other server at once.
  session_->StartConnecting(now_s_);
  EXPECT_EQ(session_->address_index(), 0u);
}

TEST_F(SessionTest, MovesToTheNextAddressWhenTheServerShutsDown) {
  EXPECT_EQ(session_->Open(now_s_, {"a:1", "b:2"}), STRIDEWIRE_OK);
  Ready();
  (void)Events();
  Receive(protocol::Goodbye{protocol::StatusCode::kShuttingDown, "see you"});
  EXPECT_LE(session_->NextTime() - now_s_, Backoff::kFirstS);
  EXPECT_GT(session_->NextTime(), now_s_);  // A random delay spreads the clients over time.
  EXPECT_TRUE(Connect().resume_token.empty());
  EXPECT_EQ(session_->address_index(), 1u);
  const auto events = Events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].status, STRIDEWIRE_SHUTTING_DOWN);
  EXPECT_STREQ(events[0].text, "a:1: see you");
}

TEST_F(SessionTest, TimesOutIfTheServerIsSilent) {
  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  session_->StartConnecting(now_s_);
  now_s_ += 5.1;
  session_->AdvanceTime(now_s_);  // no TCP connection
  EXPECT_EQ(session_->state(), State::kWaiting);
  EXPECT_EQ(session_->last_status(), STRIDEWIRE_TIMEOUT);
  Connect();
  now_s_ += 5.1;
  session_->AdvanceTime(now_s_);  // no Welcome
  EXPECT_EQ(session_->state(), State::kWaiting);
  Ready();
  now_s_ += 29.0;
  session_->AdvanceTime(now_s_);
  EXPECT_EQ(session_->state(), State::kReady);
  now_s_ += 1.1;
  session_->AdvanceTime(now_s_);  // idle
  EXPECT_EQ(session_->state(), State::kWaiting);
}

TEST_F(SessionTest, PingsWithinTheIdleTimeout) {
  SessionOptions options;
  options.ping_interval_s = 600.0;
  Use(options);
  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  Ready();
  (void)Sent();
  pings_ = 0;
  for (int i = 0; i < 300; ++i) {
    now_s_ += 0.1;
    session_->AdvanceTime(now_s_);
    Receive(protocol::Pong{1, now_s_, 0.0, 0});
  }
  (void)Sent();
  EXPECT_GE(pings_, 2);
  EXPECT_LE(pings_, 4);  // the idle timeout is 30 s, so one ping per 10 s
}

TEST_F(SessionTest, MeasuresTheRoundTrip) {
  EXPECT_EQ(session_->Ping(now_s_), STRIDEWIRE_NOT_READY);
  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  Ready();
  EXPECT_EQ(session_->Ping(now_s_), STRIDEWIRE_OK);
  const double sent_s = now_s_;
  now_s_ += 0.025;
  Receive(protocol::Pong{2, sent_s, 99.0, 40});
  const auto events = Events();
  ASSERT_EQ(events.back().type, STRIDEWIRE_EVENT_PONG);
  EXPECT_NEAR(events.back().rtt_s, 0.025, 1e-9);
  EXPECT_NEAR(session_->Statistics().rtt_s, 0.025, 1e-9);
  EXPECT_NEAR(session_->clock().ServerTime(now_s_), 99.0, 1e-9);
}

TEST_F(SessionTest, CountsDroppedBatches) {
  (void)Joined();
  (void)Events();
  Receive(protocol::Lagging{5, 10, 0});
  Receive(protocol::Lagging{5, 25, 3});
  EXPECT_EQ(session_->Statistics().dropped_batches, 25u);
  const auto events = Events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[1].type, STRIDEWIRE_EVENT_LAGGING);
  EXPECT_EQ(events[1].dropped_events, 3u);
}

TEST_F(SessionTest, DisconnectAnswersCommandsAndSendsGoodbye) {
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->Request(world, StepOf(1, 1), command_), STRIDEWIRE_OK);
  (void)Events();
  session_->Close(now_s_);
  const auto events = Events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].status, STRIDEWIRE_CANCELLED);
  EXPECT_EQ(events[1].type, STRIDEWIRE_EVENT_CLOSED);
  EXPECT_TRUE(session_->NeedsSocket());
  const auto sent = Sent();
  ASSERT_FALSE(sent.empty());
  EXPECT_TRUE(std::holds_alternative<protocol::Goodbye>(sent.back()));
  EXPECT_EQ(session_->state(), State::kIdle);
  EXPECT_FALSE(session_->NeedsSocket());
}

TEST_F(SessionTest, KeepsWorldsWhileClosed) {
  Use({.keep_worlds = true});
  const stridewire_world world = Joined();
  std::uint32_t kept = 0;
  std::uint32_t stopped = 0;
  EXPECT_EQ(session_->Observe(world, {}, kept, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->Observe(world, {}, stopped, command_), STRIDEWIRE_OK);
  session_->Close(now_s_);
  (void)Sent();
  EXPECT_EQ(session_->FindWorldState(world), Session::WorldState::kWanted);
  EXPECT_FALSE(session_->FindWorld(world)->has_info());
  EXPECT_EQ(session_->Spawn(world, SpawnOf({1}), command_), STRIDEWIRE_CLOSED);

  protocol::Observe circle;
  circle.region = protocol::Region{.radius_m = 1.0};
  std::uint32_t moved = 0;
  std::uint32_t unsent = 0;
  EXPECT_EQ(session_->Observe(world, circle, moved, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->Observe(world, {}, unsent, command_), STRIDEWIRE_OK);
  const std::uint64_t unsent_command = command_;
  (void)Events();
  circle.region->radius_m = 2.0;
  EXPECT_EQ(session_->MoveRegion(moved, *circle.region, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->StopObserving(stopped, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->StopObserving(unsent, command_), STRIDEWIRE_OK);
  const auto replies = Events();
  ASSERT_EQ(replies.size(), 4u);
  EXPECT_EQ(replies[0].status, STRIDEWIRE_OK);
  EXPECT_EQ(replies[1].status, STRIDEWIRE_OK);
  EXPECT_EQ(replies[2].command, unsent_command);
  EXPECT_EQ(replies[2].status, STRIDEWIRE_CANCELLED);
  EXPECT_EQ(replies[3].status, STRIDEWIRE_OK);

  stridewire_world other = 0;
  EXPECT_EQ(session_->JoinWorld("plaza", protocol::Role::kObserver, other, command_),
            STRIDEWIRE_ALREADY_JOINED);
  EXPECT_EQ(session_->JoinWorld("yard", protocol::Role::kObserver, other, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->LeaveWorld(other, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->FindWorld(other), nullptr);

  EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  Ready();
  AnswerJoin();
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(std::get<protocol::Observe>(sent[0]).subscription, kept);
  EXPECT_EQ(std::get<protocol::Observe>(sent[1]).subscription, moved);
  EXPECT_EQ(std::get<protocol::Observe>(sent[1]).region, circle.region);
}

TEST_F(SessionTest, InvalidServerMessagesCloseTheConnection) {
  const auto breaks = [&](const auto& say) {
    Use({});
    (void)Joined();
    std::uint32_t subscription = 0;
    EXPECT_EQ(session_->Observe(1, {}, subscription, command_), STRIDEWIRE_OK);
    say();
    EXPECT_EQ(session_->state(), State::kWaiting);
    EXPECT_EQ(session_->last_status(), STRIDEWIRE_PROTOCOL_ERROR);
    EXPECT_FALSE(session_->last_text().empty());
    Ready(true);
  };
  breaks([&] { Receive(test_world::Welcome()); });
  breaks([&] { session_->OnBytes(test_world::PoseFrame(5, 1, {{1}}, {}, 0, 7), now_s_); });
  breaks([&] {
    const std::vector<std::byte> http(64, std::byte{'H'});
    session_->OnBytes(http, now_s_);
  });
  breaks([&] {
    auto frame = test_world::PoseFrame(5, 1, {{1}});
    for (std::size_t i = 24; i < frame.size(); ++i) frame[i] = std::byte{0xff};
    session_->OnBytes(frame, now_s_);
  });
  // Poses of an unknown world are ignored.
  Use({});
  (void)Joined();
  session_->OnBytes(test_world::PoseFrame(999, 1, {{1}}), now_s_);
  EXPECT_EQ(session_->state(), State::kReady);
}

TEST_F(SessionTest, MessagesContainWholeFrames) {
  std::vector<std::byte> pong;
  ASSERT_TRUE(encoder_.Encode(protocol::Pong{1, 0.5, 1.0, 3}, pong));
  (void)Joined();
  session_->OnMessage(pong, now_s_);
  EXPECT_EQ(session_->state(), State::kReady);
  std::vector<std::byte> two = pong;
  two.insert(two.end(), pong.begin(), pong.end());
  for (const auto& bytes : {std::vector<std::byte>(pong.begin(), pong.end() - 8), two,
                            std::vector<std::byte>(8), std::vector<std::byte>()}) {
    Use({});
    (void)Joined();
    session_->OnMessage(bytes, now_s_);
    EXPECT_EQ(session_->state(), State::kWaiting) << bytes.size();
    EXPECT_EQ(session_->last_status(), STRIDEWIRE_PROTOCOL_ERROR);
  }
}

TEST_F(SessionTest, AMessageMayContainSeveralBatches) {
  std::uint32_t subscription = 0;
  EXPECT_EQ(session_->Observe(Joined(), {}, subscription, command_), STRIDEWIRE_OK);
  std::vector<std::byte> message = test_world::PoseFrame(5, 1, {{1}});
  const auto second = test_world::PoseFrame(5, 2, {{1}});
  message.insert(message.end(), second.begin(), second.end());
  session_->OnMessage(message, now_s_);
  EXPECT_EQ(session_->state(), State::kReady);
  EXPECT_EQ(session_->Statistics().batches_received, 2u);

  std::vector<std::byte> pong;
  ASSERT_TRUE(encoder_.Encode(protocol::Pong{1, 0.5, 1.0, 3}, pong));
  std::vector<std::byte> mixed = test_world::PoseFrame(5, 3, {{1}});
  mixed.insert(mixed.end(), pong.begin(), pong.end());
  std::vector<std::byte> cut = message;
  cut.resize(cut.size() - 8);
  for (const auto& [bytes, why] :
       {std::pair(mixed, "of which one is neither PoseBatch nor Movements"),
        std::pair(cut, "ends within a frame")}) {
    Use({});
    (void)Joined();
    session_->OnMessage(bytes, now_s_);
    EXPECT_EQ(session_->state(), State::kWaiting);
    EXPECT_THAT(std::string(session_->last_text()), testing::HasSubstr(why));
  }
}

TEST_F(SessionTest, StatesTheTimeOfItsNextAction) {
  EXPECT_EQ(session_->NextTime(), std::numeric_limits<double>::infinity());
  ASSERT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->NextTime(), now_s_);
  Ready();
  int actions = 0;
  for (const double end_s = now_s_ + 20.0; session_->NextTime() < end_s; ++actions) {
    ASSERT_GE(session_->NextTime(), now_s_);
    now_s_ = session_->NextTime();
    session_->AdvanceTime(now_s_);
    ASSERT_LT(actions, 1000);
  }
  EXPECT_EQ(session_->state(), State::kReady);
  (void)Sent();
  EXPECT_GE(pings_, 19);
}

TEST_F(SessionTest, InspectionsAreBoundedAndEndWithTheConnection) {
  const stridewire_world world = Joined();
  std::uint64_t nonce = 0;
  for (std::size_t i = 0; i < Session::kMaxInspections; ++i) {
    ASSERT_EQ(session_->Inspect(world, 3, nonce), STRIDEWIRE_OK);
  }
  EXPECT_EQ(session_->Inspect(world, 3, nonce), STRIDEWIRE_COMMANDS_FULL);
  const auto sent = Sent();
  ASSERT_EQ(sent.size(), Session::kMaxInspections);
  const auto& query = std::get<protocol::InspectAvatar>(sent[0]);
  EXPECT_EQ(query.world, 5u);
  EXPECT_EQ(query.avatar, 3u);
  protocol::AvatarState state;
  state.nonce = query.nonce;
  state.world = 5;
  state.avatar = 3;
  // Checks that `count` inspections have ended since the last call, all with the same status.
  const auto expect_ends = [&](std::size_t count, stridewire_status status) {
    std::size_t ends = 0;
    for (const stridewire_event& event : Events()) {
      if (event.type != STRIDEWIRE_EVENT_REPLY) continue;
      EXPECT_EQ(event.status, status);
      ++ends;
    }
    EXPECT_EQ(ends, count);
  };
  (void)Events();
  Receive(state);
  Receive(state);  // The second answer is ignored.
  expect_ends(1, STRIDEWIRE_OK);
  EXPECT_EQ(session_->Inspect(world, 3, nonce), STRIDEWIRE_OK);
  EXPECT_EQ(session_->Inspect(world, 3, nonce), STRIDEWIRE_COMMANDS_FULL);
  now_s_ += Session::kInspectTimeoutS;
  session_->AdvanceTime(now_s_);
  expect_ends(Session::kMaxInspections, STRIDEWIRE_TIMEOUT);
  EXPECT_EQ(session_->Inspect(world, 3, nonce), STRIDEWIRE_OK);
  session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  expect_ends(1, STRIDEWIRE_CONNECTION_LOST);
  EXPECT_EQ(session_->Inspect(world, 3, nonce), STRIDEWIRE_NOT_READY);
}

// The web client reads items and events of avatars from the messages itself.
TEST_F(SessionTest, DetailedEventsCanBeDisabled) {
  Use({.detailed_events = false});
  const stridewire_world world = Joined();
  ASSERT_EQ(session_->Spawn(world, SpawnOf({0, 4}), command_), STRIDEWIRE_OK);
  (void)Sent();
  (void)Events();
  protocol::Reply reply = test_world::Ok(2);
  reply.items = {{0, 41, 0, protocol::StatusCode::kOk, ""},
                 {1, 4, 0, protocol::StatusCode::kAvatarExists, ""}};
  Receive(reply);
  protocol::Event event;
  event.avatar = 41;
  Receive(protocol::Events{5, 1, 10, {event}});
  EXPECT_THAT(EventTypes(), testing::ElementsAre(STRIDEWIRE_EVENT_REPLY));
  EXPECT_EQ(session_->Statistics().events_received, 1u);
}

TEST_F(SessionTest, FindsWorldsByTheNumberOfTheServer) {
  const stridewire_world world = Joined();
  EXPECT_EQ(session_->FindHandle(5), world);
  EXPECT_EQ(session_->FindHandle(6), 0u);
  EXPECT_EQ(session_->FindWorldState(world), Session::WorldState::kJoined);
  EXPECT_FALSE(session_->FindWorldState(world + 1));
  ASSERT_EQ(session_->LeaveWorld(world, command_), STRIDEWIRE_OK);
  EXPECT_EQ(session_->FindWorldState(world), Session::WorldState::kLeft);
}

TEST_F(SessionTest, SurvivesMutatedFrames) {
  const std::uint64_t seed = 4242;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::vector<std::vector<std::byte>> frames;
  const auto add = [&](const auto& message) {
    std::vector<std::byte> frame;
    ASSERT_TRUE(encoder_.Encode(message, frame));
    frames.push_back(frame);
  };
  add(test_world::Welcome());
  add(test_world::WorldInfo(1, 5, "plaza"));
  add(test_world::Ok(1));
  protocol::Event event;
  event.avatar = 1;
  add(protocol::Events{5, 1, 10, {event}});
  add(protocol::Lagging{5, 10, 1});
  add(protocol::Pong{1, 0.5, 1.0, 3});
  add(protocol::WorldTerrain{5, Slab(0.5)});
  add(protocol::ErrorNotice{protocol::StatusCode::kInternal, "oh", false, 2});
  frames.push_back(test_world::PoseFrame(5, 7, {{1}, {2}}));
  frames.push_back(test_world::PoseFrame(5, 8, {{1}, {2}}, protocol::PoseMode::kQuantised));
  frames.push_back(test_world::PoseFrame(5, 9, {{1}, {2}}, protocol::PoseMode::kCompact));
  int survived = 0;
  (void)Joined();
  for (int i = 0; i < 20'000; ++i) {
    if (session_->state() != State::kReady) {
      Use({});
      (void)Joined();
      std::uint32_t subscription = 0;
      (void)session_->Observe(1, {}, subscription, command_);
    }
    auto frame = frames[random() % frames.size()];
    for (std::uint64_t n = random() % 3; n > 0; --n) {
      frame[random() % frame.size()] = static_cast<std::byte>(random());
    }
    session_->OnBytes(frame, now_s_);
    survived += session_->state() == State::kReady;
    ASSERT_LT(session_->Statistics().buffered_bytes, std::size_t{80} << 20);
  }
  EXPECT_GT(survived, 1000);
}

}  // namespace
}  // namespace stridewire::client
