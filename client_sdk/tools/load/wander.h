#pragma once

#include <cstdint>
#include <vector>

#include "stridewire/protocol/messages.h"

namespace stridewire::load {

using Movement = decltype(protocol::RequestItem::movement);

/// Random numbers with a state of eight bytes, so that each of many avatars can have its own
/// (SplitMix64: Steele, Lea, Flood 2014).
class SmallRandom {
 public:
  explicit SmallRandom(std::uint64_t seed) : state_(seed) {}
  [[nodiscard]] std::uint64_t Next();
  /// Returns a number with uniform distribution in [min, max).
  [[nodiscard]] double Uniform(double min, double max);
  /// Returns an integer with uniform distribution in [min, max].
  [[nodiscard]] int Integer(int min, int max);

 private:
  std::uint64_t state_;
};

/// Movements to request at once, and the time until the next plan.
struct WanderPlan {
  /// Movements to request. The first one is a step or jump, never a stand.
  std::vector<Movement> movements;
  /// Time until the next plan, in seconds. It is longer than the duration of the movements.
  double period_s = 0.0;
};

/// Plans random movements of an avatar: 6 to 16 steps with turns and sometimes a pause, or a jump.
///
/// The plan does not depend on the server (open loop). A slow server therefore receives as many
/// requests as a fast one, and its delays become visible. The period is long enough for every
/// avatar to come to a stand, so that each plan starts from a stand.
class Wanderer {
 public:
  Wanderer(std::uint64_t seed, std::uint32_t avatar);

  /// Returns the next plan. It contains jumps only if `can_jump`.
  [[nodiscard]] WanderPlan Next(bool can_jump);

  /// Returns a random start time of the first plan, so that avatars do not start simultaneously.
  [[nodiscard]] double FirstStart(double within_s) { return random_.Uniform(0.0, within_s); }

 private:
  SmallRandom random_;
};

}  // namespace stridewire::load
