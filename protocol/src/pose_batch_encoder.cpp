#include "stridewire/protocol/pose_batch_encoder.h"

#include <algorithm>

#include "frame_builder.h"
#include "stridewire/protocol/check.h"

namespace stridewire::protocol {

struct PoseBatchEncoder::Impl {
  FrameLimits limits;
  flatbuffers::FlatBufferBuilder builder;
  bool begun = false;
  PoseBatchInfo info;
  std::size_t max_avatars = 0;
  std::vector<AvatarNumber> avatars;
  std::vector<std::uint8_t> flags;
  std::vector<std::byte> poses;
};

PoseBatchEncoder::PoseBatchEncoder(const FrameLimits& limits) : impl_(std::make_unique<Impl>()) {
  impl_->limits = limits;
}
PoseBatchEncoder::~PoseBatchEncoder() = default;
PoseBatchEncoder::PoseBatchEncoder(PoseBatchEncoder&&) noexcept = default;
PoseBatchEncoder& PoseBatchEncoder::operator=(PoseBatchEncoder&&) noexcept = default;

std::size_t PoseBatchEncoder::MaxAvatars(PoseMode mode, std::size_t joint_count) const {
  const std::size_t bytes = MaxPayloadBytes(MessageType::kPoseBatch, impl_->limits);
  if (bytes <= kPoseBatchOverheadBytes) return 0;
  const std::size_t avatar_bytes = PoseBytes(mode, joint_count) + sizeof(AvatarNumber) + 1;
  return std::min(kMaxItems, (bytes - kPoseBatchOverheadBytes) / avatar_bytes);
}

Status PoseBatchEncoder::Begin(const PoseBatchInfo& info) {
  impl_->begun = false;
  if (const Status status = Check(PoseBatch{info, {}, {}, {}}); !status) return status;
  impl_->info = info;
  impl_->max_avatars = MaxAvatars(info.mode, info.joint_count);
  impl_->avatars.clear();
  impl_->flags.clear();
  impl_->poses.clear();
  impl_->begun = true;
  return {};
}

Status PoseBatchEncoder::Add(AvatarNumber avatar, std::uint8_t flags, const Vec3& root_position_m,
                             std::span<const Quat> rotations) {
  Impl& batch = *impl_;
  if (!batch.begun) return Fail(ErrorCode::kInvalidArgument, "no batch was begun");
  if (avatar == 0) return Fail(ErrorCode::kOutOfRange, "id is zero", "PoseBatch.avatars");
  if (rotations.size() != batch.info.joint_count) {
    return Fail(ErrorCode::kShapeMismatch, "pose has another number of joints", "PoseBatch.poses",
                static_cast<std::int64_t>(rotations.size()));
  }
  if (batch.avatars.size() == batch.max_avatars) {
    return Fail(ErrorCode::kLimitExceeded, "batch is full", "PoseBatch.avatars",
                static_cast<std::int64_t>(batch.max_avatars));
  }
  const std::size_t bytes = PoseBytes(batch.info.mode, rotations.size());
  const std::size_t begin = batch.poses.size();
  batch.poses.resize(begin + bytes);
  const Status status = EncodePose(batch.info.mode, root_position_m, rotations,
                                   std::span(batch.poses).subspan(begin));
  if (!status) {
    batch.poses.resize(begin);
    return status;
  }
  batch.avatars.push_back(avatar);
  batch.flags.push_back(flags);
  return {};
}

std::size_t PoseBatchEncoder::size() const { return impl_->begun ? impl_->avatars.size() : 0; }

Status PoseBatchEncoder::Finish(std::vector<std::byte>& frame) {
  Impl& batch = *impl_;
  if (!batch.begun) return Fail(ErrorCode::kInvalidArgument, "no batch was begun");
  batch.begun = false;
  batch.builder.Clear();
  batch.builder.Finish(
      BuildPoseBatch(batch.builder, {batch.info, batch.avatars, batch.flags, batch.poses}));
  return AppendFrame(batch.builder, MessageType::kPoseBatch, batch.limits, frame);
}

}  // namespace stridewire::protocol
