#include "session/subscriptions.h"

#include <algorithm>
#include <numeric>

namespace stridewire::server {

using protocol::PoseMode;
using protocol::SubscriptionId;

void Subscriptions::Add(SubscriptionId id, const Subscription& subscription) {
  all_.emplace(id, subscription);
}

std::optional<Subscriptions::Subscription> Subscriptions::Remove(SubscriptionId id) {
  const auto it = all_.find(id);
  if (it == all_.end()) return std::nullopt;
  const Subscription removed = it->second;
  all_.erase(it);
  return removed;
}

void Subscriptions::RemoveWorld(WorldId world) {
  std::erase_if(all_, [&](const auto& item) { return item.second.world == world; });
}

bool Subscriptions::Watches(WorldId world, PoseMode mode) const {
  return std::ranges::any_of(all_, [&](const auto& item) {
    return item.second.world == world && item.second.mode == mode;
  });
}

bool Subscriptions::WithEvents(WorldId world) const {
  return std::ranges::any_of(all_, [&](const auto& item) {
    return item.second.world == world && item.second.with_events;
  });
}

std::uint16_t Subscriptions::Every(WorldId world, PoseMode mode) const {
  std::uint16_t every = 0;
  for (const auto& [id, subscription] : all_) {
    if (subscription.world == world && subscription.mode == mode) {
      every = std::gcd(every, subscription.every_n_ticks);
    }
  }
  return every;
}

bool Subscriptions::Wants(const PoseDelivery& delivery) const {
  return std::ranges::any_of(all_, [&](const auto& item) {
    const Subscription& subscription = item.second;
    return subscription.world == delivery.world && subscription.mode == delivery.mode &&
           delivery.tick % subscription.every_n_ticks == 0;
  });
}

}  // namespace stridewire::server
