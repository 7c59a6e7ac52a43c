#include "offline/complete/complete_library.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "offline/base/parallel.h"
#include "offline/base/text.h"
#include "offline/build/bend_toes.h"
#include "offline/build/grid_cells.h"
#include "offline/builtin/figure.h"
#include "offline/complete/basic_steps.h"
#include "offline/complete/compose_stand.h"
#include "offline/complete/coverage.h"
#include "offline/complete/generic_stride.h"
#include "offline/complete/step_maker.h"
#include "offline/complete/stride_model.h"
#include "runtime/library/knee_hinges.h"

namespace stridewire {
namespace {

using complete::BasicStep;
using complete::BasicStepGroup;
using complete::Person;
using complete::StepSpec;
using complete::StrideModel;

// If RawLibrary::stand_tilt_m is larger, the figure is on its heels or toes, and the stand pose is
// composed instead.
constexpr double kMaxTiltM = 0.02;

// Collects the names of steps that the captures lack, on one side or on both.
class LackingList {
 public:
  void Add(const BasicStep& step, Foot foot) {
    const bool is_left = step.has_direction ? step.is_to_the_left : foot == Foot::kLeft;
    for (Entry& entry : entries_) {
      if (entry.name != step.name) continue;
      entry.sides[is_left ? 0 : 1] = true;
      return;
    }
    entries_.push_back({step.name, step.has_direction, {is_left, !is_left}});
  }

  [[nodiscard]] std::vector<std::string> Texts() const {
    std::vector<std::string> texts;
    for (const Entry& entry : entries_) {
      std::string text = entry.name;
      if (!entry.sides[0] || !entry.sides[1]) {
        const char* const side = entry.sides[0] ? "left" : "right";
        text += entry.has_direction ? Text(" to the %s", side) : Text(" with the %s foot", side);
      }
      texts.push_back(std::move(text));
    }
    return texts;
  }

 private:
  struct Entry {
    std::string name;
    bool has_direction = false;
    std::array<bool, 2> sides{};  // {left, right}: true if the step on this side is missing.
  };
  std::vector<Entry> entries_;
};

// Returns the foot that moves in all steps of a library. Returns nullopt if both feet move in
// steps, or none does.
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

// Returns the library with toes bent as by LibraryBuilder, so that generated steps resemble the
// captured steps in the built library.
RawLibrary WithBentToes(RawLibrary library) {
  const ToeBender toes(library);
  for (RawGroup& group : library.groups) {
    for (RawExample& example : group.examples) toes.Bend(group.kind, example);
  }
  return library;
}

// Describes a generated step, as the source of its example.
std::string SourceOf(const BasicStep& step) {
  std::string text =
      std::string(kCompletedSource) +
      Text(" step %.2f to %.2f m", std::fabs(step.feet.start_m.z), std::fabs(step.feet.end_m.z));
  if (step.is_backward) text += ", backward";
  const double from = std::fabs(step.feet.start_m.x);
  const double to = std::fabs(step.feet.end_m.x);
  text += Text(", side %.2f to %.2f m", from, to);
  if (step.feet.turn_rad != 0.0)
    text += Text(", turn %.0f degrees", step.feet.turn_rad / builtin::kDegree);
  return text;
}

// Measures the person in the captures. If they contain no stand, also composes the stand pose of
// the library. Returns nullopt and sets `completion.failure` if no steps can be generated.
std::optional<Person> MeasurePerson(RawLibrary& library, Completion& completion) {
  const RawLibrary bent = WithBentToes(library);
  std::optional<StrideModel> left = complete::MeasureStride(bent, Foot::kLeft);
  std::optional<StrideModel> right = complete::MeasureStride(bent, Foot::kRight);
  const bool has_strides = left && right;
  Person person{.skeleton = library.skeleton, .rig = RigOf(library), .stand = {}, .strides = {}};
  if (has_strides) person.strides = {*std::move(left), *std::move(right)};
  if (!person.rig.is_usable) {
    completion.failure = "the legs of this skeleton do not support inverse kinematics";
    return std::nullopt;
  }
  auto reason = complete::WhyNoStand(library.skeleton, person.rig, library.stand_pose);
  if (!reason && library.stand_tilt_m > kMaxTiltM) reason = "the feet are on their heels or toes";
  if (reason) {
    const auto parts = has_strides ? complete::MeasureStandParts(person.strides)
                                   : complete::MeasureStandParts(bent);
    if (!parts) {
      completion.failure =
          "the captures contain neither a stand nor a step: in the stillest pose " + *reason;
      return std::nullopt;
    }
    completion.stand_reason = *std::move(reason);
    completion.has_composed_stand = true;
    library.stand_pose = complete::ComposeStand(library.skeleton, person.rig, *parts);
    library.stand_tilt_m = 0.0;
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
  complete::MeasureLegs(library.skeleton, person.rig, person.strides);
  return person;
}

// Generates the steps of several groups, as new groups of the library.
void AddGroups(std::span<const BasicStepGroup> groups, const Person& person, double grid_fps,
               RawLibrary& library, Completion& completion) {
  struct Task {
    const BasicStep* step = nullptr;
    StepSpec spec;
    std::size_t group = 0;
    std::size_t example = 0;
  };
  std::vector<Task> tasks;
  std::vector<std::vector<int>> cells(library.groups.size());
  for (const BasicStepGroup& basic : groups) {
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const std::vector<BasicStep>& steps = basic.steps[static_cast<std::size_t>(foot)];
      std::vector<std::vector<double>> keytimes_s;
      for (const BasicStep& step : steps) {
        const StepSpec spec = {foot, step.feet, step.is_backward};
        tasks.push_back({&step, spec, library.groups.size(), keytimes_s.size()});
        keytimes_s.push_back(complete::StepKeytimes(person, spec));
      }
      cells.push_back(CellsAtRate(keytimes_s, grid_fps));
      RawGroup& group = library.groups.emplace_back();
      group.kind = StepKind(foot);
      group.parameters = basic.parameters;
      group.is_completed = true;
      group.examples.resize(steps.size());
    }
  }
  ParallelFor(static_cast<int>(tasks.size()), 1, ThreadCount(0), [&](int i, int) {
    const Task& task = tasks[static_cast<std::size_t>(i)];
    RawGroup& group = library.groups[task.group];
    group.examples[task.example] = complete::MakeStep(person, task.spec, cells[task.group],
                                                      group.parameters, SourceOf(*task.step));
  });
  completion.example_count = static_cast<int>(tasks.size());
}

std::string Joined(const std::vector<std::string>& parts) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == parts.size() ? " and " : ", ") + parts[i];
  }
  return text;
}

}  // namespace

Completion CompleteLibrary(RawLibrary& library, double grid_fps) {
  Completion completion;
  if (library.groups.empty()) return completion;
  completion.only_foot = OnlyFootOf(library);
  const std::optional<Person> person = MeasurePerson(library, completion);
  if (!person) return completion;
  LackingList lacking;
  std::vector<BasicStepGroup> needed;
  for (BasicStepGroup& group : complete::BasicSteps(*person)) {
    bool is_needed = false;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const double stand_side_m = person->StandVector(foot).x;
      for (const BasicStep& step : group.steps[static_cast<std::size_t>(foot)]) {
        if (step.name.empty()) continue;
        if (complete::IsCaptured(library, foot, step.feet, stand_side_m)) continue;
        lacking.Add(step, foot);
        is_needed = true;
      }
    }
    if (is_needed) needed.push_back(std::move(group));
  }
  AddGroups(needed, *person, grid_fps, library, completion);
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
        Text("The captures contain steps of the %s foot only: add the option --mirror to the build "
             "to use their mirror images for the other foot.",
             *completion.only_foot == Foot::kLeft ? "left" : "right"));
  }
  if (completion.has_generic_strides) {
    sentences.emplace_back(
        "The captures contain no level steps straight ahead, so the generated steps follow those "
        "of the library builtin.");
  }
  if (completion.example_count > 0) {
    sentences.push_back(Text(
        "The builder added %d generated steps in the posture and cadence of the captures. They "
        "are used only where no captured step fits. --no-complete omits them.",
        completion.example_count));
  }
  return sentences;
}

}  // namespace stridewire
