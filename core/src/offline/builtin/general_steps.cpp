#include "offline/builtin/general_steps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "offline/builtin/mirror.h"
#include "offline/builtin/step.h"

namespace stridewire::builtin {
namespace {

using Names = std::vector<ParameterName>;

// Formats a length below 1 m in metres with two decimals.
std::string MetresText(double length_m) {
  const int centimetres = static_cast<int>(std::floor(std::fabs(length_m) * 100.0 + 0.5));
  const std::string digits = std::to_string(centimetres);
  return std::string(length_m < 0.0 ? "-0." : "0.") + (centimetres < 10 ? "0" : "") + digits;
}

std::string DegreesText(double angle_rad) {
  return std::to_string(static_cast<int>(std::floor(angle_rad / kDegree + 0.5)));
}

// Describes a step, for example "generated step 0.35 to 0.55 m". If it is not straight, the text
// also contains its other parameters.
std::string Describe(const StepShape& shape) {
  std::string text = "generated step " + MetresText(std::fabs(shape.start_m.z)) + " to " +
                     MetresText(shape.end_m.z) + " m";
  if (shape.start_m.x != StandWidthM() || shape.end_m.x != StandWidthM()) {
    text += ", side " + MetresText(shape.start_m.x) + " to " + MetresText(shape.end_m.x) + " m";
  }
  if (shape.start_m.y != 0.0 || shape.end_m.y != 0.0) {
    text += ", height " + MetresText(shape.start_m.y) + " to " + MetresText(shape.end_m.y) + " m";
  }
  if (shape.turn_rad != 0.0) text += ", turn " + DegreesText(shape.turn_rad) + " degrees";
  return text;
}

constexpr double kWalkTurnRad = 40.0 * kDegree;
constexpr double kSpotTurnRad = 60.0 * kDegree;

// Returns the sideways distance between the feet after one of them has turned outward on the spot.
double WidthAfterTurnM(double turn_rad) {
  return StandWidthM() + (0.26 - StandWidthM()) * std::min(1.0, turn_rad / kSpotTurnRad + 0.2);
}

// A group of left steps and the group of their mirror images.
class MirroredGroups {
 public:
  explicit MirroredGroups(Names names)
      : left_{MovementKind::kStepLeft, names, {}}, right_{MovementKind::kStepRight, names, {}} {}

  void Add(const Skeleton& figure, const StepShape& shape) {
    Add(MakeStep(figure, Foot::kLeft, shape, left_.parameters, Describe(shape)));
  }

  void Add(RawExample example) {
    right_.examples.push_back(Mirrored(example, left_.parameters));
    left_.examples.push_back(std::move(example));
  }

  void MoveTo(RawLibrary& library) {
    library.groups.push_back(std::move(left_));
    library.groups.push_back(std::move(right_));
  }

 private:
  RawGroup left_, right_;
};

// Adds steps upwards (`direction` 1) or downwards (-1). They form separate groups, because knees
// bend least in level steps and more in steps up or down. The linear part of one interpolation
// cannot represent this minimum.
void AddClimbingSteps(double direction, RawLibrary& library) {
  constexpr double kRiseM = 0.25;
  constexpr double kTurnRad = 35.0 * kDegree;
  // Heights of the moving foot above the fixed foot at both ends, in units of kRiseM.
  struct Climb {
    double start, end;
  };
  constexpr std::array kClimbs = {Climb{0.0, 0.0}, Climb{0.0, 1.0}, Climb{-1.0, 1.0},
                                  Climb{-1.0, 0.0}};
  MirroredGroups groups({ParameterName::kStartY, ParameterName::kStartZ, ParameterName::kEndY,
                         ParameterName::kEndZ, ParameterName::kTurn});
  const auto add = [&](const Climb& climb, double start_z, double end_z, double turn_rad) {
    StepShape shape = StraightShape(Foot::kLeft, start_z, end_z);
    shape.start_m.y = direction * climb.start * kRiseM;
    shape.end_m.y = direction * climb.end * kRiseM;
    shape.turn_rad = turn_rad;
    shape.style = StepStyle::kStairs;
    groups.Add(library.skeleton, shape);
  };
  // On stairs, the other foot is one tread away. On level ground, the length varies more.
  const auto lengths = [](double height) {
    return height == 0.0 ? std::array{0.0, 0.5} : std::array{0.28, 0.42};
  };
  for (const Climb& climb : kClimbs) {
    for (const double start_z : lengths(climb.start)) {
      for (const double end_z : lengths(climb.end)) add(climb, start_z, end_z, 0.0);
    }
    for (const double turn_rad : {kTurnRad, -kTurnRad}) add(climb, 0.3, 0.3, turn_rad);
    // The bend of the knees is proportional to the square root of the height, so the blend needs an
    // example halfway between level and high.
    const Climb half{0.5 * climb.start, 0.5 * climb.end};
    if ((climb.start == 0.0) == (climb.end == 0.0)) {
      add(half, 0.3, 0.3, 0.0);
    } else {
      for (const double level_m : lengths(0.0)) {
        add(half, climb.start == 0.0 ? level_m : 0.34, climb.end == 0.0 ? level_m : 0.34, 0.0);
      }
    }
  }
  groups.MoveTo(library);
}

}  // namespace

void AddStraightSteps(RawLibrary& library) {
  constexpr std::array kLengthsM = {0.0, 0.35, 0.55, 0.75};
  MirroredGroups groups({ParameterName::kStartZ, ParameterName::kEndZ});
  for (const double start_m : kLengthsM) {
    for (const double end_m : kLengthsM) {
      if (start_m == 0.0 && end_m == 0.0) continue;
      groups.Add(library.skeleton, StraightShape(Foot::kLeft, start_m, end_m));
    }
  }
  groups.MoveTo(library);
}

void AddBackwardSteps(RawLibrary& library) {
  constexpr std::array kLengthsM = {0.0, 0.2, 0.4};
  const Names names = {ParameterName::kStartZ, ParameterName::kEndZ};
  MirroredGroups groups(names);
  for (const double start_m : kLengthsM) {
    for (const double end_m : kLengthsM) {
      if (start_m == 0.0 && end_m == 0.0) continue;
      RawExample example = Reversed(MakeStep(
          library.skeleton, Foot::kLeft, StraightShape(Foot::kLeft, end_m, start_m), names, {}));
      example.source =
          "generated step backward " + MetresText(start_m) + " to " + MetresText(end_m) + " m";
      groups.Add(std::move(example));
    }
  }
  groups.MoveTo(library);
}

void AddTurningSteps(RawLibrary& library) {
  constexpr std::array kLengthsM = {0.0, 0.4, 0.75};
  MirroredGroups groups(
      {ParameterName::kStartX, ParameterName::kStartZ, ParameterName::kEndZ, ParameterName::kTurn});
  const auto add = [&](double start_x, double start_z, double end_z, double turn_rad) {
    StepShape shape = StraightShape(Foot::kLeft, start_z, end_z);
    shape.start_m.x = start_x;
    shape.turn_rad = turn_rad;
    shape.style = StepStyle::kGeneral;
    // If the foot turns outwards and lands beside the other foot, it needs room for that foot's
    // heel.
    if (end_z == 0.0 && turn_rad > 0.0) shape.end_m.x = WidthAfterTurnM(turn_rad);
    groups.Add(library.skeleton, shape);
  };
  for (const double start_m : kLengthsM) {
    for (const double end_m : kLengthsM) {
      const bool on_the_spot = start_m == 0.0 && end_m == 0.0;
      for (const double side : {0.0, 1.0, -1.0}) {
        add(StandWidthM(), start_m, end_m, side * (on_the_spot ? kSpotTurnRad : kWalkTurnRad));
      }
    }
  }
  // Steps that follow an outward turn.
  const double wide_m = WidthAfterTurnM(kSpotTurnRad);
  add(wide_m, 0.0, 0.0, 0.0);
  add(wide_m, 0.0, 0.0, kSpotTurnRad);
  add(wide_m, 0.0, 0.0, -kSpotTurnRad);
  add(wide_m, 0.0, 0.4, 0.0);
  groups.MoveTo(library);
}

void AddSideSteps(RawLibrary& library) {
  const double near_m = StandWidthM();
  const std::array kSidesM = {near_m, near_m + 0.3};
  constexpr std::array kLengthsM = {0.0, 0.4};
  MirroredGroups groups(
      {ParameterName::kStartX, ParameterName::kStartZ, ParameterName::kEndX, ParameterName::kEndZ});
  for (const double start_x : kSidesM) {
    for (const double end_x : kSidesM) {
      for (const double start_z : kLengthsM) {
        for (const double end_z : kLengthsM) {
          StepShape shape;
          shape.start_m = DVec3(start_x, 0.0, -start_z);
          shape.end_m = DVec3(end_x, 0.0, end_z);
          shape.style = StepStyle::kGeneral;
          groups.Add(library.skeleton, shape);
        }
      }
    }
  }
  groups.MoveTo(library);
}

void AddClimbingSteps(RawLibrary& library) {
  AddClimbingSteps(1.0, library);
  AddClimbingSteps(-1.0, library);
}

}  // namespace stridewire::builtin
