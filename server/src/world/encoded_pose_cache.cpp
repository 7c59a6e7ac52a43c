#include "world/encoded_pose_cache.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "base/check.h"
#include "base/prefetch.h"
#include "stridewire/protocol/pose_codec.h"

namespace stridewire::server {

using protocol::PoseMode;

namespace {

constexpr std::size_t kRootBytes = sizeof(Vec3);
constexpr unsigned kMaxModes = PoseScratch::kMaxModes;
constexpr std::size_t kPieceBytes = protocol::CompactCodec::kPieceBytes;
static_assert(kCacheLineBytes / kPieceBytes == protocol::CompactCodec::kMaxTrailingPieces + 1);

}  // namespace

PoseScratch::PoseScratch(std::shared_ptr<const MotionLibrary> of_library)
    : library(std::move(of_library)),
      evaluator(*library, static_cast<int>(EncodedPoseCache::kMaxTicksAhead)),
      plan(*library),
      stored(library->skeleton().joint_count()),
      pose(library->skeleton().joint_count()) {}

EncodedPoseCache::EncodedPoseCache(std::shared_ptr<PoseScratch> scratch,
                                   const protocol::CompactCodecs* codecs)
    : scratch_(std::move(scratch)),
      codecs_(codecs),
      pose_bytes_(kRootBytes),
      uncompressed_bytes_(
          protocol::PoseBytes(PoseMode::kQuantised, scratch_->stored.joint_count())) {}

void EncodedPoseCache::SetModes(std::span<const PoseMode> compact_modes, int steps_apart) {
  STRIDEWIRE_CHECK(compact_modes.size() <= kMaxModes && steps_apart >= 1);
  STRIDEWIRE_CHECK(scheduled_.empty() && stored_count_ == 0);
  std::vector<Mode> modes;
  std::size_t offset = 0;
  for (const PoseMode mode : compact_modes) {
    const protocol::CompactCodec* codec = codecs_ == nullptr ? nullptr : codecs_->Find(mode);
    if (codec == nullptr) continue;
    modes.push_back({mode, codec, offset, codec->pieces()});
    offset += codec->pieces() * kPieceBytes;
  }
  // The last mode also fills the rest of its cache line.
  for (; offset % kCacheLineBytes != 0; offset += kPieceBytes) ++modes.back().pieces;
  const bool is_same = steps_apart == steps_apart_ &&
                       std::ranges::equal(modes, modes_, {}, &Mode::mode, &Mode::mode);
  if (is_same) return;
  modes_ = std::move(modes);
  pose_bytes_ = modes_.empty() ? kRootBytes : offset;
  steps_apart_ = steps_apart;
  Forget();
}

void EncodedPoseCache::Forget() {
  for (SlotState& state : slots_) {
    STRIDEWIRE_CHECK(state.kind != SlotState::kScheduled);
    state = {.backoff = state.backoff};
  }
  overflow_.clear();
  for (std::vector<Line>& plane : planes_) {
    plane.clear();
    plane.shrink_to_fit();
  }
  ResizePlanes();
}

void EncodedPoseCache::ResizePlanes() {
  const std::size_t bytes = slots_.size() * pose_bytes_;
  const std::size_t lines = (bytes + kCacheLineBytes - 1) / kCacheLineBytes;
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    if (i >= ring_size_ && i != kConstantPlane) continue;
    planes_[i].reserve(lines);
    planes_[i].resize(lines);
  }
}

void EncodedPoseCache::BeginStep(std::uint64_t step, double step_s, std::size_t avatar_count) {
  STRIDEWIRE_CHECK(scheduled_.empty() && stored_count_ == 0);
  if (ring_size_ == kMaxTicksAhead && std::max(slots_.size(), avatar_count) > kLargeCrowd) {
    ring_size_ = kMaxTicksAhead / 2;
    Forget();
  }
  step_ = step;
  plane_ = static_cast<std::uint8_t>(step / static_cast<std::uint64_t>(steps_apart_) % ring_size_);
  step_s_ = step_s;
  avatar_count_ = avatar_count;
}

void EncodedPoseCache::Allocate(Slot& slot) {
  STRIDEWIRE_CHECK(slot.cache_ == nullptr || slot.cache_ == this);
  if (slot.cache_ != nullptr) return;
  if (free_.empty()) {
    // Planes are large. To save memory, they grow to the number of avatars or by an eighth,
    // whichever is more, instead of doubling.
    const std::size_t first = slots_.size();
    const std::size_t count = std::max({std::size_t{64}, avatar_count_, first + first / 8});
    STRIDEWIRE_CHECK(count > first && count < kNoSlot);
    slots_.reserve(count);
    slots_.resize(count);
    ResizePlanes();
    // The lowest slots are used first, so that slots are in the order of avatars.
    for (std::size_t i = count; i > first; --i) free_.push_back(static_cast<std::uint32_t>(i - 1));
  }
  slot.cache_ = this;
  slot.index_ = free_.back();
  free_.pop_back();
  STRIDEWIRE_CHECK(slots_[slot.index_].kind == SlotState::kEmpty);
}

void EncodedPoseCache::Release(std::uint32_t slot) {
  SlotState& state = slots_[slot];
  STRIDEWIRE_CHECK(state.kind != SlotState::kScheduled && free_.size() < slots_.size());
  if (state.has_overflow) overflow_.erase(slot);
  state = {};
  free_.push_back(slot);
}

void EncodedPoseCache::Fill(std::uint32_t slot, std::uint64_t revision, std::size_t count,
                            SlotState::Kind kind) {
  SlotState& state = slots_[slot];
  STRIDEWIRE_CHECK(kind == SlotState::kTimed || (kind == SlotState::kConstant && count == 1));
  STRIDEWIRE_CHECK(count >= 1 && count <= ring_size_);
  if (state.has_overflow) {
    const std::size_t erased = overflow_.erase(slot);
    STRIDEWIRE_CHECK(erased == 1);
  }
  state = {.first_step = step_,
           .revision = static_cast<std::uint32_t>(revision),
           .count = static_cast<std::uint8_t>(count),
           .first_plane = plane_,
           .kind = kind,
           .backoff = state.backoff};
}

std::uint8_t EncodedPoseCache::NextBackoff(const SlotState& state, std::uint64_t revision) const {
  if (state.kind != SlotState::kTimed) return state.backoff;
  const bool was_interrupted = state.revision != static_cast<std::uint32_t>(revision);
  if (was_interrupted && PoseIndex(state) < state.count) {
    return static_cast<std::uint8_t>(std::min(state.backoff + 1u, kMaxBackoff));
  }
  return static_cast<std::uint8_t>(state.backoff > 0 ? state.backoff - 1 : 0);
}

void EncodedPoseCache::Request(Slot& slot, AvatarSimulation& avatar) {
  // Layers change the pose independently of the avatar's movement.
  const bool has_layers = !avatar.is_event_free() && !avatar.layers().empty();
  if (!has_layers && Contains(slot, avatar.revision())) return;
  if (const Movement* movement = avatar.displayed_movement(); movement != nullptr && !has_layers) {
    Schedule(slot, avatar.revision(), *movement, avatar.movement_time_s());
    return;
  }
  avatar.UpdatePose();
  Store(slot, avatar.revision(), avatar.pose(), !has_layers);
}

void EncodedPoseCache::Schedule(Slot& slot, std::uint64_t revision, const Movement& movement,
                                double time_s) {
  Allocate(slot);
  SlotState& state = slots_[slot.index_];
  STRIDEWIRE_CHECK(state.kind != SlotState::kScheduled);
  state.backoff = NextBackoff(state, revision) & kMaxBackoff;
  state.revision = static_cast<std::uint32_t>(revision);
  state.count = 0;
  state.kind = SlotState::kScheduled;
  SoaPoseEvaluator::PrefetchTimes(movement);
  scheduled_.push_back({slot.index_, 0, {&movement, time_s, step_s_, steps_apart_}, false});
}

void EncodedPoseCache::Store(Slot& slot, std::uint64_t revision, ConstPoseSpan pose,
                             bool is_constant) {
  Allocate(slot);
  STRIDEWIRE_CHECK(slots_[slot.index_].kind != SlotState::kScheduled);
  STRIDEWIRE_CHECK(stored_count_ < kLanes);
  Fill(slot.index_, revision, 1, is_constant ? SlotState::kConstant : SlotState::kTimed);
  scratch_->stored.Set(stored_count_, pose);
  stored_slots_[stored_count_++] = slot.index_;
  if (stored_count_ == kLanes) EncodeStored();
}

void EncodedPoseCache::EncodeStored() {
  Encode(scratch_->stored, std::span(stored_slots_).first(stored_count_), 0);
  stored_count_ = 0;
}

void EncodedPoseCache::FinishStep() {
  if (stored_count_ > 0) EncodeStored();
  std::size_t poses = 0;
  const std::size_t phases = std::min(PhasesOf(avatar_count_), ring_size_);
  for (Scheduled& item : scheduled_) {
    const std::size_t group = item.slot / kSlotsPerGroup;
    const std::size_t until_phase = phases - (plane_ + group) % phases;
    const std::size_t max_count = std::min(until_phase, ring_size_ >> slots_[item.slot].backoff);
    item.is_in_phase = until_phase == phases;
    item.count = SampleRunCount(*item.run.movement, item.run.time_s, step_s_, steps_apart_,
                                static_cast<int>(max_count));
    poses += static_cast<std::size_t>(item.count);
  }
  // Poses of a whole crowd may be needed in one tick, because a client starts to observe the crowd
  // or because the movements of the crowd were interrupted. In this case, slots outside their phase
  // get only one pose, so that a tick evaluates hardly more than two poses per avatar.
  const bool is_crowd_new = poses > 2 * avatar_count_ + kLanes * kMaxTicksAhead;
  for (Scheduled& item : scheduled_) {
    const SlotState& state = slots_[item.slot];
    STRIDEWIRE_CHECK(state.kind == SlotState::kScheduled);
    if (is_crowd_new && !item.is_in_phase) item.count = 1;
    Fill(item.slot, state.revision, static_cast<std::size_t>(item.count), SlotState::kTimed);
    scratch_->batcher.Add(item.run, item.count, item.slot);
  }
  scheduled_.clear();
  std::array<std::uint32_t, kLanes> slots;
  scratch_->batcher.Evaluate(
      scratch_->evaluator,
      [&](std::span<const EvaluationBatcher::Item> items, int pose, const SoaPose& lanes) {
        for (std::size_t i = 0; i < items.size(); ++i) {
          slots[i] = pose < items[i].count ? items[i].tag : kNoSlot;
        }
        Encode(lanes, std::span(slots).first(items.size()), static_cast<std::size_t>(pose));
      });
}

void EncodedPoseCache::Encode(const SoaPose& lanes, std::span<const std::uint32_t> slots,
                              std::size_t pose) {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    modes_[m].codec->Encode({.roots_m = lanes.roots_m(),
                             .rotations = lanes.rotations(),
                             .count = slots.size(),
                             .are_unit = true},
                            scratch_->blocks[m]);
  }
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (slots[i] == kNoSlot) continue;
    std::byte* to = BytesOf(slots[i], pose);
    if (modes_.empty()) {
      const Vec3 root_m = lanes.root_m(i);
      std::memcpy(to, &root_m, kRootBytes);
      continue;
    }
    for (std::size_t m = 0; m < modes_.size(); ++m) {
      scratch_->blocks[m].StreamBytes(i, modes_[m].pieces, to + modes_[m].offset);
    }
    for (std::size_t m = 0; m < modes_.size(); ++m) {
      if (scratch_->blocks[m].fits(i)) continue;
      lanes.Get(i, scratch_->pose);
      EncodeOverflow(scratch_->pose, slots[i], pose, m);
    }
  }
}

void EncodedPoseCache::EncodeOverflow(ConstPoseSpan pose, std::uint32_t slot,
                                      std::size_t pose_index, std::size_t mode) {
  slots_[slot].has_overflow = 1;
  Overflow& overflow = overflow_[slot];
  const std::size_t offset = overflow.bytes.size();
  overflow.bytes.resize(offset + uncompressed_bytes_);
  const bool is_encoded =
      protocol::EncodePose(PoseMode::kQuantised, pose.root_position_m, pose.rotations,
                           std::span(overflow.bytes).subspan(offset))
          .has_value();
  if (!is_encoded) overflow.bytes.resize(offset);
  overflow.flags[pose_index] |=
      static_cast<std::uint8_t>(1u << (is_encoded ? mode : mode + kMaxModes));
}

EncodedPoseCache::Encoded EncodedPoseCache::Find(std::uint32_t slot, PoseMode mode) const {
  STRIDEWIRE_CHECK(slot < slots_.size());
  const SlotState& state = slots_[slot];
  const std::size_t pose = PoseIndex(state);
  std::size_t m = 0;
  while (m < modes_.size() && modes_[m].mode != mode) ++m;
  STRIDEWIRE_CHECK(m < modes_.size() && pose < state.count);
  // Slots are read in order, but the hardware prefetcher stops at the end of each page, so poses
  // are prefetched this many slots ahead.
  constexpr std::size_t kSlotsAhead = 8;
  if (const std::size_t next = slot + kSlotsAhead; next < slots_.size()) {
    PrefetchBytes(BytesIn(plane_, next) + modes_[m].offset, modes_[m].codec->pose_bytes());
  }
  if (state.has_overflow) return FindOverflow(slot, pose, m);
  return {{BytesOf(slot, pose) + modes_[m].offset, modes_[m].codec->pose_bytes()}};
}

EncodedPoseCache::Encoded EncodedPoseCache::FindOverflow(std::uint32_t slot, std::size_t pose,
                                                         std::size_t mode) const {
  const Overflow& overflow = overflow_.at(slot);
  const unsigned flags = overflow.flags[pose];
  if ((flags >> (mode + kMaxModes) & 1u) != 0) return {};
  if ((flags >> mode & 1u) == 0) {
    return {{BytesOf(slot, pose) + modes_[mode].offset, modes_[mode].codec->pose_bytes()}};
  }
  // Skips the uncompressed poses that are stored before this one: those of the same pose in earlier
  // modes, and those of earlier poses.
  constexpr unsigned kUncompressed = (1u << kMaxModes) - 1;
  auto before = static_cast<std::size_t>(std::popcount(flags & kUncompressed & ((1u << mode) - 1)));
  for (std::size_t p = 0; p < pose; ++p) {
    before += static_cast<std::size_t>(std::popcount(overflow.flags[p] & kUncompressed));
  }
  STRIDEWIRE_CHECK((before + 1) * uncompressed_bytes_ <= overflow.bytes.size());
  return {std::span(overflow.bytes).subspan(before * uncompressed_bytes_, uncompressed_bytes_),
          true};
}

Vec3 EncodedPoseCache::FindRoot(std::uint32_t slot) const {
  STRIDEWIRE_CHECK(slot < slots_.size());
  const SlotState& state = slots_[slot];
  const std::size_t pose = PoseIndex(state);
  STRIDEWIRE_CHECK(pose < state.count);
  const std::byte* bytes = BytesOf(slot, pose);
  Vec3 root_m;
  if (modes_.empty()) {
    std::memcpy(&root_m, bytes, kRootBytes);
    return root_m;
  }
  // The bytes of every mode begin with the root, even if only the uncompressed format can represent
  // the rotations.
  const bool is_encoded = !state.has_overflow || (overflow_.at(slot).flags[pose] >> kMaxModes) == 0;
  const std::span<const std::byte, kRootBytes> root(bytes, kRootBytes);
  if (!is_encoded || !protocol::DecodeRoot(root, root_m)) root_m = Vec3(protocol::kMaxRootM);
  return root_m;
}

}  // namespace stridewire::server
