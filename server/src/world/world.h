#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "base/check.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/runtime/avatar.h"
#include "stridewire/runtime/motion_library.h"
#include "world/pose_quantizations.h"
#include "world/world_terrain.h"

namespace stridewire::server {

using protocol::AvatarId;
using protocol::WorldId;
using SessionId = std::uint64_t;

/// The state of a world that all shards and sessions share. Immutable except for the two counters
/// and the terrain.
struct World {
  WorldId id = 0;
  std::string name;
  std::shared_ptr<const MotionLibrary> library;
  std::shared_ptr<const PoseQuantizations> quantizations;  ///< Compact pose formats of `library`.
  WalkSpeeds walk_speeds;                                  ///< Walking speeds of `library`.
  bool persistent = false;  ///< True if avatars outlive the session that spawned them.
  AvatarOptions avatar_options;
  double interest_cell_m = 8.0;  ///< Cell size of the grid that finds the avatars of a region.

  std::atomic<std::int64_t> avatar_count{0};  ///< Avatars that exist or are being spawned.
  std::atomic<AvatarId> last_id{0};           ///< Largest avatar id that any Spawn has used.
  TerrainSlot
      terrain;  ///< The latest terrain. Shards apply it to their avatars at TerrainPart::tick.
};

/// Returns the shard that owns an avatar.
[[nodiscard]] constexpr int ShardOf(AvatarId avatar, int shard_count) {
  return static_cast<int>(avatar % static_cast<AvatarId>(shard_count));
}

/// Distributes the starts of a large command over several ticks. Returns the tick offset of an
/// avatar, less than `over_ticks`. It depends only on the avatar's id, not on the other avatars of
/// the command, their order or the number of shards.
[[nodiscard]] constexpr std::uint32_t StartTickOf(AvatarId avatar, std::uint32_t over_ticks) {
  // The finalizer of MurmurHash3 spreads consecutive ids evenly, even if `over_ticks` and the
  // number of shards have common factors.
  std::uint32_t hash = avatar;
  hash = (hash ^ (hash >> 16)) * 0x85eb'ca6bu;
  hash = (hash ^ (hash >> 13)) * 0xc2b2'ae35u;
  hash ^= hash >> 16;
  return static_cast<std::uint32_t>((std::uint64_t{hash} * over_ticks) >> 32);
}

/// Returns an avatar id that was never used in this world, or 0 if none is left.
[[nodiscard]] inline AvatarId NextAvatarId(World& world) {
  AvatarId last = world.last_id.load(std::memory_order_relaxed);
  do {
    if (last == ~AvatarId{0}) return 0;
  } while (!world.last_id.compare_exchange_weak(last, last + 1, std::memory_order_relaxed));
  return last + 1;
}

/// Records an id that a client chose, so that NextAvatarId returns only larger ids.
inline void RecordAvatarId(World& world, AvatarId id) {
  AvatarId last = world.last_id.load(std::memory_order_relaxed);
  while (last < id && !world.last_id.compare_exchange_weak(last, id, std::memory_order_relaxed)) {
  }
}

/// Counts avatars against the limits of their world and of the server. Thread-safe.
class AvatarBudget {
 public:
  enum class Verdict : std::uint8_t { kOk, kWorldFull, kServerFull };

  AvatarBudget(std::int64_t max_per_world, std::int64_t max_total)
      : max_per_world_(max_per_world), max_total_(max_total) {}

  /// Reserves room for one avatar. If a limit is reached, reserves nothing.
  [[nodiscard]] Verdict Reserve(World& world) {
    if (!TakeOne(world.avatar_count, max_per_world_)) return Verdict::kWorldFull;
    if (!TakeOne(total_, max_total_)) {
      world.avatar_count.fetch_sub(1, std::memory_order_relaxed);
      return Verdict::kServerFull;
    }
    return Verdict::kOk;
  }
  void Release(World& world, std::int64_t count = 1) {
    const std::int64_t in_world = world.avatar_count.fetch_sub(count, std::memory_order_relaxed);
    const std::int64_t in_total = total_.fetch_sub(count, std::memory_order_relaxed);
    STRIDEWIRE_CHECK(count >= 0 && in_world >= count && in_total >= count);
  }
  [[nodiscard]] std::int64_t total() const { return total_.load(std::memory_order_relaxed); }

 private:
  static bool TakeOne(std::atomic<std::int64_t>& counter, std::int64_t max) {
    if (counter.fetch_add(1, std::memory_order_relaxed) < max) return true;
    counter.fetch_sub(1, std::memory_order_relaxed);
    return false;
  }

  std::int64_t max_per_world_;
  std::int64_t max_total_;
  std::atomic<std::int64_t> total_{0};
};

}  // namespace stridewire::server
