#pragma once

#include <array>
#include <string>
#include <vector>

#include "offline/complete/step_maker.h"

namespace stridewire::complete {

/// A step that every library should have.
struct BasicStep {
  /// Name of the movement in messages to users, for example "stops". If it is empty, messages do
  /// not mention the step, whose only purpose is to improve blends of other steps in its group.
  std::string name;
  /// True if messages name the movement after its direction ("side steps to the left"), false if
  /// they name it after the moving foot ("stops with the left foot").
  bool has_direction = false;
  bool is_to_the_left = false;  ///< The direction, if `has_direction`.
  StepFeet feet;
  bool is_backward = false;
};

/// Basic steps with the same set of parameters.
struct BasicStepGroup {
  std::vector<ParameterName> parameters;
  std::array<std::vector<BasicStep>, 2> steps;  ///< [Foot]: steps in which this foot moves.
};

/// Returns the basic steps in the proportions of a person: straight steps, steps backward, turns
/// and side steps.
[[nodiscard]] std::vector<BasicStepGroup> BasicSteps(const Person& person);

}  // namespace stridewire::complete
