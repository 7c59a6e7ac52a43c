// Tests what an observer counts and which errors it reports, with a scripted server.
#include "observer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <future>
#include <thread>

#include "fake_server.h"
#include "test_world.h"

namespace stridewire::load {
namespace {

using boost::asio::ip::tcp;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr protocol::WorldId kWorld = 4;
constexpr std::uint64_t kFirstTick = 100;
constexpr std::uint64_t kLastTick = 109;

LoadOptions Options() {
  LoadOptions options;
  options.avatars = 3;
  options.observers = 1;
  options.mode = protocol::PoseMode::kFull;
  return options;
}

class ObserverTest : public ::testing::Test {
 protected:
  ObserverTest()
      : observer_(context_, tcp::endpoint(boost::asio::ip::address_v4::loopback(), server_.port()),
                  run_, 0, nullptr) {
    run_.window.Set(kFirstTick, kLastTick);
    observer_.Open();
    thread_ = std::thread([this] { context_.io.run(); });
  }
  ~ObserverTest() override { Join(); }

  /// Runs the session up to the Reply to Observe.
  void Greet() {
    connection_ = server_.Accept();
    ASSERT_TRUE(connection_.Expect<protocol::Hello>().has_value());
    connection_.Send(test_world::Welcome());
    const auto join = connection_.Expect<protocol::JoinWorld>();
    ASSERT_TRUE(join.has_value());
    EXPECT_EQ(join->name, "load-0");
    EXPECT_EQ(join->role, protocol::Role::kObserver);
    connection_.Send(test_world::WorldInfo(join->seq, kWorld, join->name));
    connection_.Send(test_world::Ok(join->seq));
    const auto observe = connection_.Expect<protocol::Observe>();
    ASSERT_TRUE(observe.has_value());
    EXPECT_EQ(observe->world, kWorld);
    EXPECT_EQ(observe->mode, protocol::PoseMode::kFull);
    connection_.Send(test_world::Ok(observe->seq));
  }

  void SendTick(std::uint64_t tick,
                const std::vector<test_world::AvatarAt>& avatars = {{1}, {2}, {3}}) {
    connection_.SendBytes(test_world::PoseFrame(kWorld, tick, avatars));
  }

  /// Sends one more message and waits until the observer has handled it and all messages before it.
  void Sync() {
    synced_dropped_ += 1;
    protocol::Lagging lagging;
    lagging.world = kWorld;
    lagging.dropped_batches = synced_dropped_;
    connection_.Send(lagging);
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    for (;;) {
      std::uint64_t dropped = 0;
      OnThread([&] { dropped = observer_.Counts().batches_dropped; });
      if (dropped >= synced_dropped_) return;
      ASSERT_LT(std::chrono::steady_clock::now(), until);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  /// Drops the connection and completes the handshake of the next one.
  void ComeBack() {
    Sync();
    OnThread([&] { observer_.Drop(0.0); });
    EXPECT_TRUE(connection_.WaitForClose());
    OnThread([&] { observer_.Poll(NowNs() + kSecondNs); });
    Greet();
    synced_dropped_ = 1;  // The count of a new connection starts at 0; the total continues.
  }

  template <typename F>
  void OnThread(F&& task) {
    std::promise<void> done;
    boost::asio::post(context_.io, [&] {
      task();
      done.set_value();
    });
    done.get_future().wait();
  }

  /// Stops the observer. Its counters can be read afterwards.
  ObserverCounts Join() {
    if (thread_.joinable()) {
      context_.io.stop();
      thread_.join();
    }
    return observer_.Counts();
  }

  const LoadOptions options_ = Options();
  RunState run_{options_, nullptr, nullptr};
  FakeServer server_;
  FakeConnection connection_;
  ThreadContext context_;
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_{
      context_.io.get_executor()};
  Observer observer_;
  std::thread thread_;
  std::uint64_t synced_dropped_ = 0;
};

TEST_F(ObserverTest, CountsThePosesOfTheWindow) {
  Greet();
  std::size_t bytes = 0;
  for (std::uint64_t tick = kFirstTick - 2; tick <= kLastTick + 2; ++tick) {
    SendTick(tick, {{1}, {2, protocol::kPoseStanding}, {3}});
    bytes = test_world::PoseFrame(kWorld, tick, {{1}, {2}, {3}}).size();
  }
  Sync();
  EXPECT_TRUE(observer_.sees_all());
  EXPECT_TRUE(observer_.saw_last_tick());
  EXPECT_EQ(observer_.latest_tick(), kLastTick + 2);
  EXPECT_EQ(observer_.avatar_count(), 3u);
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_received, 30u);
  EXPECT_EQ(counts.poses_moving, 20u);
  EXPECT_EQ(counts.bytes_received, 10 * bytes);
  EXPECT_EQ(counts.poses_invalid, 0u);
  EXPECT_THAT(run_.errors.Texts(), IsEmpty());
}

// The observers select different avatars, distributed over the crowd and all worlds.
TEST(PartialObserver, ObservesTheRequestedNumberOfAvatars) {
  LoadOptions options = Options();
  options.avatars = 10;
  options.worlds = 2;
  options.partial_observers = 2;
  options.partial_avatars = 4;
  RunState run{options, nullptr, nullptr};
  FakeServer server;
  for (int which = 0; which < options.partial_observers; ++which) {
    ThreadContext context;
    Observer observer(context,
                      tcp::endpoint(boost::asio::ip::address_v4::loopback(), server.port()), run,
                      options.observers + which, nullptr);
    EXPECT_EQ(observer.avatar_count(), 4u);
    observer.Open();
    auto work = boost::asio::make_work_guard(context.io);
    std::thread thread([&] { context.io.run(); });
    FakeConnection connection = server.Accept();
    EXPECT_TRUE(connection.Expect<protocol::Hello>().has_value());
    connection.Send(test_world::Welcome());
    std::vector<std::vector<protocol::AvatarId>> named;
    for (protocol::WorldId world = 1; world <= 2; ++world) {
      const auto join = connection.Expect<protocol::JoinWorld>();
      ASSERT_TRUE(join.has_value());
      connection.Send(test_world::WorldInfo(join->seq, world, join->name));
      connection.Send(test_world::Ok(join->seq));
    }
    for (int world = 0; world < 2; ++world) {
      const auto observe = connection.Expect<protocol::Observe>();
      ASSERT_TRUE(observe.has_value());
      named.push_back(observe->avatars);
      connection.Send(test_world::Ok(observe->seq));
    }
    // The crowd in order of worlds is 1 3 5 7 9, 2 4 6 8 10. The second observer starts one later.
    if (which == 0) {
      EXPECT_THAT(named, ElementsAre(ElementsAre(1, 5), ElementsAre(2, 6)));
    } else {
      EXPECT_THAT(named, ElementsAre(ElementsAre(3, 7), ElementsAre(4, 8)));
    }
    context.io.stop();
    thread.join();
  }
}

TEST_F(ObserverTest, WaitsForEveryAvatar) {
  Greet();
  SendTick(kFirstTick, {{1}, {3}});
  Sync();
  EXPECT_FALSE(observer_.sees_all());
  EXPECT_FALSE(observer_.saw_last_tick());
}

TEST_F(ObserverTest, IgnoresForeignAvatars) {
  Greet();
  SendTick(kFirstTick, {{1}, {2}, {3}, {4}, {1000}});
  Sync();
  EXPECT_EQ(Join().poses_received, 3u);
  EXPECT_THAT(run_.errors.Texts(), IsEmpty());
}

TEST_F(ObserverTest, ReportsABatchThatIsNotNewer) {
  Greet();
  SendTick(kFirstTick);
  SendTick(kFirstTick);
  SendTick(kFirstTick - 1);
  Sync();
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_received, 3u);
  EXPECT_EQ(counts.poses_invalid, 2u);
  EXPECT_TRUE(run_.failed);
  EXPECT_THAT(run_.errors.Texts(),
              ElementsAre(HasSubstr("load-0 at tick 100: the tick of a batch does not increase"),
                          HasSubstr("load-0 at tick 99: the tick of a batch does not increase")));
}

TEST_F(ObserverTest, ReportsAnAvatarThatAppearsTwice) {
  Greet();
  SendTick(kFirstTick, {{1}, {2}, {1}});
  connection_.SendBytes(
      test_world::PoseFrame(kWorld, kFirstTick, {{2}}, protocol::PoseMode::kFull, /*shard=*/1));
  Sync();
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_received, 2u);
  EXPECT_EQ(counts.poses_invalid, 2u);
  EXPECT_THAT(run_.errors.Texts(), ElementsAre(HasSubstr("avatar 1 appeared twice"),
                                               HasSubstr("avatar 2 appeared twice")));
}

TEST_F(ObserverTest, ReportsAnUnflaggedDiscontinuity) {
  Greet();
  // The test avatars walk at 1.5 m/s. They need 133 s for 200 m, but cannot move 1 m in one tick.
  const auto frame_at = [](std::uint64_t tick, float x_m, std::uint8_t flags) {
    return test_world::PoseFrame(kWorld, tick, {{1, flags, Vec3(x_m, 1.0f, 0.0f)}});
  };
  connection_.SendBytes(frame_at(100, 0.0f, 0));
  connection_.SendBytes(frame_at(101, 0.2f, 0));
  connection_.SendBytes(frame_at(102, 9.0f, protocol::kPoseDiscontinuity));
  connection_.SendBytes(frame_at(103, 10.0f, 0));
  connection_.SendBytes(frame_at(109, 11.0f, 0));  // In six ticks, 1 m is not too fast.
  Sync();
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_received, 5u);
  EXPECT_EQ(counts.poses_invalid, 1u);
  EXPECT_THAT(run_.errors.Texts(), ElementsAre(HasSubstr("at tick 103: avatar 1 moved 1.0")));
}

TEST_F(ObserverTest, ReportsAnInvalidPose) {
  Greet();
  std::vector<std::byte> frame = test_world::PoseFrame(kWorld, kFirstTick, {{1}});
  // Replaces every 1.0f by 2.0f, so that no quaternion is a unit quaternion.
  constexpr std::array kOne = {std::byte{0}, std::byte{0}, std::byte{0x80}, std::byte{0x3f}};
  constexpr std::array kTwo = {std::byte{0}, std::byte{0}, std::byte{0}, std::byte{0x40}};
  int changed = 0;
  for (auto at = frame.begin();
       (at = std::search(at, frame.end(), kOne.begin(), kOne.end())) != frame.end(); ++changed) {
    std::ranges::copy(kTwo, at);
  }
  ASSERT_GE(changed, 2);
  connection_.SendBytes(frame);
  Sync();
  EXPECT_EQ(Join().poses_invalid, 1u);
  EXPECT_THAT(run_.errors.Texts(), ElementsAre(HasSubstr("at tick 100: avatar 1: ")));
}

TEST_F(ObserverTest, ReportsAnotherModeOrSkeleton) {
  Greet();
  connection_.SendBytes(
      test_world::PoseFrame(kWorld, kFirstTick, {{1}}, protocol::PoseMode::kQuantised));
  connection_.SendBytes(test_world::PoseFrame(kWorld, kFirstTick, {{1}}, protocol::PoseMode::kFull,
                                              0, test_world::kJoints + 1));
  Sync();
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_received, 0u);
  EXPECT_EQ(counts.poses_invalid, 2u);
}

TEST_F(ObserverTest, SumsTheBatchesThatTheServerDropped) {
  Greet();
  for (const std::uint64_t dropped : {5u, 5u, 12u}) {
    protocol::Lagging lagging;
    lagging.world = kWorld;
    lagging.dropped_batches = dropped;
    connection_.Send(lagging);
  }
  synced_dropped_ = 19;
  Sync();
  EXPECT_EQ(Join().batches_dropped, 20u);
}

TEST_F(ObserverTest, ReportsARefusedJoin) {
  connection_ = server_.Accept();
  ASSERT_TRUE(connection_.Expect<protocol::Hello>().has_value());
  connection_.Send(test_world::Welcome());
  const auto join = connection_.Expect<protocol::JoinWorld>();
  ASSERT_TRUE(join.has_value());
  protocol::Reply reply;
  reply.seq = join->seq;
  reply.code = protocol::StatusCode::kNoSuchWorld;
  reply.text = "there is none";
  connection_.Send(reply);
  while (!run_.failed) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  Join();
  EXPECT_THAT(run_.errors.Texts(),
              ElementsAre(HasSubstr("refused to let it join: no_such_world there is none")));
}

TEST_F(ObserverTest, ExcusesPosesWhileItIsDropped) {
  Greet();
  SendTick(100);
  SendTick(101);
  ComeBack();
  SendTick(106);
  SendTick(107);
  Sync();
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_received, 4 * 3u);
  EXPECT_EQ(counts.poses_excused, 4 * 3u);  // 102 to 105
  EXPECT_EQ(counts.poses_invalid, 0u);
  EXPECT_EQ(observer_.reconnect_count(), 1u);
  EXPECT_FALSE(run_.failed);
}

// In mode movement, the states of a tick can arrive after its changes.
TEST_F(ObserverTest, ExcusesPosesUntilTheFirstStateAfterAReconnect) {
  Greet();
  SendTick(100);
  ComeBack();
  SendTick(104, {});
  SendTick(105, {{1}});
  SendTick(106);
  Sync();
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_received, 3 + 1 + 3u);
  EXPECT_EQ(counts.poses_excused, 4 * 1 + 5 * 2u);  // 101 to 104, 101 to 105
  EXPECT_EQ(counts.poses_invalid, 0u);
}

TEST_F(ObserverTest, ExpectsAllPosesOneSecondAfterAReconnect) {
  run_.window.Set(kFirstTick, kFirstTick + 1000);
  Greet();
  SendTick(100);
  ComeBack();
  SendTick(111, {{1}, {2}});
  Sync();
  const ObserverCounts counts = Join();
  const auto moment = static_cast<std::uint64_t>(Observer::kReconnectS * run_.tick_hz);
  // Ticks 101 to 110 for all three avatars, and one second for avatar 3, which has not arrived.
  EXPECT_EQ(counts.poses_excused, 10 * 3 + moment);
}

TEST_F(ObserverTest, ReportsALostConnectionOnce) {
  Greet();
  SendTick(100);
  Sync();
  connection_.Close();
  while (!run_.failed) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  // A failed attempt to reconnect is not reported.
  OnThread([&] { observer_.Poll(NowNs() + 10 * kSecondNs); });
  connection_ = server_.Accept();
  ASSERT_TRUE(connection_.Expect<protocol::Hello>().has_value());
  connection_.Close();
  OnThread([] {});
  const ObserverCounts counts = Join();
  EXPECT_EQ(counts.poses_excused, 0u);
  EXPECT_THAT(run_.errors.Texts(), ElementsAre(HasSubstr("load observer 0: connection lost")));
}

}  // namespace
}  // namespace stridewire::load
