#pragma once

#include <array>
#include <string>
#include <vector>

#include "offline/complete/step_maker.h"

namespace stridewire::complete {

/// A step that every library should have.
struct BasicStep {
  /// Name of the movement in messages to users, for example "stops". Empty: messages do not mention
  /// the step, which only improves the blends of the other steps of its group.
  std::string name;
  /// The movement is named after its direction, as in "side steps to the left". Otherwise it is
  /// named after the moving foot, as in "stops with the left foot".
  bool has_direction = false;
  bool is_to_the_left = false;  ///< The direction, if `has_direction`.
  StepFeet feet;
  bool is_backward = false;
};

/// Basic steps whose parameters are the same.
struct BasicStepGroup {
  std::vector<ParameterName> parameters;
  std::array<std::vector<BasicStep>, 2> steps;  ///< [Foot]: steps of the moving foot.
};

/// Lists the basic steps in the proportions of a person: straight steps, steps backward, turns and
/// side steps.
[[nodiscard]] std::vector<BasicStepGroup> BasicSteps(const Person& person);

}  // namespace stridewire::complete
