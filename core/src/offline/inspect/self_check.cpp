#include "offline/inspect/self_check.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/inspect/leg_survey.h"
#include "offline/inspect/library_summary.h"
#include "offline/inspect/refusals.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

constexpr double kFps = 30.0;
constexpr int kSteps = 3;
constexpr double kStandS = 0.5;
constexpr double kGoalM = 3.0;
// Limits of the checks.
constexpr double kMaxStopM = 0.03;
// Distance to the goal at the end of a walk. It is much smaller if the walk arrives (kArrivedM).
constexpr double kMaxGoalM = 0.05;
constexpr double kMaxKneeDeg = 60.0;
constexpr double kMaxSoleM = 0.01;

constexpr const char* kRecordStops =
    "Record walks that end in a stand with the feet side by side, for at least a second.";

class Checker {
 public:
  explicit Checker(const std::shared_ptr<const MotionLibrary>& library)
      : library_(library), summary_(Summarize(*library)) {
    steps_m_ = library->locomotion_profile().step_m;
  }

  SelfCheck Run() {
    PlaySteps();
    CheckThreeSteps();
    CheckStop();
    CheckWalk();
    CheckLegs();
    return std::move(result_);
  }

 private:
  CheckResult& Add(const char* name, const char* title, double bound, const char* unit) {
    result_.checks.push_back({.name = name, .title = title, .bound = bound, .unit = unit});
    return result_.checks.back();
  }

  static void CompareWithBound(CheckResult& check, double measured, std::string text) {
    check.measured = measured;
    check.verdict = measured <= check.bound ? CheckVerdict::kPassed : CheckVerdict::kFailed;
    check.text = std::move(text);
  }
  static void Fail(CheckResult& check, std::string text, std::string advice) {
    check.verdict = CheckVerdict::kFailed;
    check.text = std::move(text);
    check.advice = std::move(advice);
  }

  [[nodiscard]] bool has_steps() const { return summary_.steps.total() > 0; }

  [[nodiscard]] bool has_stop() const {
    return summary_.has_stand() &&
           (summary_.stops[0].is_available() || summary_.stops[1].is_available());
  }

  // If the library has no steps, marks the check as not applicable and returns true.
  [[nodiscard]] bool SkipWithoutSteps(CheckResult& check) const {
    if (has_steps()) return false;
    check.verdict = CheckVerdict::kNotApplicable;
    check.text = "The library has no steps.";
    return true;
  }

  // Returns advice for a failed walk. It depends on the first missing prerequisite.
  [[nodiscard]] std::string WalkAdvice() const {
    const bool has_left = summary_.has_steps_of(Foot::kLeft);
    if (!has_left || !summary_.has_steps_of(Foot::kRight)) {
      return Text(
          "The library has steps of the %s foot only: add the option --mirror to the "
          "build, or add captures with steps of the other foot.",
          has_left ? "left" : "right");
    }
    if (!summary_.has_stand()) {
      return "No capture contains a stand with the feet side by side: record walks that begin and "
             "end in a stand, for at least a second.";
    }
    const auto is_missing = [](const LibrarySummary::Sides& sides) {
      return !sides[0].is_available() && !sides[1].is_available();
    };
    if (is_missing(summary_.starts)) {
      return "The library has no start: record walks that begin in a stand with the feet side by "
             "side.";
    }
    if (is_missing(summary_.stops)) return std::string("The library has no stop. ") + kRecordStops;
    return "Add captures of straight walks with steps of both feet and of several lengths, or the "
           "option --mirror.";
  }

  void PlaySteps() {
    for (std::uint64_t id = 1; id <= kSteps; ++id) {
      step_requests_.push_back(
          {.id = id, .movement = StepRequest{.length_m = steps_m_, .allow_nearest = true}});
    }
    step_requests_.push_back({.id = kSteps + 1, .movement = StandRequest{.seconds = kStandS}});
    if (!has_steps()) return;
    const SynthesisInput input{
        .library = library_, .start = {}, .requests = step_requests_, .fps = kFps};
    auto played = Synthesize(input);
    if (!played) {
      steps_error_ = Describe(played.error());
      return;
    }
    refusals_ = FindRefusals(input, *played);
    steps_ = *std::move(played);
    SurveyLegs(*library_, *steps_, summary_.has_stand(), legs_);
  }

  void CheckThreeSteps() {
    CheckResult& check = Add("three_steps", "Three plain steps", kMaxRequestErrorM, "m");
    if (SkipWithoutSteps(check)) return;
    if (!steps_) {
      Fail(check, Text("Three steps of %.2f m are not possible: ", steps_m_) + steps_error_ + ".",
           WalkAdvice());
      return;
    }
    const Refusal* worst = nullptr;
    for (const Refusal& refusal : refusals_) {
      if (refusal.kind != "step") continue;
      if (worst == nullptr || refusal.missed_m > worst->missed_m) worst = &refusal;
    }
    const double worst_m = LargestStepMiss();
    CompareWithBound(
        check, worst_m,
        Text("Three steps of %.2f m land within %.3f m of where they should.", steps_m_, worst_m));
    if (const char* const problem = OrderProblem(); problem != nullptr) {
      // If steps are in another order than requested, there is no meaningful error.
      check.measured.reset();
      Fail(check, Text("Three steps of %.2f m are not possible: ", steps_m_) + problem,
           WalkAdvice());
    } else if (worst != nullptr) {
      Fail(
          check,
          Text("Step %d of three steps of %.2f m ", static_cast<int>(worst->request_id), steps_m_) +
              worst->reason + ".",
          WalkAdvice());
    }
  }

  // Returns the largest difference between the requested and the actual length of a step.
  [[nodiscard]] double LargestStepMiss() const {
    double largest_m = 0.0;
    for (const MovementRecord& record : steps_->movements) {
      if (record.request_id == 0 || !IsStep(record.kind)) continue;
      const int frame = std::clamp(static_cast<int>(std::floor(record.end_s * kFps + 1e-6)), 0,
                                   steps_->clip.frame_count() - 1);
      const DVec3 vector = FootVector(library_->skeleton(), steps_->clip.frame(frame),
                                      MovingFoot(record.kind), record.base.heading_rad);
      largest_m = std::max(largest_m, std::fabs(vector.z - steps_m_));
    }
    return largest_m;
  }

  // Checks that left and right steps alternate up to the last requested step, without additional
  // steps in between. Returns the problem, or null if there is none.
  [[nodiscard]] const char* OrderProblem() const {
    const MovementRecord* previous = nullptr;
    for (const MovementRecord& record : steps_->movements) {
      if (!IsStep(record.kind)) continue;
      if (record.request_id == 0 && previous != nullptr) {
        return "additional steps are necessary between them.";
      }
      if (record.request_id != 0 && previous != nullptr && previous->kind == record.kind) {
        return "the same foot has to step twice in a row.";
      }
      if (record.request_id == kSteps) break;
      previous = &record;
    }
    return nullptr;
  }

  void CheckStop() {
    CheckResult& check = Add("stop", "Stop with the feet together", kMaxStopM, "m");
    if (SkipWithoutSteps(check)) return;
    if (!steps_) {
      Fail(check, "No walk to stop from is possible: " + steps_error_ + ".", WalkAdvice());
    } else {
      const Clip& clip = steps_->clip;
      const DVec3 stopped = FootVector(library_->skeleton(), clip.frame(clip.frame_count() - 1),
                                       Foot::kLeft, steps_->movements.back().base.heading_rad);
      const DVec3 stand =
          FootVector(library_->skeleton(), library_->stand_pose(), Foot::kLeft, 0.0);
      const double apart_m = std::fabs(stopped.z - stand.z);
      CompareWithBound(
          check, apart_m,
          Text("After the steps, the feet stand %.3f m from their positions in the stand pose, "
               "measured forward.",
               apart_m));
      check.advice = check.verdict == CheckVerdict::kFailed ? kRecordStops : "";
    }
    if (!has_stop() && check.verdict != CheckVerdict::kPassed) {
      check.verdict = CheckVerdict::kNotApplicable;
      check.text = "The library has no stop with the feet together: avatars stop in a stride.";
      check.advice = kRecordStops;
    }
  }

  void CheckWalk() {
    CheckResult& check = Add("walk_to", "Walk to a goal 3 m ahead", kMaxGoalM, "m");
    if (SkipWithoutSteps(check)) return;
    const MovementRequest walk{.id = 1,
                               .movement = WalkRequest{.position_m = DVec3(0.0, 0.0, kGoalM)}};
    const auto played = Synthesize(
        {.library = library_, .start = {}, .requests = std::span(&walk, 1), .fps = kFps});
    if (!played) {
      Fail(check, "A walk is not possible: " + Describe(played.error()) + ".", WalkAdvice());
      return;
    }
    SurveyLegs(*library_, *played, summary_.has_stand(), legs_);
    STRIDEWIRE_CHECK(played->walks.size() == 1);
    const WalkRecord& record = played->walks.front();
    const double left_m = std::hypot(record.base.position_m.x, record.base.position_m.z - kGoalM);
    const auto step_count = static_cast<int>(std::ranges::count_if(
        played->movements, [](const MovementRecord& m) { return IsStep(m.kind); }));
    const char* const steps = step_count == 1 ? "step" : "steps";
    if (record.arrived) {
      CompareWithBound(
          check, left_m,
          Text("The walk arrives after %d %s, %.3f m from its goal.", step_count, steps, left_m));
      return;
    }
    if (!has_stop()) check.bound = 0.5 * steps_m_;
    check.measured = left_m;
    const std::string text =
        Text("The walk ends after %d %s, %.2f m from its goal: ", step_count, steps, left_m) +
        record.reason + ".";
    if (!has_stop() && left_m <= check.bound) {
      check.verdict = CheckVerdict::kPassed;
      check.text = text + " The library has no stop, so walks end up to half a step from the goal.";
      return;
    }
    Fail(check, text, WalkAdvice());
  }

  void CheckLegs() {
    PlayJump();
    CheckResult& knees = Add("knees", "Knees bend forward", kMaxKneeDeg, "degrees");
    if (!SkipWithoutFeet(knees)) {
      if (!legs_.knee_deg) {
        knees.text = "No leg bends by more than 20 degrees.";
      } else {
        CompareWithBound(
            knees, *legs_.knee_deg,
            Text("Bent knees point at most %.0f degrees away from the direction of their feet.",
                 *legs_.knee_deg));
        if (knees.verdict == CheckVerdict::kFailed) {
          knees.advice =
              "Check that hip, knee and ankle are the right joints of the capture; --left-ankle "
              "and --right-ankle name the ankles.";
        }
      }
    }
    CheckResult& soles = Add("soles", "Soles on the ground", kMaxSoleM, "m");
    if (!SkipWithoutFeet(soles)) {
      CompareWithBound(
          soles, std::max(legs_.hover_m, legs_.sink_m),
          Text("Standing soles are at most %.3f m above the ground, and the balls of the feet at "
               "most %.3f m below it.",
               legs_.hover_m, legs_.sink_m));
      if (soles.verdict == CheckVerdict::kFailed) {
        soles.advice =
            "Check in the report which steps leave the ground, and leave out captures whose floor "
            "is uneven or whose feet hover.";
      }
    }
  }

  // If no movement with feet on the ground was played, explains this in the check and returns true.
  [[nodiscard]] bool SkipWithoutFeet(CheckResult& check) const {
    if (legs_.feet > 0) return false;
    check.text = library_->leg_rig().is_usable
                     ? "No movement could be played."
                     : "The legs of this skeleton do not support foot planting.";
    return true;
  }

  // If no step was played but the library has jumps, plays a jump to measure the legs. Its length
  // is the mean of the shortest and the longest one.
  void PlayJump() {
    if (legs_.feet > 0 || !summary_.jumps.is_available()) return;
    const double length_m = 0.5 * (summary_.jumps.range.min + summary_.jumps.range.max);
    const MovementRequest jump{
        .id = 1, .movement = JumpRequest{.length_m = length_m, .allow_nearest = true}};
    const auto played = Synthesize(
        {.library = library_, .start = {}, .requests = std::span(&jump, 1), .fps = kFps});
    if (played) SurveyLegs(*library_, *played, summary_.has_stand(), legs_);
  }

  const std::shared_ptr<const MotionLibrary>& library_;
  const LibrarySummary summary_;
  double steps_m_ = 0.0;
  SelfCheck result_;
  std::vector<MovementRequest> step_requests_;
  std::optional<Synthesis> steps_;
  std::string steps_error_;
  std::vector<Refusal> refusals_;
  LegDeviations legs_;
};

}  // namespace

std::string_view CheckVerdictName(CheckVerdict verdict) {
  switch (verdict) {
    case CheckVerdict::kPassed: return "passed";
    case CheckVerdict::kFailed: return "failed";
    case CheckVerdict::kNotApplicable: break;
  }
  return "not_applicable";
}

bool SelfCheck::passed() const {
  return std::ranges::none_of(
      checks, [](const CheckResult& check) { return check.verdict == CheckVerdict::kFailed; });
}

SelfCheck CheckLibrary(const std::shared_ptr<const MotionLibrary>& library) {
  STRIDEWIRE_CHECK(library != nullptr);
  return Checker(library).Run();
}

std::string DescribeVerdict(const SelfCheck& check) {
  const auto count = [&](CheckVerdict verdict) {
    return static_cast<int>(std::ranges::count(check.checks, verdict, &CheckResult::verdict));
  };
  const int failed = count(CheckVerdict::kFailed);
  const int skipped = count(CheckVerdict::kNotApplicable);
  std::string text = failed > 0 ? Text("Self-check failed: %d of %d checks", failed,
                                       static_cast<int>(check.checks.size()))
                                : "Self-check passed";
  if (skipped > 0) text += Text("; %d not applicable", skipped);
  return text + ".";
}

}  // namespace stridewire
