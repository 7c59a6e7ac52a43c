#pragma once

#include <cstdint>
#include <vector>

#include "stridewire/protocol/messages.h"

namespace stridewire::load {

using Movement = decltype(protocol::RequestItem::movement);

/// Random numbers in eight bytes, so that a hundred thousand avatars may each have theirs
/// (SplitMix64: Steele, Lea, Flood 2014).
class SmallRandom {
 public:
  explicit SmallRandom(std::uint64_t seed) : state_(seed) {}
  [[nodiscard]] std::uint64_t Next();
  /// Uniform in [min, max).
  [[nodiscard]] double Uniform(double min, double max);
  /// Uniform in [min, max], both included.
  [[nodiscard]] int Integer(int min, int max);

 private:
  std::uint64_t state_;
};

/// Movements to be asked for at once, and how long to leave the avatar alone after that.
struct Outing {
  std::vector<Movement> movements;  ///< The first one moves: a step or a jump, never a stand.
  double period_s = 0.0;            ///< Until the next outing, ample for these movements.
};

/// Where an avatar wanders: walks of 6 to 16 steps with turns and now and then a pause, or a jump.
///
/// The plan does not depend on what the server does (an open loop): a server that falls behind is
/// asked for as much as one that does not, and its delays are measured, not waited for. The period
/// leaves every avatar time to come to a stand, so each outing starts from one.
class Wanderer {
 public:
  Wanderer(std::uint64_t seed, std::uint32_t avatar);

  /// The next outing; without jumps when the world's library has none.
  [[nodiscard]] Outing Next(bool may_jump);

  /// When the first one begins, so that not all avatars start at the same moment.
  [[nodiscard]] double FirstStart(double within_s) { return random_.Uniform(0.0, within_s); }

 private:
  SmallRandom random_;
};

}  // namespace stridewire::load
