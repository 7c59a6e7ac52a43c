// web_movement_stream LIBRARY AVATARS TICKS SEED OUT
// Simulates a crowd with random requests and writes the frames that a server sends to a client in
// movement mode, with hashes of the poses that the C++ client evaluates from them. LIBRARY is
// `builtin` or a library file.
//
// The file OUT is a sequence of entries in little-endian order: u32 size of the frame, u32 hash,
// f64 server time, the frame. The hash is 0 unless the frame completes a tick. It covers the poses
// of all avatars at the server time (Hash below), in the order of World.sampleAll.
#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "base/check.h"
#include "random_requests.h"
#include "runtime/avatar/movement_record.h"
#include "runtime/library/pose_quantization.h"
#include "session.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/protocol/encoder.h"

namespace stridewire::client {
namespace {

constexpr std::uint32_t kWorld = 3;
constexpr double kTickS = 1.0 / 60.0;

/// FNV-1a over 32-bit words.
class Hash {
 public:
  void Add(std::uint32_t word) { value_ = (value_ ^ word) * 16777619u; }
  void Add(std::span<const float> numbers) {
    for (const float number : numbers) Add(std::bit_cast<std::uint32_t>(number));
  }
  [[nodiscard]] std::uint32_t value() const { return value_ == 0 ? 1 : value_; }

 private:
  std::uint32_t value_ = 2166136261u;
};

std::uint32_t HashOf(const CrowdPose& crowd) {
  Hash hash;
  for (const std::uint32_t avatar : crowd.avatars) hash.Add(avatar);
  for (const std::uint8_t flags : crowd.flags) hash.Add(flags);
  for (const Vec3& root : crowd.roots_m) hash.Add(std::span<const float>(&root.x, 3));
  for (const Quat& q : crowd.rotations) hash.Add(std::span<const float>(&q.x, 4));
  return hash.value();
}

protocol::WorldInfo DescribeWorld(const MotionLibrary& library) {
  protocol::WorldInfo info;
  info.seq = 1;
  info.world = kWorld;
  info.name = "plaza";
  info.role = protocol::Role::kObserver;
  info.library_hash = library.hash();
  for (const Joint& joint : library.skeleton().joints) {
    info.skeleton.joints.push_back(
        {joint.name, static_cast<std::int16_t>(joint.parent), joint.offset_m});
  }
  info.rotation_quantizations = ChoosePoseQuantization(library).joints;
  info.reduced_joints = ChooseReducedJoints(library);
  return info;
}

/// Writes frames to the file and passes them to the C++ client.
class Stream {
 public:
  explicit Stream(const std::string& path) : out_(path, std::ios::binary) {
    double now_s = 0.0;
    STRIDEWIRE_CHECK(session_.Open(now_s) == STRIDEWIRE_OK);
    while (!session_.ConnectDue(now_s)) now_s += 0.05;
    session_.StartConnecting(now_s);
    session_.OnConnected(now_s);
    now_s_ = now_s;
  }

  Session& session() { return session_; }

  void Send(const protocol::Message& message) { Write(Encode(message), 0, 0.0); }

  /// Sends the last message of a tick.
  void SendTick(const protocol::Movements& movements, stridewire_world world) {
    const std::vector<std::byte> frame = Encode(movements);
    CrowdPose crowd;
    DisplayCounts displayed;
    session_.FindWorld(world)->SampleAll(movements.server_time_s, crowd, displayed);
    poses_ += crowd.avatars.size();
    Write(frame, HashOf(crowd), movements.server_time_s);
  }

  [[nodiscard]] std::size_t poses() const { return poses_; }
  [[nodiscard]] bool ok() { return out_.flush().good(); }

 private:
  /// Encodes a message. The client handles it.
  std::vector<std::byte> Encode(const protocol::Message& message) {
    std::vector<std::byte> frame;
    STRIDEWIRE_CHECK(encoder_.Encode(message, frame).has_value());
    std::vector<std::uint64_t> aligned((frame.size() + 7) / 8);
    std::memcpy(aligned.data(), frame.data(), frame.size());
    session_.OnMessage(std::as_bytes(std::span(aligned)).first(frame.size()), now_s_);
    while (const auto task = session_.TakeLibraryTask()) {
      session_.OnLibraryTask(task->hash, RunLibraryTask(*task));
    }
    if (std::vector<std::byte> sent; session_.TakeOutput(sent)) session_.OnOutputWritten();
    if (session_.state() != Session::State::kReady) {
      std::fprintf(stderr, "web_movement_stream: %s\n", session_.last_text().c_str());
      std::exit(1);
    }
    return frame;
  }
  void Write(std::span<const std::byte> frame, std::uint32_t hash, double time_s) {
    const std::uint32_t sizes[2] = {static_cast<std::uint32_t>(frame.size()), hash};
    out_.write(reinterpret_cast<const char*>(sizes), sizeof sizes);
    out_.write(reinterpret_cast<const char*>(&time_s), sizeof time_s);
    out_.write(reinterpret_cast<const char*>(frame.data()),
               static_cast<std::streamsize>(frame.size()));
  }

  std::ofstream out_;
  protocol::Encoder encoder_;
  Session session_{SessionOptions{}};
  double now_s_ = 0.0;
  std::size_t poses_ = 0;
};

int Run(const std::string& library_name, int avatars, std::uint64_t ticks, unsigned seed,
        const std::string& path) {
  const auto library = OpenLibrary(library_name);
  if (!library) {
    std::fprintf(stderr, "web_movement_stream: %s\n", Describe(library.error()).c_str());
    return 1;
  }
  Stream stream(path);
  stream.Send(protocol::Welcome{.session = 5, .resume_token = std::vector<std::byte>(16)});
  Session& session = stream.session();
  stridewire_world world = 0;
  std::uint64_t command = 0;
  std::uint32_t subscription = 0;
  session.JoinWorld("plaza", protocol::Role::kObserver, world, command);
  protocol::Observe observe;
  observe.mode = protocol::PoseMode::kMovement;
  session.Observe(world, observe, subscription, command);

  stream.Send(DescribeWorld(**library));
  stream.Send(protocol::Reply{.seq = 1});
  const std::span<const std::byte> file = (*library)->bytes();
  std::uint64_t nonce = 0;
  for (std::size_t at = 0; at < file.size(); at += LibraryFetch::kPieceBytes) {
    const auto piece =
        file.subspan(at, std::min<std::size_t>(LibraryFetch::kPieceBytes, file.size() - at));
    stream.Send(protocol::LibraryPiece{.nonce = ++nonce,
                                       .hash = (*library)->hash(),
                                       .total_bytes = file.size(),
                                       .offset = at,
                                       .bytes = {piece.begin(), piece.end()}});
  }
  stream.Send(protocol::Reply{.seq = 2});

  DrawnCrowd crowd(*library, avatars, seed);
  for (std::uint64_t tick = 1; tick <= ticks; ++tick) {
    crowd.Advance();
    protocol::Movements movements{.world = kWorld,
                                  .step = tick,
                                  .tick = tick,
                                  .server_time_s = kTickS * static_cast<double>(tick)};
    protocol::AvatarId id = 0;
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      ++id;
      if (!AppendChange(avatar, movements.records)) continue;
      movements.avatars.push_back(id);
      movements.flags.push_back(0);
      movements.ends.push_back(static_cast<std::uint32_t>(movements.records.size()));
    }
    stream.SendTick(movements, world);
  }
  std::printf("%zu poses of %d avatars\n", stream.poses(), avatars);
  return stream.ok() && stream.poses() == ticks * static_cast<std::uint64_t>(avatars) ? 0 : 1;
}

}  // namespace
}  // namespace stridewire::client

int main(int argc, char** argv) {
  if (argc != 6) return 2;
  return stridewire::client::Run(argv[1], std::atoi(argv[2]),
                                 static_cast<std::uint64_t>(std::atoll(argv[3])),
                                 static_cast<unsigned>(std::atoi(argv[4])), argv[5]);
}
