#include "stridewire/protocol/compact_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "stridewire/protocol/pose_codec.h"

namespace stridewire::protocol {
namespace {

constexpr std::array<std::int16_t, 3> kParents = {-1, 0, 1};

// A root, a joint with three axes and one with a single axis: 2 + 36 + 30 + 13 bits.
std::vector<RotationQuantization> Codes() {
  std::vector<RotationQuantization> codes(3);
  codes[0].smallest_three_bits = 12;
  codes[1].reference = YawRotation(0.5);
  codes[1].low = Vec3(-0.5f);
  codes[1].step = Vec3(1.0f / 1024.0f);
  codes[1].bits = {10, 10, 10};
  codes[1].least_w = 0.5f;
  codes[2].low = Vec3(-0.25f, 0.0f, 0.0f);
  codes[2].step = Vec3(1.0f / 8192.0f, 0.004f, 0.004f);
  codes[2].bits = {13, 0, 0};
  codes[2].least_w = 0.9f;
  return codes;
}

CompactCodec Codec() { return CompactCodec::Make(Codes(), kParents).value(); }

std::vector<Quat> SomePose() {
  return {YawRotation(2.0), YawRotation(0.7), glm::normalize(Quat(1.0f, 0.1f, 0.0f, 0.0f))};
}

std::vector<std::byte> BytesOf(const CompactCodec& codec, const Vec3& root,
                               const std::vector<Quat>& rotations) {
  CompactCodec::Block block;
  block.Add(root, rotations);
  codec.Encode(block);
  if (!block.fits(0)) return {};
  std::vector<std::byte> bytes(codec.pose_bytes());
  block.CopyBytes(0, bytes);
  return bytes;
}

TEST(CompactCodec, MatchesTheStandard) {
  const CompactCodec codec = Codec();
  EXPECT_EQ(codec.joint_count(), 3u);
  ASSERT_EQ(codec.pose_bytes(), 12u + 12u);
  // The rotations are represented exactly, so that no joint has to correct an error.
  const Quat bent = Quat(std::sqrt(0.984375f), 0.125f, 0.0f, 0.0f);
  const Quat turned = Codes()[1].reference * Quat(std::sqrt(0.6875f), 0.25f, -0.5f, 0.0f);
  const auto bytes = BytesOf(codec, Vec3(1.0f, -0.5f, 0.00002f), {Quat(0, 0, -1, 0), turned, bent});
  ASSERT_EQ(bytes.size(), 24u);
  std::array<std::int32_t, 3> root;
  std::array<std::uint32_t, 3> words;
  std::memcpy(root.data(), bytes.data(), 12);
  std::memcpy(words.data(), bytes.data() + 12, 12);
  EXPECT_EQ(root, (std::array<std::int32_t, 3>{16384, -8192, 0}));
  // Root: y (index 1) is dropped; x, z and w are 0, which is stored as 2048.
  EXPECT_EQ(words[0], 1u | 2048u << 2 | 2048u << 14 | (2048u & 63u) << 26);
  // The remaining bits of w, then 0.25, -0.5 and 0 in steps of 2^-10 from -0.5: 768, 0, 512.
  EXPECT_EQ(words[1], 2048u >> 6 | 768u << 6 | 0u << 16 | (512u & 63u) << 26);
  // The remaining bits, then 0.125 in steps of 2^-13 from -0.25: 3072.
  EXPECT_EQ(words[2], 512u >> 6 | 3072u << 4);
}

TEST(CompactCodec, DecodesWhatItEncodes) {
  const CompactCodec codec = Codec();
  const auto bytes = BytesOf(codec, Vec3(1.0f, 2.0f, 3.0f), SomePose());
  ASSERT_EQ(bytes.size(), codec.pose_bytes());
  Vec3 root;
  std::vector<Quat> back(3);
  ASSERT_TRUE(codec.Decode(bytes, root, back));
  EXPECT_EQ(root, Vec3(1.0f, 2.0f, 3.0f));
  const std::vector<Quat> given = SomePose();
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_NEAR(std::abs(Dot(back[j], given[j])), 1.0f, 1e-5) << j;
    EXPECT_NEAR(Dot(back[j], back[j]), 1.0f, 1e-6) << j;
  }
}

TEST(CompactCodec, JointsCorrectErrorsOfTheirAncestors) {
  std::vector<RotationQuantization> codes = Codes();
  codes[0].smallest_three_bits = RotationQuantization::kMinFreeBits;  // errors of 0.019 rad
  codes[1].bits = {16, 16, 16};
  codes[1].step = Vec3(1.0f / 65536.0f);
  const CompactCodec codec = CompactCodec::Make(codes, kParents).value();
  const unsigned seed = std::random_device{}();
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  double largest_root = 0.0;
  for (int i = 0; i < 1000; ++i) {
    std::vector<Quat> pose = SomePose();
    pose[0] = glm::normalize(Quat(normal(random), normal(random), normal(random), normal(random)));
    const auto bytes = BytesOf(codec, Vec3(0.0f), pose);
    ASSERT_FALSE(bytes.empty()) << "seed " << seed;
    Vec3 root;
    std::vector<Quat> back(3);
    ASSERT_TRUE(codec.Decode(bytes, root, back));
    const auto angle = [](const Quat& a, const Quat& b) { return AngleBetween(a, b); };
    largest_root = std::max(largest_root, angle(pose[0], back[0]));
    ASSERT_LE(angle(pose[0], back[0]), std::sqrt(6.0) / 127.0);
    ASSERT_LE(angle(pose[0] * pose[1], back[0] * back[1]), 1e-4) << "seed " << seed;
  }
  EXPECT_GT(largest_root, 0.005) << "seed " << seed;
}

// The encoder computes errors to first order, which matters if a coarsely quantized joint is turned
// far.
TEST(CompactCodec, JointsCorrectErrorsOfFarTurnedAncestors) {
  for (const Quat& reference : {kIdentityQuat, YawRotation(1.0)}) {
    std::vector<RotationQuantization> codes(4);
    codes[0].smallest_three_bits = 8;
    for (std::size_t j = 1; j < 4; ++j) {
      const auto bits = static_cast<std::uint8_t>(j < 3 ? 8 : 16);  // errors of 0.004 in v
      codes[j].reference = reference;
      codes[j].low = Vec3(-0.8f);
      codes[j].step = Vec3(1.6f / static_cast<float>(1 << bits));
      codes[j].bits = {bits, bits, bits};
      codes[j].least_w = RotationQuantization::kMinLeastW;
    }
    const CompactCodec codec =
        CompactCodec::Make(codes, std::array<std::int16_t, 4>{-1, 0, 1, 2}).value();
    const unsigned seed = std::random_device{}();
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> component(-0.5f, 0.5f);
    double largest = 0.0;
    for (int i = 0; i < 1000; ++i) {
      std::vector<Quat> pose(4);
      for (Quat& q : pose) {
        const Vec3 v(component(random), component(random), component(random));
        q = reference * Quat(std::sqrt(1.0f - glm::dot(v, v)), v.x, v.y, v.z);
      }
      const auto bytes = BytesOf(codec, Vec3(0.0f), pose);
      ASSERT_FALSE(bytes.empty()) << "seed " << seed;
      Vec3 root;
      std::vector<Quat> back(4);
      ASSERT_TRUE(codec.Decode(bytes, root, back));
      const double off = AngleBetween(pose[0] * pose[1] * pose[2] * pose[3],
                                      back[0] * back[1] * back[2] * back[3]);
      largest = std::max(largest, off);
      ASSERT_LE(off, 0.0005) << "seed " << seed;
    }
    std::printf("largest %.6f rad, seed %u\n", largest, seed);
  }
}

TEST(CompactCodec, PosesOutsideTheCodesDoNotFit) {
  const CompactCodec codec = Codec();
  const auto fits = [&](const Vec3& root, const std::vector<Quat>& pose) {
    return !BytesOf(codec, root, pose).empty();
  };
  ASSERT_TRUE(fits(Vec3(0.0f), SomePose()));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, infinity, -infinity, 131'072.0f}) {
    EXPECT_FALSE(fits(Vec3(0.0f, bad, 0.0f), SomePose()));
  }
  EXPECT_TRUE(fits(Vec3(kMaxRootM), SomePose()));
  for (std::size_t joint = 0; joint < 3; ++joint) {
    for (const Quat& bad : {Quat(nan, 0, 0, 0), Quat(1, infinity, 0, 0), Quat(0, 0, 0, 0),
                            Quat(1.001f, 0, 0, 0), Quat(0.999f, 0, 0, 0)}) {
      std::vector<Quat> pose = SomePose();
      pose[joint] = bad;
      EXPECT_FALSE(fits(Vec3(0.0f), pose)) << joint;
    }
  }
  std::vector<Quat> pose = SomePose();
  pose[0] = Quat(0, 1, 0, 0);  // the root has no range
  EXPECT_TRUE(fits(Vec3(0.0f), pose));
  pose[1] = YawRotation(0.5 + 1.3);  // y = sin 0.65 = 0.61
  EXPECT_FALSE(fits(Vec3(0.0f), pose));
  pose = SomePose();
  pose[2] = YawRotation(0.02);  // about an axis without bits
  EXPECT_FALSE(fits(Vec3(0.0f), pose));
}

// With are_unit, lengths are not checked, but NaN is still detected.
TEST(CompactCodec, UnitPosesAreEncodedEquallyAndNaNDoesNotFit) {
  const CompactCodec codec = Codec();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  alignas(64) std::array<std::array<float, CompactCodec::kBlock>, 3> roots{};
  alignas(64) std::array<std::array<float, CompactCodec::kBlock>, 12> rotations{};
  const auto set = [&](std::size_t lane, const std::vector<Quat>& pose) {
    for (std::size_t j = 0; j < pose.size(); ++j) {
      for (std::size_t c = 0; c < 4; ++c) rotations[4 * j + c][lane] = (&pose[j].x)[c];
    }
  };
  std::size_t lane = 0;
  for (std::size_t joint = 0; joint < 3; ++joint) {
    for (const Quat& bad : {Quat(nan, 0, 0, 0), Quat(1, 0, nan, 0), Quat(1, infinity, 0, 0),
                            Quat(infinity, 0, 0, 0)}) {
      std::vector<Quat> pose = SomePose();
      pose[joint] = bad;
      set(lane++, pose);
    }
  }
  for (std::size_t good = lane; good < CompactCodec::kBlock; ++good) set(good, SomePose());
  CompactCodec::Block block;
  codec.Encode({roots[0].data(), rotations[0].data(), CompactCodec::kBlock, true}, block);
  for (std::size_t i = 0; i < CompactCodec::kBlock; ++i) {
    ASSERT_EQ(block.fits(i), i >= lane) << i;
    if (i < lane) continue;
    std::vector<std::byte> bytes(codec.pose_bytes());
    block.CopyBytes(i, bytes);
    EXPECT_EQ(bytes, BytesOf(codec, Vec3(0.0f), SomePose()));
  }
}

TEST(CompactCodec, PosesOfABlockAreIndependent) {
  const CompactCodec codec = Codec();
  CompactCodec::Block block;
  for (std::size_t i = 0; i < CompactCodec::kBlock; ++i) {
    std::vector<Quat> pose = SomePose();
    pose[1] = YawRotation(i % 3 == 1 ? 3.0 : 0.5 + 0.03 * static_cast<double>(i));
    block.Add(Vec3(static_cast<float>(i), 0.0f, 0.0f), pose);
  }
  codec.Encode(block);
  for (std::size_t i = 0; i < CompactCodec::kBlock; ++i) {
    Vec3 root;
    std::vector<Quat> pose(3);
    block.Get(i, root, pose);
    EXPECT_EQ(root.x, static_cast<float>(i));
    ASSERT_EQ(block.fits(i), i % 3 != 1) << i;
    if (!block.fits(i)) continue;
    std::vector<std::byte> bytes(codec.pose_bytes());
    block.CopyBytes(i, bytes);
    EXPECT_EQ(bytes, BytesOf(codec, root, pose)) << i;
  }
}

TEST(CompactCodec, StreamBytesEqualsCopyBytes) {
  const CompactCodec codec = Codec();
  ASSERT_EQ(codec.pieces(), 2u);
  CompactCodec::Block block;
  for (std::size_t i = 0; i < CompactCodec::kBlock; ++i) {
    block.Add(Vec3(static_cast<float>(i)), SomePose());
  }
  codec.Encode(block);
  for (std::size_t i = 0; i < CompactCodec::kBlock; ++i) {
    std::array<std::byte, 24> copied;
    block.CopyBytes(i, copied);
    alignas(64) std::array<std::byte, 128> streamed;
    streamed.fill(std::byte{0xaa});
    const std::size_t pieces = codec.pieces() + CompactCodec::kMaxTrailingPieces;
    block.StreamBytes(i, pieces, streamed.data());
    EXPECT_TRUE(std::ranges::equal(std::span(streamed).first(24), copied)) << i;
    const auto behind = std::span(streamed).subspan(pieces * CompactCodec::kPieceBytes);
    EXPECT_TRUE(std::ranges::all_of(behind, [](std::byte b) { return b == std::byte{0xaa}; })) << i;
  }
}

TEST(CompactCodec, DecodeRejectsBitsThatNoEncoderWrites) {
  const CompactCodec codec = Codec();
  const auto good = BytesOf(codec, Vec3(0.0f), SomePose());
  ASSERT_FALSE(good.empty());
  const auto decode = [&](std::span<const std::byte> bytes) {
    Vec3 root;
    std::vector<Quat> back(3);
    return codec.Decode(bytes, root, back);
  };
  ASSERT_TRUE(decode(good));
  EXPECT_EQ(decode(std::span(good).first(23)).error().code, ErrorCode::kShapeMismatch);
  auto longer = good;
  longer.resize(28);
  EXPECT_EQ(decode(longer).error().code, ErrorCode::kShapeMismatch);
  const auto with_word = [&](std::size_t word, std::uint32_t value) {
    auto bytes = good;
    std::memcpy(bytes.data() + 4 * word, &value, 4);
    return decode(bytes);
  };
  EXPECT_EQ(with_word(1, 0x8000'0000).error().code, ErrorCode::kOutOfRange);
  EXPECT_EQ(with_word(3, 0).error().code, ErrorCode::kMalformed);  // a component is 0
  EXPECT_EQ(with_word(3, 0xffff'fffc).error().code,
            ErrorCode::kMalformed);  // the squares of the root sum to more than 1
  EXPECT_EQ(with_word(5, 0x8000'0000).error().code, ErrorCode::kMalformed);  // after the last bit
  // -0.5, -0.5 and 0 yield w = 0.71, below the limit of 0.9.
  auto codes = Codes();
  codes[1].least_w = 0.9f;
  const CompactCodec strict = CompactCodec::Make(codes, kParents).value();
  auto bytes = good;
  const std::uint32_t low = 2048u >> 6;
  std::memcpy(bytes.data() + 16, &low, 4);
  Vec3 root;
  std::vector<Quat> back(3);
  EXPECT_EQ(strict.Decode(bytes, root, back).error().code, ErrorCode::kMalformed);
}

TEST(CompactCodec, MakeRejectsInvalidCodes) {
  const auto code = [](const std::vector<RotationQuantization>& codes) {
    const auto codec = CompactCodec::Make(codes, kParents);
    return codec ? ErrorCode::kIo : codec.error().code;
  };
  ASSERT_EQ(code(Codes()), ErrorCode::kIo);
  const auto with = [&](const auto& change, std::size_t joint = 1) {
    std::vector<RotationQuantization> codes = Codes();
    change(codes[joint]);
    return code(codes);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(with([](RotationQuantization& c) { c.smallest_three_bits = 0; }, 0),
            ErrorCode::kMalformed);
  for (const std::uint8_t bits : {1, 7, 16, 255}) {
    EXPECT_EQ(with([&](RotationQuantization& c) { c.smallest_three_bits = bits; }),
              ErrorCode::kOutOfRange);
  }
  EXPECT_EQ(with([](RotationQuantization& c) { c.bits[2] = 17; }), ErrorCode::kOutOfRange);
  for (const float bad : {nan, -2.0f, 0.0f}) {
    EXPECT_EQ(with([&](RotationQuantization& c) { c.step.y = bad; }), ErrorCode::kOutOfRange);
    EXPECT_EQ(with([&](RotationQuantization& c) { c.reference.x = bad == 0.0f ? 1.0f : bad; }),
              ErrorCode::kOutOfRange);
    EXPECT_EQ(with([&](RotationQuantization& c) { c.least_w = bad; }), ErrorCode::kOutOfRange);
  }
  EXPECT_EQ(with([&](RotationQuantization& c) { c.low.z = nan; }), ErrorCode::kOutOfRange);
  EXPECT_EQ(with([&](RotationQuantization& c) { c.low.z = 1.5f; }), ErrorCode::kOutOfRange);
  EXPECT_EQ(with([&](RotationQuantization& c) { c.least_w = 1.5f; }), ErrorCode::kOutOfRange);
  EXPECT_EQ(CompactCodec::Make({}, {}).error().code, ErrorCode::kShapeMismatch);
  EXPECT_EQ(CompactCodec::Make(Codes(), std::array<std::int16_t, 2>{-1, 0}).error().code,
            ErrorCode::kShapeMismatch);
  EXPECT_EQ(CompactCodec::Make(Codes(), std::array<std::int16_t, 3>{-1, 0, 2}).error().code,
            ErrorCode::kOutOfRange);
  const auto told = [](std::vector<std::uint16_t> joints) {
    const auto codec = CompactCodec::Make(Codes(), kParents, joints);
    return codec ? ErrorCode::kIo : codec.error().code;
  };
  EXPECT_EQ(told({0, 1}), ErrorCode::kIo);
  EXPECT_EQ(told({1}), ErrorCode::kMalformed);
  EXPECT_EQ(told({0, 2}), ErrorCode::kMalformed);  // without its parent
  EXPECT_EQ(told({0, 1, 3}), ErrorCode::kMalformed);
  EXPECT_EQ(told({0, 0}), ErrorCode::kMalformed);
  EXPECT_EQ(told({0, 1, 2, 3}), ErrorCode::kShapeMismatch);
}

TEST(CompactCodec, OmittedJointsAreDecodedToTheirReference) {
  const CompactCodec all = Codec();
  const CompactCodec fewer =
      CompactCodec::Make(Codes(), kParents, std::array<std::uint16_t, 2>{0, 1}).value();
  const CompactCodec root =
      CompactCodec::Make(Codes(), kParents, std::array<std::uint16_t, 1>{0}).value();
  EXPECT_EQ(all.pose_bytes(), 12u + 2 * 6);  // 38, 30 and 13 bits
  EXPECT_EQ(fewer.pose_bytes(), 12u + 2 * 5);
  EXPECT_EQ(root.pose_bytes(), 12u + 2 * 3);

  std::vector<Quat> pose = SomePose();
  const std::vector<std::byte> whole = BytesOf(all, Vec3(1.0f), pose);
  std::vector<Quat> back(3);
  std::vector<Quat> back_whole(3);
  Vec3 root_m;
  ASSERT_TRUE(all.Decode(whole, root_m, back_whole));
  pose[2] = YawRotation(3.0);  // outside every range
  EXPECT_TRUE(BytesOf(all, Vec3(1.0f), pose).empty());
  ASSERT_TRUE(fewer.Decode(BytesOf(fewer, Vec3(1.0f), pose), root_m, back));
  EXPECT_EQ(back[0], back_whole[0]);
  EXPECT_EQ(back[1], back_whole[1]);
  EXPECT_EQ(back[2], Codes()[2].reference);
  pose[1] = YawRotation(-2.0);
  EXPECT_TRUE(BytesOf(fewer, Vec3(1.0f), pose).empty());
  ASSERT_TRUE(root.Decode(BytesOf(root, Vec3(1.0f), pose), root_m, back));
  EXPECT_EQ(back[0], back_whole[0]);
  EXPECT_EQ(back[1], Codes()[1].reference);
  EXPECT_EQ(back[2], Codes()[2].reference);
  // An invalid rotation does not fit, even if its joint is omitted.
  pose[2] = Quat(0.0f, 0.0f, 0.0f, 0.0f);
  EXPECT_TRUE(BytesOf(root, Vec3(1.0f), pose).empty());
}

}  // namespace
}  // namespace stridewire::protocol
