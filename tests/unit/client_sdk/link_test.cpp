// Tests what a client displays over links that delay, stall and cut messages. Time is simulated.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "runtime/avatar/avatar_simulation.h"
#include "session.h"
#include "stridewire/protocol/decode.h"
#include "stridewire/protocol/pose_rows.h"
#include "test_library.h"
#include "test_world.h"

namespace stridewire::client {
namespace {

constexpr double kTickS = 1.0 / 60.0;
constexpr double kStepS = 0.001;  // Resolution of the simulated time.

/// A link with TCP's order of messages. Each message takes `latency_s` plus a random part.
struct Link {
  double latency_s = 0.0;
  double jitter_s = 0.0;  ///< Standard deviation if `gaussian`, otherwise half of the range.
  bool gaussian = false;
  double stall_every_s = 0.0;  ///< 0: never. A stall lasts kStallS.
  double cut_every_s = 0.0;    ///< 0: never.

  static constexpr double kStallS = 2.0;

  [[nodiscard]] double Delay(std::mt19937_64& random) const {
    if (gaussian) return std::max(0.0, std::normal_distribution(latency_s, jitter_s)(random));
    return std::uniform_real_distribution(latency_s - jitter_s, latency_s + jitter_s)(random);
  }
  [[nodiscard]] bool Stalled(double now_s) const {
    return stall_every_s > 0.0 && std::fmod(now_s, stall_every_s) >= stall_every_s - kStallS;
  }
};

/// A displayed pose of the avatar.
struct Frame {
  double local_s = 0.0;
  double render_s = 0.0;
  bool extrapolated = false;
  bool held = false;
  std::uint32_t segment = 0;
  std::vector<Vec3> joints_m;
};

/// A server with one walking avatar, a link and a session that observes the avatar.
class Simulation {
 public:
  Simulation(const Link& first_link, std::uint64_t seed)
      : link(first_link), random_(seed), walk_(seed) {
    SessionOptions options;
    options.seed = seed;
    session_ = std::make_unique<Session>(options);
    EXPECT_EQ(session_->Open(now_s_), STRIDEWIRE_OK);
    EXPECT_EQ(session_->JoinWorld("plaza", protocol::Role::kObserver, world_, command_),
              STRIDEWIRE_OK);
    std::uint32_t subscription = 0;
    EXPECT_EQ(session_->Observe(world_, {}, subscription, command_), STRIDEWIRE_OK);
  }

  /// Runs until `until_s` and calls `display` for each frame of a display with 60 Hz.
  void Run(double until_s, const std::function<void(const Frame&)>& display) {
    while (now_s_ < until_s) {
      now_s_ = kStepS * static_cast<double>(++steps_);
      Tick();
      if (frozen) {
        // The server drops old messages for a client that does not read.
        while (down_.size() > 60) down_.pop_front();
        continue;
      }
      Cut();
      Transfer();
      Connect();
      if (now_s_ >= next_frame_s_) {
        next_frame_s_ += kTickS;
        Display(display);
      }
    }
  }

  Link link;            ///< May change between two calls of Run.
  bool frozen = false;  ///< True: the client does nothing, like a page that is hidden.

  [[nodiscard]] const Session& session() const { return *session_; }
  [[nodiscard]] double now_s() const { return now_s_; }
  /// Times from a cut until the next pose, without those of back-off and stalls.
  [[nodiscard]] const std::vector<double>& recoveries_s() const { return recoveries_s_; }
  [[nodiscard]] int stalls() const { return stalls_; }

 private:
  struct Sent {
    double arrival_s;
    std::vector<std::byte> bytes;
  };

  void Tick() {
    if (now_s_ < kTickS * static_cast<double>(tick_ + 1)) return;
    ++tick_;
    if (avatar_.queue_size() < 2) {
      StepRequest step;
      step.length_m = std::uniform_real_distribution(0.25, 0.6)(walk_);
      EXPECT_TRUE(avatar_.Enqueue({1, step}));
    }
    avatar_.Advance(kTickS);
    if (!observing_) return;
    const protocol::PoseBatchInfo info{
        .world = 5,
        .tick = tick_,
        .server_time_s = kTickS * static_cast<double>(tick_),
        .mode = protocol::PoseMode::kFull,
        .joint_count = static_cast<std::uint16_t>(library_->skeleton().joints.size())};
    protocol::PoseRows rows;
    (void)rows.Begin(
        info,
        std::make_shared<const std::vector<protocol::AvatarId>>(std::vector<protocol::AvatarId>{1}),
        nullptr);
    (void)rows.Add(0, avatar_.pose().root_position_m, avatar_.pose().rotations);
    std::vector<std::byte> frame;
    (void)protocol::PoseBatchComposer().Compose(rows, std::vector<std::uint32_t>{0}, {}, frame);
    SendDown(std::move(frame));
  }

  void Cut() {
    if (link.cut_every_s <= 0.0 || now_s_ < next_cut_s_) return;
    next_cut_s_ = now_s_ + link.cut_every_s;
    if (!connected_) return;
    connected_ = observing_ = false;
    up_.clear();
    down_.clear();
    cut_s_ = now_s_;
    stalled_s_ = 0.0;
    poses_at_cut_ = session_->Statistics().poses_received;
    session_->OnLost(STRIDEWIRE_CONNECTION_LOST, "", now_s_);
  }

  void Connect() {
    session_->AdvanceTime(now_s_);
    if (session_->ConnectDue(now_s_)) {
      session_->StartConnecting(now_s_);
      if (cut_s_) back_off_s_ = now_s_ - *cut_s_;
      connected_at_s_ = now_s_ + link.Delay(random_) + link.Delay(random_);
    }
    if (connected_at_s_ && now_s_ >= *connected_at_s_ && !link.Stalled(now_s_)) {
      connected_at_s_.reset();
      connected_ = true;
      last_arrival_s_ = 0.0;
      reader_.emplace(protocol::Sender::kClient);
      encoder_ = protocol::Encoder();
      session_->OnConnected(now_s_);
    }
  }

  void SendDown(std::vector<std::byte> bytes) {
    const double arrival_s = std::max(last_arrival_s_, now_s_ + link.Delay(random_));
    last_arrival_s_ = arrival_s;
    down_.push_back({arrival_s, std::move(bytes)});
  }
  template <typename Message>
  void Answer(const Message& message) {
    std::vector<std::byte> bytes;
    EXPECT_TRUE(encoder_.Encode(message, bytes));
    SendDown(std::move(bytes));
  }

  void Transfer() {
    const bool stalled = link.Stalled(now_s_);
    stalls_ += stalled && !was_stalled_ ? 1 : 0;
    was_stalled_ = stalled;
    if (stalled && !session_->ConnectDue(now_s_)) stalled_s_ += kStepS;
    std::vector<std::byte> bytes;
    while (connected_ && session_->TakeOutput(bytes)) {
      session_->OnOutputWritten();
      up_.push_back({now_s_ + link.Delay(random_), bytes});
    }
    if (stalled) return;
    while (!up_.empty() && up_.front().arrival_s <= now_s_) {
      std::span<const std::byte> rest(up_.front().bytes);
      for (;;) {
        auto frame = reader_->Next(rest);
        ASSERT_TRUE(frame);
        if (!*frame) break;
        auto message = protocol::DecodeMessage(**frame);
        ASSERT_TRUE(message);
        Serve(*message);
      }
      up_.pop_front();
    }
    while (!down_.empty() && down_.front().arrival_s <= now_s_) {
      const std::vector<std::byte> received = std::move(down_.front().bytes);
      down_.pop_front();
      session_->OnBytes(received, now_s_);
    }
    if (cut_s_ && session_->Statistics().poses_received > poses_at_cut_) {
      recoveries_s_.push_back(now_s_ - *cut_s_ - back_off_s_ - stalled_s_);
      cut_s_.reset();
    }
  }

  void Serve(const protocol::Message& message) {
    if (std::holds_alternative<protocol::Hello>(message)) {
      const bool resumed = !std::get<protocol::Hello>(message).resume_token.empty();
      Answer(test_world::Welcome(resumed));
      if (resumed) Answer(Info(0));
      observing_ = resumed;
    } else if (const auto* join = std::get_if<protocol::JoinWorld>(&message)) {
      Answer(Info(join->seq));
      Answer(test_world::Ok(join->seq));
    } else if (const auto* observe = std::get_if<protocol::Observe>(&message)) {
      Answer(test_world::Ok(observe->seq));
      observing_ = true;
    } else if (const auto* ping = std::get_if<protocol::Ping>(&message)) {
      protocol::Pong pong;
      pong.nonce = ping->nonce;
      pong.time_s = ping->time_s;
      pong.tick = tick_;
      pong.server_time_s = kTickS * static_cast<double>(tick_);
      Answer(pong);
    }
  }

  [[nodiscard]] protocol::WorldInfo Info(protocol::Seq seq) const {
    protocol::WorldInfo info;
    info.seq = seq;
    info.world = 5;
    info.name = "plaza";
    for (const Joint& joint : library_->skeleton().joints) {
      info.skeleton.joints.push_back(
          {joint.name, static_cast<std::int16_t>(joint.parent), joint.offset_m});
    }
    return info;
  }

  void Display(const std::function<void(const Frame&)>& display) {
    WorldView* view = session_->FindWorld(world_);
    if (view == nullptr || !session_->clock().ready()) return;
    PoseHistory* history = view->Find(1);
    if (history == nullptr) return;
    Frame frame;
    frame.local_s = now_s_;
    frame.render_s = session_->RenderTime(now_s_);
    Pose pose;
    pose.rotations.resize(library_->skeleton().joints.size());
    const auto sampled = history->Display(frame.render_s, pose.root_position_m, pose.rotations);
    if (!sampled) return;
    frame.extrapolated = sampled->extrapolated;
    frame.held = !sampled->interpolated && !sampled->extrapolated;
    frame.segment = history->stamp(sampled->index).segment;
    frame.joints_m.resize(pose.rotations.size());
    std::vector<Quat> rotations(pose.rotations.size());
    ForwardKinematics(library_->skeleton(), pose, frame.joints_m, rotations);
    display(frame);
  }

  std::shared_ptr<const MotionLibrary> library_ = MakeTestLibrary();
  AvatarSimulation avatar_ = AvatarSimulation(library_, {DVec3(0.0), 0.0});
  std::mt19937_64 random_;
  std::mt19937_64 walk_;
  std::unique_ptr<Session> session_;
  stridewire_world world_ = 0;
  std::uint64_t command_ = 0;
  double now_s_ = 0.0;
  std::uint64_t steps_ = 0;
  std::uint64_t tick_ = 0;
  double next_frame_s_ = 0.0;
  double next_cut_s_ = 10.0;
  bool connected_ = false;
  bool observing_ = false;
  bool was_stalled_ = false;
  int stalls_ = 0;
  std::optional<double> connected_at_s_;
  std::optional<double> cut_s_;
  double back_off_s_ = 0.0;
  double stalled_s_ = 0.0;  ///< Time for which the link has stalled since the cut.
  std::uint64_t poses_at_cut_ = 0;
  std::vector<double> recoveries_s_;
  double last_arrival_s_ = 0.0;
  std::optional<protocol::FrameReader> reader_;
  protocol::Encoder encoder_;
  std::deque<Sent> up_;
  std::deque<Sent> down_;
};

/// Compares each displayed pose with the one before it.
class Steps {
 public:
  void Add(const Frame& frame) {
    if (last_ && last_->segment == frame.segment) {
      largest_m.resize(frame.joints_m.size());
      for (std::size_t j = 0; j < largest_m.size(); ++j) {
        const float step_m = glm::length(frame.joints_m[j] - last_->joints_m[j]);
        largest_m[j] = std::max(largest_m[j], step_m);
      }
      const double speed = (frame.render_s - last_->render_s) / (frame.local_s - last_->local_s);
      slowest = std::min(slowest, speed);
      fastest = std::max(fastest, speed);
    } else if (last_) {
      ++segments;
    }
    ++frames;
    extrapolated += frame.extrapolated ? 1 : 0;
    held += frame.held ? 1 : 0;
    last_ = frame;
  }
  /// Returns the largest ratio of a joint's largest step to that in `clean`.
  [[nodiscard]] double RatioTo(const Steps& clean) const {
    double ratio = 0.0;
    for (std::size_t j = 0; j < largest_m.size(); ++j) {
      ratio = std::max(ratio, static_cast<double>(largest_m[j] / clean.largest_m[j]));
    }
    return ratio;
  }

  std::vector<float> largest_m;
  double slowest = 1.0;
  double fastest = 1.0;
  int frames = 0;
  int segments = 0;
  int extrapolated = 0;
  int held = 0;

 private:
  std::optional<Frame> last_;
};

constexpr double kMinutes = 10.0;

/// Returns what is displayed over a link without delay.
Steps RunClean(std::uint64_t seed) {
  Steps steps;
  Simulation(Link{}, seed).Run(60.0, [&](const Frame& f) { steps.Add(f); });
  return steps;
}

class LinkTest : public testing::TestWithParam<std::uint64_t> {};

TEST_P(LinkTest, DisplaysSmoothlyDespiteJitterStallsAndCuts) {
  const std::uint64_t seed = GetParam();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const Steps clean = RunClean(seed);
  const Link bad{.latency_s = 0.1, .jitter_s = 0.05, .stall_every_s = 17.0, .cut_every_s = 10.0};
  Simulation simulation(bad, seed);
  Steps steps;
  double longest_delay_s = 0.0;
  simulation.Run(60.0 * kMinutes, [&](const Frame& f) {
    steps.Add(f);
    if (f.local_s > 5.0) longest_delay_s = std::max(longest_delay_s, f.local_s - f.render_s);
  });
  const auto& recoveries_s = simulation.recoveries_s();
  ASSERT_GT(recoveries_s.size(), 50u);
  const double slowest_s = *std::ranges::max_element(recoveries_s);
  std::printf(
      "seed %llu: largest step %.2f of the clean stream, delay up to %.0f ms, %d of %d frames "
      "extrapolated, %d held, %d segments, %zu cuts, %d stalls, recovery within %.0f ms, speed "
      "%.3f to %.3f\n",
      static_cast<unsigned long long>(seed), steps.RatioTo(clean), 1e3 * longest_delay_s,
      steps.extrapolated, steps.frames, steps.held, steps.segments, recoveries_s.size(),
      simulation.stalls(), 1e3 * slowest_s, steps.slowest, steps.fastest);
  EXPECT_LE(steps.RatioTo(clean), 2.0);
  // Only cuts and stalls interrupt the motion.
  EXPECT_LE(steps.segments, static_cast<int>(recoveries_s.size()) + simulation.stalls());
  // The slowest message takes 100 ms longer than the fastest one, which takes 50 ms.
  EXPECT_LE(longest_delay_s - 0.05, 1.5 * (0.1 + kTickS));
  EXPECT_LT(slowest_s, 1.0);
  EXPECT_GE(steps.slowest, 0.95 - 1e-6);
  EXPECT_LE(steps.fastest, 1.05 + 1e-6);
}

TEST_P(LinkTest, DelayIsShortOverASteadyLink) {
  for (const double jitter_s : {0.0, 0.001, 0.003, 0.005}) {
    const std::uint64_t seed = GetParam();
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", jitter " << jitter_s);
    Simulation simulation(Link{.latency_s = 0.08, .jitter_s = jitter_s, .gaussian = true}, seed);
    double longest_delay_s = 0.0;
    Steps steps;
    simulation.Run(65.0, [&](const Frame& f) {
      if (f.local_s < 5.0) return;
      // Delay in addition to the mean latency. The simulated time has a resolution of kStepS.
      longest_delay_s = std::max(longest_delay_s, f.local_s - f.render_s - 0.08 - 2.0 * kStepS);
      steps.Add(f);
    });
    std::printf("jitter %.0f ms: delay up to %.1f ms, %d of %d frames extrapolated\n",
                1e3 * jitter_s, 1e3 * longest_delay_s, steps.extrapolated, steps.frames);
    EXPECT_LE(longest_delay_s, 1.5 * kTickS + 2.0 * jitter_s);
    EXPECT_LE(steps.extrapolated, steps.frames / 200);
    EXPECT_EQ(steps.held + steps.segments, 0);
  }
}

TEST_P(LinkTest, DelayFollowsAChangeWithinFiveSeconds) {
  const std::uint64_t seed = GetParam();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const Steps clean = RunClean(seed);
  const Link good{.latency_s = 0.1};
  const Link bad{.latency_s = 0.1, .jitter_s = 0.05};
  Simulation simulation(good, seed);
  Steps steps;
  for (int change = 0; change < 8; ++change) {
    const bool is_good = change % 2 == 0;
    simulation.link = is_good ? good : bad;
    const double since_s = simulation.now_s();
    const double fastest_s = is_good ? 0.1 : 0.05;
    const double needed_s = kTickS + (is_good ? 0.0 : 0.1);
    double longest_delay_s = 0.0;
    int late = 0;
    int frames = 0;
    simulation.Run(since_s + 10.0, [&](const Frame& f) {
      steps.Add(f);
      if (f.local_s < since_s + 5.0) return;
      longest_delay_s = std::max(longest_delay_s, f.local_s - f.render_s - fastest_s);
      late += f.extrapolated || f.held ? 1 : 0;
      ++frames;
    });
    EXPECT_LE(longest_delay_s, 1.5 * needed_s) << change;
    EXPECT_LE(late, frames / 50) << change;
  }
  EXPECT_EQ(steps.segments, 0);
  EXPECT_LE(steps.RatioTo(clean), 2.0);
  EXPECT_GE(steps.slowest, 0.95 - 1e-6);
  EXPECT_LE(steps.fastest, 1.05 + 1e-6);
}

TEST_P(LinkTest, ShowsThePresentAfterALongPause) {
  Simulation simulation(Link{.latency_s = 0.05, .jitter_s = 0.02}, GetParam());
  std::optional<Frame> last;
  const auto keep = [&](const Frame& f) { last = f; };
  simulation.Run(10.0, keep);
  ASSERT_TRUE(last);
  const std::uint32_t segment = last->segment;
  simulation.frozen = true;
  simulation.Run(610.0, keep);
  simulation.frozen = false;
  simulation.Run(610.1, keep);
  EXPECT_LT(610.1 - last->render_s, 0.2);
  EXPECT_FALSE(last->held || last->extrapolated);
  EXPECT_NE(last->segment, segment);
}

INSTANTIATE_TEST_SUITE_P(Seeds, LinkTest, testing::Values(1, 2, 3));

}  // namespace
}  // namespace stridewire::client
