// Tests the C API and its C++ wrapper over real sockets with a scripted server.
#include "stridewire/client.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <thread>

#include "fake_server.h"
#include "test_world.h"

namespace stridewire {
namespace {

using client::Client;
using client::Options;

constexpr double kPatienceS = 20.0;

class ClientTest : public testing::Test {
 protected:
  void Start(const Options& options = {}) {
    client_.emplace(Client::Create(options).value());
    ASSERT_TRUE(client_->Connect("127.0.0.1", server_.port()));
    connection_ = Greet(false);
  }

  FakeConnection Greet(bool resumed) {
    FakeConnection connection = server_.Accept();
    EXPECT_TRUE(connection.is_open());
    const auto hello = connection.Expect<protocol::Hello>();
    EXPECT_TRUE(hello);
    if (hello) hello_ = *hello;
    connection.Send(test_world::Welcome(resumed));
    return connection;
  }

  void Join(stridewire_role role = STRIDEWIRE_CONTROLLER) {
    ASSERT_TRUE(client_->JoinWorld("plaza", role, world_));
    LetIn();
  }
  void LetIn() {
    const auto join = connection_.Expect<protocol::JoinWorld>();
    ASSERT_TRUE(join);
    connection_.Send(test_world::WorldInfo(join->seq, 5, "plaza"));
    connection_.Send(test_world::Ok(join->seq));
  }
  void Observe(stridewire_pose_mode mode = STRIDEWIRE_FULL) {
    ASSERT_TRUE(client_->Observe(world_, mode));
    const auto observe = connection_.Expect<protocol::Observe>();
    ASSERT_TRUE(observe);
    connection_.Send(test_world::Ok(observe->seq));
  }

  /// Returns the next event of a type and drops the events before it.
  std::optional<stridewire_event> Next(stridewire_event_type type) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
    stridewire_event event;
    while (std::chrono::steady_clock::now() < until) {
      while (client_->PollEvent(event)) {
        if (event.type == type) return event;
      }
      (void)client_->WaitEvent(1.0);
    }
    return std::nullopt;
  }

  static bool Eventually(const std::function<bool()>& holds) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
    while (!holds()) {
      if (std::chrono::steady_clock::now() > until) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
  }

  FakeServer server_;
  std::optional<Client> client_;
  FakeConnection connection_;
  protocol::Hello hello_;
  stridewire_world world_ = 0;
};

TEST_F(ClientTest, ConnectsJoinsAndGetsTheSkeleton) {
  Options options;
  options.client_name = "unit test";
  options.auth_token = "sesame";
  Start(options);
  EXPECT_EQ(hello_.client_name, "unit test");
  EXPECT_EQ(hello_.auth_token, "sesame");
  Join();
  ASSERT_TRUE(Next(STRIDEWIRE_EVENT_WORLD_JOINED));
  EXPECT_TRUE(client_->ready());
  client::Skeleton skeleton;
  ASSERT_TRUE(client_->GetSkeleton(world_, skeleton));
  ASSERT_EQ(skeleton.joints.size(), 3u);
  EXPECT_STREQ(skeleton.joints[1].name, "spine");
  EXPECT_EQ(skeleton.joints[2].parent, 1);
  EXPECT_FLOAT_EQ(skeleton.joints[2].offset_m[1], 0.4f);
  ASSERT_EQ(skeleton.end_sites.size(), 1u);
  EXPECT_EQ(skeleton.end_sites[0].joint, 2u);
  EXPECT_EQ(skeleton.tick_hz, test_world::kTickHz);
  EXPECT_STREQ(skeleton.library_hash, "0123456789abcdef");
}

TEST_F(ClientTest, SendsACrowdInOneCommand) {
  Start();
  Join();
  std::vector<stridewire_spawn> spawns;
  std::vector<stridewire_movement> movements;
  for (std::uint32_t a = 1; a <= 2000; ++a) {
    spawns.push_back({a, {1.0 * a, 0.0, 2.0}, 0.25});
    movements.push_back(client::Step(a, 10 * a, 0.6, 0.1, STRIDEWIRE_FOOT_LEFT));
    movements.push_back(client::Jump(a, 10 * a + 1, 0.9));
    movements.push_back(client::Stand(a, 10 * a + 2, 1.5));
  }
  movements[0].has_side = 1;
  movements[0].side_m = 0.12;
  ASSERT_TRUE(client_->Spawn(world_, spawns));
  ASSERT_TRUE(client_->Request(world_, movements));
  ASSERT_TRUE(client_->Cancel(world_, {4, 5}));
  ASSERT_TRUE(client_->SetPlanting(world_, {4, 7}, false));
  ASSERT_TRUE(client_->SetPlanting(world_, {4}, true));
  ASSERT_TRUE(client_->Remove(world_, {6}));
  const auto spawn = connection_.Expect<protocol::Spawn>();
  ASSERT_TRUE(spawn);
  ASSERT_EQ(spawn->items.size(), 2000u);
  EXPECT_EQ(spawn->items[6], (protocol::SpawnItem{7, {DVec3(7.0, 0.0, 2.0), 0.25}}));
  const auto request = connection_.Expect<protocol::Request>();
  ASSERT_TRUE(request);
  ASSERT_EQ(request->items.size(), 6000u);
  const auto& first = std::get<protocol::StepMovement>(request->items[0].movement);
  EXPECT_EQ(first.side_m, 0.12);
  EXPECT_EQ(first.foot, protocol::FootChoice::kLeft);
  EXPECT_EQ(first.turn_rad, 0.1);
  EXPECT_FALSE(std::get<protocol::StepMovement>(request->items[3].movement).side_m);
  EXPECT_EQ(std::get<protocol::JumpMovement>(request->items[1].movement).length_m, 0.9);
  EXPECT_EQ(std::get<protocol::StandMovement>(request->items[2].movement).seconds, 1.5);
  const auto cancel = connection_.Expect<protocol::CancelQueue>();
  ASSERT_TRUE(cancel);
  EXPECT_EQ(cancel->avatars, (std::vector<std::uint32_t>{4, 5}));
  for (const bool enabled : {false, true}) {
    const auto planting = connection_.Expect<protocol::SetPlanting>();
    ASSERT_TRUE(planting);
    EXPECT_EQ(planting->enabled, enabled);
    EXPECT_EQ(planting->avatars.size(), enabled ? 1u : 2u);
  }
  const auto remove = connection_.Expect<protocol::Remove>();
  ASSERT_TRUE(remove);
  EXPECT_EQ(remove->avatars, (std::vector<std::uint32_t>{6}));
}

TEST_F(ClientTest, ReturnsRawAndInterpolatedPoses) {
  Start();
  Join();
  Observe();
  for (std::uint64_t tick = 100; tick < 120; ++tick) {
    connection_.SendBytes(test_world::PoseFrame(5, tick, {{1}, {9}}));
  }
  client::Pose pose;
  ASSERT_TRUE(Eventually([&] {
    (void)client_->LatestPose(world_, 1, pose);
    return pose.tick == 119;
  }));
  EXPECT_EQ(client_->ListAvatars(world_), (std::vector<std::uint32_t>{1, 9}));
  EXPECT_EQ(pose.kind, STRIDEWIRE_POSE_RAW);
  EXPECT_EQ(pose.root_position_m[2], test_world::RootAt(test_world::TickTime(119)).z);
  EXPECT_EQ(pose.rotations[2].y, test_world::RotationsAt(test_world::TickTime(119))[2].y);

  // Read every received pose in order.
  std::uint64_t after = UINT64_MAX;
  for (std::uint64_t tick = 100; tick < 120; ++tick) {
    ASSERT_TRUE(client_->NextPose(world_, 1, after, pose));
    ASSERT_EQ(pose.tick, tick);
    EXPECT_EQ(pose.discontinuity, tick == 100);
    after = pose.tick;
  }
  ASSERT_TRUE(client_->NextPose(world_, 1, after, pose));
  EXPECT_TRUE(pose.missing());

  const double between_s = test_world::TickTime(110) + 0.4 / test_world::kTickHz;
  ASSERT_TRUE(client_->SamplePose(world_, 1, between_s, pose));
  EXPECT_EQ(pose.kind, STRIDEWIRE_POSE_INTERPOLATED);
  EXPECT_NEAR(pose.root_position_m[2], test_world::RootAt(between_s).z, 1e-5);
  EXPECT_NEAR(pose.rotations[2].y, test_world::RotationsAt(between_s)[2].y, 1e-5);
  ASSERT_TRUE(client_->SamplePose(world_, 1, test_world::TickTime(119) + 0.5, pose));
  EXPECT_EQ(pose.kind, STRIDEWIRE_POSE_HELD);
  EXPECT_NEAR(pose.held_s, 0.5, 1e-9);
  ASSERT_TRUE(client_->SamplePose(world_, 1, test_world::TickTime(99), pose));
  EXPECT_TRUE(pose.missing());
  ASSERT_TRUE(client_->SamplePose(world_, 55, between_s, pose));
  EXPECT_TRUE(pose.missing());
  EXPECT_EQ(client_->SamplePose(77, 1, between_s, pose).status(), STRIDEWIRE_NO_SUCH_WORLD);
  float small[4];
  pose.rotations_xyzw = small;
  pose.joint_capacity = 1;
  EXPECT_EQ(stridewire_client_sample_pose(client_->get(), world_, 1, between_s, &pose),
            STRIDEWIRE_BUFFER_TOO_SMALL);
  EXPECT_EQ(pose.joint_count, 3u);

  const auto now_s = client_->ServerTime();
  const auto render_s = client_->RenderTime();
  ASSERT_TRUE(now_s && render_s);
  EXPECT_LT(*render_s, *now_s + 1.0);
}

TEST_F(ClientTest, QuantisedPosesAreWithinTheirError) {
  Start();
  Join();
  Observe(STRIDEWIRE_QUANTISED);
  connection_.SendBytes(test_world::PoseFrame(5, 33, {{1}}, protocol::PoseMode::kQuantised));
  client::Pose pose;
  ASSERT_TRUE(Eventually([&] {
    (void)client_->LatestPose(world_, 1, pose);
    return pose.tick == 33;
  }));
  EXPECT_NEAR(pose.root_position_m[2], test_world::RootAt(test_world::TickTime(33)).z,
              1.0 / 32768.0);
  const auto& q = pose.rotations[2];
  EXPECT_LT(
      AngleBetween(Quat(q.w, q.x, q.y, q.z), test_world::RotationsAt(test_world::TickTime(33))[2]),
      protocol::kMaxQuantisedAngleRad * 1.5);
}

TEST_F(ClientTest, ResumesAndResendsUnansweredCommands) {
  Start();
  Join();
  std::uint64_t command = 0;
  ASSERT_TRUE(client_->Request(world_, {client::Step(1, 42, 0.6)}, &command));
  const auto first = connection_.Expect<protocol::Request>();
  ASSERT_TRUE(first);
  connection_.Close();  // before the Reply
  connection_ = Greet(true);
  EXPECT_EQ(hello_.resume_token, test_world::Welcome().resume_token);
  connection_.Send(test_world::WorldInfo(0, 5, "plaza"));
  const auto again = connection_.Expect<protocol::Request>();
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, *first);
  connection_.Send(test_world::Ok(again->seq));
  const auto connected = Next(STRIDEWIRE_EVENT_CONNECTION_LOST);
  ASSERT_TRUE(connected);
  const auto reply = Next(STRIDEWIRE_EVENT_REPLY);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->command, command);
  EXPECT_EQ(reply->status, STRIDEWIRE_OK);
  EXPECT_EQ(client_->Statistics().resumes, 1u);
}

TEST_F(ClientTest, SurvivesAConnectionLossInsideAFrame) {
  Start();
  Join();
  Observe();
  const auto frame = test_world::PoseFrame(5, 10, {{1}});
  connection_.SendBytes(frame);
  const auto half = test_world::PoseFrame(5, 11, {{1}});
  connection_.SendBytes(std::span(half).first(half.size() / 2));
  connection_.Close();
  connection_ = Greet(true);
  connection_.Send(test_world::WorldInfo(0, 5, "plaza"));
  connection_.SendBytes(test_world::PoseFrame(5, 40, {{1}}));
  client::Pose pose;
  ASSERT_TRUE(Eventually([&] {
    (void)client_->LatestPose(world_, 1, pose);
    return pose.tick == 40;
  }));
  EXPECT_EQ(pose.discontinuity, 1);
  ASSERT_TRUE(client_->NextPose(world_, 1, 10, pose));
  EXPECT_EQ(pose.tick, 40u);  // the incomplete frame was ignored
}

TEST_F(ClientTest, ReconnectsAfterInvalidBytes) {
  Start();
  connection_.SendBytes(std::vector<std::byte>(1000, std::byte{0xa5}));
  EXPECT_TRUE(connection_.WaitForClose());
  const auto lost = Next(STRIDEWIRE_EVENT_CONNECTION_LOST);
  ASSERT_TRUE(lost);
  EXPECT_EQ(lost->status, STRIDEWIRE_PROTOCOL_ERROR);
  EXPECT_GT(std::strlen(lost->text), 5u);
  connection_ = Greet(true);
  Join();
  EXPECT_TRUE(Next(STRIDEWIRE_EVENT_WORLD_JOINED));
}

TEST_F(ClientTest, JoinsAgainAfterTheServerLostTheSession) {
  Options options;
  options.respawn = 1;
  Start(options);
  Join();
  ASSERT_TRUE(client_->Spawn(world_, {{3, {1.0, 0.0, 2.0}, 0.5}}));
  const auto spawn = connection_.Expect<protocol::Spawn>();
  ASSERT_TRUE(spawn);
  protocol::Reply reply = test_world::Ok(spawn->seq);
  reply.items = {{0, 3, 0, protocol::StatusCode::kOk, ""}};
  connection_.Send(reply);
  Observe();
  connection_.Close();
  connection_ = Greet(false);
  LetIn();
  const auto observe = connection_.Expect<protocol::Observe>();
  EXPECT_TRUE(observe);
  const auto respawn = connection_.Expect<protocol::Spawn>();
  ASSERT_TRUE(respawn);
  EXPECT_EQ(respawn->items, spawn->items);
  EXPECT_TRUE(Next(STRIDEWIRE_EVENT_SESSION_LOST));
  EXPECT_TRUE(Next(STRIDEWIRE_EVENT_WORLD_JOINED));
}

TEST_F(ClientTest, LimitsEventsThatAreNotPolled) {
  Options options;
  options.max_events = 100;
  Start(options);
  Join();
  protocol::Event strike;
  strike.type = protocol::EventType::kFootStrike;
  strike.avatar = 1;
  for (std::uint64_t n = 1; n <= 50; ++n) {
    connection_.Send(protocol::Events{5, n, n, std::vector<protocol::Event>(100, strike)});
  }
  ASSERT_TRUE(Eventually([&] { return client_->Statistics().events_received == 5000; }));
  EXPECT_GE(client_->Statistics().events_dropped, 4900u);
  stridewire_event event;
  int polled = 0;
  while (client_->PollEvent(event)) ++polled;
  EXPECT_EQ(polled, 100);
}

TEST_F(ClientTest, RetriesUntilAServerListens) {
  std::uint16_t port = 0;
  {
    const FakeServer gone;  // provides an unused port
    port = gone.port();
  }
  client_.emplace(Client::Create().value());
  ASSERT_TRUE(client_->Connect("127.0.0.1", port));
  const auto failed = Next(STRIDEWIRE_EVENT_CONNECT_FAILED);
  ASSERT_TRUE(failed);
  EXPECT_EQ(failed->status, STRIDEWIRE_CONNECT_FAILED);
  EXPECT_THAT(client_->LastError(), testing::HasSubstr("refused"));
  ASSERT_TRUE(Next(STRIDEWIRE_EVENT_CONNECT_FAILED));
  FakeServer back(port);
  ASSERT_EQ(back.port(), port);
  FakeConnection connection = back.Accept();
  ASSERT_TRUE(connection.Expect<protocol::Hello>());
  connection.Send(test_world::Welcome());
  EXPECT_TRUE(Next(STRIDEWIRE_EVENT_CONNECTED));
}

TEST_F(ClientTest, SendsGoodbyeWhenDestroyed) {
  Start();
  Join();
  ASSERT_TRUE(Next(STRIDEWIRE_EVENT_WORLD_JOINED));
  client_.reset();
  EXPECT_TRUE(connection_.Expect<protocol::Goodbye>());
}

TEST_F(ClientTest, StartsANewSessionAfterDisconnect) {
  Start();
  Join();
  ASSERT_TRUE(client_->Disconnect());
  EXPECT_EQ(client_->state(), STRIDEWIRE_STATE_IDLE);
  EXPECT_TRUE(connection_.Expect<protocol::Goodbye>());
  ASSERT_TRUE(client_->Connect("127.0.0.1", server_.port()));
  connection_ = Greet(false);
  EXPECT_TRUE(hello_.resume_token.empty());
  EXPECT_EQ(client_->Spawn(world_, {{1, {}, 0.0}}).status(), STRIDEWIRE_NO_SUCH_WORLD);
}

TEST_F(ClientTest, PingMeasuresTheRoundTrip) {
  Start();
  ASSERT_TRUE(Next(STRIDEWIRE_EVENT_CONNECTED));
  ASSERT_TRUE(client_->Ping());
  ASSERT_TRUE(client_->JoinWorld("plaza", STRIDEWIRE_OBSERVER, world_));
  ASSERT_TRUE(connection_.Expect<protocol::JoinWorld>());  // sends Pongs meanwhile
  const auto pong = Next(STRIDEWIRE_EVENT_PONG);
  ASSERT_TRUE(pong);
  EXPECT_GT(pong->rtt_s, 0.0);
  EXPECT_GT(client_->Statistics().rtt_s, 0.0);
}

TEST_F(ClientTest, IsThreadSafe) {
  Start();
  Join();
  Observe();
  std::atomic<bool> stop = false;
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t) {
    threads.emplace_back([&] {
      client::Pose pose;
      stridewire_event event;
      while (!stop) {
        (void)client_->LatestPose(world_, 1, pose);
        (void)client_->SamplePose(world_, 1, client_->RenderTime().value_or(0.0), pose);
        (void)client_->PollEvent(event);
        (void)client_->Request(world_, {client::Step(1, 1, 0.5)});
        (void)client_->Statistics();
      }
    });
  }
  for (std::uint64_t tick = 1; tick <= 300; ++tick) {
    connection_.SendBytes(test_world::PoseFrame(5, tick, {{1}}));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  client::Pose pose;
  EXPECT_TRUE(Eventually([&] {
    (void)client_->LatestPose(world_, 1, pose);
    return pose.tick == 300;
  }));
  stop = true;
  for (auto& thread : threads) thread.join();
  EXPECT_LE(client_->Statistics().commands_waiting, 4096u);
}

TEST(ClientOptions, AreChecked) {
  const auto status = [](const std::function<void(Options&)>& change) {
    Options options;
    change(options);
    stridewire_status result = STRIDEWIRE_OK;
    (void)Client::Create(options, &result);
    return result;
  };
  EXPECT_EQ(status([](Options&) {}), STRIDEWIRE_OK);
  EXPECT_EQ(status([](Options& o) { o.struct_bytes = 8; }), STRIDEWIRE_VERSION_MISMATCH);
  EXPECT_EQ(status([](Options& o) { o.abi_version = 99; }), STRIDEWIRE_VERSION_MISMATCH);
  EXPECT_EQ(status([](Options& o) { o.max_events = 1; }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.max_commands = 0; }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.pose_history = 1; }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.max_command_bytes = 1; }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.max_pose_bytes = 1; }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.render_delay_s = std::nan(""); }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.connect_timeout_s = 0.0; }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.ping_interval_s = -1.0; }), STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(status([](Options& o) { o.client_name = ""; }), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(status([](Options& o) { o.client_name = "\xff"; }), STRIDEWIRE_INVALID_ARGUMENT);
  const std::string long_token(5000, 'x');
  EXPECT_EQ(status([&](Options& o) { o.auth_token = long_token.c_str(); }),
            STRIDEWIRE_INVALID_ARGUMENT);
}

TEST(ClientArguments, RejectNullAndInvalidValues) {
  stridewire_world world = 0;
  size_t count = 0;
  EXPECT_EQ(stridewire_client_create(nullptr, nullptr), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_connect(nullptr, "x", 1), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_get_state(nullptr), STRIDEWIRE_STATE_IDLE);
  EXPECT_EQ(stridewire_client_poll_events(nullptr, nullptr, 0, &count),
            STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_wait_event(nullptr, 0.0), STRIDEWIRE_INVALID_ARGUMENT);
  stridewire_client* client = nullptr;
  ASSERT_EQ(stridewire_client_create(nullptr, &client), STRIDEWIRE_OK);
  EXPECT_EQ(stridewire_client_connect(client, nullptr, 1), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_connect(client, "", 1), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_connect(client, "localhost", 0), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_join_world(client, nullptr, STRIDEWIRE_OBSERVER, &world, nullptr),
            STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(
      stridewire_client_join_world(client, "w", static_cast<stridewire_role>(7), &world, nullptr),
      STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_spawn(client, 1, nullptr, 1, nullptr), STRIDEWIRE_INVALID_ARGUMENT);
  const stridewire_spawn spawn{};
  EXPECT_EQ(stridewire_client_spawn(client, 1, &spawn, 0, nullptr), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_spawn(client, 1, &spawn, STRIDEWIRE_MAX_ITEMS + 1, nullptr),
            STRIDEWIRE_INVALID_ARGUMENT);
  stridewire_movement movement = client::Step(1, 1, 0.5);
  movement.type = static_cast<stridewire_movement_type>(9);
  EXPECT_EQ(stridewire_client_request(client, 1, &movement, 1, nullptr),
            STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_observe(client, 1, nullptr, nullptr, nullptr),
            STRIDEWIRE_INVALID_ARGUMENT);
  stridewire_observation observation{};
  observation.avatar_count = 3;
  EXPECT_EQ(stridewire_client_observe(client, 1, &observation, nullptr, nullptr),
            STRIDEWIRE_INVALID_ARGUMENT);
  stridewire_pose pose{};
  EXPECT_EQ(stridewire_client_sample_pose(client, 1, 1, std::nan(""), &pose),
            STRIDEWIRE_OUT_OF_RANGE);
  pose.joint_capacity = 5;
  EXPECT_EQ(stridewire_client_latest_pose(client, 1, 1, &pose), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_wait_event(client, -1.0), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_wait_event(client, 0.0), STRIDEWIRE_TIMEOUT);
  double time_s = 0.0;
  EXPECT_EQ(stridewire_client_render_time(client, &time_s), STRIDEWIRE_NOT_READY);
  EXPECT_EQ(stridewire_client_render_time(client, nullptr), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_get_statistics(client, nullptr), STRIDEWIRE_INVALID_ARGUMENT);
  char text[4];
  EXPECT_EQ(stridewire_client_last_error(client, nullptr, 4), STRIDEWIRE_INVALID_ARGUMENT);
  EXPECT_EQ(stridewire_client_last_error(client, text, sizeof text), STRIDEWIRE_OK);
  stridewire_client_destroy(client);
}

}  // namespace
}  // namespace stridewire
