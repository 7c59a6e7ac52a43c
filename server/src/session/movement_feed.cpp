#include "session/movement_feed.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/check.h"

namespace stridewire::server {

void MovementFeed::SetAvatars(std::optional<std::vector<AvatarId>> avatars) {
  pending_nonce_ = 0;
  if (!avatars || covers_all_) {
    covers_all_ = true;
    selected_.clear();
    deselected_.clear();
    states_of_ = nullptr;
    next_ = 1;
    return;
  }
  STRIDEWIRE_CHECK(std::ranges::is_sorted(*avatars));
  std::vector<AvatarId> added;
  std::ranges::set_difference(*avatars, selected_, std::back_inserter(added));
  std::vector<AvatarId> removed;
  std::ranges::set_difference(selected_, *avatars, std::back_inserter(removed));
  std::vector<AvatarId> all_removed;
  std::ranges::set_union(deselected_, removed, std::back_inserter(all_removed));
  // If an avatar is selected again before it was reported as gone, its state on the client remains
  // valid.
  deselected_.clear();
  std::ranges::set_difference(all_removed, *avatars, std::back_inserter(deselected_));
  // States are missing for new avatars, and for avatars that are still selected and whose states
  // have not been sent.
  std::vector<AvatarId> missing;
  if (next_ != 0 && states_of_ != nullptr) {
    std::ranges::copy_if(*states_of_, std::back_inserter(missing), [&](AvatarId id) {
      return id >= next_ && std::ranges::binary_search(*avatars, id);
    });
  }
  auto states_of = std::make_shared<std::vector<AvatarId>>();
  std::ranges::set_union(missing, added, std::back_inserter(*states_of));
  next_ = states_of->empty() ? 0 : 1;
  states_of_ = std::move(states_of);
  selected_ = *std::move(avatars);
}

protocol::Movements MovementFeed::Select(const protocol::Movements& step, std::size_t max_bytes) {
  STRIDEWIRE_CHECK(!covers_all_);
  protocol::Movements result{.world = step.world,
                             .shard = step.shard,
                             .part = step.part,
                             .parts = step.parts,
                             .more_steps = step.more_steps,
                             .step = step.step,
                             .tick = step.tick,
                             .server_time_s = step.server_time_s};
  const auto add = [&](AvatarId id, std::uint8_t flags, std::span<const std::byte> record) {
    result.avatars.push_back(id);
    result.flags.push_back(flags);
    result.records.insert(result.records.end(), record.begin(), record.end());
    result.ends.push_back(static_cast<std::uint32_t>(result.records.size()));
  };
  // A complete step fits into a frame. Ids of avatars that are gone may take the remaining bytes.
  constexpr std::size_t kAvatarBytes = 9;
  constexpr std::size_t kOverheadBytes = 512;
  STRIDEWIRE_CHECK(step.avatars.size() <= protocol::kMaxItems);
  const std::size_t used =
      step.records.size() + kAvatarBytes * step.avatars.size() + kOverheadBytes;
  const std::size_t room = std::min(used < max_bytes ? (max_bytes - used) / kAvatarBytes : 0,
                                    protocol::kMaxItems - step.avatars.size());
  const auto reported =
      deselected_.begin() + static_cast<std::ptrdiff_t>(std::min(room, deselected_.size()));
  std::for_each(deselected_.begin(), reported,
                [&](AvatarId id) { add(id, protocol::kMovementGone, {}); });
  deselected_.erase(deselected_.begin(), reported);
  for (std::size_t i = 0; i < step.avatars.size(); ++i) {
    if (!std::ranges::binary_search(selected_, step.avatars[i])) continue;
    add(step.avatars[i], step.flags[i], RecordOf(step, i));
  }
  return result;
}

void MovementFeed::SetLost() {
  is_lost_ = true;
  deselected_.clear();
}

void MovementFeed::Restart() {
  STRIDEWIRE_CHECK(is_lost_);
  is_lost_ = false;
  pending_nonce_ = 0;
  states_of_ = covers_all_ ? nullptr : std::make_shared<const std::vector<AvatarId>>(selected_);
  next_ = covers_all_ || !selected_.empty() ? 1 : 0;
}

void MovementFeed::NextRequest(std::uint32_t nonce, StatesRequest& request) {
  STRIDEWIRE_CHECK(nonce != 0 && needs_request());
  pending_nonce_ = nonce;
  request.world = world_;
  request.nonce = nonce;
  request.first = next_;
  request.avatars = states_of_;
}

bool MovementFeed::OnStates(const StatesResult& result) {
  if (pending_nonce_ == 0 || pending_nonce_ != result.nonce) return false;
  pending_nonce_ = 0;
  next_ = result.next;
  return true;
}

}  // namespace stridewire::server
