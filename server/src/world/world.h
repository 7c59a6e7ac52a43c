#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/runtime/motion_library.h"
#include "world/pose_quantizations.h"
#include "world/world_terrain.h"

namespace stridewire::server {

using protocol::AvatarId;
using protocol::WorldId;
using SessionId = std::uint64_t;

/// What all shards and sessions share of a world. Immutable but for the two counters and the ground.
struct World {
  WorldId id = 0;
  std::string name;
  std::shared_ptr<const MotionLibrary> library;
  std::shared_ptr<const PoseCodes> codes;  ///< The library's
  bool persistent = false;                 ///< Avatars outlive the session that spawned them.
  AvatarOptions avatar_options;
  double interest_cell_m = 8.0;  ///< Of the grid that regions are looked up in.

  std::atomic<std::int64_t> avatar_count{0};  ///< Living and about to be spawned.
  std::atomic<AvatarId> last_number{0};       ///< Largest avatar number ever asked for.
  TerrainSlot ground;  ///< As last set; a shard's avatars have it from a tick on.
};

/// The shard an avatar lives on.
[[nodiscard]] constexpr int ShardOf(AvatarId avatar, int shard_count) {
  return static_cast<int>(avatar % static_cast<AvatarId>(shard_count));
}

/// In which of so many ticks an avatar begins what a large command asks of all: of no account who else was asked,
/// in what order, and on which shard they live.
[[nodiscard]] constexpr std::uint32_t StartTickOf(AvatarId avatar, std::uint32_t over_ticks) {
  // The finaliser of MurmurHash3: numbers in a row are spread whatever `over_ticks` has in common with the shards.
  std::uint32_t hash = avatar;
  hash = (hash ^ (hash >> 16)) * 0x85eb'ca6bu;
  hash = (hash ^ (hash >> 13)) * 0xc2b2'ae35u;
  hash ^= hash >> 16;
  return static_cast<std::uint32_t>((std::uint64_t{hash} * over_ticks) >> 32);
}

/// An avatar number nobody has used in this world; 0 when there is none left.
[[nodiscard]] inline AvatarId NextNumber(World& world) {
  AvatarId last = world.last_number.load(std::memory_order_relaxed);
  do {
    if (last == ~AvatarId{0}) return 0;
  } while (!world.last_number.compare_exchange_weak(last, last + 1, std::memory_order_relaxed));
  return last + 1;
}

/// Numbers the server chooses are larger than any a client chose.
inline void NoteNumber(World& world, AvatarId number) {
  AvatarId last = world.last_number.load(std::memory_order_relaxed);
  while (last < number &&
         !world.last_number.compare_exchange_weak(last, number, std::memory_order_relaxed)) {
  }
}

/// Counts avatars against the limits of a world and of the server. Any thread.
class AvatarBudget {
 public:
  enum class Verdict : std::uint8_t { kOk, kWorldFull, kServerFull };

  AvatarBudget(std::int64_t max_per_world, std::int64_t max_total)
      : max_per_world_(max_per_world), max_total_(max_total) {}

  /// Takes the place of one avatar, or nothing.
  [[nodiscard]] Verdict Reserve(World& world) {
    if (!TakeOne(world.avatar_count, max_per_world_)) return Verdict::kWorldFull;
    if (!TakeOne(total_, max_total_)) {
      world.avatar_count.fetch_sub(1, std::memory_order_relaxed);
      return Verdict::kServerFull;
    }
    return Verdict::kOk;
  }
  void Release(World& world, std::int64_t count = 1) {
    world.avatar_count.fetch_sub(count, std::memory_order_relaxed);
    total_.fetch_sub(count, std::memory_order_relaxed);
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
