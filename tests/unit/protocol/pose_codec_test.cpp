#include "stridewire/protocol/pose_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace stridewire::protocol {
namespace {

constexpr float kFloatNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kFloatInfinity = std::numeric_limits<float>::infinity();

Quat RandomRotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random), w = normal(random);
  const double l = std::sqrt(x * x + y * y + z * z + w * w);
  return Quat(static_cast<float>(w / l), static_cast<float>(x / l), static_cast<float>(y / l),
              static_cast<float>(z / l));
}

/// Returns the angle between two rotations, from the vector part of a^-1 b, which is precise for
/// small angles.
double Angle(const Quat& a, const Quat& b) {
  const DQuat difference = glm::conjugate(glm::normalize(DQuat(a))) * glm::normalize(DQuat(b));
  const double v = std::sqrt(difference.x * difference.x + difference.y * difference.y +
                             difference.z * difference.z);
  return 2.0 * std::atan2(v, std::abs(difference.w));
}

Quat Through(const Quat& q) {
  std::vector<std::byte> bytes(PoseBytes(PoseMode::kQuantised, 1));
  const Status encoded = EncodePose(PoseMode::kQuantised, Vec3(0.0f), {&q, 1}, bytes);
  EXPECT_TRUE(encoded) << Describe(encoded.error());
  Quat back;
  Vec3 root;
  const Status decoded = DecodePose(PoseMode::kQuantised, bytes, root, {&back, 1});
  EXPECT_TRUE(decoded) << Describe(decoded.error());
  return back;
}

TEST(PoseCodec, HasTheDocumentedSizes) {
  EXPECT_EQ(PoseBytes(PoseMode::kFull, 31), 508u);
  EXPECT_EQ(PoseBytes(PoseMode::kQuantised, 31), 198u);
  EXPECT_EQ(PoseBytes(PoseMode::kMovement, 31), 0u);
}

TEST(PoseCodec, FullPosesAreLossless) {
  std::mt19937 random(1);
  std::vector<Quat> rotations(31);
  for (Quat& q : rotations) q = RandomRotation(random);
  const Vec3 root(-1.25f, 3.0e-8f, 123456.7f);
  std::vector<std::byte> bytes(PoseBytes(PoseMode::kFull, 31));
  ASSERT_TRUE(EncodePose(PoseMode::kFull, root, rotations, bytes));
  Vec3 root_back;
  std::vector<Quat> back(31);
  ASSERT_TRUE(DecodePose(PoseMode::kFull, bytes, root_back, back));
  // Compare bytes, because a zero can have a sign.
  EXPECT_TRUE(std::ranges::equal(std::as_bytes(std::span(&root, 1)),
                                 std::as_bytes(std::span(&root_back, 1))));
  EXPECT_TRUE(
      std::ranges::equal(std::as_bytes(std::span(rotations)), std::as_bytes(std::span(back))));
}

TEST(PoseCodec, QuantisedRotationsAreWithinTheirError) {
  const unsigned seed = std::random_device{}();
  std::mt19937 random(seed);
  double largest = 0.0;
  for (int i = 0; i < 200'000; ++i) {
    const Quat q = RandomRotation(random);
    const double angle = Angle(q, Through(q));
    largest = std::max(largest, angle);
    ASSERT_LE(angle, kMaxQuantisedAngleRad) << "seed " << seed;
  }
  // The bound is tight: random rotations reach more than half of it.
  EXPECT_GT(largest, 0.5 * kMaxQuantisedAngleRad) << "seed " << seed;
  RecordProperty("largest_angle_rad", std::to_string(largest));
}

TEST(PoseCodec, QuantisedRotationsAreWithinTheirErrorForEqualComponents) {
  // The error of the dropped component is largest near (+-0.5)^4, so test around each of these
  // points.
  std::mt19937 random(2);
  std::uniform_real_distribution<float> nudge(-4e-5f, 4e-5f);
  for (int signs = 0; signs < 16; ++signs) {
    const auto half = [&](int bit) { return signs & (1 << bit) ? -0.5f : 0.5f; };
    for (int i = 0; i < 2'000; ++i) {
      const Quat q = glm::normalize(Quat(half(3) + nudge(random), half(0) + nudge(random),
                                         half(1) + nudge(random), half(2) + nudge(random)));
      ASSERT_LE(Angle(q, Through(q)), kMaxQuantisedAngleRad);
    }
  }
}

TEST(PoseCodec, QuantisedRotationsAreUnit) {
  std::mt19937 random(3);
  for (int i = 0; i < 10'000; ++i) {
    const Quat q = Through(RandomRotation(random));
    ASSERT_NEAR(std::sqrt(static_cast<double>(Dot(q, q))), 1.0, 2e-7);
  }
}

TEST(PoseCodec, IdentityAndHalfTurnsAreExact) {
  for (const Quat& q : {Quat(1, 0, 0, 0), Quat(0, 1, 0, 0), Quat(0, 0, 1, 0), Quat(0, 0, 0, 1)}) {
    EXPECT_EQ(Through(q), q);
    EXPECT_EQ(Through(-q), q) << "the sign is the codec's";
  }
}

TEST(PoseCodec, OppositeQuaternionsHaveTheSameBytes) {
  std::mt19937 random(4);
  for (int i = 0; i < 10'000; ++i) {
    const Quat q = RandomRotation(random);
    const Quat opposite = -q;
    std::array<std::byte, 18> a, b;
    ASSERT_TRUE(EncodePose(PoseMode::kQuantised, Vec3(0.0f), {&q, 1}, a));
    ASSERT_TRUE(EncodePose(PoseMode::kQuantised, Vec3(0.0f), {&opposite, 1}, b));
    ASSERT_EQ(a, b);
  }
}

TEST(PoseCodec, MatchesTheStandard) {
  // y (index 1) is dropped. It is negative, so all components are negated.
  const Quat q(0.5f, 0.5f, -0.70710677f, 0.0f);  // w, x, y, z
  std::array<std::byte, 18> bytes;
  ASSERT_TRUE(EncodePose(PoseMode::kQuantised, Vec3(1.0f, -0.5f, 0.00002f), {&q, 1}, bytes));
  std::array<std::int32_t, 3> root;
  std::array<std::uint16_t, 3> words;
  std::memcpy(root.data(), bytes.data(), 12);
  std::memcpy(words.data(), bytes.data() + 12, 6);
  EXPECT_EQ(root, (std::array<std::int32_t, 3>{16384, -8192, 0}));
  const auto minus_half = static_cast<std::uint16_t>(16384 - 11585);  // round(0.5 sqrt 2 16383)
  EXPECT_EQ(words[0], minus_half | 0x8000);
  EXPECT_EQ(words[1], 16384);
  EXPECT_EQ(words[2], minus_half);
}

TEST(PoseCodec, DropsTheLowestIndexOfEqualComponents) {
  const Quat q(0.5f, 0.5f, 0.5f, 0.5f);
  std::array<std::byte, 18> bytes;
  ASSERT_TRUE(EncodePose(PoseMode::kQuantised, Vec3(0.0f), {&q, 1}, bytes));
  EXPECT_EQ(std::to_integer<int>(bytes[13]) & 0x80, 0);
  EXPECT_EQ(std::to_integer<int>(bytes[15]) & 0x80, 0);
}

TEST(PoseCodec, QuantisedRootsAreWithinTheirError) {
  const unsigned seed = std::random_device{}();
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> near(-256.0f, 256.0f);
  const Quat q = kIdentityQuat;
  std::array<std::byte, 18> bytes;
  Quat q_back;
  for (int i = 0; i < 100'000; ++i) {
    const Vec3 root(near(random), near(random), near(random));
    Vec3 back;
    ASSERT_TRUE(EncodePose(PoseMode::kQuantised, root, {&q, 1}, bytes));
    ASSERT_TRUE(DecodePose(PoseMode::kQuantised, bytes, back, {&q_back, 1}));
    for (int k = 0; k < 3; ++k) {
      ASSERT_LE(std::abs(static_cast<double>(root[k]) - static_cast<double>(back[k])),
                1.0 / 32768.0)
          << "seed " << seed;
    }
  }
  for (const float far : {kMaxRootM, -kMaxRootM, 131'000.5f}) {
    Vec3 back;
    ASSERT_TRUE(EncodePose(PoseMode::kQuantised, Vec3(far), {&q, 1}, bytes));
    ASSERT_TRUE(DecodePose(PoseMode::kQuantised, bytes, back, {&q_back, 1}));
    EXPECT_EQ(back, Vec3(far));
  }
}

TEST(PoseCodec, EncodeRejectsInvalidPoses) {
  const auto code = [](PoseMode mode, const Vec3& root, const Quat& q, std::size_t bytes) {
    std::vector<std::byte> out(bytes);
    const Status status = EncodePose(mode, root, {&q, 1}, out);
    EXPECT_FALSE(status);
    return status ? ErrorCode::kIo : status.error().code;
  };
  const Quat one = kIdentityQuat;
  EXPECT_EQ(code(PoseMode::kMovement, Vec3(0.0f), one, 0), ErrorCode::kUnsupported);
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
    const std::size_t bytes = PoseBytes(mode, 1);
    EXPECT_EQ(code(mode, Vec3(0.0f), one, bytes - 1), ErrorCode::kShapeMismatch);
    EXPECT_EQ(code(mode, Vec3(0.0f), one, bytes + 1), ErrorCode::kShapeMismatch);
    for (const float bad : {kFloatNaN, kFloatInfinity, -kFloatInfinity}) {
      EXPECT_EQ(code(mode, Vec3(0.0f, bad, 0.0f), one, bytes), ErrorCode::kOutOfRange);
      EXPECT_EQ(code(mode, Vec3(0.0f), Quat(1.0f, bad, 0.0f, 0.0f), bytes), ErrorCode::kOutOfRange);
    }
    EXPECT_EQ(code(mode, Vec3(0.0f), Quat(0, 0, 0, 0), bytes), ErrorCode::kOutOfRange);
    EXPECT_EQ(code(mode, Vec3(0.0f), Quat(1.0011f, 0, 0, 0), bytes), ErrorCode::kOutOfRange);
    EXPECT_EQ(code(mode, Vec3(0.0f), Quat(0.9989f, 0, 0, 0), bytes), ErrorCode::kOutOfRange);
  }
  EXPECT_EQ(code(PoseMode::kQuantised, Vec3(131'072.0f, 0.0f, 0.0f), one, 18),
            ErrorCode::kOutOfRange);
}

TEST(PoseCodec, AcceptsLengthsWithinTheTolerance) {
  for (const float length : {0.9991f, 1.0009f}) {
    const Quat q = kIdentityQuat * length;
    std::array<std::byte, 28> full;
    EXPECT_TRUE(EncodePose(PoseMode::kFull, Vec3(0.0f), {&q, 1}, full));
    std::mt19937 random(5);
    for (int i = 0; i < 10'000; ++i) {
      const Quat unit = RandomRotation(random);
      ASSERT_LE(Angle(unit, Through(unit * length)), kMaxQuantisedAngleRad);
    }
  }
}

TEST(PoseCodec, DecodeRejectsInvalidFullPoses) {
  std::array<float, 7> numbers = {0, 0, 0, 0, 0, 0, 1};
  const auto decode = [&] {
    Vec3 root;
    Quat q;
    return DecodePose(PoseMode::kFull, std::as_bytes(std::span(numbers)), root, {&q, 1});
  };
  ASSERT_TRUE(decode());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    for (const float bad : {kFloatNaN, kFloatInfinity, -kFloatInfinity}) {
      const float kept = std::exchange(numbers[i], bad);
      const Status status = decode();
      ASSERT_FALSE(status);
      EXPECT_EQ(status.error().code, ErrorCode::kOutOfRange);
      numbers[i] = kept;
    }
  }
  numbers[6] = 1.0011f;
  EXPECT_EQ(decode().error().code, ErrorCode::kOutOfRange);
  numbers[6] = 0.0f;
  EXPECT_EQ(decode().error().code, ErrorCode::kOutOfRange);
}

TEST(PoseCodec, DecodeRejectsBitsThatNoEncoderWrites) {
  const Quat q = kIdentityQuat;
  std::array<std::byte, 18> good;
  ASSERT_TRUE(EncodePose(PoseMode::kQuantised, Vec3(0.0f), {&q, 1}, good));
  const auto decode = [](std::span<const std::byte> bytes) {
    Vec3 root;
    Quat back;
    return DecodePose(PoseMode::kQuantised, bytes, root, {&back, 1});
  };
  ASSERT_TRUE(decode(good));
  const auto with_words = [&](std::array<std::uint16_t, 3> words) {
    auto bytes = good;
    std::memcpy(bytes.data() + 12, words.data(), 6);
    return decode(bytes);
  };
  EXPECT_EQ(with_words({16384, 16384, 0x8000 | 16384}).error().code, ErrorCode::kMalformed);
  for (int zero = 0; zero < 3; ++zero) {
    std::array<std::uint16_t, 3> words = {16384, 16384, 16384};
    words[static_cast<std::size_t>(zero)] = 0;
    EXPECT_EQ(with_words(words).error().code, ErrorCode::kMalformed);
  }
  EXPECT_EQ(with_words({32767, 32767, 16384}).error().code, ErrorCode::kMalformed);
  EXPECT_TRUE(with_words({32767, 16384, 16384}));

  auto far = good;
  const std::int32_t too_far = std::numeric_limits<std::int32_t>::min();
  std::memcpy(far.data() + 4, &too_far, 4);
  EXPECT_EQ(decode(far).error().code, ErrorCode::kOutOfRange);

  EXPECT_EQ(decode(std::span(good).first(17)).error().code, ErrorCode::kShapeMismatch);
  Vec3 root;
  EXPECT_EQ(DecodePose(PoseMode::kMovement, {}, root, {}).error().code, ErrorCode::kUnsupported);
}

TEST(PoseCodec, BuffersNeedNoAlignment) {
  const Quat q = kIdentityQuat;
  std::array<std::byte, 64> space;
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
    const auto odd = std::span(space).subspan(1, PoseBytes(mode, 1));
    ASSERT_TRUE(EncodePose(mode, Vec3(1.0f), {&q, 1}, odd));
    Vec3 root;
    Quat back;
    ASSERT_TRUE(DecodePose(mode, odd, root, {&back, 1}));
    EXPECT_EQ(root, Vec3(1.0f));
    EXPECT_EQ(back, q);
  }
}

}  // namespace
}  // namespace stridewire::protocol
