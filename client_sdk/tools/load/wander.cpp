#include "wander.h"

namespace stridewire::load {
namespace {

// Approximate maximum durations of movements in the known libraries.
constexpr double kStepS = 0.75;
constexpr double kJumpS = 2.5;
constexpr double kClosingStepS = 1.5;

}  // namespace

std::uint64_t SmallRandom::Next() {
  std::uint64_t z = (state_ += 0x9e3779b97f4a7c15U);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31);
}

double SmallRandom::Uniform(double min, double max) {
  constexpr double kUnit = 1.0 / static_cast<double>(std::uint64_t{1} << 53);
  return min + (max - min) * static_cast<double>(Next() >> 11) * kUnit;
}

int SmallRandom::Integer(int min, int max) {
  return min + static_cast<int>(Next() % static_cast<std::uint64_t>(max - min + 1));
}

Wanderer::Wanderer(std::uint64_t seed, std::uint32_t avatar) : random_(seed) {
  // Mixes seed and avatar, so that neighbouring values do not yield shifted copies of one sequence.
  random_ = SmallRandom(random_.Next() ^ (std::uint64_t{avatar} * 0xd1342543de82ef95U));
}

WanderPlan Wanderer::Next(bool can_jump) {
  WanderPlan plan;
  plan.period_s = kClosingStepS + random_.Uniform(0.0, 1.0);
  if (can_jump && random_.Uniform(0.0, 1.0) < 0.1) {
    plan.movements.emplace_back(
        protocol::JumpMovement{.length_m = random_.Uniform(0.4, 1.2), .allow_nearest = true});
    plan.period_s += kJumpS;
    return plan;
  }
  const int steps = random_.Integer(6, 16);
  const int pause_after = random_.Uniform(0.0, 1.0) < 0.2 ? random_.Integer(2, steps - 1) : -1;
  for (int step = 0; step < steps; ++step) {
    const bool turns = random_.Uniform(0.0, 1.0) < 0.25;
    plan.movements.emplace_back(
        protocol::StepMovement{.length_m = random_.Uniform(0.4, 0.7),
                               .side_m = {},
                               .turn_rad = turns ? random_.Uniform(-0.3, 0.3) : 0.0,
                               .allow_nearest = true});
    plan.period_s += kStepS;
    if (step + 1 == pause_after) {
      const double seconds = random_.Uniform(0.3, 1.5);
      plan.movements.emplace_back(protocol::StandMovement{.seconds = seconds});
      plan.period_s += seconds + kClosingStepS;
    }
  }
  return plan;
}

}  // namespace stridewire::load
