#include "stridewire/protocol/pose_rows.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "protocol_testing.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::protocol {
namespace {

using testing::ElementsAre;

constexpr std::size_t kJoints = 5;

PoseBatchInfo Info(PoseMode mode) { return {5, 1, 0, 1, 99, 1.5, mode, kJoints}; }

Vec3 RootOf(AvatarId avatar) { return {0.25f * static_cast<float>(avatar), 1.0f, 0.0f}; }

/// Rows of avatars 10, 20, 30, ... with their row number as flags.
void Fill(PoseRows& rows, PoseMode mode, std::size_t count) {
  std::vector<AvatarId> avatars(count);
  for (std::size_t i = 0; i < count; ++i) avatars[i] = static_cast<AvatarId>(10 * (i + 1));
  ASSERT_TRUE(rows.Begin(Info(mode), std::make_shared<const std::vector<AvatarId>>(avatars)));
  const std::vector<Quat> rotations(kJoints, YawRotation(0.25));
  for (std::size_t i = 0; i < count; ++i) {
    ASSERT_TRUE(rows.Add(static_cast<std::uint8_t>(i), RootOf(avatars[i]), rotations));
  }
}

/// A decoded batch and the frame that it borrows.
struct Decoded {
  Decoded(PoseBatchComposer& composer, const PoseRows& rows,
          const std::vector<std::uint32_t>& picked) {
    EXPECT_TRUE(composer.Compose(rows, picked, {}, frame));
    auto message = Decode(frame, MessageType::kPoseBatch);
    EXPECT_TRUE(message);
    batch = std::get<PoseBatch>(*message);
  }
  std::vector<std::byte> frame;
  PoseBatch batch;
};

TEST(PoseBatchComposer, EqualsTheEncoder) {
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
    PoseRows rows;
    PoseBatchComposer composer;
    for (const std::size_t count : {20u, 7u}) {  // the second round reuses the memory
      Fill(rows, mode, count);
      std::vector<std::uint32_t> all(count);
      std::iota(all.begin(), all.end(), 0u);
      const Decoded decoded(composer, rows, all);
      EXPECT_EQ(decoded.batch.info, Info(mode));
      ASSERT_EQ(decoded.batch.avatars.size(), count);
      EXPECT_EQ(EncodeOrFail(decoded.batch), decoded.frame);
    }
  }
}

TEST(PoseBatchComposer, ContainsThePickedRows) {
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
    PoseRows rows;
    Fill(rows, mode, 40);
    PoseBatchComposer composer;
    const Decoded decoded(composer, rows, {0, 3, 4, 5, 20, 39});
    EXPECT_EQ(decoded.batch.info, Info(mode));
    EXPECT_THAT(decoded.batch.avatars, ElementsAre(10, 40, 50, 60, 210, 400));
    EXPECT_THAT(decoded.batch.flags, ElementsAre(0, 3, 4, 5, 20, 39));
    PoseBatchReader reader(decoded.batch, nullptr);
    for (const AvatarId avatar : decoded.batch.avatars) {
      Vec3 root;
      std::vector<Quat> rotations(kJoints);
      ASSERT_TRUE(DecodePose(mode, reader.Next(), root, rotations));
      EXPECT_EQ(root.x, RootOf(avatar).x);
      EXPECT_NEAR(rotations.back().y, YawRotation(0.25).y, 3e-5);
    }
    EXPECT_TRUE(Decoded(composer, rows, {}).batch.avatars.empty());
  }
}

TEST(PoseBatchComposer, OmitsEmptyRows) {
  PoseRows rows;
  ASSERT_TRUE(rows.Begin(Info(PoseMode::kQuantised), std::make_shared<const std::vector<AvatarId>>(
                                                         std::vector<AvatarId>{1, 2, 3, 4, 5})));
  const std::vector<Quat> rotations(kJoints, kIdentityQuat);
  rows.SkipTo(1);
  ASSERT_TRUE(rows.Add(7, RootOf(2), rotations));
  EXPECT_FALSE(rows.Add(0, RootOf(3), std::vector<Quat>(kJoints, Quat(2.0f, 0, 0, 0))));
  EXPECT_EQ(rows.Add(0, RootOf(4), std::vector<Quat>(kJoints - 1)).error().code,
            ErrorCode::kShapeMismatch);
  ASSERT_TRUE(rows.Add(8, RootOf(5), rotations));
  EXPECT_EQ(rows.pose_count(), 2u);
  EXPECT_FALSE(rows.has_pose(0));
  EXPECT_TRUE(rows.has_pose(1));
  EXPECT_FALSE(rows.has_pose(2));
  PoseBatchComposer composer;
  EXPECT_THAT(Decoded(composer, rows, {0, 1, 2, 3, 4}).batch.avatars, ElementsAre(2, 5));
  EXPECT_THAT(Decoded(composer, rows, {0, 1, 2, 3, 4}).batch.flags, ElementsAre(7, 8));
  EXPECT_THAT(Decoded(composer, rows, {0, 3}).batch.avatars, ElementsAre());
}

// A root and a joint that rotates about y by up to 0.5 rad.
CompactCodec SmallCodec() {
  std::vector<RotationQuantization> codes(2);
  codes[0].smallest_three_bits = 12;
  codes[1].low = Vec3(0.0f, -0.25f, 0.0f);
  codes[1].step = Vec3(0.01f, 0x1p-10f, 0.01f);
  codes[1].bits = {0, 9, 0};
  codes[1].least_w = 0.9f;
  return CompactCodec::Make(codes, std::array<std::int16_t, 2>{-1, 0}).value();
}

TEST(PoseRows, CompactPosesAreUncompressedIfNecessary) {
  const CompactCodec codec = SmallCodec();
  const PoseBatchInfo info{5, 1, 0, 1, 99, 1.5, PoseMode::kCompact, 2};
  std::vector<AvatarId> avatars(100);
  std::iota(avatars.begin(), avatars.end(), 1u);
  const auto numbers = std::make_shared<const std::vector<AvatarId>>(avatars);
  const auto is_skipped = [](AvatarId a) { return a % 11 == 3 || a > 97; };
  const auto is_bad = [](AvatarId a) { return a % 7 == 0; };
  const auto turn = [](AvatarId a) { return a % 5 == 0 ? 2.0 : 0.02 * (a % 20); };
  PoseRows rows;
  PoseBatchComposer composer;
  for (int round = 0; round < 2; ++round) {  // the second round reuses the memory
    ASSERT_TRUE(rows.Begin(info, numbers, &codec));
    std::vector<std::uint32_t> picked;
    for (const AvatarId a : avatars) {
      if (a % 3 > 0) picked.push_back(a - 1);
      if (is_skipped(a)) {
        rows.SkipTo(a);
        continue;
      }
      const Vec3 root(is_bad(a) ? std::numeric_limits<float>::quiet_NaN() : 0.5f, 0.0f, 0.0f);
      // The flag uncompressed from the caller is ignored.
      const Status status = rows.Add(a % 8, root, std::array{YawRotation(a), YawRotation(turn(a))});
      ASSERT_EQ(status.has_value(), !is_bad(a)) << a;
    }
    rows.SkipTo(100);
    const auto has_pose = [&](AvatarId a) { return !is_skipped(a) && !is_bad(a); };
    EXPECT_EQ(rows.pose_count(),
              static_cast<std::size_t>(std::ranges::count_if(avatars, has_pose)));
    const Decoded decoded(composer, rows, picked);
    EXPECT_EQ(CompactPoseBytes(decoded.batch), codec.pose_bytes());
    PoseBatchReader reader(decoded.batch, &codec);
    std::size_t i = 0;
    for (const std::uint32_t row : picked) {
      const AvatarId a = row + 1;
      ASSERT_EQ(rows.has_pose(row), has_pose(a)) << a;
      if (!has_pose(a)) continue;
      const int wide = a % 5 == 0 ? kPoseUncompressed : 0;
      ASSERT_EQ(decoded.batch.avatars[i], a);
      ASSERT_EQ(decoded.batch.flags[i++], (a % 4) | wide);
      ASSERT_EQ(reader.Next().size(), wide != 0 ? 24u : codec.pose_bytes());
      Vec3 root;
      std::vector<Quat> back(2);
      ASSERT_TRUE(reader.Decode(root, back));
      ASSERT_EQ(root.x, 0.5f);
      ASSERT_LT(AngleBetween(back[1], YawRotation(turn(a))), 4e-3) << a;
    }
    EXPECT_EQ(i, decoded.batch.avatars.size());
    PoseBatchReader without(decoded.batch, nullptr);
    Vec3 root;
    std::vector<Quat> back(2);
    without.Next();
    EXPECT_EQ(without.Decode(root, back).error().code, ErrorCode::kUnsupported);
  }
  EXPECT_EQ(rows.Begin(info, numbers).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(rows.Begin(Info(PoseMode::kCompact), numbers, &codec).error().code,
            ErrorCode::kInvalidArgument);
}

TEST(PoseBatchComposer, RejectsMoreRowsThanFit) {
  PoseRows rows;
  Fill(rows, PoseMode::kFull, 100);
  const FrameLimits limits{1 << 20, 4096};
  PoseBatchComposer composer(limits);
  std::vector<std::uint32_t> picked(100);
  std::iota(picked.begin(), picked.end(), 0u);
  const std::size_t fitting = composer.CountThatFit(rows, picked);
  // The frame is full except for its header and less than one avatar.
  const std::size_t avatar_bytes = PoseBytes(PoseMode::kFull, kJoints) + sizeof(AvatarId) + 1;
  EXPECT_GT((fitting + 1) * avatar_bytes + 128, 4096u);
  std::vector<std::byte> frame;
  ASSERT_TRUE(composer.Compose(rows, std::span(picked).first(fitting),
                               {.part = 3, .parts = 4, .is_partial = true}, frame));
  EXPECT_LE(frame.size(), 4096 + kFrameHeaderBytes);
  const auto message = Decode(frame, MessageType::kPoseBatch);
  ASSERT_TRUE(message);
  EXPECT_EQ(std::get<PoseBatch>(*message).avatars.size(), fitting);
  EXPECT_EQ(std::get<PoseBatch>(*message).info.part, 3);
  EXPECT_EQ(std::get<PoseBatch>(*message).info.parts, 4);
  EXPECT_TRUE(std::get<PoseBatch>(*message).info.is_partial);
  EXPECT_EQ(composer.Compose(rows, picked, {}, frame).error().code, ErrorCode::kLimitExceeded);
  EXPECT_FALSE(composer.Compose(rows, std::span(picked).first(1), {.part = 4, .parts = 4}, frame));
}

TEST(PoseBatchComposer, ComposesAllRowsThatFit) {
  // Frames of 4 KiB that are filled completely.
  PoseBatchComposer composer({4096, 4096});
  std::vector<AvatarId> avatars(500);
  std::iota(avatars.begin(), avatars.end(), 1u);
  const auto numbers = std::make_shared<const std::vector<AvatarId>>(avatars);
  std::vector<std::uint32_t> all(avatars.size());
  std::iota(all.begin(), all.end(), 0u);
  for (std::uint16_t joints = 1; joints <= 64; ++joints) {
    for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
      PoseRows rows;
      ASSERT_TRUE(rows.Begin({5, 1, 0, 1, 99, 1.5, mode, joints}, numbers));
      const std::vector<Quat> rotations(joints, kIdentityQuat);
      while (rows.size() < avatars.size()) ASSERT_TRUE(rows.Add(0, Vec3(0.0f), rotations));
      const std::size_t fitting = composer.CountThatFit(rows, all);
      ASSERT_GT(fitting, 0u);
      ASSERT_LT(fitting, all.size());
      std::vector<std::byte> frame;
      ASSERT_TRUE(composer.Compose(rows, std::span(all).first(fitting), {}, frame)) << joints;
    }
  }
}

TEST(PoseRows, BeginRejectsInvalidBatches) {
  const auto none = std::make_shared<const std::vector<AvatarId>>();
  const auto begin = [&](PoseMode mode, std::uint16_t joints) {
    return PoseRows().Begin({5, 1, 0, 1, 99, 1.5, mode, joints}, none).error().code;
  };
  EXPECT_EQ(begin(PoseMode::kMovement, 31), ErrorCode::kUnsupported);
  EXPECT_EQ(begin(PoseMode::kFull, 0), ErrorCode::kOutOfRange);
  EXPECT_EQ(begin(PoseMode::kFull, 257), ErrorCode::kOutOfRange);
}

}  // namespace
}  // namespace stridewire::protocol
