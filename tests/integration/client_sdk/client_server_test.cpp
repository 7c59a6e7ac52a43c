// Tests the client library, stridewire-record and the sample with stridewired as separate
// processes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "child_process.h"
#include "link_proxy.h"
#include "ready_line.h"
#include "run_program.h"
#include "scratch_folder.h"
#include "stridewire/base/version.h"
#include "stridewire/client.hpp"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/protocol/pose_codec.h"

namespace stridewire {
namespace {

using client::Client;
using client::Options;
using nlohmann::json;
using test::ChildProcess;
using test::RunProgram;
using test::ScratchFolder;
using testing::HasSubstr;

constexpr double kPatienceS = 60.0;

bool Eventually(const std::function<bool()>& holds) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
  while (!holds()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

/// Runs stridewired as a process.
class Daemon {
 public:
  explicit Daemon(std::uint16_t port = 0)
      : process_(STRIDEWIRE_SERVER, {"--listen", "127.0.0.1:" + std::to_string(port), "--http",
                                     "127.0.0.1:0", "--shards", "2", "--log-level", "warning"}),
        port_(test::PortIn(process_.ReadLineThatBegins("ready ").value_or(""), "listen")) {}
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  /// Stops the process for a while, so that it misses ticks.
  void Pause(std::chrono::milliseconds time) {
    process_.Signal(SIGSTOP);
    std::this_thread::sleep_for(time);
    process_.Signal(SIGCONT);
  }
  void KillHard() {
    process_.Signal(SIGKILL);
    (void)process_.Wait();
  }
  int Terminate() {
    process_.Signal(SIGTERM);
    return process_.Wait();
  }

 private:
  ChildProcess process_;
  std::uint16_t port_;
};

/// A client in world "plaza".
class User {
 public:
  explicit User(std::uint16_t port, stridewire_role role = STRIDEWIRE_CONTROLLER,
                const Options& options = {},
                const std::vector<std::pair<std::string, std::uint16_t>>& addresses = {})
      : client(Client::Create(options).value()) {
    EXPECT_TRUE(addresses.empty() ? client.Connect("127.0.0.1", port)
                                  : client.ConnectAny(addresses));
    EXPECT_TRUE(client.JoinWorld("plaza", role, world));
  }

  std::optional<stridewire_event> Next(stridewire_event_type type) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
    stridewire_event event;
    while (std::chrono::steady_clock::now() < until) {
      while (client.PollEvent(event)) {
        if (event.type == type) return event;
      }
      (void)client.WaitEvent(1.0);
    }
    return std::nullopt;
  }

  void Spawn(std::uint32_t count) {
    std::vector<stridewire_spawn> spawns;
    for (std::uint32_t a = 1; a <= count; ++a) spawns.push_back({a, {1.0 * a, 0.0, 0.0}, 0.0});
    EXPECT_TRUE(client.Spawn(world, spawns));
    const auto reply = Next(STRIDEWIRE_EVENT_REPLY);  // the first is of JoinWorld
    const auto second = Next(STRIDEWIRE_EVENT_REPLY);
    ASSERT_TRUE(reply && second);
    EXPECT_EQ(second->status, STRIDEWIRE_OK);
    EXPECT_EQ(second->accepted, count);
  }

  /// Receives `count` consecutive poses of an avatar.
  std::vector<client::Pose> Collect(std::uint32_t avatar, std::size_t count) {
    std::vector<client::Pose> poses;
    std::uint64_t after = UINT64_MAX;
    client::Pose pose;
    EXPECT_TRUE(Eventually([&] {
      while (poses.size() < count && client.NextPose(world, avatar, after, pose) &&
             !pose.missing()) {
        after = pose.tick;
        poses.push_back(pose);
      }
      return poses.size() == count;
    }));
    return poses;
  }

  Client client;
  stridewire_world world = 0;
};

Options LongHistory() {
  Options options;
  options.pose_history = 1024;
  return options;
}

TEST(ClientAndServer, ARequestedStepIsExecuted) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  User user(server.port());
  user.Spawn(1);
  ASSERT_TRUE(user.client.Observe(user.world, STRIDEWIRE_FULL));
  std::vector<stridewire_movement> steps;
  for (std::uint64_t r = 1; r <= 4; ++r) steps.push_back(client::Step(1, r, 0.6));
  ASSERT_TRUE(user.client.Request(user.world, steps));
  for (std::uint64_t r = 1; r <= 4; ++r) {
    const auto started = user.Next(STRIDEWIRE_EVENT_STARTED);
    ASSERT_TRUE(started);
    EXPECT_EQ(started->request_id, r);
    EXPECT_GT(started->applied.count, 0);
    const auto finished = user.Next(STRIDEWIRE_EVENT_FINISHED);
    ASSERT_TRUE(finished);
    EXPECT_EQ(finished->request_id, r);
  }
  const auto idle = user.Next(STRIDEWIRE_EVENT_IDLE);
  ASSERT_TRUE(idle);
  EXPECT_GT(idle->base_position_m[2], 1.0);
  client::Pose pose;
  ASSERT_TRUE(Eventually([&] {
    return user.client.LatestPose(user.world, 1, pose) && !pose.missing() && pose.standing != 0;
  }));
  EXPECT_GT(pose.root_position_m[2], 1.0f);
  EXPECT_EQ(server.Terminate(), 0);
}

class ClientRegion : public testing::TestWithParam<stridewire_pose_mode> {};
INSTANTIATE_TEST_SUITE_P(Modes, ClientRegion,
                         testing::Values(STRIDEWIRE_QUANTISED, STRIDEWIRE_MOVEMENT));

TEST_P(ClientRegion, ReceivesTheAvatarsInside) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  User user(server.port());
  user.Spawn(30);  // on a grid
  stridewire_observation observation{};
  observation.mode = GetParam();
  observation.every_n_ticks = 1;
  const stridewire_rate_ring ring{1.0, 2};
  stridewire_region region{-1000.0, 0.0, 5.0, -1.0, &ring, 1, nullptr};
  std::uint32_t subscription = 0;
  ASSERT_TRUE(user.client.ObserveRegion(user.world, observation, region, &subscription));
  region.ring_count = 5;
  EXPECT_FALSE(user.client.MoveRegion(subscription, region));
  region.ring_count = 1;
  EXPECT_FALSE(user.client.MoveRegion(subscription + 1, region));
  const auto count = [&] { return user.client.ListAvatars(user.world).size(); };
  region = {0.0, 0.0, 1000.0, 2.0, nullptr, 0, nullptr};
  ASSERT_TRUE(user.client.MoveRegion(subscription, region));
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_ENTERED)) << i;
  EXPECT_TRUE(Eventually([&] { return count() == 30; }));
  region.x = 5000.0;
  ASSERT_TRUE(user.client.MoveRegion(subscription, region));
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_LEFT)) << i;
  EXPECT_TRUE(Eventually([&] { return count() == 0; }));
  EXPECT_EQ(server.Terminate(), 0);
}

TEST(ClientAndServer, RingsHaveDetails) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  User user(server.port());
  user.Spawn(30);  // at x = 1 to 30 m
  const stridewire_rate_ring rings[] = {{10.5, 1}, {20.5, 2}};
  stridewire_pose_detail details[] = {STRIDEWIRE_DETAIL_ALL, STRIDEWIRE_DETAIL_REDUCED};
  stridewire_region region{0.0, 0.0, 100.0, -1.0, rings, 2, details};
  stridewire_observation observation{};
  observation.mode = STRIDEWIRE_FULL;
  observation.every_n_ticks = 4;
  EXPECT_EQ(user.client.ObserveRegion(user.world, observation, region).status(),
            STRIDEWIRE_INVALID_ARGUMENT);
  observation.mode = STRIDEWIRE_QUANTISED;
  observation.detail = STRIDEWIRE_DETAIL_ROOT;
  details[1] = static_cast<stridewire_pose_detail>(3);
  EXPECT_EQ(user.client.ObserveRegion(user.world, observation, region).status(),
            STRIDEWIRE_INVALID_ARGUMENT);
  details[1] = STRIDEWIRE_DETAIL_REDUCED;
  std::uint32_t subscription = 0;
  ASSERT_TRUE(user.client.ObserveRegion(user.world, observation, region, &subscription));
  // Avatars up to `all` have all joints, up to `fewer` reduced joints, and others the root only.
  const auto shows = [&](std::uint32_t all, std::uint32_t fewer) {
    return Eventually([&] {
      for (std::uint32_t avatar = 1; avatar <= 30; ++avatar) {
        client::Pose pose;
        if (!user.client.LatestPose(user.world, avatar, pose) || pose.missing()) return false;
        const int detail = avatar <= all     ? STRIDEWIRE_DETAIL_ALL
                           : avatar <= fewer ? STRIDEWIRE_DETAIL_REDUCED
                                             : STRIDEWIRE_DETAIL_ROOT;
        if (pose.detail != detail) return false;
      }
      return true;
    });
  };
  EXPECT_TRUE(shows(10, 20));
  region.x = 5.0;
  ASSERT_TRUE(user.client.MoveRegion(subscription, region));
  EXPECT_TRUE(shows(15, 25));
  region.ring_details = nullptr;
  ASSERT_TRUE(user.client.MoveRegion(subscription, region));
  EXPECT_TRUE(shows(0, 0));
  EXPECT_EQ(user.client.ListAvatars(user.world).size(), 30u);
  EXPECT_EQ(server.Terminate(), 0);
}

TEST(ClientAndServer, ObserversReceiveEqualPosesWithinTheQuantisationError) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  User user(server.port());
  user.Spawn(1);
  User first(server.port(), STRIDEWIRE_OBSERVER, LongHistory());
  User second(server.port(), STRIDEWIRE_OBSERVER, LongHistory());
  User coarse(server.port(), STRIDEWIRE_OBSERVER, LongHistory());
  ASSERT_TRUE(first.client.Observe(first.world, STRIDEWIRE_FULL));
  ASSERT_TRUE(second.client.Observe(second.world, STRIDEWIRE_FULL));
  ASSERT_TRUE(coarse.client.Observe(coarse.world, STRIDEWIRE_QUANTISED));
  for (User* observer : {&first, &second, &coarse}) {
    ASSERT_EQ(observer->Collect(1, 1).size(), 1u);
  }
  std::vector<stridewire_movement> steps;
  for (std::uint64_t r = 1; r <= 4; ++r) steps.push_back(client::Step(1, r, 0.55, 0.1));
  ASSERT_TRUE(user.client.Request(user.world, steps));
  const auto a = first.Collect(1, 180);
  const auto b = second.Collect(1, 180);
  const auto c = coarse.Collect(1, 180);
  ASSERT_EQ(a.size(), 180u);
  int compared = 0;
  double worst_rad = 0.0;
  double worst_m = 0.0;
  for (const auto& pose : a) {
    for (const auto& same : b) {
      if (same.tick != pose.tick) continue;
      ++compared;
      ASSERT_EQ(same.time_s, pose.time_s);
      for (int i = 0; i < 3; ++i) ASSERT_EQ(same.root_position_m[i], pose.root_position_m[i]);
      for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
        ASSERT_EQ(same.rotations[j].x, pose.rotations[j].x);
        ASSERT_EQ(same.rotations[j].w, pose.rotations[j].w);
      }
    }
    for (const auto& near : c) {
      if (near.tick != pose.tick) continue;
      for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
        const auto& p = pose.rotations[j];
        const auto& q = near.rotations[j];
        worst_rad = std::max(
            worst_rad, AngleBetween(Normalise(Quat(p.w, p.x, p.y, p.z)), Quat(q.w, q.x, q.y, q.z)));
      }
      for (int i = 0; i < 3; ++i) {
        worst_m = std::max(worst_m, std::abs(static_cast<double>(near.root_position_m[i]) -
                                             static_cast<double>(pose.root_position_m[i])));
      }
    }
  }
  EXPECT_GT(compared, 60);
  EXPECT_GT(worst_rad, 0.0);
  // A joint's own error in the world, and that of its parent, which it compensates.
  EXPECT_LT(worst_rad, 0.004 + 0.002);
  EXPECT_LE(worst_m, 0.5 / protocol::kRootStepsPerM + 1e-6);
}

// Counts the joints that rotate during the recording.
std::size_t MovingJoints(const std::vector<client::Pose>& poses) {
  std::size_t moving = 0;
  for (std::size_t j = 0; j < poses.front().rotations.size(); ++j) {
    moving += std::ranges::any_of(poses, [&](const client::Pose& pose) {
      return pose.rotations[j].x != poses.front().rotations[j].x;
    });
  }
  return moving;
}

TEST(ClientAndServer, PosesHaveTheRequestedDetail) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  User user(server.port());
  user.Spawn(1);
  User all(server.port(), STRIDEWIRE_OBSERVER, LongHistory());
  User fewer(server.port(), STRIDEWIRE_OBSERVER, LongHistory());
  User root(server.port(), STRIDEWIRE_OBSERVER, LongHistory());
  const std::array<std::pair<User*, stridewire_pose_detail>, 3> observers = {
      {{&all, STRIDEWIRE_DETAIL_ALL},
       {&fewer, STRIDEWIRE_DETAIL_REDUCED},
       {&root, STRIDEWIRE_DETAIL_ROOT}}};
  for (const auto& [observer, detail] : observers) {
    ASSERT_TRUE(observer->client.Observe(
        observer->world, {.mode = STRIDEWIRE_QUANTISED, .every_n_ticks = 1, .detail = detail}));
    ASSERT_EQ(observer->Collect(1, 1).size(), 1u);
  }
  ASSERT_TRUE(
      user.client.Request(user.world, {client::Step(1, 1, 0.55, 0.1), client::Step(1, 2, 0.55)}));
  std::array<std::vector<client::Pose>, 3> poses;
  for (std::size_t i = 0; i < 3; ++i) {
    poses[i] = observers[i].first->Collect(1, 120);
    ASSERT_EQ(poses[i].size(), 120u);
    for (const client::Pose& pose : poses[i]) ASSERT_EQ(pose.detail, observers[i].second);
  }
  EXPECT_GT(MovingJoints(poses[0]), MovingJoints(poses[1]));
  EXPECT_GT(MovingJoints(poses[1]), 8u);  // legs, spine and arms
  EXPECT_EQ(MovingJoints(poses[2]), 1u);

  // The root is equal in all details.
  std::size_t compared = 0;
  for (std::size_t i = 1; i < 3; ++i) {
    for (const client::Pose& pose : poses[i]) {
      const auto same = std::ranges::find(poses[0], pose.tick, &client::Pose::tick);
      if (same == poses[0].end()) continue;
      ++compared;
      for (int k = 0; k < 3; ++k) {
        ASSERT_EQ(pose.root_position_m[k], same->root_position_m[k]);
      }
      const auto& p = pose.rotations[0];
      const auto& q = same->rotations[0];
      ASSERT_LT(AngleBetween(Quat(p.w, p.x, p.y, p.z), Quat(q.w, q.x, q.y, q.z)), 0.012);
    }
  }
  EXPECT_GT(compared, 100u);
}

TEST(ClientAndServer, PosesAtRenderTimeAreInterpolated) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  Options options;
  options.render_delay_s = 0.5;  // test machines are busy
  User user(server.port(), STRIDEWIRE_CONTROLLER, options);
  user.Spawn(1);
  ASSERT_TRUE(user.client.Observe(user.world, STRIDEWIRE_QUANTISED));
  ASSERT_TRUE(user.client.Request(
      user.world, {client::Step(1, 1, 0.6), client::Step(1, 2, 0.6), client::Step(1, 3, 0.6)}));
  client::Pose pose;
  int interpolated = 0;
  double last_s = -1.0;
  ASSERT_TRUE(Eventually([&] {
    const auto time_s = user.client.RenderTime();
    if (!time_s || !user.client.SamplePose(user.world, 1, *time_s, pose)) return false;
    if (pose.kind == STRIDEWIRE_POSE_INTERPOLATED) {
      ++interpolated;
      EXPECT_GE(pose.time_s, last_s - 1e-9);
      last_s = pose.time_s;
    }
    return pose.root_position_m[2] > 1.0f;
  }));
  EXPECT_GT(interpolated, 20);
}

TEST(ClientAndServer, ReconnectsAfterTheServerWasKilled) {
  std::optional<Daemon> server(std::in_place);
  const std::uint16_t port = server->port();
  ASSERT_NE(port, 0);
  Options options;
  options.respawn = 1;
  User user(port, STRIDEWIRE_CONTROLLER, options);
  user.Spawn(2);
  ASSERT_TRUE(user.client.Observe(user.world, STRIDEWIRE_FULL));
  ASSERT_TRUE(user.client.Request(
      user.world, {client::Step(1, 1, 0.6), client::Step(1, 2, 0.6), client::Step(1, 3, 0.6)}));
  const auto finished = user.Next(STRIDEWIRE_EVENT_FINISHED);
  ASSERT_TRUE(finished);

  server->KillHard();
  server.reset();
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_CONNECTION_LOST));
  // A request without a connection waits.
  ASSERT_TRUE(user.client.Request(user.world, {client::Step(2, 9, 0.5)}));
  server.emplace(port);
  ASSERT_EQ(server->port(), port);
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_SESSION_LOST));
  // The avatars are on different shards, so that their events arrive in any order.
  std::optional<stridewire_event> spawned;
  std::optional<stridewire_event> started;
  ASSERT_TRUE(Eventually([&] {
    stridewire_event event;
    while (user.client.PollEvent(event)) {
      if (event.type == STRIDEWIRE_EVENT_SPAWNED && event.avatar == 1) spawned = event;
      if (event.type == STRIDEWIRE_EVENT_STARTED && !started) started = event;
    }
    return spawned && started;
  }));
  EXPECT_GE(spawned->base_position_m[2], finished->base_position_m[2] - 1e-9);
  EXPECT_EQ(started->request_id, 9u);
  client::Pose pose;
  EXPECT_TRUE(Eventually([&] {
    return user.client.LatestPose(user.world, 1, pose) && !pose.missing() &&
           user.client.ListAvatars(user.world).size() == 2;
  }));
  EXPECT_EQ(user.client.Statistics().connects, 2u);
  EXPECT_EQ(user.client.Statistics().resumes, 0u);
}

TEST(ClientAndServer, ReconnectsAfterTheServerWasRestarted) {
  std::optional<Daemon> server(std::in_place);
  const std::uint16_t port = server->port();
  ASSERT_NE(port, 0);
  User user(port);
  user.Spawn(1);
  EXPECT_EQ(server->Terminate(), 0);
  server.reset();
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_CONNECTION_LOST));
  server.emplace(port);
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_SESSION_LOST));
  EXPECT_TRUE(user.Next(STRIDEWIRE_EVENT_WORLD_JOINED));
}

TEST(ClientAndServer, MovesToAnotherServer) {
  std::optional<Daemon> first(std::in_place);
  std::optional<Daemon> second(std::in_place);
  const std::uint16_t port = first->port();
  ASSERT_NE(port, 0);
  ASSERT_NE(second->port(), 0);
  Options options;
  options.respawn = 1;
  User user(port, STRIDEWIRE_CONTROLLER, options,
            {{"127.0.0.1", port}, {"localhost", second->port()}});
  const auto connected = user.Next(STRIDEWIRE_EVENT_CONNECTED);
  ASSERT_TRUE(connected);
  EXPECT_EQ(connected->text, first->address());
  user.Spawn(1);
  const auto is_there = [&](const Daemon& server, const std::string& host) {
    const auto moved = user.Next(STRIDEWIRE_EVENT_CONNECTED);
    const auto spawned = user.Next(STRIDEWIRE_EVENT_SPAWNED);
    return moved && spawned && moved->text == host + ":" + std::to_string(server.port());
  };

  EXPECT_EQ(first->Terminate(), 0);  // A planned move.
  const auto left = user.Next(STRIDEWIRE_EVENT_CONNECTION_LOST);
  ASSERT_TRUE(left);
  EXPECT_EQ(left->status, STRIDEWIRE_SHUTTING_DOWN);
  EXPECT_TRUE(is_there(*second, "localhost"));
  EXPECT_EQ(user.client.Statistics().connect_failures, 0u);

  first.reset();
  first.emplace(port);
  second->KillHard();
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_CONNECTION_LOST));
  EXPECT_TRUE(is_there(*first, "127.0.0.1"));
}

/// Lets an avatar walk on a server that is killed again and again. Checks that the client receives
/// exactly one reply per command and at most one end per request, and that every displayed jump
/// starts a new segment.
class RestartObserver {
 public:
  explicit RestartObserver(User& user) : user_(user) {}

  /// Polls events, samples the avatar and keeps it walking until `done` returns true for an event.
  bool Until(const std::function<bool(const stridewire_event&)>& done) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(kPatienceS);
    while (std::chrono::steady_clock::now() < until) {
      bool is_done = false;
      stridewire_event event;
      while (user_.client.PollEvent(event)) {
        Count(event);
        is_done = is_done || done(event);
      }
      Sample();
      if (is_done) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(8));
    }
    return false;
  }

  void Request() {
    std::uint64_t command = 0;
    const std::uint64_t id = ++last_request_;
    EXPECT_TRUE(user_.client.Request(user_.world, {client::Step(1, id, 0.6)}, &command));
    replies_.emplace(command, 0);
    ends_.emplace(id, 0);
  }

  /// Checks the numbers of replies and ends. Call it after all replies have arrived.
  void Check() {
    for (const auto& [command, count] : replies_) EXPECT_EQ(count, 1) << "command " << command;
    for (const auto& [id, count] : ends_) EXPECT_LE(count, 1) << "request " << id;
  }

  [[nodiscard]] bool IsAnswered() const {
    return std::ranges::all_of(replies_, [](const auto& entry) { return entry.second > 0; });
  }

  void Print(int restarts) const {
    std::printf(
        "%d restarts: %zu requests, %d ended, %d lost with their session; %d samples in %d "
        "segments, fastest motion within a segment %.2f m/s\n",
        restarts, replies_.size(), ended_, lost_, samples_, segments_, fastest_m_s_);
  }

 private:
  void Count(const stridewire_event& event) {
    if (event.type == STRIDEWIRE_EVENT_REPLY) {
      if (const auto found = replies_.find(event.command); found != replies_.end()) {
        ++found->second;
        EXPECT_TRUE(event.status == STRIDEWIRE_OK || event.status == STRIDEWIRE_SESSION_LOST)
            << event.text;
        if (event.status == STRIDEWIRE_SESSION_LOST) ++lost_;
      }
    }
    if (event.outcome != STRIDEWIRE_OUTCOME_NONE) {
      ++ends_[event.request_id];
      ++ended_;
    }
  }

  void Sample() {
    const auto time_s = user_.client.RenderTime();
    if (!time_s || !user_.client.SamplePose(user_.world, 1, *time_s, pose_) || pose_.missing()) {
      return;
    }
    ++samples_;
    if (has_last_ && pose_.segment == last_.segment) {
      const double elapsed_s = pose_.time_s - last_.time_s;
      const double moved_m = std::hypot(pose_.root_position_m[0] - last_.root_position_m[0],
                                        pose_.root_position_m[2] - last_.root_position_m[2]);
      EXPECT_GE(elapsed_s, -1e-9);
      EXPECT_LE(moved_m, kFastestMPerS * elapsed_s + 1e-3);
      if (elapsed_s > 0.005) fastest_m_s_ = std::max(fastest_m_s_, moved_m / elapsed_s);
    } else {
      ++segments_;
    }
    last_ = pose_;
    has_last_ = true;
  }

  static constexpr double kFastestMPerS = 3.0;

  User& user_;
  std::map<std::uint64_t, int> replies_;  // Number of replies to each command.
  std::map<std::uint64_t, int> ends_;     // Number of ends of each request.
  std::uint64_t last_request_ = 0;
  client::Pose pose_;
  client::Pose last_;
  bool has_last_ = false;
  double fastest_m_s_ = 0.0;
  int ended_ = 0;
  int lost_ = 0;
  int samples_ = 0;
  int segments_ = 0;
};

TEST(ClientAndServer, SurvivesManyRestarts) {
  const char* count = std::getenv("STRIDEWIRE_RESTARTS");
  const int restarts = count != nullptr ? std::atoi(count) : 3;
  std::optional<Daemon> server(std::in_place);
  const std::uint16_t port = server->port();
  ASSERT_NE(port, 0);
  Options options;
  options.respawn = 1;
  User user(port, STRIDEWIRE_CONTROLLER, options);
  user.Spawn(1);
  ASSERT_TRUE(user.client.Observe(user.world));
  RestartObserver observer(user);
  const auto step_has_ended = [&](const stridewire_event& event) {
    return event.type == STRIDEWIRE_EVENT_FINISHED && event.request_id != 0;
  };
  for (int i = 0; i < restarts; ++i) {
    observer.Request();
    observer.Request();
    ASSERT_TRUE(observer.Until(step_has_ended)) << i;
    // These requests may be lost with the session, which their replies report.
    observer.Request();
    server->KillHard();
    server.reset();
    observer.Request();
    server.emplace(port);
    ASSERT_EQ(server->port(), port);
    ASSERT_TRUE(observer.Until([](const stridewire_event& event) {
      return event.type == STRIDEWIRE_EVENT_SESSION_LOST;
    })) << i;
    observer.Request();
    ASSERT_TRUE(observer.Until(step_has_ended)) << i;
  }
  const auto idle = [](const stridewire_event& event) {
    return event.type == STRIDEWIRE_EVENT_IDLE;
  };
  ASSERT_TRUE(observer.Until(idle));
  EXPECT_TRUE(observer.IsAnswered());
  observer.Check();
  observer.Print(restarts);
  EXPECT_EQ(user.client.Statistics().connects, static_cast<std::uint64_t>(restarts) + 1);
}

/// Displays an avatar and measures how far its joints move between two frames.
class DisplayedSteps {
 public:
  explicit DisplayedSteps(User& user) : user_(user) {}

  void Display() {
    if (skeleton_.joints.empty()) (void)user_.client.GetSkeleton(user_.world, skeleton_);
    const auto time_s = user_.client.RenderTime();
    if (!time_s || !user_.client.SamplePose(user_.world, 1, *time_s, pose_) || pose_.missing()) {
      return;
    }
    const std::vector<Vec3> joints_m = JointPositions();
    largest_m_s_.resize(joints_m.size());
    const double elapsed_s = pose_.time_s - last_time_s_;
    if (!last_m_.empty() && pose_.segment == last_segment_) {
      // Frames that are closer than those of a display with 120 Hz are compared with one of these.
      const auto frame_s = static_cast<float>(std::max(elapsed_s, 1.0 / 120.0));
      for (std::size_t j = 0; j < joints_m.size(); ++j) {
        largest_m_s_[j] =
            std::max(largest_m_s_[j], glm::length(joints_m[j] - last_m_[j]) / frame_s);
      }
    } else {
      ++segments_;
    }
    last_m_ = joints_m;
    last_time_s_ = pose_.time_s;
    last_segment_ = pose_.segment;
    delays_s_.push_back(user_.client.Playout().delay_s);
  }

  [[nodiscard]] double RatioTo(const DisplayedSteps& clean) const {
    double ratio = 0.0;
    for (std::size_t j = 0; j < largest_m_s_.size(); ++j) {
      ratio = std::max<double>(ratio, largest_m_s_[j] / clean.largest_m_s_.at(j));
    }
    return ratio;
  }
  [[nodiscard]] int segments() const { return segments_; }
  /// Returns the quantile `part` of the delays, for example their median for 0.5.
  [[nodiscard]] double DelayS(double part) {
    std::ranges::sort(delays_s_);
    return delays_s_.at(static_cast<std::size_t>(part * static_cast<double>(delays_s_.size() - 1)));
  }

 private:
  [[nodiscard]] std::vector<Vec3> JointPositions() const {
    std::vector<Vec3> positions_m;
    std::vector<Quat> rotations;
    for (std::size_t j = 0; j < skeleton_.joints.size(); ++j) {
      const auto& r = pose_.rotations[j];
      const Quat local(r.w, r.x, r.y, r.z);
      const stridewire_joint& joint = skeleton_.joints[j];
      const auto& root = pose_.root_position_m;
      if (joint.parent < 0) {
        positions_m.emplace_back(root[0], root[1], root[2]);
        rotations.push_back(local);
        continue;
      }
      const auto parent = static_cast<std::size_t>(joint.parent);
      const Vec3 offset_m(joint.offset_m[0], joint.offset_m[1], joint.offset_m[2]);
      positions_m.push_back(positions_m[parent] + rotations[parent] * offset_m);
      rotations.push_back(rotations[parent] * local);
    }
    return positions_m;
  }

  User& user_;
  client::Skeleton skeleton_;
  client::Pose pose_;
  std::vector<Vec3> last_m_;
  double last_time_s_ = 0.0;
  std::uint32_t last_segment_ = 0;
  std::vector<float> largest_m_s_;
  std::vector<double> delays_s_;
  int segments_ = 0;
};

// STRIDEWIRE_LINK_MINUTES sets the length of the test; the links then stall and are cut less often.
TEST(ClientAndServer, DisplaysSmoothlyThroughABadLink) {
  const char* minutes = std::getenv("STRIDEWIRE_LINK_MINUTES");
  const double length_s = minutes != nullptr ? 60.0 * std::atof(minutes) : 14.0;
  const std::uint64_t seed = 7;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Daemon server;
  ASSERT_NE(server.port(), 0);
  test::LinkProxy::Link link{.latency_s = 0.1, .jitter_s = 0.05, .stall_s = 2.0};
  link.stall_every_s = minutes != nullptr ? 17.0 : 9.0;
  link.cut_every_s = minutes != nullptr ? 10.0 : 4.0;
  test::LinkProxy proxy(server.port(), link, seed);
  ASSERT_NE(proxy.port(), 0);
  User walker(server.port());
  walker.Spawn(1);
  ASSERT_TRUE(walker.client.Observe(walker.world));
  User observer(proxy.port(), STRIDEWIRE_OBSERVER);
  ASSERT_TRUE(observer.client.Observe(observer.world));
  DisplayedSteps clean(walker);
  DisplayedSteps displayed(observer);
  const auto start = std::chrono::steady_clock::now();
  const auto passed_s = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::uint64_t steps = 0;
  double lost_s = 0.0;
  double slowest_s = 0.0;
  stridewire_event event;
  std::uint64_t last_poses = 0;
  while (passed_s() < length_s) {
    while (walker.client.PollEvent(event)) {
    }
    while (observer.client.PollEvent(event)) {
      if (event.type == STRIDEWIRE_EVENT_CONNECTION_LOST) lost_s = passed_s();
    }
    // A step takes about half a second.
    for (; static_cast<double>(steps) < 2.0 * passed_s() + 8.0; ++steps) {
      const double length_m = steps % 3 == 0 ? 0.45 : 0.6;
      ASSERT_TRUE(walker.client.Request(walker.world, {client::Step(1, steps + 1, length_m)}));
    }
    if (const auto poses = observer.client.Statistics().poses_received; poses > last_poses) {
      last_poses = poses;
      if (lost_s > 0.0) slowest_s = std::max(slowest_s, passed_s() - lost_s);
      lost_s = 0.0;
    }
    clean.Display();
    displayed.Display();
    std::this_thread::sleep_for(std::chrono::milliseconds(16));
  }
  const stridewire_playout playout = observer.client.Playout();
  std::printf(
      "%.0f s: largest step %.2f of the clean stream, %d segments, %d cuts, %d stalls, slowest "
      "recovery %.2f s; %llu of %llu poses extrapolated, %llu held; delay beyond the fastest "
      "message %.0f ms (median), %.0f ms (95 %%); clean: %.0f and %.0f ms\n",
      length_s, displayed.RatioTo(clean), displayed.segments(), proxy.cuts(), proxy.stalls(),
      slowest_s, static_cast<unsigned long long>(playout.extrapolated_poses),
      static_cast<unsigned long long>(playout.displayed_poses),
      static_cast<unsigned long long>(playout.held_poses), 1e3 * displayed.DelayS(0.5),
      1e3 * displayed.DelayS(0.95), 1e3 * clean.DelayS(0.5), 1e3 * clean.DelayS(0.95));
  EXPECT_GE(proxy.cuts(), 2);
  EXPECT_GE(proxy.stalls(), 1);
  EXPECT_LE(displayed.RatioTo(clean), 2.0);
}

// ---- stridewire-record

test::ProgramResult RecordTool(const std::vector<std::string>& arguments) {
  return RunProgram(STRIDEWIRE_RECORD, arguments, 200);
}

std::vector<std::string> RecordArguments(const std::string& address, const std::string& out) {
  return {"--connect", address, "--world", "plaza", "--avatar",    "1",
          "--seconds", "2",     "--out",   out,     "--timeout-s", "60"};
}

TEST(Record, WritesTheReceivedPoses) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  const ScratchFolder folder;
  User user(server.port(), STRIDEWIRE_CONTROLLER, LongHistory());
  user.Spawn(1);
  ASSERT_TRUE(user.client.Observe(user.world, STRIDEWIRE_FULL));
  std::vector<stridewire_movement> steps;
  for (std::uint64_t r = 1; r <= 20; ++r) steps.push_back(client::Step(1, r, 0.6));
  ASSERT_TRUE(user.client.Request(user.world, steps));
  auto arguments = RecordArguments(server.address(), folder.File("walk.bvh"));
  arguments.push_back("--json");
  const auto result = RecordTool(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = json::parse(result.out);
  EXPECT_EQ(report["frames"], 120);
  EXPECT_EQ(report["fps"], 60.0);
  EXPECT_LT(report["ticks_missing"], 60);  // a busy machine misses ticks
  EXPECT_TRUE(report["cut_short"].is_null());
  const auto capture = ReadBvh(folder.File("walk.bvh"), {});
  ASSERT_TRUE(capture) << Describe(capture.error());
  ASSERT_EQ(capture->clip.frame_count(), 120);
  // Compare the file with the poses of another observer.
  const std::uint64_t first_tick = report["first_tick"];
  client::Pose pose;
  int compared = 0;
  for (int f = 0; f < 120; ++f) {
    if (!user.client.NextPose(user.world, 1, first_tick + static_cast<std::uint64_t>(f) - 1,
                              pose) ||
        pose.missing() || pose.tick != first_tick + static_cast<std::uint64_t>(f)) {
      continue;
    }
    ++compared;
    const auto frame = capture->clip.frame(f);
    EXPECT_NEAR(frame.root_position_m.z, pose.root_position_m[2], 1e-5) << f;
    ASSERT_EQ(frame.rotations.size(), pose.rotations.size());
    for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
      const auto& q = pose.rotations[j];
      EXPECT_LT(AngleBetween(frame.rotations[j], Normalise(Quat(q.w, q.x, q.y, q.z))), 2e-3)
          << "frame " << f << " joint " << j;
    }
  }
  EXPECT_GT(compared, 60);
}

TEST(Record, InterpolatesMissingPoses) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  const ScratchFolder folder;
  User user(server.port());
  user.Spawn(1);
  auto arguments = RecordArguments(server.address(), folder.File("slow.bvh"));
  arguments[7] = "6";
  arguments.push_back("--json");
  ChildProcess record(STRIDEWIRE_RECORD, arguments);
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  server.Pause(std::chrono::milliseconds(1000));
  const auto line = record.ReadLineThatBegins("{", 120.0);
  ASSERT_TRUE(line);
  EXPECT_EQ(record.Wait(), 0);
  const json report = json::parse(*line);
  EXPECT_EQ(report["frames"], 360);
  EXPECT_GT(report["ticks_missing"], 30);  // missed by the server
  ASSERT_FALSE(report["gaps"].empty());
  EXPECT_GT(report["gaps"][0][0], 0);  // the first frame is a received one
  const auto capture = ReadBvh(folder.File("slow.bvh"), {});
  ASSERT_TRUE(capture) << Describe(capture.error());
  EXPECT_EQ(capture->clip.frame_count(), 360);
}

TEST(Record, ContinuesAfterTheServerWasKilled) {
  std::optional<Daemon> server(std::in_place);
  const std::uint16_t port = server->port();
  ASSERT_NE(port, 0);
  const ScratchFolder folder;
  Options options;
  options.respawn = 1;
  User user(port, STRIDEWIRE_CONTROLLER, options);
  user.Spawn(1);
  auto arguments = RecordArguments(server->address(), folder.File("restart.bvh"));
  arguments[7] = "20";
  arguments.push_back("--json");
  ChildProcess record(STRIDEWIRE_RECORD, arguments);
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  server->KillHard();
  server.reset();
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  server.emplace(port);
  const auto line = record.ReadLineThatBegins("{", 120.0);
  ASSERT_TRUE(line);
  EXPECT_EQ(record.Wait(), 0);
  const json report = json::parse(*line);
  EXPECT_TRUE(report["cut_short"].is_null());
  EXPECT_EQ(report["frames"], 1200);
  ASSERT_EQ(report["restarts"].size(), 1u);
  const double away_s = report["restarts"][0]["away_s"];
  EXPECT_GE(away_s, 0.5);
  // The gap ends at the first pose of the new server.
  const int frame = report["restarts"][0]["frame"];
  ASSERT_LT(frame, 1200);
  const int frames = static_cast<int>(std::round(60.0 * away_s)) - 1;
  EXPECT_THAT(report["gaps"], testing::Contains(json({frame - frames, frames})));
  const auto capture = ReadBvh(folder.File("restart.bvh"), {});
  ASSERT_TRUE(capture) << Describe(capture.error());
  ASSERT_EQ(capture->clip.frame_count(), 1200);
  // The frames of the gap repeat the last pose.
  const auto root = [&](int f) { return capture->clip.frame(f).root_position_m; };
  EXPECT_EQ(root(frame - frames - 1), root(frame - 1));
  EXPECT_NE(root(frame - 1), root(frame));
}

TEST(Record, WritesAPartialFileIfTheServerStops) {
  Daemon server;
  ASSERT_NE(server.port(), 0);
  const ScratchFolder folder;
  User user(server.port());
  user.Spawn(1);
  auto arguments = RecordArguments(server.address(), folder.File("short.bvh"));
  arguments[7] = "3000";
  arguments[11] = "2";
  ChildProcess record(STRIDEWIRE_RECORD, arguments);
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  server.KillHard();
  EXPECT_EQ(record.Wait(), 1);
  const auto capture = ReadBvh(folder.File("short.bvh"), {});
  ASSERT_TRUE(capture) << Describe(capture.error());
  EXPECT_GT(capture->clip.frame_count(), 5);
}

TEST(Record, ExitsWithTwoOnInvalidOptions) {
  const ScratchFolder folder;
  const std::string out = folder.File("a.bvh");
  const auto expect = [&](std::size_t index, const std::string& value, const std::string& named) {
    auto arguments = RecordArguments("127.0.0.1:1", out);
    arguments[index] = value;
    const auto result = RecordTool(arguments);
    EXPECT_EQ(result.exit_code, 2) << named << ": " << result.err;
    EXPECT_THAT(result.err, HasSubstr(named));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_TRUE(result.out.empty());
  };
  for (const char* address : {"localhost", "localhost:", ":7420", "localhost:0", "localhost:70000",
                              "localhost:7x", "::1:7420"}) {
    expect(1, address, "--connect");
  }
  expect(3, "", "--world");
  expect(3, std::string(65, 'w'), "--world");
  expect(5, "0", "--avatar");
  expect(5, "one", "--avatar");
  expect(7, "0", "--seconds");
  expect(7, "4000", "--seconds");
  expect(7, "nan", "--seconds");
  expect(9, folder.File("no/such/a.bvh"), "--out");
  expect(9, folder.path().string(), "--out");
  expect(11, "0", "--timeout-s");
  {
    auto arguments = RecordArguments("127.0.0.1:1", out);
    arguments.insert(arguments.end(), {"--mode", "wrong"});
    const auto result = RecordTool(arguments);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, HasSubstr("wrong"));
  }
  EXPECT_EQ(RecordTool({}).exit_code, 2);
  const auto unknown = RecordTool({"--nonsense"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("--nonsense: unknown option"));
  EXPECT_EQ(folder.Count(), 0);
  const auto help = RecordTool({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.out, HasSubstr("Example"));
  EXPECT_THAT(RecordTool({"--version"}).out, HasSubstr(kVersion));
}

TEST(Record, ReportsAMissingServerOrAvatar) {
  const ScratchFolder folder;
  const std::string out = folder.File("a.bvh");
  std::string address;
  {
    Daemon server;
    ASSERT_NE(server.port(), 0);
    address = server.address();
    auto arguments = RecordArguments(address, out);
    arguments[5] = "77";
    arguments[11] = "1";
    const auto nobody = RecordTool(arguments);
    EXPECT_EQ(nobody.exit_code, 1);
    EXPECT_THAT(nobody.err, HasSubstr("avatar 77 of world \"plaza\" sent no pose within"));
  }
  const auto refused = RecordTool(RecordArguments(address, out));
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("refused"));
  EXPECT_THAT(refused.err, HasSubstr(address));
  EXPECT_EQ(folder.Count(), 0);
}

#ifdef STRIDEWIRE_WALK_SAMPLE
TEST(Sample, ContinuesAfterAServerRestart) {
  std::optional<Daemon> server(std::in_place);
  const std::uint16_t port = server->port();
  ASSERT_NE(port, 0);
  ChildProcess sample(STRIDEWIRE_WALK_SAMPLE, {"127.0.0.1", std::to_string(port), "120"});
  const auto walks_to = [&](double wanted_m) {
    double z = 0.0;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (z < wanted_m && std::chrono::steady_clock::now() < until) {
      const auto line = sample.ReadLineThatBegins("root ");
      if (!line) return false;
      z = std::stod(line->substr(line->rfind(' ') + 1));
    }
    return z >= wanted_m;
  };
  ASSERT_TRUE(walks_to(1.0));
  server->KillHard();
  server.reset();
  ASSERT_TRUE(sample.ReadLineThatBegins("event 2"));  // CONNECTION_LOST
  server.emplace(port);
  ASSERT_TRUE(sample.ReadLineThatBegins("event 3"));  // SESSION_LOST
  EXPECT_TRUE(walks_to(3.0));
}
#endif

TEST(ClientAndServer, TerrainIsSetForAllClients) {
  Daemon daemon;
  User builder(daemon.port());
  User watcher(daemon.port(), STRIDEWIRE_OBSERVER);
  ASSERT_TRUE(watcher.Next(STRIDEWIRE_EVENT_WORLD_JOINED));
  client::Terrain flat;
  ASSERT_TRUE(watcher.client.GetTerrain(watcher.world, flat));
  EXPECT_EQ(flat.columns, 0u);
  EXPECT_TRUE(flat.boxes.empty());

  client::Terrain terrain;
  terrain.origin_m[0] = -1.5;
  terrain.cell_m = 0.5;
  terrain.columns = 2;
  terrain.rows = 3;
  EXPECT_FALSE(builder.client.SetTerrain(builder.world, terrain));
  terrain.heights_m = {0.0f, 0.125f, 0.25f, 0.5f, -0.5f, 1.0f};
  terrain.boxes = {{{0.0, 1.0}, {2.0, 3.0}, 0.25}};
  ASSERT_TRUE(builder.client.SetTerrain(builder.world, terrain));
  for (User* user : {&builder, &watcher}) {
    ASSERT_TRUE(user->Next(STRIDEWIRE_EVENT_TERRAIN));
    client::Terrain seen;
    ASSERT_TRUE(user->client.GetTerrain(user->world, seen));
    EXPECT_EQ(seen.origin_m[0], -1.5);
    EXPECT_EQ(seen.cell_m, 0.5);
    EXPECT_EQ(seen.columns, 2u);
    EXPECT_EQ(seen.rows, 3u);
    EXPECT_EQ(seen.heights_m, terrain.heights_m);
    ASSERT_EQ(seen.boxes.size(), 1u);
    EXPECT_EQ(seen.boxes[0].max_m[1], 3.0);
    EXPECT_EQ(seen.boxes[0].height_m, 0.25);
  }
  ASSERT_TRUE(builder.client.SetTerrain(builder.world, {}));
  ASSERT_TRUE(watcher.Next(STRIDEWIRE_EVENT_TERRAIN));
  ASSERT_TRUE(watcher.client.GetTerrain(watcher.world, terrain));
  EXPECT_EQ(terrain.columns, 0u);
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, AStepLandsOnTheTerrain) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(2);  // the second one does nothing
  client::Terrain terrain;
  terrain.boxes = {{{-5.0, 0.25}, {5.0, 5.0}, 0.1}};
  ASSERT_TRUE(user.client.SetTerrain(user.world, terrain));
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_REPLY));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));  // until the terrain applies
  ASSERT_TRUE(user.client.Request(user.world, {client::Step(1, 7, 0.5)}));
  const auto strike = user.Next(STRIDEWIRE_EVENT_FOOT_STRIKE);
  ASSERT_TRUE(strike);
  EXPECT_GT(strike->position_m[2], 0.25);
  EXPECT_NEAR(strike->position_m[1], 0.1, 0.03);
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, ALayerMovesTheArmAndNotTheLegs) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(1);
  ASSERT_TRUE(user.client.Observe(user.world, STRIDEWIRE_FULL));
  client::Skeleton skeleton;
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_REPLY));
  ASSERT_TRUE(user.client.GetSkeleton(user.world, skeleton));
  EXPECT_EQ(user.client.ListLayers(user.world), (std::vector<std::string>{"wave", "carry"}));
  EXPECT_TRUE(user.client.ListLayers(user.world + 1).empty());
  const auto joint = [&](const std::string& name) {
    std::size_t j = 0;
    while (j < skeleton.joints.size() && name != skeleton.joints[j].name) ++j;
    return j;
  };
  client::Pose before;
  const auto sample = [&](client::Pose& pose) {
    const auto time_s = user.client.RenderTime();
    return time_s && user.client.SamplePose(user.world, 1, *time_s, pose) && !pose.missing();
  };
  const auto until = [&](const std::function<bool()>& is_so) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!is_so() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return is_so();
  };
  ASSERT_TRUE(until([&] { return sample(before); }));
  ASSERT_TRUE(user.client.SetLayers(
      user.world, {client::StartLayer(1, "wave", 1.0, 0.1), client::StartLayer(1, "dance")}));
  const auto refused = user.Next(STRIDEWIRE_EVENT_ITEM);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->item_index, 1u);
  EXPECT_EQ(refused->status, STRIDEWIRE_NO_MOVEMENT);
  client::Pose pose;
  const auto turned = [&](const char* name) {
    const auto& a = before.rotations[joint(name)];
    const auto& b = pose.rotations[joint(name)];
    return std::abs(a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w) < 0.9f;
  };
  EXPECT_TRUE(until([&] { return sample(pose) && turned("RightArm"); }));
  EXPECT_FALSE(turned("LeftArm"));
  for (const char* name : {"Hips", "LeftUpLeg", "RightLeg", "LeftFoot"}) {
    EXPECT_FALSE(turned(name)) << name;
  }
  ASSERT_TRUE(user.client.SetLayers(user.world, {client::FadeOutLayer(1, "wave", 0.1)}));
  EXPECT_TRUE(until([&] { return sample(pose) && !turned("RightArm"); }));
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, AWalkArrives) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(1);
  ASSERT_TRUE(user.client.Request(user.world, {client::WalkTo(1, 7, {1.2, 0.0, 0.8}, 0.5)}));
  auto finished = user.Next(STRIDEWIRE_EVENT_FINISHED);
  int steps = 0;
  for (; finished && finished->kind != STRIDEWIRE_KIND_STAND; ++steps) {
    EXPECT_EQ(finished->request_id, 7u);
    finished = user.Next(STRIDEWIRE_EVENT_FINISHED);
  }
  ASSERT_TRUE(finished);
  EXPECT_GE(steps, 2);
  EXPECT_NEAR(finished->base_position_m[0], 1.2, 0.01);
  EXPECT_NEAR(finished->base_position_m[2], 0.8, 0.01);
  EXPECT_NEAR(finished->base_heading_rad, 0.5, 0.01);
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, ATeleportEndsRequestsAndMovesTheAvatar) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(1);
  ASSERT_TRUE(user.client.Observe(user.world));
  ASSERT_TRUE(user.client.Request(user.world, {client::Stand(1, 7, 100.0)}));
  ASSERT_TRUE(user.Next(STRIDEWIRE_EVENT_STARTED));
  client::Pose before;
  ASSERT_TRUE(Eventually([&] {
    const auto time_s = user.client.RenderTime();
    return time_s && user.client.SamplePose(user.world, 1, *time_s, before) && !before.missing();
  }));
  EXPECT_EQ(user.client.Teleport(user.world, {{0, {}, 0.0}}).status(), STRIDEWIRE_INVALID_ARGUMENT);
  ASSERT_TRUE(user.client.Teleport(user.world, {{1, {20.0, 0.0, 5.0}, 0.0}}));
  const auto ended = user.Next(STRIDEWIRE_EVENT_REJECTED);
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->request_id, 7u);
  EXPECT_EQ(ended->outcome, STRIDEWIRE_OUTCOME_CANCELLED);
  EXPECT_EQ(ended->status, STRIDEWIRE_DROPPED);
  EXPECT_STREQ(ended->text, "the request was cancelled");
  client::Pose pose;
  EXPECT_TRUE(Eventually([&] {
    return user.client.LatestPose(user.world, 1, pose) && !pose.missing() &&
           std::abs(pose.root_position_m[0] - 20.0f) < 0.1f;
  }));
  // Sampled poses before and after the teleport belong to different segments.
  EXPECT_NE(pose.segment, before.segment);
  EXPECT_TRUE(Eventually([&] {
    if (!user.client.SamplePose(user.world, 1, *user.client.RenderTime(), pose)) return false;
    EXPECT_EQ(pose.segment == before.segment, pose.root_position_m[0] < 10.0f);
    return pose.segment != before.segment;
  }));

  // The ids of living avatars cannot be used again.
  std::uint64_t command = 0;
  ASSERT_TRUE(user.client.Spawn(user.world, {{1, {}, 0.0}, {2, {}, 0.0}}, &command));
  auto reply = user.Next(STRIDEWIRE_EVENT_REPLY);
  while (reply && reply->command != command) reply = user.Next(STRIDEWIRE_EVENT_REPLY);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, STRIDEWIRE_AVATAR_EXISTS);
  EXPECT_EQ(reply->accepted, 1u);
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, AStepLandsOnItsFootprint) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(1);
  ASSERT_TRUE(user.client.Request(
      user.world, {client::StepTo(1, 7, {1.1, 0.0, 0.45}, 0.0, STRIDEWIRE_FOOT_LEFT)}));
  const auto strike = user.Next(STRIDEWIRE_EVENT_FOOT_STRIKE);
  ASSERT_TRUE(strike);
  EXPECT_EQ(strike->foot, STRIDEWIRE_FOOT_LEFT);
  EXPECT_NEAR(strike->position_m[0], 1.1, 0.01);
  EXPECT_NEAR(strike->position_m[2], 0.45, 0.01);
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, AnExactStepOutOfReachIsRejected) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(1);
  for (const stridewire_movement& bad :
       {client::ExactOnly(client::AllowNearest(client::Step(1, 7, 0.5))),
        client::ExactOnly(client::Jump(1, 7, 0.5)), client::AllowNearest(client::Stand(1, 7, 1.0)),
        client::AllowNearest(client::WalkTo(1, 7, {}, 0.0))}) {
    EXPECT_EQ(user.client.Request(user.world, {bad}).status(), STRIDEWIRE_INVALID_ARGUMENT);
  }
  ASSERT_TRUE(user.client.Request(
      user.world,
      {client::ExactOnly(client::StepTo(1, 7, {1.1, 0.0, 5.0}, 0.0, STRIDEWIRE_FOOT_LEFT)),
       client::ExactOnly(client::StepTo(1, 8, {1.1, 0.0, 0.45}, 0.0, STRIDEWIRE_FOOT_LEFT))}));
  const auto rejected = user.Next(STRIDEWIRE_EVENT_REJECTED);
  ASSERT_TRUE(rejected);
  EXPECT_EQ(rejected->request_id, 7u);
  EXPECT_EQ(rejected->status, STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_EQ(rejected->kind, STRIDEWIRE_KIND_STEP_LEFT);
  EXPECT_GT(rejected->position_m[2], 0.5);
  EXPECT_LT(rejected->position_m[2], 2.0);
  EXPECT_EQ(std::string(rejected->text).rfind("the footprint is out of reach: ", 0), 0u)
      << rejected->text;
  const auto strike = user.Next(STRIDEWIRE_EVENT_FOOT_STRIKE);
  ASSERT_TRUE(strike);
  EXPECT_EQ(strike->request_id, 8u);
  EXPECT_NEAR(strike->position_m[2], 0.45, 0.001);
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, AStepOutOfReachIsRejectedUnlessTheNearestIsAllowed) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(1);
  ASSERT_TRUE(user.client.Request(
      user.world, {client::Step(1, 7, 2.0), client::ExactOnly(client::Step(1, 8, 1.3)),
                   client::Jump(1, 9, 4.0), client::AllowNearest(client::Step(1, 10, 2.0)),
                   client::AllowNearest(client::Jump(1, 11, 4.0))}));
  const auto step = user.Next(STRIDEWIRE_EVENT_REJECTED);
  ASSERT_TRUE(step);
  EXPECT_EQ(step->request_id, 7u);
  EXPECT_EQ(step->status, STRIDEWIRE_OUT_OF_RANGE);
  EXPECT_NE(step->foot, STRIDEWIRE_FOOT_AUTO);
  EXPECT_GT(step->missed_m, 0.2);
  EXPECT_NEAR(step->nearest_length_m + step->missed_m, 2.0, 1e-6);
  EXPECT_GT(step->nearest_side_m, 0.05);
  const auto exact = user.Next(STRIDEWIRE_EVENT_REJECTED);
  ASSERT_TRUE(exact);
  EXPECT_EQ(exact->request_id, 8u);
  const auto jump = user.Next(STRIDEWIRE_EVENT_REJECTED);
  ASSERT_TRUE(jump);
  EXPECT_EQ(jump->request_id, 9u);
  EXPECT_EQ(jump->kind, STRIDEWIRE_KIND_JUMP);
  EXPECT_NEAR(jump->nearest_length_m + jump->missed_m, 4.0, 1e-6);
  std::vector<std::uint64_t> started;
  while (started.empty() || started.back() != 11) {
    const auto event = user.Next(STRIDEWIRE_EVENT_STARTED);
    ASSERT_TRUE(event);
    if (event->request_id == 0) continue;
    started.push_back(event->request_id);
    EXPECT_EQ(event->clamped, 1);
  }
  EXPECT_EQ(started, (std::vector<std::uint64_t>{10, 11}));
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(ClientAndServer, AWalkReportsItsSpeed) {
  Daemon daemon;
  User user(daemon.port());
  user.Spawn(1);
  const auto command =
      user.client.Request(user.world, {client::WalkTo(1, 7, {1.0, 0.0, 12.0}, 0.0, 4.0)});
  ASSERT_TRUE(command);
  const auto accepted = user.Next(STRIDEWIRE_EVENT_ACCEPTED);
  ASSERT_TRUE(accepted);
  EXPECT_EQ(accepted->clamped, 1);
  EXPECT_GT(accepted->speed_m_s, 1.0);
  EXPECT_LT(accepted->speed_m_s, 2.5);
  auto finished = user.Next(STRIDEWIRE_EVENT_FINISHED);
  while (finished && finished->kind != STRIDEWIRE_KIND_STAND) {
    EXPECT_EQ(finished->speed_m_s, 0.0);
    finished = user.Next(STRIDEWIRE_EVENT_FINISHED);
  }
  ASSERT_TRUE(finished);
  EXPECT_NEAR(finished->speed_m_s, accepted->speed_m_s, 0.08 * accepted->speed_m_s);
  EXPECT_EQ(daemon.Terminate(), 0);
}

}  // namespace
}  // namespace stridewire
