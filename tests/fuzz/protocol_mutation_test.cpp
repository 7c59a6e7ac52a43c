// Decodes mutated frames. Each is rejected, or is a valid message that survives another round trip.
// Memory is limited by the size of the frame.
//
// STRIDEWIRE_FUZZ_COUNT sets the number of frames (5000), STRIDEWIRE_FUZZ_SEED repeats a run.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <map>
#include <random>
#include <string>

#include "counted_memory.h"
#include "stridewire/protocol/check.h"
#include "stridewire/protocol/decode.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/frame_reader.h"
#include "stridewire/protocol/pose_batch_reader.h"
#include "test_vectors.h"

namespace stridewire::protocol {
namespace {

using Bytes = std::vector<std::byte>;

std::uint64_t FromEnvironment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

/// Upper limit of the decoded size. A frame can refer to the same bytes many times.
std::size_t MaxDecodedBytes(std::size_t frame_bytes) { return (1u << 16) + 200 * frame_bytes; }

struct Mutator {
  std::mt19937_64 random;

  std::size_t Below(std::size_t end) { return random() % end; }

  void Store(Bytes& bytes, std::size_t at, const void* value, std::size_t size) {
    if (at + size <= bytes.size()) std::memcpy(bytes.data() + at, value, size);
  }

  void MutateOnce(Bytes& bytes, const std::vector<Bytes>& others) {
    if (bytes.empty()) return;
    // Mutate the payload only, because the header has its own tests.
    const bool header = Below(16) == 0 || bytes.size() <= kFrameHeaderBytes;
    const std::size_t begin = header ? 0 : kFrameHeaderBytes;
    const std::size_t at = begin + Below(bytes.size() - begin);
    const std::size_t word = at / 4 * 4;
    switch (Below(10)) {
      case 0: bytes[at] ^= static_cast<std::byte>(1u << Below(8)); break;
      case 1: bytes[at] = static_cast<std::byte>(random()); break;
      case 2: {
        static constexpr std::uint32_t kEdges[] = {
            0,     1,          2,          4,          8,         16,      0x7f,
            0x80,  0xff,       0x7fff,     0x8000,     0xffff,    0x10000, 65536,
            65537, 0x7fffffff, 0x80000000, 0xfffffffc, 0xffffffff};
        const std::uint32_t value = kEdges[Below(std::size(kEdges))];
        Store(bytes, word, &value, 4);
        break;
      }
      case 3: {  // change an offset or length slightly
        std::uint32_t value = 0;
        if (word + 4 <= bytes.size()) std::memcpy(&value, bytes.data() + word, 4);
        value += static_cast<std::uint32_t>(Below(65)) - 32;
        Store(bytes, word, &value, 4);
        break;
      }
      case 4: {
        static constexpr double kEdges[] = {NAN, -NAN, INFINITY, -INFINITY, -0.0, 5e-324, 1.7e308};
        Store(bytes, at / 8 * 8, &kEdges[Below(std::size(kEdges))], 8);
        break;
      }
      case 5: bytes.resize(at); break;
      case 6:
        bytes.insert(bytes.end(), 8 * (1 + Below(64)), static_cast<std::byte>(random()));
        break;
      case 7: {  // copy a piece within the frame
        const std::size_t from = Below(bytes.size());
        const std::size_t size = std::min({Below(64) + 1, bytes.size() - from, bytes.size() - at});
        std::memmove(bytes.data() + at, bytes.data() + from, size);
        break;
      }
      case 8: {  // copy a piece of another frame
        const Bytes& other = others[Below(others.size())];
        const std::size_t from = Below(other.size());
        const std::size_t size = std::min({Below(128) + 1, other.size() - from, bytes.size() - at});
        std::memcpy(bytes.data() + at, other.data() + from, size);
        break;
      }
      default: {  // change the message type
        static constexpr std::uint16_t kRanges[][2] = {{1, 12}, {32, 1}, {64, 10}};
        const auto& [first, types] = kRanges[Below(3)];
        const auto type = static_cast<std::uint16_t>(first + Below(types));
        Store(bytes, 6, &type, 2);
        break;
      }
    }
  }

  Bytes Mutate(const std::vector<Bytes>& frames) {
    Bytes bytes = frames[Below(frames.size())];
    for (std::size_t i = 1 + Below(6); i > 0; --i) MutateOnce(bytes, frames);
    if (Below(8) != 0 && bytes.size() >= kFrameHeaderBytes) {
      // Usually correct the length, so that the payload is decoded.
      bytes.resize((bytes.size() + 7) / 8 * 8);
      const auto payload = static_cast<std::uint32_t>(bytes.size() - kFrameHeaderBytes);
      Store(bytes, 8, &payload, 4);
    }
    return bytes;
  }
};

bool SameBytes(const PoseBatch& a, const PoseBatch& b) {
  return a.info == b.info && std::ranges::equal(a.avatars, b.avatars) &&
         std::ranges::equal(a.flags, b.flags) && std::ranges::equal(a.poses, b.poses);
}

bool Same(const Message& a, const Message& b) {
  return std::visit(
      []<typename A, typename B>(const A& x, const B& y) {
        if constexpr (!std::is_same_v<A, B>) {
          return false;
        } else if constexpr (std::is_same_v<A, PoseBatch>) {
          return SameBytes(x, y);
        } else {
          return x == y;
        }
      },
      a, b);
}

void ExpectMeaning(const Message& message, Sender sender) {
  Bytes frame;
  const Status encoded = Encoder().Encode(message, frame);
  ASSERT_TRUE(encoded) << Describe(encoded.error());
  const auto view = ParseFrame(frame, sender);
  ASSERT_TRUE(view) << Describe(view.error());
  const auto again = DecodeMessage(*view);
  ASSERT_TRUE(again) << Describe(again.error());
  ASSERT_TRUE(Same(message, *again));
  if (const auto* batch = std::get_if<PoseBatch>(&message)) {
    std::vector<Quat> rotations(batch->info.joint_count);
    PoseBatchReader reader(*batch, SampleCodecs().Find(batch->info.mode));
    for (std::size_t i = 0; i < batch->avatars.size(); ++i) {
      Vec3 root;
      reader.Next();
      if (!reader.Decode(root, rotations)) continue;
      const PoseMode mode =
          batch->info.mode == PoseMode::kFull ? PoseMode::kFull : PoseMode::kQuantised;
      Bytes pose(PoseBytes(mode, rotations.size()));
      ASSERT_TRUE(EncodePose(mode, root, rotations, pose));
    }
  }
}

TEST(ProtocolMutation, FramesAreRejectedOrValid) {
  const std::uint64_t count = FromEnvironment("STRIDEWIRE_FUZZ_COUNT", 5000);
  const std::uint64_t seed = FromEnvironment("STRIDEWIRE_FUZZ_SEED", std::random_device{}());
  std::cout << "STRIDEWIRE_FUZZ_SEED=" << seed << " STRIDEWIRE_FUZZ_COUNT=" << count << '\n'
            << std::flush;

  std::vector<Bytes> frames;
  for (const auto& [name, sample] : SampleMessages()) {
    ASSERT_TRUE(Encoder().Encode(sample, frames.emplace_back()));
  }
  Mutator mutator{std::mt19937_64(seed)};
  std::map<std::string, std::uint64_t> outcomes;
  std::uint64_t made_sense = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", frame " << i);
    const Bytes bytes = mutator.Mutate(frames);
    // Usually use the correct direction, because the other one is rejected immediately.
    const bool high = bytes.size() > 6 && bytes[6] >= std::byte{33};
    const Sender sender = high != (mutator.Below(16) == 0) ? Sender::kServer : Sender::kClient;
    FrameReader reader(sender);
    const std::size_t longest = 1 + mutator.Below(bytes.size() + 1);
    std::span<const std::byte> rest = bytes;
    std::string outcome = "incomplete";
    while (!rest.empty()) {
      // Separate copies, so that a sanitizer detects reads beyond them.
      const std::size_t size = std::min(rest.size(), 1 + mutator.Below(longest));
      const Bytes piece(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(size));
      rest = rest.subspan(size);
      std::span<const std::byte> unread = piece;
      bool closed = false;
      for (;;) {
        const auto next = reader.Next(unread);
        ASSERT_LE(reader.capacity_bytes(), std::max<std::size_t>(4096, 2 * bytes.size()));
        if (!next) {
          outcome = "frame: " + std::string(ErrorCodeName(next.error().code));
          closed = true;
          break;
        }
        if (!*next) break;
        counted_memory::ResetPeak();
        const std::size_t before = counted_memory::LiveBytes();
        const auto message = DecodeMessage(**next);
        ASSERT_LE(counted_memory::PeakBytes() - before, MaxDecodedBytes(bytes.size()));
        if (!message) {
          EXPECT_STRNE(message.error().text, "");
          outcome = "payload: " + std::string(ErrorCodeName(message.error().code));
          closed = true;
          break;
        }
        outcome = "makes sense";
        ++made_sense;
        ASSERT_NO_FATAL_FAILURE(ExpectMeaning(*message, sender));
      }
      if (closed) break;
    }
    ++outcomes[outcome];
  }
  for (const auto& [outcome, times] : outcomes) std::cout << outcome << ": " << times << "\n";
  // The test is useful only if some mutations are rejected and some are valid.
  EXPECT_GT(made_sense, 0u);
  EXPECT_GT(outcomes["payload: malformed"], 0u);
}

TEST(ProtocolMutation, PosesAreRejectedOrValid) {
  const std::uint64_t count = FromEnvironment("STRIDEWIRE_FUZZ_COUNT", 5000);
  const std::uint64_t seed = FromEnvironment("STRIDEWIRE_FUZZ_SEED", std::random_device{}());
  std::cout << "STRIDEWIRE_FUZZ_SEED=" << seed << '\n' << std::flush;
  std::mt19937_64 random(seed);
  std::uint64_t decoded = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const PoseMode mode = random() % 2 == 0 ? PoseMode::kFull : PoseMode::kQuantised;
    std::vector<Quat> rotations(1 + random() % 2);
    Bytes pose(PoseBytes(mode, rotations.size()));
    for (std::byte& b : pose) b = static_cast<std::byte>(random());
    Vec3 root;
    if (!DecodePose(mode, pose, root, rotations)) continue;
    ++decoded;
    ASSERT_TRUE(EncodePose(mode, root, rotations, pose)) << "seed " << seed << ", pose " << i;
  }
  std::cout << "decoded " << decoded << " of " << count << "\n";
  EXPECT_GT(decoded, 0u);

  // Compact poses with some changed bits.
  for (const auto& [name, mode] : {std::pair("pose_batch_compact", PoseMode::kCompact),
                                   std::pair("pose_batch_reduced", PoseMode::kCompactReduced),
                                   std::pair("pose_batch_root", PoseMode::kCompactRoot)}) {
    SCOPED_TRACE(name);
    const CompactCodec& codec = *SampleCodecs().Find(mode);
    std::vector<Quat> rotations(codec.joint_count(), kIdentityQuat);
    CompactCodec::Block block;
    Bytes good(codec.pose_bytes());
    const Message sample = SampleMessages().at(name);
    PoseBatchReader reader(std::get<PoseBatch>(sample), &codec);
    std::ranges::copy(reader.Next(), good.begin());
    Vec3 root;
    ASSERT_TRUE(codec.Decode(good, root, rotations));
    std::uint64_t known = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      Bytes pose = good;
      for (std::uint64_t change = 1 + random() % 4; change > 0; --change) {
        pose[random() % pose.size()] ^= static_cast<std::byte>(1u << random() % 8);
      }
      if (random() % 8 == 0) pose.resize(random() % (2 * pose.size()));
      if (!codec.Decode(pose, root, rotations)) continue;
      ++known;
      for (const Quat& q : rotations) ASSERT_NEAR(Dot(q, q), 1.0f, 1e-5f) << "seed " << seed;
      block.Clear();
      block.Add(root, rotations);
      codec.Encode(block);
      if (!block.fits(0)) continue;  // at the end of a range
      Bytes again(codec.pose_bytes());
      block.CopyBytes(0, again);
      std::vector<Quat> back(rotations.size());
      Vec3 root_back;
      ASSERT_TRUE(codec.Decode(again, root_back, back)) << "seed " << seed << ", pose " << i;
    }
    EXPECT_GT(known, 0u);
    EXPECT_LT(known, count);
  }
}

}  // namespace
}  // namespace stridewire::protocol
