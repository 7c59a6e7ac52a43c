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
constexpr unsigned kModes = PoseScratch::kModes;  // bits of each kind in Others::flags
constexpr std::size_t kPieceBytes = protocol::CompactCodec::kPieceBytes;
static_assert(kCacheLineBytes / kPieceBytes == protocol::CompactCodec::kMostBehind + 1);

}  // namespace

PoseScratch::PoseScratch(std::shared_ptr<const MotionLibrary> of_library)
    : library(std::move(of_library)),
      evaluator(*library, static_cast<int>(EncodedPoseCache::kMost)),
      plan(*library),
      taken(library->skeleton().joint_count()),
      pose(library->skeleton().joint_count()) {}

EncodedPoseCache::EncodedPoseCache(std::shared_ptr<PoseScratch> scratch,
                                   const protocol::CompactCodecs* codecs)
    : scratch_(std::move(scratch)),
      codecs_(codecs),
      pose_bytes_(kRootBytes),
      wide_bytes_(protocol::PoseBytes(PoseMode::kQuantised, scratch_->taken.joint_count())) {}

void EncodedPoseCache::SetModes(std::span<const PoseMode> compact_modes, int ticks_apart) {
  STRIDEWIRE_CHECK(compact_modes.size() <= kModes && ticks_apart >= 1);
  std::vector<Mode> modes;
  std::size_t at = 0;
  for (const PoseMode mode : compact_modes) {
    const protocol::CompactCodec* codec = codecs_ == nullptr ? nullptr : codecs_->Find(mode);
    if (codec == nullptr) continue;
    modes.push_back({mode, codec, at, codec->pieces()});
    at += codec->pieces() * kPieceBytes;
  }
  // Whole lines.
  for (; at % kCacheLineBytes != 0; at += kPieceBytes) ++modes.back().pieces;
  const bool is_same = ticks_apart == ticks_apart_ &&
                       std::ranges::equal(modes, modes_, {}, &Mode::mode, &Mode::mode);
  if (is_same) return;
  modes_ = std::move(modes);
  pose_bytes_ = modes_.empty() ? kRootBytes : at;
  ticks_apart_ = ticks_apart;
  Forget();
}

void EncodedPoseCache::Forget() {
  if (++layout_ == 0) layout_ = 1;
  for (Kept& kept : kept_) kept.layout = 0;
  others_.clear();
  for (std::vector<Line>& plane : planes_) {
    plane.clear();
    plane.shrink_to_fit();
  }
  SizePlanes();
}

void EncodedPoseCache::SizePlanes() {
  const std::size_t bytes = kept_.size() * pose_bytes_;
  const std::size_t lines = (bytes + kCacheLineBytes - 1) / kCacheLineBytes;
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    if (i >= ring_ && i != kStanding) continue;
    planes_[i].reserve(lines);
    planes_[i].resize(lines);
  }
}

void EncodedPoseCache::Begin(std::uint64_t step, double step_s, std::size_t shown) {
  STRIDEWIRE_CHECK(wanted_.empty() && taken_count_ == 0);
  if (ring_ == kMost && std::max(kept_.size(), shown) > kMany) {
    ring_ = kMost / 2;
    Forget();
  }
  step_ = step;
  plane_ = static_cast<std::uint8_t>(step / static_cast<std::uint64_t>(ticks_apart_) % ring_);
  step_s_ = step_s;
  shown_ = shown;
}

void EncodedPoseCache::MakePlace(Place& place) {
  if (place.of_ != nullptr) return;
  if (free_.empty()) {
    // For all that are shown, or by an eighth: planes are large.
    const std::size_t first = kept_.size();
    const std::size_t places = std::max({std::size_t{64}, shown_, first + first / 8});
    kept_.reserve(places);
    kept_.resize(places);
    SizePlanes();
    // The lowest are taken first, so that places follow the order of avatars.
    for (std::size_t i = places; i > first; --i) free_.push_back(static_cast<std::uint32_t>(i - 1));
  }
  place.of_ = this;
  place.index_ = free_.back();
  free_.pop_back();
}

void EncodedPoseCache::Start(std::uint32_t place, std::uint64_t revision, std::size_t count,
                             bool stays) {
  Kept& kept = kept_[place];
  if (kept.is_any_other) others_.erase(place);
  kept = {.first_step = step_,
          .revision = static_cast<std::uint32_t>(revision),
          .layout = layout_,
          .count = static_cast<std::uint8_t>(count),
          .first_plane = plane_,
          .stays = stays,
          .cuts = kept.cuts};
}

// Who is sent elsewhere again and again makes few poses in vain.
std::uint8_t EncodedPoseCache::CutsAfter(const Kept& kept, std::uint64_t revision) const {
  constexpr std::uint8_t kMostCuts = 3;
  if (kept.layout != layout_ || kept.stays || kept.count == 0) return kept.cuts;
  if (kept.revision != static_cast<std::uint32_t>(revision) && PoseOf(kept) < kept.count) {
    return std::min<std::uint8_t>(kept.cuts + 1, kMostCuts);
  }
  return kept.cuts > 0 ? kept.cuts - 1 : 0;
}

void EncodedPoseCache::Ask(Place& place, AvatarSimulation& avatar) {
  // Layers go on by themselves, whatever the avatar does.
  const bool has_layers = !avatar.is_event_free() && !avatar.layers().empty();
  if (!has_layers && Has(place, avatar.revision())) return;
  if (const Movement* movement = avatar.movement(); movement != nullptr && !has_layers) {
    Want(place, avatar.revision(), *movement, avatar.movement_time_s());
    return;
  }
  avatar.UpdatePose();
  Take(place, avatar.revision(), avatar.pose(), !has_layers);
}

void EncodedPoseCache::Want(Place& place, std::uint64_t revision, const Movement& movement,
                            double time_s) {
  MakePlace(place);
  Kept& kept = kept_[place.index_];
  kept.cuts = CutsAfter(kept, revision);
  kept.revision = static_cast<std::uint32_t>(revision);
  kept.count = 0;
  SoaPoseEvaluator::PrefetchTimes(movement);
  wanted_.push_back({place.index_, 0, {&movement, time_s, step_s_, ticks_apart_}, false});
}

void EncodedPoseCache::Take(Place& place, std::uint64_t revision, ConstPoseSpan pose, bool stays) {
  MakePlace(place);
  Start(place.index_, revision, 1, stays);
  scratch_->taken.Set(taken_count_, pose);
  taken_for_[taken_count_++] = place.index_;
  if (taken_count_ == kLanes) KeepTaken();
}

void EncodedPoseCache::KeepTaken() {
  Keep(scratch_->taken, std::span(taken_for_).first(taken_count_), 0);
  taken_count_ = 0;
}

void EncodedPoseCache::Finish() {
  if (taken_count_ > 0) KeepTaken();
  std::size_t poses = 0;
  const std::size_t turns = std::min(TurnsOf(shown_), ring_);
  for (Wanted& wanted : wanted_) {
    const std::size_t turn = wanted.place / kPlacesOfATurn;
    const std::size_t left = turns - (plane_ + turn) % turns;
    const std::size_t most = std::min(left, ring_ >> kept_[wanted.place].cuts);
    wanted.is_its_turn = left == turns;
    wanted.count = SampleRunCount(*wanted.run.movement, wanted.run.time_s, step_s_, ticks_apart_,
                                  static_cast<int>(most));
    poses += static_cast<std::size_t>(wanted.count);
  }
  // Where a whole crowd wants poses at once, since somebody looks at it for the first time or it
  // was sent elsewhere, those whose turn it is not get one only: a tick makes hardly more than two
  // poses an avatar.
  const bool is_crowd_new = poses > 2 * shown_ + kLanes * kMost;
  for (Wanted& wanted : wanted_) {
    if (is_crowd_new && !wanted.is_its_turn) wanted.count = 1;
    Start(wanted.place, kept_[wanted.place].revision, static_cast<std::size_t>(wanted.count),
          false);
    scratch_->queue.Add(wanted.run, wanted.count, wanted.place);
  }
  wanted_.clear();
  std::array<std::uint32_t, kLanes> places;
  scratch_->queue.Evaluate(scratch_->evaluator, [&](std::span<const EvaluationBatcher::Item> items,
                                                    int pose, const SoaPose& lanes) {
    for (std::size_t i = 0; i < items.size(); ++i) {
      places[i] = pose < items[i].count ? items[i].tag : kNobody;
    }
    Keep(lanes, std::span(places).first(items.size()), static_cast<std::size_t>(pose));
  });
}

void EncodedPoseCache::Keep(const SoaPose& lanes, std::span<const std::uint32_t> places,
                            std::size_t pose) {
  for (std::size_t m = 0; m < modes_.size(); ++m) {
    modes_[m].codec->Encode({.roots_m = lanes.roots_m(),
                             .rotations = lanes.rotations(),
                             .count = places.size(),
                             .are_unit = true},
                            scratch_->blocks[m]);
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i] == kNobody) continue;
    std::byte* to = BytesOf(places[i], pose);
    if (modes_.empty()) {
      const Vec3 root_m = lanes.root_m(i);
      std::memcpy(to, &root_m, kRootBytes);
      continue;
    }
    for (std::size_t m = 0; m < modes_.size(); ++m) {
      scratch_->blocks[m].StreamBytes(i, modes_[m].pieces, to + modes_[m].at);
    }
    for (std::size_t m = 0; m < modes_.size(); ++m) {
      if (!scratch_->blocks[m].fits(i)) KeepWide(lanes, i, places[i], pose, m);
    }
  }
}

void EncodedPoseCache::KeepWide(const SoaPose& lanes, std::size_t lane, std::uint32_t place,
                                std::size_t pose, std::size_t mode) {
  lanes.Get(lane, scratch_->pose);
  kept_[place].is_any_other = 1;
  Others& others = others_[place];
  const std::size_t at = others.wide.size();
  others.wide.resize(at + wide_bytes_);
  const bool is_told =
      protocol::EncodePose(PoseMode::kQuantised, scratch_->pose.root_position_m,
                           scratch_->pose.rotations, std::span(others.wide).subspan(at))
          .has_value();
  if (!is_told) others.wide.resize(at);
  others.flags[pose] |= static_cast<std::uint8_t>(1u << (is_told ? mode : mode + kModes));
}

EncodedPoseCache::Encoded EncodedPoseCache::Of(const Place& place, PoseMode mode) const {
  STRIDEWIRE_CHECK(place.of_ == this);
  const Kept& kept = kept_[place.index_];
  const std::size_t pose = PoseOf(kept);
  std::size_t m = 0;
  while (m < modes_.size() && modes_[m].mode != mode) ++m;
  STRIDEWIRE_CHECK(m < modes_.size() && pose < kept.count);
  // Planes are read one place after the other, and page by page: the processor does not ask ahead
  // over the end of one.
  constexpr std::size_t kReadAhead = 8;
  if (const std::size_t next = place.index_ + kReadAhead; next < kept_.size()) {
    PrefetchBytes(BytesIn(plane_, next) + modes_[m].at, modes_[m].codec->pose_bytes());
  }
  if (kept.is_any_other) return OtherOf(place.index_, pose, m);
  return {{BytesOf(place.index_, pose) + modes_[m].at, modes_[m].codec->pose_bytes()}};
}

EncodedPoseCache::Encoded EncodedPoseCache::OtherOf(std::uint32_t place, std::size_t pose,
                                                    std::size_t mode) const {
  const Others& others = others_.at(place);
  const unsigned flags = others.flags[pose];
  if ((flags >> (mode + kModes) & 1u) != 0) return {};
  if ((flags >> mode & 1u) == 0) {
    return {{BytesOf(place, pose) + modes_[mode].at, modes_[mode].codec->pose_bytes()}};
  }
  // Behind those of the poses before, and of the modes before.
  constexpr unsigned kWide = (1u << kModes) - 1;
  auto before = static_cast<std::size_t>(std::popcount(flags & kWide & ((1u << mode) - 1)));
  for (std::size_t p = 0; p < pose; ++p) {
    before += static_cast<std::size_t>(std::popcount(others.flags[p] & kWide));
  }
  return {std::span(others.wide).subspan(before * wide_bytes_, wide_bytes_), true};
}

Vec3 EncodedPoseCache::RootOf(const Place& place) const {
  const Kept& kept = kept_[place.index_];
  const std::byte* bytes = BytesOf(place.index_, PoseOf(kept));
  Vec3 root_m;
  if (modes_.empty()) {
    std::memcpy(&root_m, bytes, kRootBytes);
    return root_m;
  }
  // All modes begin with it; a pose that can be told only by a wide one, too.
  const bool is_told =
      !kept.is_any_other || (others_.at(place.index_).flags[PoseOf(kept)] >> kModes) == 0;
  const std::span<const std::byte, kRootBytes> root(bytes, kRootBytes);
  if (!is_told || !protocol::DecodeRoot(root, root_m)) root_m = Vec3(protocol::kMaxRootM);
  return root_m;
}

}  // namespace stridewire::server
