#include "stridewire/protocol/pose_rows.h"

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "base/prefetch.h"
#include "frame_builder.h"
#include "stridewire/protocol/check.h"

namespace stridewire::protocol {

Status PoseRows::Begin(const PoseBatchInfo& info, Avatars avatars, const CompactCodec* codec) {
  STRIDEWIRE_CHECK(avatars != nullptr);
  codec_ = codec;
  info_ = info;
  avatars_ = std::move(avatars);
  flags_.clear();
  flags_.reserve(avatars_->size());
  begins_.reserve(avatars_->size() + 1);
  begins_.assign(1, 0);
  pose_count_ = 0;
  if (IsCompact(info.mode) && (codec == nullptr || codec->joint_count() != info.joint_count)) {
    return Fail(ErrorCode::kInvalidArgument,
                "a compact mode needs a codec with the same number of joints", "PoseBatch.mode");
  }
  return Check(PoseBatch{info, {}, {}, {}});
}

Status PoseRows::Add(std::uint8_t flags, const Vec3& root_position_m,
                     std::span<const Quat> rotations) {
  AddEncoded(flags, false, {});
  if (rotations.size() != info_.joint_count) {
    return Fail(ErrorCode::kShapeMismatch, "the pose has another number of joints",
                "PoseBatch.poses", static_cast<std::int64_t>(rotations.size()));
  }
  const std::size_t begin = begins_.back();
  PoseMode mode = info_.mode;
  std::size_t length = 0;
  if (IsCompact(mode)) {
    block_.Clear();
    block_.Add(root_position_m, rotations);
    codec_->Encode(block_);
    if (block_.fits(0)) {
      length = codec_->pose_bytes();
      block_.CopyBytes(0, Room(begin, length));
    } else {
      flags_.back() |= kPoseUncompressed;
      mode = PoseMode::kQuantised;
    }
  }
  if (length == 0) {
    length = PoseBytes(mode, rotations.size());
    const Status status = EncodePose(mode, root_position_m, rotations, Room(begin, length));
    if (!status) return status;
  }
  begins_.back() = begin + length;
  ++pose_count_;
  return {};
}

void PoseRows::AddEncoded(std::uint8_t flags, bool is_uncompressed,
                          std::span<const std::byte> pose) {
  STRIDEWIRE_CHECK(size() < avatars_->size());
  const std::size_t begin = begins_.back();
  if (IsCompact(info_.mode)) flags &= static_cast<std::uint8_t>(~kPoseUncompressed);
  flags_.push_back(is_uncompressed ? flags | kPoseUncompressed : flags);
  begins_.push_back(begin + pose.size());
  if (pose.empty()) return;
  std::ranges::copy(pose, Room(begin, pose.size()).begin());
  ++pose_count_;
}

std::span<std::byte> PoseRows::Room(std::size_t begin, std::size_t length) {
  if (bytes_.size() < begin + length) {
    // Grows only by an eighth, because the poses of a crowd take megabytes.
    const std::size_t room = std::max(begin + length, bytes_.size() + bytes_.size() / 8);
    bytes_.reserve(room);
    bytes_.resize(room);
  }
  return std::span(bytes_).subspan(begin, length);
}

void PoseRows::SkipTo(std::size_t row) {
  STRIDEWIRE_CHECK(row <= avatars_->size());
  if (row <= size()) return;
  flags_.resize(row);
  begins_.resize(row + 1, begins_.back());
}

namespace {

// Copies each run of consecutive rows at once. The processor prefetches data within a run, but not
// of the next runs, so this function prefetches them.
void AppendPoses(const PoseRows& rows, std::span<const std::uint32_t> picked,
                 std::vector<std::byte>& frame) {
  constexpr std::size_t kAhead = 4;
  for (std::size_t i = 0; i < picked.size();) {
    std::size_t last = i;
    while (last + 1 < picked.size() && picked[last + 1] == picked[last] + 1) ++last;
    if (last + kAhead < picked.size()) {
      const std::span<const std::byte> later =
          rows.poses(picked[last + kAhead], picked[last + kAhead]);
      PrefetchBytes(later.data(), later.size());
    }
    const std::span<const std::byte> run = rows.poses(picked[i], picked[last]);
    frame.insert(frame.end(), run.begin(), run.end());
    i = last + 1;
  }
}

}  // namespace

struct PoseBatchComposer::Impl {
  FrameLimits limits;
  flatbuffers::FlatBufferBuilder builder;
};

PoseBatchComposer::PoseBatchComposer(const FrameLimits& limits) : impl_(std::make_unique<Impl>()) {
  impl_->limits = limits;
}
PoseBatchComposer::~PoseBatchComposer() = default;
PoseBatchComposer::PoseBatchComposer(PoseBatchComposer&&) noexcept = default;
PoseBatchComposer& PoseBatchComposer::operator=(PoseBatchComposer&&) noexcept = default;

std::size_t PoseBatchComposer::CountThatFit(const PoseRows& rows,
                                            std::span<const std::uint32_t> picked) const {
  const std::size_t room = MaxPayloadBytes(MessageType::kPoseBatch, impl_->limits);
  std::size_t used = kPoseBatchOverheadBytes;
  std::size_t poses = 0;
  for (std::size_t i = 0; i < picked.size(); ++i) {
    if (!rows.has_pose(picked[i])) continue;
    used += rows.poses(picked[i], picked[i]).size() + sizeof(AvatarId) + 1;
    if (used > room || ++poses > kMaxItems) return i;
  }
  return picked.size();
}

Status PoseBatchComposer::Compose(const PoseRows& rows, std::span<const std::uint32_t> picked,
                                  const Slice& slice, std::vector<std::byte>& frame) {
  PoseBatchInfo info = rows.info();
  info.part = static_cast<std::uint16_t>(slice.part);
  info.parts = static_cast<std::uint16_t>(slice.parts);
  info.is_partial = slice.is_partial;
  if (const Status status = Check(PoseBatch{info, {}, {}, {}}); !status) return status;
  std::size_t count = 0;
  std::size_t length = 0;
  for (const std::uint32_t row : picked) {
    count += rows.has_pose(row) ? 1 : 0;
    length += rows.poses(row, row).size();
  }

  flatbuffers::FlatBufferBuilder& builder = impl_->builder;
  builder.Clear();
  // The builder only reserves space for the poses, at the end of the payload. They are copied once,
  // directly into the frame.
  std::uint8_t* poses = nullptr;
  const auto poses_offset = builder.CreateUninitializedVector<std::uint8_t>(length, &poses);
  std::uint8_t* flags = nullptr;
  const auto flags_offset = builder.CreateUninitializedVector<std::uint8_t>(count, &flags);
  for (const std::uint32_t row : picked) {
    if (rows.has_pose(row)) *flags++ = rows.flags(row);
  }
  AvatarId* avatars = nullptr;
  const auto avatars_offset = builder.CreateUninitializedVector<AvatarId>(count, &avatars);
  for (const std::uint32_t row : picked) {
    if (rows.has_pose(row)) {
      *avatars++ = flatbuffers::EndianScalar((*rows.avatars())[row]);
    }
  }
  builder.Finish(BuildPoseBatch(builder, info, avatars_offset, flags_offset, poses_offset));

  const std::size_t size = builder.GetSize();
  const Status begun = BeginFrame(size, MessageType::kPoseBatch, impl_->limits, frame);
  if (!begun) return begun;
  const auto* payload = reinterpret_cast<const std::byte*>(builder.GetBufferPointer());
  // The offset counts from the end of the payload to the length of the vector, which precedes its
  // bytes.
  const std::byte* room = payload + size - poses_offset.o + sizeof(flatbuffers::uoffset_t);
  frame.insert(frame.end(), payload, room);
  AppendPoses(rows, picked, frame);
  frame.insert(frame.end(), room + length, payload + size);
  EndFrame(size, frame);
  return {};
}

}  // namespace stridewire::protocol
