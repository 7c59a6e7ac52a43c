// The part of WorldShard that encodes poses.

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "world/world_shard.h"

namespace stridewire::server {

using protocol::PoseMode;

namespace {

// Number of avatars by which prefetching is ahead of processing.
constexpr std::size_t kPrefetchDistance = 16;

}  // namespace

std::span<const std::uint32_t> WorldShard::SelectedRows(PoseMode mode) {
  if (!are_selected_rows_valid_) {
    are_selected_rows_valid_ = true;
    for (std::size_t m = 0; m < selected_rows_.size(); ++m) {
      selected_rows_[m].clear();
      auto from = ids_->begin();
      for (const AvatarId id : interest_.SelectedAvatars(kSentModes[m])) {
        from = std::lower_bound(from, ids_->end(), id);
        if (from == ids_->end()) break;
        if (*from == id) {
          selected_rows_[m].push_back(static_cast<std::uint32_t>(from - ids_->begin()));
        }
      }
    }
  }
  return selected_rows_[ModeIndex(mode)];
}

std::span<const std::uint32_t> WorldShard::SelectedAndRegionRows(PoseMode mode,
                                                                 const SpatialGrid& grid) {
  is_picked_.resize(ids_->size());
  picked_rows_.clear();
  const auto pick = [&](std::uint32_t row) {
    if (std::exchange(is_picked_[row], 1) == 0) picked_rows_.push_back(row);
  };
  for (const std::uint32_t row : SelectedRows(mode)) pick(row);
  interest_.ForEachRegion(mode, [&](const RegionFilter& region) {
    const double inner_m2 = region.inner_m * region.inner_m;
    grid.ForEachNear(region.x, region.z, region.outer_m,
                     [&](std::uint32_t row, double x, double z) {
                       // RegionMembers must use the same formula and comparison to select the ring.
                       const double distance_m2 =
                           (x - region.x) * (x - region.x) + (z - region.z) * (z - region.z);
                       if (region.inner_m == 0.0 || distance_m2 > inner_m2) pick(row);
                     });
  });
  for (const std::uint32_t row : picked_rows_) is_picked_[row] = 0;
  std::ranges::sort(picked_rows_);
  return picked_rows_;
}

void WorldShard::CachePoses(std::span<const std::uint32_t> rows) {
  const std::span<const OrderedAvatar> ordered = OrderedAvatars();
  cache_.BeginStep(step_, clock_.tick_s(), rows.size());
  cached_poses_.clear();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kPrefetchDistance < rows.size()) {
      Prefetch(*ordered[rows[i + kPrefetchDistance]].entry);
    }
    Entry& entry = *ordered[rows[i]].entry;
    cache_.Request(entry.poses, entry.avatar);
    cached_poses_.push_back({entry.placed_tick, entry.poses.number(), entry.avatar.idle()});
  }
  cache_.FinishStep();
}

void WorldShard::EvaluatePoses(std::span<const std::uint32_t> rows) {
  const std::span<const OrderedAvatar> ordered = OrderedAvatars();
  evaluated_.clear();
  for (const std::uint32_t row : rows) evaluated_.push_back(&ordered[row].entry->avatar);
  AvatarSimulation::UpdatePoses(evaluated_, cache_.evaluator());
}

std::shared_ptr<const SpatialGrid> WorldShard::GridAt(std::uint64_t tick) {
  if (grid_ != nullptr && grid_tick_ == tick) return grid_;
  const std::span<const OrderedAvatar> ordered = OrderedAvatars();
  auto grid = std::make_shared<SpatialGrid>();
  grid->Begin(world_->interest_cell_m, ordered.size());
  CachePoses(all_rows_);
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    const Vec3 root_m = cache_.FindRoot(cached_poses_[i].slot);
    grid->Add(static_cast<std::uint32_t>(i), root_m.x, root_m.z);
  }
  grid->Sort();
  grid_ = std::move(grid);
  grid_tick_ = tick;
  return grid_;
}

bool WorldShard::Encode(PoseMode mode, std::uint64_t tick, bool all,
                        protocol::PoseBatchComposer& composer, PoseDelivery& delivery) {
  const std::span<const OrderedAvatar> ordered = OrderedAvatars();
  delivery.grid = interest_.HasRegions(mode) ? GridAt(tick) : nullptr;
  std::span<const std::uint32_t> picked = all_rows_;
  if (!all) {
    picked =
        delivery.grid != nullptr ? SelectedAndRegionRows(mode, *delivery.grid) : SelectedRows(mode);
  }
  bool& had_poses = last_had_poses_[ModeIndex(mode)];
  if (picked.empty() && !had_poses && !interest_.HasMixedRegions(mode)) return false;
  had_poses = !picked.empty();
  STRIDEWIRE_CHECK(picked.empty() || picked.back() < ordered.size());

  protocol::PoseRows& rows = rows_[ModeIndex(mode)].Take();
  const Status begun = rows.Begin(
      {.world = world_->id,
       .shard = static_cast<std::uint16_t>(shard_),
       .tick = tick,
       .server_time_s = clock_.TickTime(tick),
       .mode = mode,
       .joint_count = static_cast<std::uint16_t>(world_->library->skeleton().joint_count())},
      ids_, world_->quantizations == nullptr ? nullptr : world_->quantizations->codecs.Find(mode));
  STRIDEWIRE_CHECK(begun.has_value());
  const bool is_compact = protocol::IsCompact(mode);
  if (is_compact) {
    CachePoses(picked);
  } else {
    EvaluatePoses(picked);
  }
  const auto flags_of = [&](std::uint64_t placed_tick, bool is_standing) {
    std::uint8_t flags = is_standing ? protocol::kPoseStanding : 0;
    // The flag stays set for the longest interval of any observer, so that every observer receives
    // it.
    if (tick < placed_tick + interest_.max_interval()) flags |= protocol::kPoseDiscontinuity;
    return flags;
  };
  for (std::size_t i = 0; i < picked.size(); ++i) {
    rows.SkipTo(picked[i]);
    if (is_compact) {
      const CachedPose& cached = cached_poses_[i];
      const EncodedPoseCache::Encoded encoded = cache_.Find(cached.slot, mode);
      rows.AddEncoded(flags_of(cached.placed_tick, cached.is_standing), encoded.is_uncompressed,
                      encoded.bytes);
    } else {
      const Entry& entry = *ordered[picked[i]].entry;
      const ConstPoseSpan pose = entry.avatar.pose();
      (void)rows.Add(flags_of(entry.placed_tick, entry.avatar.idle()), pose.root_position_m,
                     pose.rotations);
    }
  }
  rows.SkipTo(ordered.size());
  STRIDEWIRE_CHECK(rows.pose_count() <= picked.size());
  metrics_.poses_encoded.Add(rows.pose_count());
  metrics_.pose_errors.Add(picked.size() - rows.pose_count());

  delivery.world = world_->id;
  delivery.mode = mode;
  delivery.from_shard = shard_;
  delivery.tick = tick;
  delivery.avatar_count = static_cast<std::uint32_t>(rows.pose_count());
  delivery.parts.clear();
  if (all) delivery.parts = ComposeFrames(composer, rows, picked, false, metrics_);
  delivery.rows = rows_[ModeIndex(mode)].Share();
  return true;
}

}  // namespace stridewire::server
