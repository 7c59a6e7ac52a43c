#include "offline/complete/complete_library.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "offline/base/parallel.h"
#include "offline/base/text.h"
#include "offline/complete/compose_stand.h"
#include "offline/complete/coverage.h"
#include "offline/complete/generic_stride.h"
#include "offline/complete/step_maker.h"
#include "offline/complete/stride_model.h"
#include "runtime/library/knee_hinges.h"

namespace stridewire {
namespace {

using complete::Outward;
using complete::Person;
using complete::StepFeet;
using complete::StrideModel;
using Names = std::vector<ParameterName>;

constexpr double kDegree = 0.017453292519943295;
constexpr double kWalkTurnRad = 40.0 * kDegree;
constexpr double kSpotTurnRad = 60.0 * kDegree;
constexpr double kUsualLegM =
    0.86;  // Length of the legs for which the following lengths are meant.
constexpr double kSideM = 0.3;
constexpr double kOpenM = 0.26;  // Sideways distance of feet that have turned outwards on the spot.
constexpr double kSideLengthM = 0.4;
constexpr std::array kBackM = {0.0, 0.2, 0.4};
constexpr double kLeastWidthM = 0.1;

// A step to generate, and the sort of movement to which it belongs. Lengths and sides are those of
// a left step; a right step is its mirror image.
struct WantedStep {
  std::string what;          // For example "stops". Empty: the step only supports the blends.
  bool is_directed = false;  // `what` depends on the direction, not on the moving foot.
  bool is_left = false;      // Direction of a left step.
  StepFeet feet;
  bool is_backward = false;
};

struct WantedGroup {
  Names names;
  std::array<std::vector<WantedStep>, 2> steps;  // [Foot]
};

// Lists the steps that every library should have, in the proportions of a person.
class Catalogue {
 public:
  explicit Catalogue(const Person& person) : person_(person) {
    const LegRig::Side& side = person.rig.side(Foot::kLeft);
    scale_ = (side.thigh_m + side.shank_m) / kUsualLegM;
  }

  [[nodiscard]] std::vector<WantedGroup> Groups() {
    std::vector<WantedGroup> groups;
    for (const auto add : {&Catalogue::AddStraight, &Catalogue::AddBackward, &Catalogue::AddTurning,
                           &Catalogue::AddSideways}) {
      WantedGroup& group = groups.emplace_back();
      for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
        foot_ = foot;
        steps_ = &group.steps[static_cast<std::size_t>(foot)];
        (this->*add)(group.names);
      }
    }
    return groups;
  }

 private:
  [[nodiscard]] const StrideModel& stride() const {
    return person_.strides[static_cast<std::size_t>(foot_)];
  }
  [[nodiscard]] double stand_width() const { return Outward(foot_) * person_.StandVector(foot_).x; }
  // The length of full strides, forward.
  [[nodiscard]] double full() const {
    return 0.5 * (stride().start_length_m + stride().end_length_m);
  }
  // Returns the sideways distance of feet that are `length_m` apart along the way.
  [[nodiscard]] double Width(double length_m) const {
    const double share = std::min(1.0, length_m / full());
    return stand_width() + share * (std::max(stride().width_m, 0.06) - stand_width());
  }
  [[nodiscard]] double Ahead(double length_m) const {
    return person_.StandVector(foot_).z * (1.0 - std::min(1.0, length_m / full()));
  }
  // Returns the vector to the moving foot at the start: behind the fixed foot by `length_m`.
  [[nodiscard]] DVec3 Start(double length_m, double width_m) const {
    return {Outward(foot_) * width_m, 0.0, Ahead(length_m) - length_m};
  }
  [[nodiscard]] DVec3 End(double length_m, double width_m) const {
    return {Outward(foot_) * width_m, 0.0, Ahead(length_m) + length_m};
  }
  StepFeet Feet(double start_m, double end_m, double turn_rad = 0.0) const {
    return {Start(start_m, Width(start_m)), End(end_m, Width(end_m)), Outward(foot_) * turn_rad};
  }
  void Add(std::string what, const StepFeet& feet) {
    steps_->push_back({.what = std::move(what), .feet = feet});
  }
  void AddDirected(const char* what, bool is_outward, const StepFeet& feet) {
    steps_->push_back({.what = what,
                       .is_directed = true,
                       .is_left = is_outward == (foot_ == Foot::kLeft),
                       .feet = feet});
  }

  void AddStraight(Names& names) {
    names = {ParameterName::kStartZ, ParameterName::kEndZ};
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

  void AddBackward(Names& names) {
    names = {ParameterName::kStartZ, ParameterName::kEndZ};
    for (const double start_m : kBackM) {
      for (const double end_m : kBackM) {
        if (start_m == 0.0 && end_m == 0.0) continue;
        // The moving foot is in front at the start and behind at the end.
        StepFeet feet;
        feet.start_m = End(scale_ * start_m, Width(scale_ * start_m));
        feet.end_m = Start(scale_ * end_m, Width(scale_ * end_m));
        const bool is_core = start_m == 0.0 || end_m == 0.0;
        steps_->push_back(
            {.what = is_core ? "steps backward" : "", .feet = feet, .is_backward = true});
      }
    }
  }

  void AddTurning(Names& names) {
    names = {ParameterName::kStartX, ParameterName::kStartZ, ParameterName::kEndZ,
             ParameterName::kTurn};
    const double open_m = std::max(scale_ * kOpenM, stand_width());
    for (const double start_m : {0.0, full()}) {
      for (const double end_m : {0.0, full()}) {
        const bool on_the_spot = start_m == 0.0 && end_m == 0.0;
        const double turn_rad = on_the_spot ? kSpotTurnRad : kWalkTurnRad;
        Add("", Feet(start_m, end_m));
        for (const double side : {1.0, -1.0}) {
          StepFeet feet = Feet(start_m, end_m, side * turn_rad);
          // A foot that turns outwards and lands beside the other one keeps clear of its heel.
          if (end_m == 0.0 && side > 0.0) feet.end_m.x = Outward(foot_) * open_m;
          AddDirected(on_the_spot ? "turns on the spot" : "turns while walking", side > 0.0, feet);
        }
      }
    }
    for (const double side : {0.0, 1.0, -1.0}) {
      Add("", Feet(0.5 * full(), 0.5 * full(), side * kWalkTurnRad));
    }
    // Steps that continue after an outward turn, or from feet wider apart than in a walk.
    for (const double turn_rad : {0.0, kSpotTurnRad, -kSpotTurnRad}) {
      StepFeet feet = Feet(0.0, 0.0, turn_rad);
      feet.start_m.x = Outward(foot_) * open_m;
      if (turn_rad > 0.0) feet.end_m.x = Outward(foot_) * open_m;
      Add("", feet);
    }
    for (const double start_m : {0.0, full()}) {
      StepFeet feet = Feet(start_m, 0.6 * full());
      feet.start_m.x = Outward(foot_) * open_m;
      Add("", feet);
    }
  }

  void AddSideways(Names& names) {
    names = {ParameterName::kStartX, ParameterName::kStartZ, ParameterName::kEndX,
             ParameterName::kEndZ};
    const double near_m = std::min(std::max(stride().width_m, kLeastWidthM), stand_width());
    const double far_m = stand_width() + scale_ * kSideM;
    for (const double start_x : {near_m, far_m}) {
      for (const double end_x : {near_m, far_m}) {
        for (const double start_z : {0.0, scale_ * kSideLengthM}) {
          for (const double end_z : {0.0, scale_ * kSideLengthM}) {
            const StepFeet feet{Start(start_z, start_x), End(end_z, end_x), 0.0};
            const bool is_pure = start_z == 0.0 && end_z == 0.0 && start_x != end_x;
            if (is_pure) {
              AddDirected("side steps", end_x > start_x, feet);
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
  std::vector<WantedStep>* steps_ = nullptr;
};

// Collects the sorts of movements that are lacking on one side or on both.
class LackingList {
 public:
  void Add(const WantedStep& step, Foot foot) {
    const bool is_left = step.is_directed ? step.is_left : foot == Foot::kLeft;
    for (Entry& entry : entries_) {
      if (entry.what != step.what) continue;
      entry.sides[is_left ? 0 : 1] = true;
      return;
    }
    entries_.push_back({step.what, step.is_directed, {is_left, !is_left}});
  }

  [[nodiscard]] std::vector<std::string> Texts() const {
    std::vector<std::string> texts;
    for (const Entry& entry : entries_) {
      std::string text = entry.what;
      if (!entry.sides[0] || !entry.sides[1]) {
        const char* const side = entry.sides[0] ? "left" : "right";
        text += entry.is_directed ? Text(" to the %s", side) : Text(" with the %s foot", side);
      }
      texts.push_back(std::move(text));
    }
    return texts;
  }

 private:
  struct Entry {
    std::string what;
    bool is_directed = false;
    std::array<bool, 2> sides{};
  };
  std::vector<Entry> entries_;
};

// Returns the foot that moves in all steps of a library, or nothing if both move or none does.
std::optional<Foot> OnlyFootOf(const RawLibrary& library) {
  std::array<bool, 2> moves{};
  for (const RawGroup& group : library.groups) {
    if (!IsStep(group.kind) || group.examples.empty()) continue;
    moves[static_cast<std::size_t>(MovingFoot(group.kind))] = true;
  }
  if (moves[0] == moves[1]) return std::nullopt;
  return moves[0] ? Foot::kLeft : Foot::kRight;
}

LegRig RigOf(const RawLibrary& library) {
  std::vector<const Clip*> clips;
  for (const RawGroup& group : library.groups) {
    for (const RawExample& example : group.examples) clips.push_back(&example.clip);
  }
  const auto hinges = LearnKneeHinges(library.skeleton, library.stand_pose, clips);
  return MakeLegRig(library.skeleton, library.stand_pose, hinges);
}

std::string SourceOf(const WantedStep& step) {
  std::string text =
      std::string(kCompletedSource) +
      Text(" step %.2f to %.2f m", std::fabs(step.feet.start_m.z), std::fabs(step.feet.end_m.z));
  if (step.is_backward) text += ", backward";
  const double from = std::fabs(step.feet.start_m.x);
  const double to = std::fabs(step.feet.end_m.x);
  text += Text(", side %.2f to %.2f m", from, to);
  if (step.feet.turn_rad != 0.0) text += Text(", turn %.0f degrees", step.feet.turn_rad / kDegree);
  return text;
}

void AddGroup(const WantedGroup& wanted, const Person& person, RawLibrary& library,
              Completion& completion) {
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const std::vector<WantedStep>& steps = wanted.steps[static_cast<std::size_t>(foot)];
    RawGroup group;
    group.kind = StepKind(foot);
    group.parameters = wanted.names;
    group.is_completed = true;
    group.examples.resize(steps.size());
    ParallelFor(static_cast<int>(steps.size()), 1, ThreadCount(0), [&](int i, int) {
      const WantedStep& step = steps[static_cast<std::size_t>(i)];
      const auto make = step.is_backward ? complete::MakeBackwardStep : complete::MakeStep;
      group.examples[static_cast<std::size_t>(i)] =
          make(person, foot, step.feet, wanted.names, SourceOf(step));
    });
    completion.example_count += static_cast<int>(group.examples.size());
    library.groups.push_back(std::move(group));
  }
}

std::string Joined(const std::vector<std::string>& parts) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == parts.size() ? " and " : ", ") + parts[i];
  }
  return text;
}

}  // namespace

Completion CompleteLibrary(RawLibrary& library) {
  Completion completion;
  if (library.groups.empty()) return completion;
  completion.only_foot = OnlyFootOf(library);
  std::optional<StrideModel> left = complete::MeasureStride(library, Foot::kLeft);
  std::optional<StrideModel> right = complete::MeasureStride(library, Foot::kRight);
  const bool has_strides = left && right;
  Person person{.skeleton = library.skeleton, .rig = RigOf(library), .stand = {}, .strides = {}};
  if (has_strides) person.strides = {*std::move(left), *std::move(right)};
  if (!person.rig.is_usable) {
    completion.failure = "the legs of this skeleton do not support inverse kinematics";
    return completion;
  }
  if (auto reason = complete::WhyNoStand(library.skeleton, person.rig, library.stand_pose)) {
    const auto parts = has_strides ? complete::PartsOf(person.strides) : complete::PartsOf(library);
    if (!parts) {
      completion.failure =
          "the captures contain neither a stand nor steps of both feet: in the "
          "stillest pose " +
          *reason;
      return completion;
    }
    completion.stand_reason = *std::move(reason);
    completion.has_composed_stand = true;
    library.stand_pose = complete::ComposeStand(library.skeleton, person.rig, *parts);
    person.rig = RigOf(library);
  }
  person.stand = complete::SampleOf(library.skeleton, library.stand_pose, 0.0);
  if (!has_strides) {
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      person.strides[static_cast<std::size_t>(foot)] =
          complete::GenericStride(library.skeleton, person.rig, person.stand, foot);
    }
    completion.has_generic_strides = true;
  }
  complete::JoinStrides(person.strides);

  LackingList lacking;
  for (const WantedGroup& group : Catalogue(person).Groups()) {
    bool is_needed = false;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const double stand_side_m = person.StandVector(foot).x;
      for (const WantedStep& step : group.steps[static_cast<std::size_t>(foot)]) {
        if (step.what.empty()) continue;
        if (complete::IsCaptured(library, foot, step.feet, stand_side_m)) continue;
        lacking.Add(step, foot);
        is_needed = true;
      }
    }
    if (is_needed) AddGroup(group, person, library, completion);
  }
  completion.lacking = lacking.Texts();
  if (completion.has_composed_stand) {
    completion.lacking.insert(completion.lacking.begin(), "a stand with the feet side by side");
  }
  return completion;
}

std::vector<std::string> DescribeCompletion(const Completion& completion) {
  std::vector<std::string> sentences;
  if (!completion.failure.empty()) {
    sentences.push_back("The library was not completed: " + completion.failure + ".");
    return sentences;
  }
  if (completion.lacking.empty()) {
    sentences.emplace_back("The captures contain all basic steps, so nothing was completed.");
    return sentences;
  }
  sentences.push_back("The captures lack " + Joined(completion.lacking) + ".");
  if (completion.has_composed_stand) {
    sentences.push_back(
        "The stand pose was composed from the mean posture of the steps, because in "
        "the stillest captured pose " +
        completion.stand_reason + ".");
  }
  if (completion.only_foot) {
    sentences.push_back(
        Text("They contain steps of the %s foot only: add the option --mirror to the build to use "
             "their mirror images for the other foot.",
             *completion.only_foot == Foot::kLeft ? "left" : "right"));
  }
  if (completion.has_generic_strides) {
    sentences.emplace_back(
        "They contain no level steps straight ahead, so the generated steps "
        "follow those of the generated figure.");
  }
  if (completion.example_count > 0) {
    sentences.push_back(
        Text("The builder completed them with %d generated steps in the posture and cadence of the "
             "captures, which are used only where no captured step fits. --no-complete omits them.",
             completion.example_count));
  }
  return sentences;
}

}  // namespace stridewire
