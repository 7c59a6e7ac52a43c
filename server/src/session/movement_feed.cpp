#include "session/movement_feed.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace stridewire::server {

void MovementFeed::Watch(std::optional<std::vector<AvatarId>> named) {
  asked_ = 0;
  if (!named || is_whole_) {
    is_whole_ = true;
    named_.clear();
    forgotten_.clear();
    states_of_ = nullptr;
    next_ = 1;
    return;
  }
  std::vector<AvatarId> added;
  std::ranges::set_difference(*named, named_, std::back_inserter(added));
  // Who came back before the client has heard of it was told of all the time.
  std::vector<AvatarId> removed;
  std::ranges::set_difference(named_, *named, std::back_inserter(removed));
  std::vector<AvatarId> either;
  std::ranges::set_union(forgotten_, removed, std::back_inserter(either));
  forgotten_.clear();
  std::ranges::set_difference(either, *named, std::back_inserter(forgotten_));
  // Those whose states are still to come and are wanted, and the new ones.
  std::vector<AvatarId> waiting;
  if (next_ != 0 && states_of_ != nullptr) {
    std::ranges::copy_if(*states_of_, std::back_inserter(waiting), [&](AvatarId number) {
      return number >= next_ && std::ranges::binary_search(*named, number);
    });
  }
  auto states_of = std::make_shared<std::vector<AvatarId>>();
  std::ranges::set_union(waiting, added, std::back_inserter(*states_of));
  next_ = states_of->empty() ? 0 : 1;
  states_of_ = std::move(states_of);
  named_ = *std::move(named);
}

protocol::Movements MovementFeed::Pick(const protocol::Movements& step, std::size_t max_bytes) {
  protocol::Movements some{.world = step.world,
                           .shard = step.shard,
                           .part = step.part,
                           .parts = step.parts,
                           .more_steps = step.more_steps,
                           .step = step.step,
                           .tick = step.tick,
                           .server_time_s = step.server_time_s};
  const auto add = [&](AvatarId number, std::uint8_t flags, std::span<const std::byte> record) {
    some.avatars.push_back(number);
    some.flags.push_back(flags);
    some.records.insert(some.records.end(), record.begin(), record.end());
    some.ends.push_back(static_cast<std::uint32_t>(some.records.size()));
  };
  // The step itself leaves room, for it fits with all its records.
  constexpr std::size_t kAvatarBytes = 9;
  constexpr std::size_t kOverheadBytes = 512;
  const std::size_t used =
      step.records.size() + kAvatarBytes * step.avatars.size() + kOverheadBytes;
  const std::size_t room = std::min(used < max_bytes ? (max_bytes - used) / kAvatarBytes : 0,
                                    protocol::kMaxItems - step.avatars.size());
  const auto told =
      forgotten_.begin() + static_cast<std::ptrdiff_t>(std::min(room, forgotten_.size()));
  std::for_each(forgotten_.begin(), told,
                [&](AvatarId number) { add(number, protocol::kMovementGone, {}); });
  forgotten_.erase(forgotten_.begin(), told);
  for (std::size_t i = 0; i < step.avatars.size(); ++i) {
    if (!std::ranges::binary_search(named_, step.avatars[i])) continue;
    add(step.avatars[i], step.flags[i], step.record(i));
  }
  return some;
}

void MovementFeed::Lose() {
  is_lost_ = true;
  forgotten_.clear();
}

void MovementFeed::Recover() {
  is_lost_ = false;
  asked_ = 0;
  states_of_ = is_whole_ ? nullptr : std::make_shared<const std::vector<AvatarId>>(named_);
  next_ = is_whole_ || !named_.empty() ? 1 : 0;
}

void MovementFeed::Ask(std::uint32_t nonce, StatesQuestion& question) {
  asked_ = nonce;
  question.world = world_;
  question.nonce = nonce;
  question.first = next_;
  question.named = states_of_;
}

bool MovementFeed::OnStates(const StatesAnswer& answer) {
  if (asked_ != answer.nonce) return false;
  asked_ = 0;
  next_ = answer.next;
  return true;
}

}  // namespace stridewire::server
