#include "offline/inspect/library_summary.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <string_view>
#include <utility>

#include "offline/base/degrees.h"
#include "offline/base/text.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire {
namespace {

// Limits for classifying steps. A stride ends at least kStrideM in front of the fixed foot. A side
// step moves the foot at least kAsideM sideways, and farther sideways than forward or backward.
constexpr double kStrideM = 0.15;
constexpr double kBackM = 0.1;
constexpr double kAsideM = 0.1;
constexpr double kTurnDeg = 10.0;
// On level ground, the roll of a foot raises its ball by up to this height.
constexpr double kRollM = 0.06;

// Adds an example to an ability.
void Add(Ability& ability, const ExampleOrigins& origin, double value) {
  ValueRange& range = ability.range;
  range.min = ability.is_available() ? std::min(range.min, value) : value;
  range.max = ability.is_available() ? std::max(range.max, value) : value;
  ability.origins.captured += origin.captured;
  ability.origins.mirrored += origin.mirrored;
  ability.origins.generated += origin.generated;
  ability.origins.completed += origin.completed;
}

Ability& Of(LibrarySummary::Sides& sides, Foot foot) {
  return sides[static_cast<std::size_t>(foot)];
}
const Ability& Of(const LibrarySummary::Sides& sides, Foot foot) {
  return sides[static_cast<std::size_t>(foot)];
}

// Returns the first source of an averaged example: "a.bvh 1-2 s" for "a.bvh 1-2 s and 3 like it".
std::string FirstSource(std::string_view source) {
  const std::size_t end = source.ends_with(" like it") ? source.rfind(" and ") : source.npos;
  return std::string(source.substr(0, end));
}

Foot LeftIf(bool is_left) { return is_left ? Foot::kLeft : Foot::kRight; }

// Measurements of an example by which the summary classifies it.
struct MeasuredExample {
  // Vectors from the fixed to the moving foot in the first and in the last pose, each in the
  // heading frame of its pose.
  DVec3 start_m;
  DVec3 end_m;
  double turn_deg = 0.0;
  double travelled_m = 0.0;
  double duration_s = 0.0;
};

class Summarizer {
 public:
  explicit Summarizer(const MotionLibrary& library)
      : library_(library), pose_(library.skeleton().joint_count()) {}

  LibrarySummary Run() {
    summary_.stand_stride_m =
        std::fabs(FootVector(library_.skeleton(), library_.stand_pose(), Foot::kLeft, 0.0).z);
    // A step may be stored in two groups: complete among the general steps, and without its turn
    // among the straight steps. Groups with more parameters are therefore read first, and copies in
    // later groups are ignored.
    std::vector<std::size_t> order(library_.groups().size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
      return library_.groups()[a].parameter_count() > library_.groups()[b].parameter_count();
    });
    for (const std::size_t g : order) AddGroup(library_.groups()[g]);
    return std::move(summary_);
  }

 private:
  void AddGroup(const MotionGroup& group) {
    for (int e = 0; e < group.example_count; ++e) {
      const auto index = static_cast<std::size_t>(e);
      const std::string_view source = group.sources[index];
      const bool is_mirrored = group.mirrored[index] != 0;
      const bool is_generated = source.starts_with("generated");
      const std::string key(MovementKindName(group.kind));
      if (!seen_.insert({key + " " + FirstSource(source), is_mirrored}).second) continue;
      const bool is_completed = source.starts_with(kCompletedSource);
      const bool is_captured = !is_generated && !is_completed;
      const ExampleOrigins origin{.captured = is_captured && !is_mirrored ? 1 : 0,
                                  .mirrored = is_captured && is_mirrored ? 1 : 0,
                                  .generated = is_generated ? 1 : 0,
                                  .completed = is_completed ? 1 : 0};
      if (IsStep(group.kind)) {
        AddStep(MovingFoot(group.kind), Measure(group, e), origin);
      } else if (group.kind == MovementKind::kJump) {
        AddJump(group, e, origin);
      }
    }
  }

  // Reads the pose of an example in one row of the grid.
  double ReadPose(const MotionGroup& group, int example, int point) {
    const GridLayout& layout = library_.layout();
    const float* row = group.grid.data() + (static_cast<std::size_t>(point) *
                                                static_cast<std::size_t>(group.row_count()) +
                                            static_cast<std::size_t>(example)) *
                                               static_cast<std::size_t>(layout.row_floats);
    const GridLayout::Root root = layout.RootOf(row);
    pose_.root_position_m = Vec3(root.position_m);
    for (std::size_t j = 0; j < pose_.rotations.size(); ++j) {
      pose_.rotations[j] = GridLayout::RotationOf(row, j);
    }
    const double half = 0.5 * root.yaw_rad;
    const Quat yaw(static_cast<float>(std::cos(half)), 0.0f, static_cast<float>(std::sin(half)),
                   0.0f);
    pose_.rotations[0] = yaw * pose_.rotations[0];
    return root.yaw_rad;
  }

  MeasuredExample Measure(const MotionGroup& group, int example) {
    const Foot moving = MovingFoot(group.kind);
    const double turn_rad = group.heading_change_rad[static_cast<std::size_t>(example)];
    MeasuredExample measured;
    ReadPose(group, example, 0);
    const Vec3 from = pose_.root_position_m;
    measured.start_m = FootVector(library_.skeleton(), pose_, moving, 0.0);
    ReadPose(group, example, group.grid_point_count - 1);
    measured.end_m = FootVector(library_.skeleton(), pose_, moving, turn_rad);
    const Vec3 way = pose_.root_position_m - from;
    measured.travelled_m = std::hypot(way.x, way.z);
    measured.turn_deg = kDegreesPerRadian * turn_rad;
    const auto keys = static_cast<std::size_t>(group.interval_count()) + 1;
    measured.duration_s = group.keytimes_s[static_cast<std::size_t>(example) * keys + keys - 1];
    return measured;
  }

  void AddStep(Foot foot, const MeasuredExample& step, const ExampleOrigins& origin) {
    summary_.steps.captured += origin.captured;
    summary_.steps.mirrored += origin.mirrored;
    summary_.steps.generated += origin.generated;
    summary_.steps.completed += origin.completed;
    ++summary_.feet[static_cast<std::size_t>(foot)];
    const bool starts_together = std::fabs(step.start_m.z) <= LibrarySummary::kTogetherM;
    const bool ends_together = std::fabs(step.end_m.z) <= LibrarySummary::kTogetherM;
    const double aside_m = step.end_m.x - step.start_m.x;
    const bool is_side_step = std::fabs(aside_m) >= kAsideM &&
                              std::fabs(aside_m) >= std::fabs(step.end_m.z - step.start_m.z);
    if (starts_together && !ends_together && step.end_m.z > 0.0 && !is_side_step) {
      Add(Of(summary_.starts, foot), origin, step.end_m.z);
    }
    if (!starts_together && ends_together && step.start_m.z < 0.0) {
      Add(Of(summary_.stops, foot), origin, -step.start_m.z);
    }
    if (step.end_m.z >= kStrideM && !is_side_step) {
      const double speed = step.duration_s > 0.0 ? step.travelled_m / step.duration_s : 0.0;
      ValueRange& speeds = summary_.speed_m_s;
      const bool is_first = !Of(summary_.strides, Foot::kLeft).is_available() &&
                            !Of(summary_.strides, Foot::kRight).is_available();
      speeds.min = is_first ? speed : std::min(speeds.min, speed);
      speeds.max = is_first ? speed : std::max(speeds.max, speed);
      Add(Of(summary_.strides, foot), origin, step.end_m.z);
    }
    if (std::fabs(step.turn_deg) >= kTurnDeg) {
      Add(Of(summary_.turns, LeftIf(step.turn_deg > 0.0)), origin, std::fabs(step.turn_deg));
    }
    if (is_side_step) {
      Add(Of(summary_.side_steps, LeftIf(aside_m > 0.0)), origin, std::fabs(aside_m));
    }
    if (step.end_m.z <= -kBackM) Add(Of(summary_.back_steps, foot), origin, -step.end_m.z);
    if (step.end_m.y >= kRollM) Add(Of(summary_.climbs, foot), origin, step.end_m.y);
    if (step.end_m.y <= -kRollM) Add(Of(summary_.descents, foot), origin, -step.end_m.y);
  }

  void AddJump(const MotionGroup& group, int example, const ExampleOrigins& origin) {
    const auto value = [&](ParameterName name) {
      const int l = group.FindParameter(name);
      return l < 0 ? 0.0 : group.site(example)[static_cast<std::size_t>(l)];
    };
    const auto extend = [&](ValueRange& range, double v) {
      const bool is_first = !summary_.jumps.is_available();
      range = {is_first ? v : std::min(range.min, v), is_first ? v : std::max(range.max, v)};
    };
    extend(summary_.jump_up_m, value(ParameterName::kHeight));
    extend(summary_.jump_turn_deg, kDegreesPerRadian * value(ParameterName::kTurn));
    Add(summary_.jumps, origin, value(ParameterName::kLength));
  }

  const MotionLibrary& library_;
  Pose pose_;
  LibrarySummary summary_;
  std::set<std::pair<std::string, bool>> seen_;
};

// Returns the advice for movements that the library contains on one side only.
std::string OtherSideAdvice(const LibrarySummary& summary) {
  return summary.steps.mirrored > 0
             ? "Record these movements, too."
             : "Add the option --mirror to the build, or record these movements, too.";
}

// Collects the movements that the library lacks on one side or on both.
class MissingFinder {
 public:
  explicit MissingFinder(LibrarySummary& summary) : summary_(summary) {}

  // `what` is plural, for example "starts". `names` contains a phrase per side, for example "with
  // the left foot". `record` is the advice if both are missing.
  void Check(const LibrarySummary::Sides& sides, const std::string& what,
             const std::array<std::string, 2>& names, const std::string& record) {
    const bool has[2] = {sides[0].is_available(), sides[1].is_available()};
    if (has[0] && has[1]) return;
    if (!has[0] && !has[1]) {
      summary_.missing.push_back({what, record});
      return;
    }
    summary_.missing.push_back({what + " " + names[has[0] ? 1 : 0], OtherSideAdvice(summary_)});
  }

 private:
  LibrarySummary& summary_;
};

void FindMissing(LibrarySummary& summary) {
  const std::array<std::string, 2> feet{"with the left foot", "with the right foot"};
  const std::array<std::string, 2> directions{"to the left", "to the right"};
  const char* const record_jumps =
      "Record jumps that begin and end in a stand, with both feet leaving the ground together.";
  if (summary.steps.total() == 0) {
    summary.missing.push_back(
        {"steps", "Record walks that begin and end in a stand with the feet side by side."});
    if (!summary.jumps.is_available()) summary.missing.push_back({"jumps", record_jumps});
    return;
  }
  if (!summary.has_stand()) {
    summary.missing.push_back(
        {"a stand with the feet side by side",
         Text("Record a second of standing still; avatars now stand in a stride of %.2f m.",
              summary.stand_stride_m)});
  }
  MissingFinder finder(summary);
  if (!summary.has_steps_of(Foot::kLeft) || !summary.has_steps_of(Foot::kRight)) {
    const bool has_left = summary.has_steps_of(Foot::kLeft);
    summary.missing.push_back({"steps " + feet[has_left ? 1 : 0], OtherSideAdvice(summary)});
  }
  finder.Check(summary.starts, "starts", feet,
               "Record walks that begin in a stand with the feet side by side.");
  finder.Check(
      summary.stops, "stops", feet,
      "Record walks that end in a stand with the feet side by side, for at least a second.");
  finder.Check(summary.strides, "steps forward", feet, "Record walks straight ahead.");
  finder.Check(summary.turns, "turns", directions,
               "Record walks along curves, and turns on the spot.");
  finder.Check(summary.side_steps, "side steps", directions, "Record steps to both sides.");
  finder.Check(summary.back_steps, "steps backward", feet, "Record a walk backward.");
  finder.Check(summary.climbs, "steps up", feet, "Record a walk up stairs or onto blocks.");
  finder.Check(summary.descents, "steps down", feet, "Record a walk down stairs or from blocks.");
  if (!summary.jumps.is_available()) summary.missing.push_back({"jumps", record_jumps});
}

// Returns "3 captured, 2 mirrored".
std::string OriginText(const ExampleOrigins& origins) {
  std::string text;
  const auto add = [&](int count, const char* origin) {
    if (count == 0) return;
    text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + origin;
  };
  add(origins.captured, "captured");
  add(origins.mirrored, "mirrored");
  add(origins.generated, "generated");
  add(origins.completed, "completed");
  return text;
}

// Returns "0.35 to 0.81 m", or "0.35 m" if both ends are equal at this precision.
std::string RangeText(const ValueRange& range, const char* format, const char* unit) {
  const std::string low = Text(format, range.min);
  const std::string high = Text(format, range.max);
  return low == high ? low + unit : low + " to " + high + unit;
}
std::string Metres(const ValueRange& range) { return RangeText(range, "%.2f", " m"); }

// Describes both sides of an ability: "Starts with the left foot: 0.55 to 0.62 m (2 captured); with
// the right foot: none."
std::string SidesText(const char* what, const LibrarySummary::Sides& sides,
                      const std::array<const char*, 2>& names,
                      std::string (*range_text)(const ValueRange&)) {
  if (!sides[0].is_available() && !sides[1].is_available()) return std::string(what) + ": none.";
  std::string text = std::string(what) + " ";
  for (std::size_t s = 0; s < 2; ++s) {
    text += std::string(s == 0 ? "" : "; ") + names[s] + ": ";
    text += sides[s].is_available()
                ? range_text(sides[s].range) + " (" + OriginText(sides[s].origins) + ")"
                : "none";
  }
  return text + ".";
}

}  // namespace

LibrarySummary Summarize(const MotionLibrary& library) {
  LibrarySummary summary = Summarizer(library).Run();
  FindMissing(summary);
  return summary;
}

std::vector<std::string> DescribeSummary(const LibrarySummary& summary) {
  constexpr std::array<const char*, 2> kFeet{"with the left foot", "with the right foot"};
  constexpr std::array<const char*, 2> kDirections{"to the left", "to the right"};
  constexpr std::array<const char*, 2> kMoving{"of the left foot", "of the right foot"};
  std::vector<std::string> lines;
  if (summary.steps.total() == 0) {
    lines.emplace_back("Steps: none.");
  } else {
    lines.push_back(
        Text("Steps: %d of the left and %d of the right foot (", summary.feet[0], summary.feet[1]) +
        OriginText(summary.steps) + ").");
    lines.push_back(SidesText("Starts", summary.starts, kFeet, Metres));
    lines.push_back(SidesText("Stops", summary.stops, kFeet, [](const ValueRange& range) {
      return "from strides of " + Metres(range);
    }));
    lines.push_back(SidesText("Steps forward", summary.strides, kMoving, Metres));
    if (Of(summary.strides, Foot::kLeft).is_available() ||
        Of(summary.strides, Foot::kRight).is_available()) {
      lines.push_back("Speed of steps forward: " + RangeText(summary.speed_m_s, "%.1f", " m/s") +
                      ".");
    }
    lines.push_back(SidesText("Turns", summary.turns, kDirections, [](const ValueRange& range) {
      return Text("up to %.0f degrees per step", range.max);
    }));
    const auto up_to = [](const ValueRange& range) { return Text("up to %.2f m", range.max); };
    lines.push_back(SidesText("Side steps", summary.side_steps, kDirections, up_to));
    lines.push_back(SidesText("Steps backward", summary.back_steps, kMoving, up_to));
    lines.push_back(SidesText("Steps up", summary.climbs, kMoving, up_to));
    lines.push_back(SidesText("Steps down", summary.descents, kMoving, up_to));
  }
  if (!summary.jumps.is_available()) {
    lines.emplace_back("Jumps: none.");
  } else {
    const bool is_level = summary.jump_up_m.min > -0.005 && summary.jump_up_m.max < 0.005;
    std::string jumps =
        "Jumps: " + Metres(summary.jumps.range) + " long, landing " +
        (is_level ? std::string("as high as they start")
                  : RangeText(summary.jump_up_m, "%.2f", " m") + " above the start");
    if (summary.jump_turn_deg.max - summary.jump_turn_deg.min >= 1.0) {
      jumps += ", turning " + RangeText(summary.jump_turn_deg, "%.0f", " degrees");
    }
    lines.push_back(jumps + " (" + OriginText(summary.jumps.origins) + ").");
  }
  return lines;
}

}  // namespace stridewire
