// Measures the cost of one more observer for a tick of the server. The poses are already encoded;
// the session selects them and passes the bytes to the operating system. For comparison, the floor
// is the cost of passing the same bytes to the operating system and nothing else.
//
//   in_process   sessions and their queues, above a transport that discards all bytes
//   sockets      the same with TCP over loopback
//   floor        one sendmsg per socket with existing frames
//
// The readers read received bytes while the clock is stopped, so that everything runs on one core.

#include <benchmark/benchmark.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <ctime>
#include <map>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "base/check.h"
#include "bench_libraries.h"
#include "net/tcp_transport.h"
#include "session/session.h"
#include "world/pose_frames.h"

namespace stridewire {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using server::PoseDelivery;
using server::SharedFrame;

constexpr std::uint32_t kAvatars = 1000;
constexpr float kSideM = 100.0f;  // Side of the square in which the avatars stand, in metres.
constexpr std::size_t kNamedCount = 100;
// About 30 avatars are in a region of this radius, in metres.
constexpr double kRegionRadiusM = 10.0;
constexpr std::size_t kSocketBufferBytes = std::size_t{4} << 20;

enum class Watch : std::uint8_t { kAll, kNamed, kRegion };
enum class Through : std::uint8_t { kInProcess, kSockets, kFloor };

/// The poses of a shard for one tick: compact poses, encoded once.
struct Crowd {
  explicit Crowd(const std::shared_ptr<const MotionLibrary>& library) {
    world = std::make_shared<server::World>();
    world->id = 1;
    world->name = "crowd";
    world->library = library;
    world->quantizations = server::MakePoseQuantizations(*library);
    std::vector<protocol::AvatarId> numbers(kAvatars);
    std::iota(numbers.begin(), numbers.end(), 1u);
    auto rows = std::make_shared<protocol::PoseRows>();
    auto grid = std::make_shared<server::SpatialGrid>();
    const Pose& pose = library->stand_pose();
    Status status = rows->Begin({.world = world->id,
                                 .tick = 1,
                                 .mode = protocol::PoseMode::kCompact,
                                 .joint_count = static_cast<std::uint16_t>(pose.rotations.size())},
                                std::make_shared<const std::vector<protocol::AvatarId>>(numbers),
                                world->quantizations->codecs.Find(protocol::PoseMode::kCompact));
    grid->Begin(world->interest_cell_m, kAvatars);
    std::mt19937 random(1);
    for (std::uint32_t row = 0; row < kAvatars; ++row) {
      const Vec3 root_m(Draw(random), pose.root_position_m.y, Draw(random));
      if (status) status = rows->Add(0, root_m, pose.rotations);
      grid->Add(row, root_m.x, root_m.z);
    }
    STRIDEWIRE_CHECK(status.has_value());
    grid->Sort();
    std::vector<std::uint32_t> all(kAvatars);
    std::iota(all.begin(), all.end(), 0u);
    protocol::PoseBatchComposer composer;
    server::ThreadMetrics metrics;
    delivery = {.world = world->id,
                .mode = protocol::PoseMode::kCompact,
                .tick = 1,
                .avatar_count = kAvatars,
                .parts = server::ComposeFrames(composer, *rows, all, false, metrics),
                .rows = rows,
                .grid = grid};
  }
  static float Draw(std::mt19937& random) {
    return kSideM * static_cast<float>(random() % 1'000'000) / 1e6f;
  }

  std::shared_ptr<server::World> world;
  PoseDelivery delivery;
};

/// The observer's end of a connection over loopback. Counts and discards the received bytes.
class Reader {
 public:
  explicit Reader(tcp::acceptor& acceptor) : socket_(acceptor.get_executor()) {
    socket_.open(tcp::v4());
    socket_.set_option(asio::socket_base::receive_buffer_size(kSocketBufferBytes));
    socket_.connect(acceptor.local_endpoint());
  }
  std::size_t Drain() {
    std::size_t bytes = 0;
    for (;;) {
      // Without a buffer, TCP discards this number of received bytes.
      const ssize_t some =
          recv(socket_.native_handle(), nullptr, std::size_t{1} << 30, MSG_TRUNC | MSG_DONTWAIT);
      if (some <= 0) return bytes;
      bytes += static_cast<std::size_t>(some);
    }
  }

 private:
  tcp::socket socket_;
};

/// A transport that sends everything at once.
class NoTransport final : public server::Transport {
 public:
  explicit NoTransport(asio::io_context& context) : context_(context) {}
  server::TransportKind kind() const override { return server::TransportKind::kTcp; }
  asio::any_io_executor executor() override { return context_.get_executor(); }
  void Prepare(server::Traffic& /*traffic*/, std::size_t /*bytes*/) override {}
  void Receive(std::shared_ptr<User> /*user*/, std::span<std::byte> /*buffer*/) override {}
  bool Send(std::shared_ptr<User> /*user*/, std::span<const SharedFrame> /*frames*/,
            std::size_t /*joined_frames*/) override {
    return true;
  }
  void KeepAlive(std::shared_ptr<User> /*user*/) override {}
  bool End(std::shared_ptr<User> /*user*/, server::CloseCode /*code*/) override { return false; }
  void Close() override {}
  void Detach() override {}
  bool Attach(asio::io_context& /*context*/) override { return true; }

 private:
  asio::io_context& context_;
};

/// A shard without avatars. All its sessions observe the same world.
class Host final : public server::SessionHost {
 public:
  explicit Host(const Crowd& crowd) : crowd_(crowd) {
    config_.limits.socket_send_buffer_bytes = kSocketBufferBytes;
  }
  const server::Config& config() const override { return config_; }
  int shard_index() const override { return 0; }
  int shard_count() const override { return 1; }
  const server::TickClock& clock() const override { return clock_; }
  std::uint64_t tick() const override { return 1; }
  bool is_draining() const override { return false; }
  server::AvatarBudget& avatar_budget() override { return budget_; }
  server::ThreadMetrics& metrics() override { return metrics_; }
  protocol::Encoder& encoder() override { return encoder_; }
  protocol::PoseBatchComposer& composer() override { return composer_; }
  void SendToShard(int /*shard*/, server::ShardMessage /*message*/) override {}
  void SendToServer(server::ServerMessage message) override {
    if (const auto* join = std::get_if<server::JoinRequest>(&message)) {
      sessions_[join->session - 1]->OnJoined(join->seq, crowd_.world);
    }
  }
  void DestroySession(server::SessionId /*session*/) override {}
  void InterestChanged(const std::shared_ptr<server::World>& /*world*/) override {}
  void SelectionChanged(server::WorldId /*world*/) override {}

  void Add(std::shared_ptr<server::Connection> connection, protocol::Observe&& observe) {
    const server::SessionId id = sessions_.size() + 1;
    sessions_.push_back(std::make_unique<server::Session>(
        server::SessionIdentity{id, std::vector<std::byte>(16), "bench"}, *this));
    std::vector<std::byte> commands;
    observe.seq = 2;
    Status status = encoder_.Encode(
        protocol::JoinWorld{.seq = 1, .name = "crowd", .role = protocol::Role::kObserver},
        commands);
    if (status) status = encoder_.Encode(observe, commands);
    STRIDEWIRE_CHECK(status.has_value());
    protocol::Hello hello;
    hello.client_name = "bench";
    sessions_.back()->Attach(std::move(connection), hello, false, commands);
  }

  /// Delivers poses like Shard::Deliver.
  void Tick(const PoseDelivery& delivery) {
    server::SharedPoses poses(delivery, composer_, metrics_);
    for (const auto& session : sessions_) session->OnPoses(poses);
  }

 private:
  const Crowd& crowd_;
  server::Config config_;
  server::TickClock clock_{server::TickClock::Clock::now(), 60.0};
  server::AvatarBudget budget_{1000, 1000};
  server::ThreadMetrics metrics_;
  protocol::Encoder encoder_;
  protocol::PoseBatchComposer composer_;
  std::vector<std::unique_ptr<server::Session>> sessions_;
};

/// The subscription of an observer, and the frames that it should receive.
struct Wanted {
  protocol::Observe observe;
  std::vector<SharedFrame> frames;
};

Wanted Want(const Crowd& crowd, Watch watch, std::mt19937& random,
            protocol::PoseBatchComposer& composer) {
  Wanted wanted{.observe = {.world = crowd.world->id,
                            .subscription = 1,
                            .mode = protocol::PoseMode::kQuantised},
                .frames = crowd.delivery.parts};
  if (watch == Watch::kAll) return wanted;
  std::vector<std::uint32_t> rows;
  if (watch == Watch::kNamed) {
    std::vector<std::uint32_t> all(kAvatars);
    std::iota(all.begin(), all.end(), 0u);
    std::ranges::sample(all, std::back_inserter(rows), kNamedCount, random);
    for (const std::uint32_t row : rows) wanted.observe.avatars.push_back(row + 1);
  } else {
    protocol::Region& region = wanted.observe.region.emplace();
    region.centre_m = {Crowd::Draw(random), Crowd::Draw(random)};
    region.radius_m = kRegionRadiusM;
    server::RegionMembers members;
    members.Set(region, crowd.world->interest_cell_m, 1, crowd.delivery.mode);
    const auto due = members.Update(crowd.delivery).due;
    rows.assign(due.begin(), due.end());
  }
  server::ThreadMetrics metrics;
  wanted.frames =
      server::ComposeFrames(composer, *crowd.delivery.rows, rows, watch == Watch::kRegion, metrics);
  return wanted;
}

/// Passes bytes of frames to the operating system until all are passed or the socket accepts no
/// more.
class Writer {
 public:
  explicit Writer(tcp::acceptor& acceptor) : socket_(acceptor.accept()) {
    socket_.set_option(tcp::no_delay(true));
    socket_.set_option(asio::socket_base::send_buffer_size(kSocketBufferBytes));
  }
  void Begin(std::span<const SharedFrame> frames) {
    pieces_.clear();
    for (const SharedFrame& frame : frames) {
      pieces_.push_back({const_cast<std::byte*>(frame->data()), frame->size()});
    }
    first_ = 0;
  }
  void Write() {
    while (first_ < pieces_.size()) {
      msghdr message{};
      message.msg_iov = &pieces_[first_];
      message.msg_iovlen = pieces_.size() - first_;
      const ssize_t sent = sendmsg(socket_.native_handle(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (sent <= 0) return;
      auto bytes = static_cast<std::size_t>(sent);
      while (first_ < pieces_.size() && bytes >= pieces_[first_].iov_len) {
        bytes -= pieces_[first_++].iov_len;
      }
      if (bytes > 0) {
        pieces_[first_].iov_base = static_cast<std::byte*>(pieces_[first_].iov_base) + bytes;
        pieces_[first_].iov_len -= bytes;
      }
    }
  }

 private:
  tcp::socket socket_;
  std::vector<iovec> pieces_;
  std::size_t first_ = 0;
};

double ThreadTimeS() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Raises the limit on open files for `count` observers with two sockets each.
bool AllowSockets(std::size_t count) {
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0) return false;
  files.rlim_cur = files.rlim_max;
  return setrlimit(RLIMIT_NOFILE, &files) == 0 && files.rlim_cur >= 2 * count + 100;
}

void Observe(benchmark::State& state, const std::shared_ptr<const Crowd>& crowd, Watch watch,
             Through way) {
  const auto count = static_cast<std::size_t>(state.range(0));
  if (!AllowSockets(count)) return state.SkipWithError("the system allows too few open files");
  asio::io_context context(1);
  tcp::acceptor acceptor(context, tcp::endpoint(asio::ip::address_v4::loopback(), 0));
  Host host(*crowd);
  std::vector<std::shared_ptr<server::Connection>> connections;
  std::vector<Reader> readers;
  std::vector<Writer> writers;
  std::vector<Wanted> all_wanted;
  std::mt19937 random(1);
  std::size_t tick_bytes = 0;
  server::Limits limits;
  limits.socket_send_buffer_bytes = kSocketBufferBytes;
  for (std::size_t i = 0; i < count; ++i) {
    Wanted wanted = Want(*crowd, watch, random, host.composer());
    for (const SharedFrame& frame : wanted.frames) tick_bytes += frame->size();
    if (way != Through::kInProcess) readers.emplace_back(acceptor);
    if (way == Through::kFloor) {
      writers.emplace_back(acceptor);
      all_wanted.push_back(std::move(wanted));
      continue;
    }
    connections.push_back(std::make_shared<server::Connection>(
        way == Through::kSockets ? server::MakeTcpTransport(acceptor.accept())
                                 : std::make_unique<NoTransport>(context),
        limits, host.metrics()));
    host.Add(connections.back(), std::move(wanted.observe));
    context.poll();
  }
  const auto drain = [&] {
    std::size_t bytes = 0;
    for (Reader& reader : readers) bytes += reader.Drain();
    return bytes;
  };
  const auto write_all = [&] {
    for (Writer& writer : writers) writer.Write();
  };
  // The first ticks are not measured: sessions receive the avatars that enter their regions, and
  // the TCP windows still have to open.
  for (int tick = 0; tick < 8; ++tick) {
    if (way != Through::kFloor) host.Tick(crowd->delivery);
    for (std::size_t i = 0; i < writers.size(); ++i) writers[i].Begin(all_wanted[i].frames);
    do {
      context.poll();
      write_all();
    } while (drain() > 0);
  }
  const std::uint64_t batches_dropped = host.metrics().batches_dropped.value();
  for (auto _ : state) {
    double begin_s = ThreadTimeS();
    if (way == Through::kFloor) {
      for (std::size_t i = 0; i < writers.size(); ++i) writers[i].Begin(all_wanted[i].frames);
      write_all();
    } else {
      host.Tick(crowd->delivery);
      context.poll();
    }
    double taken_s = ThreadTimeS() - begin_s;
    for (std::size_t bytes = drain(); !readers.empty() && bytes < tick_bytes;) {
      // The TCP window of the reader was full.
      begin_s = ThreadTimeS();
      write_all();
      context.poll();
      taken_s += ThreadTimeS() - begin_s;
      bytes += drain();
    }
    state.SetIterationTime(taken_s);
  }
  if (host.metrics().batches_dropped.value() > batches_dropped) {
    state.SkipWithError("a batch was dropped");
  }
  for (const auto& connection : connections) {
    connection->set_handler(nullptr);
    connection->Close();
  }
  context.restart();
  context.poll();
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(count));
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(tick_bytes));
}

}  // namespace

void RegisterObservers(const std::string& name,
                       const std::shared_ptr<const MotionLibrary>& library) {
  spdlog::set_level(spdlog::level::off);
  const auto crowd = std::make_shared<const Crowd>(library);
  const std::pair<const char*, Watch> watches[] = {
      {"all", Watch::kAll}, {"named", Watch::kNamed}, {"region", Watch::kRegion}};
  const std::pair<const char*, Through> ways[] = {{"floor", Through::kFloor},
                                                  {"sockets", Through::kSockets},
                                                  {"in_process", Through::kInProcess}};
  for (const auto& [watch_name, watch] : watches) {
    for (const auto& [way_name, way] : ways) {
      benchmark::RegisterBenchmark((name + "/observers/" + watch_name + "/" + way_name).c_str(),
                                   Observe, crowd, watch, way)
          ->Arg(1)
          ->Arg(10)
          ->Arg(100)
          ->Arg(1000)
          ->UseManualTime()
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

}  // namespace stridewire
