#include "offline/complete/basic_steps.h"

#include <algorithm>
#include <utility>

#include "offline/builtin/figure.h"

namespace stridewire::complete {
namespace {

using builtin::kDegree;

constexpr double kWalkTurnRad = 40.0 * kDegree;
constexpr double kSpotTurnRad = 60.0 * kDegree;

// The following lengths are for a person whose legs have the length kReferenceLegM. They are scaled
// with the length of the legs.
constexpr double kReferenceLegM = 0.86;
constexpr double kSideStepM = 0.3;        // Additional width of a side step.
constexpr double kDiagonalLengthM = 0.4;  // Forward distance between the feet in diagonal steps.
// Sideways distance between the feet after a turn to the side of the moving foot.
constexpr double kWidthAfterTurnM = 0.26;
constexpr std::array kBackwardLengthsM = {0.0, 0.2, 0.4};

// Minimum sideways distances of the feet. They apply even if captured distances are smaller.
constexpr double kMinStrideWidthM = 0.06;
constexpr double kMinSideStepWidthM = 0.1;

class BasicStepList {
 public:
  explicit BasicStepList(const Person& person) : person_(person) {
    const LegRig::Side& side = person.rig.side(Foot::kLeft);
    scale_ = (side.thigh_m + side.shank_m) / kReferenceLegM;
  }

  [[nodiscard]] std::vector<BasicStepGroup> Groups() {
    std::vector<BasicStepGroup> groups;
    for (const auto add : {&BasicStepList::AddStraight, &BasicStepList::AddBackward,
                           &BasicStepList::AddTurning, &BasicStepList::AddSideways}) {
      BasicStepGroup& group = groups.emplace_back();
      for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
        foot_ = foot;
        steps_ = &group.steps[static_cast<std::size_t>(foot)];
        (this->*add)(group.parameters);
      }
    }
    return groups;
  }

 private:
  [[nodiscard]] const StrideModel& stride() const {
    return person_.strides[static_cast<std::size_t>(foot_)];
  }
  [[nodiscard]] double stand_width() const {
    return SideSign(foot_) * person_.StandVector(foot_).x;
  }
  // Forward distance between the feet in the middle of double support, as in the captured strides.
  [[nodiscard]] double full() const {
    return 0.5 * (stride().start_length_m + stride().end_length_m);
  }
  // Returns the sideways distance between the feet if one is `length_m` ahead of the other. For
  // length 0 it is the distance in the stand pose. It approaches the distance in the captured
  // strides as the length increases.
  [[nodiscard]] double Width(double length_m) const {
    const double share = std::min(1.0, length_m / full());
    return stand_width() + share * (std::max(stride().width_m, kMinStrideWidthM) - stand_width());
  }
  // Returns the forward distance between the feet of the stand pose, reduced in proportion to the
  // length of the step. It is 0 in full strides.
  [[nodiscard]] double StandOffset(double length_m) const {
    return person_.StandVector(foot_).z * (1.0 - std::min(1.0, length_m / full()));
  }
  // Start and End return the vector from the fixed to the moving foot. The moving foot is
  // `length_m` behind the fixed foot at the start of a step, and `length_m` ahead of it at the end.
  // In short steps, both positions are shifted forward by StandOffset.
  [[nodiscard]] DVec3 Start(double length_m, double width_m) const {
    return {SideSign(foot_) * width_m, 0.0, StandOffset(length_m) - length_m};
  }
  [[nodiscard]] DVec3 End(double length_m, double width_m) const {
    return {SideSign(foot_) * width_m, 0.0, StandOffset(length_m) + length_m};
  }
  StepFeet Feet(double start_m, double end_m, double turn_rad = 0.0) const {
    return {Start(start_m, Width(start_m)), End(end_m, Width(end_m)), SideSign(foot_) * turn_rad};
  }
  void Add(std::string name, const StepFeet& feet) {
    steps_->push_back({.name = std::move(name), .feet = feet});
  }
  void AddWithDirection(const char* name, bool is_outward, const StepFeet& feet) {
    steps_->push_back({.name = name,
                       .has_direction = true,
                       .is_to_the_left = is_outward == (foot_ == Foot::kLeft),
                       .feet = feet});
  }

  void AddStraight(std::vector<ParameterName>& parameters) {
    parameters = {ParameterName::kStartZ, ParameterName::kEndZ};
    const double half = 0.5 * full();
    Add("starts", Feet(0.0, full()));
    Add("stops", Feet(full(), 0.0));
    Add("small steps", Feet(0.0, half));
    Add("small steps", Feet(half, half));
    Add("small steps", Feet(half, 0.0));
    Add("steps forward", Feet(full(), full()));
    Add("", Feet(half, full()));
    Add("", Feet(full(), half));
  }

  void AddBackward(std::vector<ParameterName>& parameters) {
    parameters = {ParameterName::kStartZ, ParameterName::kEndZ};
    for (const double start_m : kBackwardLengthsM) {
      for (const double end_m : kBackwardLengthsM) {
        if (start_m == 0.0 && end_m == 0.0) continue;
        // In steps backward, the moving foot is in front at the start and behind at the end.
        StepFeet feet;
        feet.start_m = End(scale_ * start_m, Width(scale_ * start_m));
        feet.end_m = Start(scale_ * end_m, Width(scale_ * end_m));
        const bool touches_stand = start_m == 0.0 || end_m == 0.0;
        steps_->push_back(
            {.name = touches_stand ? "steps backward" : "", .feet = feet, .is_backward = true});
      }
    }
  }

  void AddTurning(std::vector<ParameterName>& parameters) {
    parameters = {ParameterName::kStartX, ParameterName::kStartZ, ParameterName::kEndZ,
                  ParameterName::kTurn};
    const double wide_m = std::max(scale_ * kWidthAfterTurnM, stand_width());
    for (const double start_m : {0.0, full()}) {
      for (const double end_m : {0.0, full()}) {
        const bool on_the_spot = start_m == 0.0 && end_m == 0.0;
        const double turn_rad = on_the_spot ? kSpotTurnRad : kWalkTurnRad;
        Add("", Feet(start_m, end_m));
        for (const double side : {1.0, -1.0}) {
          StepFeet feet = Feet(start_m, end_m, side * turn_rad);
          // If the foot turns outward and lands beside the other foot, it needs room for that
          // foot's heel.
          if (end_m == 0.0 && side > 0.0) feet.end_m.x = SideSign(foot_) * wide_m;
          AddWithDirection(on_the_spot ? "turns on the spot" : "turns while walking", side > 0.0,
                           feet);
        }
      }
    }
    for (const double side : {0.0, 1.0, -1.0}) {
      Add("", Feet(0.5 * full(), 0.5 * full(), side * kWalkTurnRad));
    }
    // After an outward turn, the feet are wider apart than in a walk. The following steps start at
    // this distance.
    for (const double turn_rad : {0.0, kSpotTurnRad, -kSpotTurnRad}) {
      StepFeet feet = Feet(0.0, 0.0, turn_rad);
      feet.start_m.x = SideSign(foot_) * wide_m;
      if (turn_rad > 0.0) feet.end_m.x = SideSign(foot_) * wide_m;
      Add("", feet);
    }
    for (const double start_m : {0.0, full()}) {
      StepFeet feet = Feet(start_m, 0.6 * full());
      feet.start_m.x = SideSign(foot_) * wide_m;
      Add("", feet);
    }
  }

  void AddSideways(std::vector<ParameterName>& parameters) {
    parameters = {ParameterName::kStartX, ParameterName::kStartZ, ParameterName::kEndX,
                  ParameterName::kEndZ};
    const double near_m = std::min(std::max(stride().width_m, kMinSideStepWidthM), stand_width());
    const double far_m = stand_width() + scale_ * kSideStepM;
    for (const double start_x : {near_m, far_m}) {
      for (const double end_x : {near_m, far_m}) {
        for (const double start_z : {0.0, scale_ * kDiagonalLengthM}) {
          for (const double end_z : {0.0, scale_ * kDiagonalLengthM}) {
            const StepFeet feet{Start(start_z, start_x), End(end_z, end_x), 0.0};
            const bool is_plain = start_z == 0.0 && end_z == 0.0 && start_x != end_x;
            if (is_plain) {
              AddWithDirection("side steps", end_x > start_x, feet);
            } else {
              Add("", feet);
            }
          }
        }
      }
    }
  }

  const Person& person_;
  double scale_ = 1.0;
  Foot foot_ = Foot::kLeft;
  std::vector<BasicStep>* steps_ = nullptr;
};

}  // namespace

std::vector<BasicStepGroup> BasicSteps(const Person& person) {
  return BasicStepList(person).Groups();
}

}  // namespace stridewire::complete
