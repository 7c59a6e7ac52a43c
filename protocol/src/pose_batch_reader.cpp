#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::protocol {

std::span<const std::byte> PoseBatchReader::Next() {
  const PoseBatchInfo& info = batch_.info;
  mode_ = info.mode;
  if (IsCompact(mode_) && (batch_.flags[index_] & kPoseUncompressed) != 0) {
    mode_ = PoseMode::kQuantised;
  }
  ++index_;
  const std::size_t bytes = IsCompact(mode_) ? compact_bytes_ : PoseBytes(mode_, info.joint_count);
  pose_ = batch_.poses.subspan(at_, bytes);
  at_ += bytes;
  return pose_;
}

Status PoseBatchReader::Decode(Vec3& root_position_m, std::span<Quat> rotations) const {
  if (!IsCompact(mode_)) return DecodePose(mode_, pose_, root_position_m, rotations);
  if (codec_ == nullptr) {
    return Fail(ErrorCode::kUnsupported, "the world has no codec for compact poses");
  }
  return codec_->Decode(pose_, root_position_m, rotations);
}

}  // namespace stridewire::protocol
