#include "corpus/draw_movement.h"

#include <cmath>

#include "corpus/draw.h"
#include "corpus/gait.h"
#include "corpus/postures.h"

namespace stridewire::test {
namespace {

constexpr double kFrameRates[] = {24, 25, 29.97, 30, 50, 60, 90, 100, 120, 144, 240};
constexpr double kFastJumpFactor = 1.3;
constexpr double kSlowFactor = 0.25;

// Adds a kerb, stairs or a slope under a walk.
void DrawFloor(Random& random, WalkOptions& walk, std::string& description) {
  const double kind = random.Draw(0.0, 1.0);
  const bool forward = walk.length_m > 0.0 && walk.side_m == 0.0;
  const double sign = Chance(random, 0.5) ? 1.0 : -1.0;
  if (kind < 0.5) return;
  if (kind < 0.75 || !forward) {
    const double direction = random.Draw(0.0, 6.28);
    walk.slope_x = 0.01 * std::cos(direction);
    walk.slope_z = 0.01 * std::sin(direction);
    description += "; floor rises 1 cm/m";
  } else if (kind < 0.9) {
    const double rise_m = sign * random.Draw(0.05, 0.10);
    walk.rises_m.assign(static_cast<std::size_t>(walk.steps / 2) + 1, 0.0);
    walk.rises_m.back() = rise_m;
    description += Text("; kerb of %.1f cm", 100.0 * rise_m);
  } else {
    const double rise_m = sign * random.Draw(0.14, 0.18);
    walk.rises_m.assign(static_cast<std::size_t>(walk.steps) - 1, rise_m);
    walk.rises_m[0] = 0.0;
    walk.length_m = 0.32;
    walk.step_s = 0.65;
    walk.lift_m = 0.12;
    walk.turn_rad = 0.0;
    description += Text("; stairs of %.1f cm", 100.0 * rise_m);
  }
}

WalkOptions DrawWalk(const Figure& figure, Random& random, std::string& description) {
  WalkOptions walk;
  walk.steps = 4 + 2 * Below(random, 3);
  walk.first_foot = Below(random, 2);
  walk.step_s = random.Draw(0.5, 0.75);
  walk.support_s = random.Draw(0.2, 0.28) * walk.step_s;
  walk.lift_m = random.Draw(0.07, 0.14);
  walk.heel_rad = Chance(random, 0.5) ? random.Draw(5.0, 20.0) * kDegree : 0.0;
  walk.heading_rad = random.Draw(-3.1, 3.1);
  const double kind = random.Draw(0.0, 1.0);
  if (kind < 0.55) {
    walk.length_m = figure.scale() * random.Draw(0.4, 0.72);
    description += Text("forward %.2f m", walk.length_m);
  } else if (kind < 0.75) {
    walk.length_m = figure.scale() * random.Draw(0.35, 0.6);
    walk.turn_rad = (Chance(random, 0.5) ? 1 : -1) * random.Draw(8.0, 30.0) * kDegree;
    description += Text("forward %.2f m, turning %.0f degrees per step", walk.length_m,
                        walk.turn_rad / kDegree);
  } else if (kind < 0.88) {
    walk.length_m = -figure.scale() * random.Draw(0.3, 0.5);
    description += Text("backward %.2f m", -walk.length_m);
  } else {
    const double side_m = figure.scale() * random.Draw(0.2, 0.4);
    walk.side_m = walk.first_foot == 0 ? side_m : -side_m;
    description += Text("sideways %.2f m", walk.side_m);
  }
  const double part = random.Draw(0.0, 1.0);
  if (part > 0.5) {
    walk.starts = part < 0.66;
    walk.stops = part >= 0.66 && part < 0.83;
    walk.cut_share = Chance(random, 0.5) ? 0.0 : random.Draw(0.1, 0.4);
    description += walk.starts  ? "; the end is cut off"
                   : walk.stops ? "; the start is cut off"
                                : "; start and end are cut off";
  }
  DrawFloor(random, walk, description);
  return walk;
}

// Inserts a second of the rest pose, with the feet at another height than in the walk.
void InsertRestPose(const Figure& figure, const WalkOptions& walk, Random& random,
                    DrawnMovement& drawn) {
  const double height_m = random.Draw(-0.08, 0.08);
  FigurePose pose = RestPose(figure);
  pose.pelvis_m += walk.start_m + DVec3(0.0, height_m, 0.0);
  for (FigurePose::LegPose& leg : pose.legs) leg.ankle_m += walk.start_m + DVec3(0, height_m, 0);
  drawn.motion.poses.insert(drawn.motion.poses.begin(),
                            static_cast<std::size_t>(std::lround(drawn.motion.fps)), pose);
  drawn.description += Text("; T-pose for 1 s, %.1f cm high", 100.0 * height_m);
}

// Sets the mean displacement of the feet over the recorded steps.
void SetMeanMove(const WalkOptions& walk, const Gait& gait, DrawnMovement& drawn) {
  DVec3 sum(0.0);
  int count = 0;
  for (const std::vector<Footprint>& prints : gait.prints) {
    for (std::size_t k = 0; k + 1 < prints.size(); ++k) {
      if (prints[k].lift_s < gait.begin_s || prints[k + 1].land_s > gait.end_s) continue;
      const double yaw_rad = 0.5 * (prints[k].yaw_rad + prints[k + 1].yaw_rad);
      sum += AboutY(-yaw_rad) * (prints[k + 1].ball_m - prints[k].ball_m);
      ++count;
    }
  }
  drawn.mean_move_m = DVec3(sum.x, 0.0, sum.z) / static_cast<double>(std::max(1, count));
  drawn.move_tolerance_m =
      0.06 + 0.1 * glm::length(drawn.mean_move_m) + 0.3 * std::fabs(walk.turn_rad);
}

void AddWalk(const Figure& figure, double fps, Random& random, DrawnMovement& drawn) {
  const WalkOptions walk = DrawWalk(figure, random, drawn.description);
  const Gait gait = PlanWalk(figure, walk);
  drawn.motion = RenderGait(figure, gait, fps);
  SetMeanMove(walk, gait, drawn);
  for (int k = 0; k < walk.steps; ++k) {
    drawn.steps[static_cast<std::size_t>((walk.first_foot + k) % 2)] += 1;
  }
  if (Chance(random, 0.12)) InsertRestPose(figure, walk, random, drawn);
}

// Returns a straight walk with parameters in the middle of the range of natural walks.
WalkOptions PlainWalk(const Figure& figure, Random& random) {
  WalkOptions walk;
  walk.length_m = figure.scale() * random.Draw(0.5, 0.7);
  walk.heading_rad = random.Draw(-3.1, 3.1);
  walk.first_foot = Below(random, 2);
  return walk;
}

}  // namespace

DrawnMovement DrawMovement(Movement movement, const Figure& figure, Random& random) {
  DrawnMovement drawn;
  const double fps = kFrameRates[Below(random, std::size(kFrameRates))];
  drawn.declared_fps = fps;
  const double seconds = random.Draw(3.0, 6.0);
  switch (movement) {
    case Movement::kWalk: AddWalk(figure, fps, random, drawn); break;
    case Movement::kJump:
    case Movement::kFastJump:
      drawn.motion = StandingJump(figure, fps, figure.scale() * random.Draw(0.3, 0.9));
      drawn.jumps = movement == Movement::kJump ? 1 : 0;
      if (movement == Movement::kFastJump) drawn.declared_fps = kFastJumpFactor * fps;
      break;
    case Movement::kRun: {
      RunOptions run;
      run.length_m = figure.scale() * random.Draw(0.85, 1.2);
      run.step_s = random.Draw(0.32, 0.38);
      run.contact_s = run.step_s - random.Draw(0.09, 0.14);
      drawn.motion = RenderGait(figure, PlanRun(figure, run), fps);
      break;
    }
    case Movement::kStand: drawn.motion = StandStill(figure, fps, seconds); break;
    case Movement::kDance: drawn.motion = DanceOnOneLeg(figure, fps, 2.0 * seconds); break;
    case Movement::kSit: drawn.motion = Sit(figure, fps, seconds); break;
    case Movement::kLie: drawn.motion = Lie(figure, fps, seconds); break;
    case Movement::kCrawl: drawn.motion = Crawl(figure, fps, seconds); break;
    case Movement::kHang: drawn.motion = Hang(figure, fps, seconds); break;
    case Movement::kMarch: {
      WalkOptions walk;
      walk.length_m = 0.0;
      drawn.motion = RenderGait(figure, PlanWalk(figure, walk), fps);
      break;
    }
    case Movement::kWalkInPlace: {
      const WalkOptions walk = PlainWalk(figure, random);
      drawn.motion = RenderGait(figure, PlanWalk(figure, walk), fps);
      StayInPlace(drawn.motion);
      drawn.steps = {walk.steps / 2, walk.steps / 2};
      break;
    }
    case Movement::kSlowWalk:
      drawn.motion = RenderGait(figure, PlanWalk(figure, PlainWalk(figure, random)), fps);
      drawn.declared_fps = kSlowFactor * fps;
      break;
    case Movement::kOneFrame: drawn.motion = StandStill(figure, fps, 0.0); break;
    case Movement::kFrozen:
      drawn.motion = StandStill(figure, fps, seconds);
      for (FigurePose& pose : drawn.motion.poses) pose = drawn.motion.poses.front();
      break;
  }
  drawn.description = std::string(MovementName(movement)) + (drawn.description.empty() ? "" : " ") +
                      drawn.description + Text("; %.4g frames/s", drawn.declared_fps);
  return drawn;
}

}  // namespace stridewire::test
