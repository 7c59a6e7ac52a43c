#include "stridewire/protocol/pose_batch_encoder.h"

#include <limits>

#include "protocol_testing.h"

namespace stridewire::protocol {
namespace {

PoseBatchInfo Info(PoseMode mode, std::uint16_t joints) {
  return {5, 1, 0, 1, 99, 1.5, mode, joints};
}

TEST(PoseBatchEncoder, HoldsWhatWasAdded) {
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
    PoseBatchEncoder encoder;
    for (int round = 0; round < 2; ++round) {  // the second with the first one's memory
      ASSERT_TRUE(encoder.Begin(Info(mode, 31)));
      const std::vector<Quat> rotations(31, YawRotation(0.25));
      for (AvatarNumber a = 1; a <= 1000; ++a) {
        ASSERT_TRUE(
            encoder.Add(a, a % 4, Vec3(0.5f * static_cast<float>(a), 1.0f, 0.0f), rotations));
      }
      EXPECT_EQ(encoder.size(), 1000u);
      std::vector<std::byte> frame;
      ASSERT_TRUE(encoder.Finish(frame));
      EXPECT_LT(frame.size(), 1000 * (PoseBytes(mode, 31) + 5) + 144);
      const auto message = Decode(frame, MessageType::kPoseBatch);
      ASSERT_TRUE(message) << Describe(message.error());
      const auto& batch = std::get<PoseBatch>(*message);
      EXPECT_EQ(batch.info, Info(mode, 31));
      ASSERT_EQ(batch.avatars.size(), 1000u);
      for (std::size_t i = 0; i < 1000; ++i) {
        Vec3 root;
        std::vector<Quat> back(31);
        ASSERT_TRUE(DecodePose(mode, batch.pose(i), root, back));
        ASSERT_EQ(batch.avatars[i], i + 1);
        ASSERT_EQ(batch.flags[i], (i + 1) % 4);
        ASSERT_EQ(root.x, 0.5f * static_cast<float>(i + 1));
        ASSERT_NEAR(back[30].y, rotations[30].y, 3e-5);
      }
    }
  }
}

TEST(PoseBatchEncoder, GivesTheBytesOfTheGeneralEncoder) {
  PoseBatchEncoder encoder;
  ASSERT_TRUE(encoder.Begin(Info(PoseMode::kFull, 1)));
  ASSERT_TRUE(encoder.Add(7, kPoseStanding, Vec3(1.0f), std::array{kIdentityQuat}));
  std::vector<std::byte> frame;
  ASSERT_TRUE(encoder.Finish(frame));
  const auto message = Decode(frame, MessageType::kPoseBatch);
  ASSERT_TRUE(message);
  EXPECT_EQ(EncodeOrFail(*message), frame);
}

TEST(PoseBatchEncoder, GoesOnWithoutAFaultyPose) {
  PoseBatchEncoder encoder;
  ASSERT_TRUE(encoder.Begin(Info(PoseMode::kQuantised, 1)));
  const std::array one = {kIdentityQuat};
  ASSERT_TRUE(encoder.Add(1, 0, Vec3(0.0f), one));
  const Vec3 nowhere(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(encoder.Add(2, 0, nowhere, one).error().code, ErrorCode::kOutOfRange);
  EXPECT_EQ(encoder.Add(0, 0, Vec3(0.0f), one).error().code, ErrorCode::kOutOfRange);
  const std::array two = {kIdentityQuat, kIdentityQuat};
  EXPECT_EQ(encoder.Add(2, 0, Vec3(0.0f), two).error().code, ErrorCode::kShapeMismatch);
  ASSERT_TRUE(encoder.Add(3, 0, Vec3(0.0f), one));
  std::vector<std::byte> frame;
  ASSERT_TRUE(encoder.Finish(frame));
  const auto message = Decode(frame, MessageType::kPoseBatch);
  ASSERT_TRUE(message) << Describe(message.error());
  const auto& batch = std::get<PoseBatch>(*message);
  EXPECT_EQ(std::vector(batch.avatars.begin(), batch.avatars.end()),
            (std::vector<AvatarNumber>{1, 3}));
}

TEST(PoseBatchEncoder, AFullBatchFitsItsFrame) {
  // 4 KiB frames, filled to the last avatar, for every number of joints up to some.
  const FrameLimits limits{4096, 4096};
  PoseBatchEncoder encoder(limits);
  for (std::uint16_t joints = 1; joints <= 64; ++joints) {
    for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
      const std::vector<Quat> rotations(joints, kIdentityQuat);
      ASSERT_TRUE(encoder.Begin(Info(mode, joints)));
      const std::size_t most = encoder.MaxAvatars(mode, joints);
      ASSERT_GT(most, 0u);
      for (std::size_t a = 1; a <= most; ++a) {
        ASSERT_TRUE(encoder.Add(static_cast<AvatarNumber>(a), 0, Vec3(0.0f), rotations));
      }
      EXPECT_EQ(encoder.Add(9999, 0, Vec3(0.0f), rotations).error().code,
                ErrorCode::kLimitExceeded);
      std::vector<std::byte> frame;
      ASSERT_TRUE(encoder.Finish(frame)) << joints;
    }
  }
  EXPECT_EQ(PoseBatchEncoder().MaxAvatars(PoseMode::kQuantised, 31), kMaxItems);
  EXPECT_EQ(PoseBatchEncoder({64, 64}).MaxAvatars(PoseMode::kFull, 31), 0u);
}

TEST(PoseBatchEncoder, RefusesWhatIsNoBatch) {
  PoseBatchEncoder encoder;
  std::vector<std::byte> frame(3);
  EXPECT_EQ(encoder.Finish(frame).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(encoder.Add(1, 0, Vec3(0.0f), {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(encoder.Begin(Info(PoseMode::kMovement, 31)).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(encoder.Begin(Info(PoseMode::kFull, 0)).error().code, ErrorCode::kOutOfRange);
  EXPECT_EQ(encoder.Begin(Info(PoseMode::kFull, 257)).error().code, ErrorCode::kOutOfRange);
  EXPECT_EQ(encoder.Finish(frame).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(frame.size(), 3u);
}

}  // namespace
}  // namespace stridewire::protocol
