#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "figures.h"
#include "gnuplot.h"
#include "stick_figure.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

constexpr double kFps = 60.0;
constexpr double kPoseSpacingM = 0.3;
constexpr double kMaxPixelsPerMetre = 220.0;
constexpr double kSlabM = 0.3;  // Length of the mark at a requested position.

// A mark at the position where a step was requested to land, in world coordinates. The requested
// distance is measured from the place where the fixed foot stands.
struct Slab {
  DVec3 centre_m = DVec3(0.0);
  double heading_rad = 0.0;
};

std::vector<Slab> SlabsOf(const Synthesis& synthesis, const MotionLibrary& library,
                          std::span<const MovementRequest> requests) {
  std::vector<Slab> slabs;
  double ground_m = 0.0;
  for (const MovementRecord& record : synthesis.movements) {
    if (!IsStep(record.kind) || record.request_id == 0) continue;
    const auto* step = std::get_if<StepRequest>(
        &requests[static_cast<std::size_t>(record.request_id - 1)].movement);
    if (step == nullptr) continue;
    const Foot moving = MovingFoot(record.kind);
    const int frame = std::min(static_cast<int>(std::lround(record.end_s * kFps)),
                               synthesis.clip.frame_count() - 1);
    const DVec3 fixed =
        BallPosition(library.skeleton(), synthesis.clip.frame(frame), OtherFoot(moving));
    // If the request has no side_m, the slab is drawn where the foot has landed.
    const DVec3 ball = BallPosition(library.skeleton(), synthesis.clip.frame(frame), moving);
    const double own_side = moving == Foot::kLeft ? 1.0 : -1.0;
    const double side = step->side_m ? own_side * *step->side_m
                                     : RotateYaw(-record.base.heading_rad, ball - fixed).x;
    const DVec3 way = RotateYaw(record.base.heading_rad, DVec3(side, 0.0, step->length_m));
    ground_m += step->height_m;
    slabs.push_back({DVec3(fixed.x + way.x, ground_m, fixed.z + way.z), record.base.heading_rad});
  }
  return slabs;
}

}  // namespace

Expected<Figure> WalkFigure(const std::shared_ptr<const MotionLibrary>& library,
                            const std::string& name, const std::string& caption,
                            std::span<const MovementRequest> requests) {
  const auto synthesis = Synthesize({.library = library, .requests = requests, .fps = kFps});
  if (!synthesis) return std::unexpected(synthesis.error());
  const Clip& clip = synthesis->clip;
  const Skeleton& skeleton = library->skeleton();
  StickFigure stick(*library);
  std::array<double, 2> along = {HUGE_VAL, -HUGE_VAL};
  std::array<double, 2> across = {HUGE_VAL, -HUGE_VAL};
  double top = 0.0;
  double last_m = -HUGE_VAL;
  std::array<std::string, 2> ways;
  std::string pelvis;
  // Walks that move mainly sideways are drawn from the front, with x to the right; others from the
  // side, with z to the right.
  const Vec3 way = clip.root_positions_m.back() - clip.root_positions_m.front();
  const bool from_front = std::fabs(way.x) > std::fabs(way.z);
  const int ahead = from_front ? 0 : 2;
  // Returns the coordinate that is drawn upwards in the view from above.
  const auto up = [&](const auto& p) { return from_front ? -double{p[2]} : double{p[0]}; };
  const auto point = [&](const auto& p) { return Number(p[ahead]) + " " + Number(up(p)) + "\n"; };
  for (int f = 0; f < clip.frame_count(); ++f) {
    const Vec3 root = clip.frame(f).root_position_m;
    const bool is_shown = std::fabs(root[ahead] - last_m) > kPoseSpacingM;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const Vec3 ball = BallPosition(skeleton, clip.frame(f), foot);
      ways[static_cast<std::size_t>(foot)] += point(ball);
      across = {std::min(across[0], up(ball)), std::max(across[1], up(ball))};
    }
    pelvis += point(root);
    if (!is_shown) continue;
    last_m = root[ahead];
    stick.Draw(clip.frame(f), 0.0, from_front);
    for (const Vec3& position : stick.Place(clip.frame(f))) {
      along = {std::min(along[0], double{position[ahead]}),
               std::max(along[1], double{position[ahead]})};
      top = std::max(top, double{position.y});
    }
  }
  std::string side_slabs = "$slabs << EOD\n";
  std::string top_slabs = "$marks << EOD\n";
  const std::vector<Slab> slabs = SlabsOf(*synthesis, *library, requests);
  for (const Slab& slab : slabs) {
    const double half = 0.5 * kSlabM;
    const double ground = slab.centre_m.y - 0.02;  // Draws the thick line below the feet.
    const double middle = slab.centre_m[ahead];
    const double reach = from_front ? 0.2 * kSlabM : half;
    side_slabs += Number(middle - reach) + " " + Number(ground) + "\n" + Number(middle + reach) +
                  " " + Number(ground) + "\n\n";
    const DVec3 tip = RotateYaw(slab.heading_rad, DVec3(0.0, 0.0, half));
    top_slabs += point(slab.centre_m - tip) + point(slab.centre_m + tip) + "\n";
  }
  if (slabs.empty()) side_slabs += "NaN NaN\n";
  if (slabs.empty()) top_slabs += "NaN NaN\n";

  Figure figure{.file = "walk_" + name + ".svg", .caption = caption, .width = 1200};
  const double width_m = along[1] - along[0] + 0.3;
  const double scale = std::min(1140.0 / width_m, kMaxPixelsPerMetre);
  const int strip = static_cast<int>(scale * (top + 0.35)) + 60;
  const double above_m = std::clamp(across[1] - across[0] + 0.5, 0.8, 6.0);
  const int above = static_cast<int>(std::min(scale, 300.0) * above_m) + 70;
  figure.height = std::min(strip + above, 1600);
  const double share = static_cast<double>(above) / (strip + above);
  figure.script = stick.Blocks() + side_slabs + "EOD\n" + top_slabs + "EOD\n$way_left << EOD\n" +
                  ways[0] + "EOD\n$way_right << EOD\n" + ways[1] + "EOD\n$pelvis << EOD\n" +
                  pelvis + "EOD\n";
  figure.script +=
      "set multiplot\nunset key\nset border 1\nset xtics nomirror\nunset ytics\n"
      "set size ratio -1\nset lmargin 2\nset rmargin 1\n"
      "set size 1," +
      Number(1.0 - share) + "\nset origin 0," + Number(share) + "\nset xrange [" +
      Number(along[0] - 0.15) + ":" + Number(along[1] + 0.15) +
      "]\nset yrange [-0.15:" + Number(top + 0.1) +
      "]\nplot $slabs w l lw 7 lc rgb "
      "'#bbbbbb', " +
      StickFigure::PlotCommand() + "\n";
  figure.script +=
      "set size 1," + Number(share) +
      "\nset origin 0,0\n"
      "set xlabel " +
      Quoted(std::string("from above, m: ") + (from_front ? "left side to the right, ahead down"
                                                          : "ahead to the right, left side up")) +
      "\nset xrange [*:*]\n"
      "set yrange [" +
      Number(across[0] - 0.25) + ":" + Number(across[1] + 0.25) +
      "]\nplot $marks w l lw 7 lc rgb '#bbbbbb', $pelvis w l lw 1 lc rgb '#555555', "
      "$way_right w l lw 1 dt 2 lc rgb '#0072b2', $way_left w l lw 1.5 lc rgb "
      "'#d55e00'\nunset multiplot\n";
  return figure;
}

std::vector<Walk> DemonstrationWalks(const MotionLibrary& library) {
  struct Range {
    double min = 0.0;
    double max = 0.0;
  };
  const auto widest = [&](ParameterName name) {
    Range range;
    for (const MotionGroup& group : library.groups()) {
      const int l = group.FindParameter(name);
      if (!IsStep(group.kind) || l < 0) continue;
      range.min = std::min(range.min, group.parameters[static_cast<std::size_t>(l)].min);
      range.max = std::max(range.max, group.parameters[static_cast<std::size_t>(l)].max);
    }
    return range;
  };
  std::vector<Walk> walks;
  const auto add = [&](const char* name, const char* caption, std::vector<StepRequest> steps) {
    Walk walk{name, caption, {}};
    for (const StepRequest& step : steps) {
      walk.requests.push_back({.id = walk.requests.size() + 1, .movement = step});
    }
    walks.push_back(std::move(walk));
  };
  const double longest = widest(ParameterName::kEndZ).max;
  if (longest <= 0.0) return walks;
  std::vector<StepRequest> steps;
  for (const double share : {0.8, 0.95, 0.65, 0.85, 0.6, 1.0, 0.75, 0.9, 0.0}) {
    steps.push_back({.length_m = share * longest});
  }
  add("slabs",
      "A walk over slabs at arbitrary distances (paper, Figure 4). Grey marks show where each step "
      "was requested to land",
      steps);
  const Range height = widest(ParameterName::kEndY);
  if (height.max > 0.1) {
    steps.clear();
    for (const double rise : {0.15, 0.18, 0.2, 0.22, 0.2, 0.15}) {
      steps.push_back({.length_m = 0.35, .height_m = std::min(rise, height.max)});
    }
    steps.push_back({.length_m = 0.0});
    add("stairs", "A walk up stairs. Grey marks show where each step was requested to land", steps);
  }
  const Range turn = widest(ParameterName::kTurn);
  if (turn.max > 0.15 && turn.min < -0.15) {
    steps.clear();
    const double most = std::min({turn.max, -turn.min, 0.35});
    for (int i = 0; i < 12; ++i) {
      steps.push_back({.length_m = std::min(0.5, 0.8 * longest),
                       .turn_rad = ((i + 2) / 4) % 2 == 0 ? most : -most});
    }
    steps.push_back({.length_m = 0.0});
    add("slalom", "A slalom: two steps to the left, four to the right, four to the left and so on",
        steps);
  }
  const Range side = widest(ParameterName::kEndX);
  if (side.max > 0.25) {
    steps.clear();
    for (int i = 0; i < 4; ++i) {
      steps.push_back({.foot = Foot::kLeft, .length_m = 0.0, .side_m = std::min(0.3, side.max)});
      steps.push_back({.foot = Foot::kRight, .length_m = 0.0, .side_m = 0.12});
    }
    add("shuffle",
        "A sideways shuffle to the left, seen from the front. Grey marks show where each step was "
        "requested to land",
        steps);
  }
  return walks;
}

}  // namespace stridewire
