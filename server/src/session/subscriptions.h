#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include "world/mail.h"

namespace stridewire::server {

/// What a session watches, by the numbers its client chose.
class Subscriptions {
 public:
  struct Subscription {
    WorldId world = 0;
    protocol::PoseMode mode = protocol::PoseMode::kFull;
    std::uint16_t every_n_ticks = 1;
    bool with_events = false;
  };

  [[nodiscard]] bool Contains(protocol::SubscriptionId id) const { return all_.contains(id); }
  [[nodiscard]] std::size_t size() const { return all_.size(); }

  void Add(protocol::SubscriptionId id, const Subscription& subscription);
  /// Returns what it was; empty: there is none of that number.
  std::optional<Subscription> Remove(protocol::SubscriptionId id);
  void RemoveWorld(WorldId world);

  /// Some subscription is about these poses.
  [[nodiscard]] bool Watches(WorldId world, protocol::PoseMode mode) const;
  [[nodiscard]] bool WithEvents(WorldId world) const;
  /// Greatest common divisor of the ticks wanted, 0: none.
  [[nodiscard]] std::uint16_t Every(WorldId world, protocol::PoseMode mode) const;
  /// Some subscription is about these poses at this tick.
  [[nodiscard]] bool Wants(const PoseDelivery& delivery) const;

 private:
  std::map<protocol::SubscriptionId, Subscription> all_;
};

}  // namespace stridewire::server
