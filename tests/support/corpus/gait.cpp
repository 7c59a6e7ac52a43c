#include "corpus/gait.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stridewire::test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kGravity = 9.81;
constexpr int kLeadSteps = 2;     // Steps before and after the recorded part of a cut walk.
constexpr double kReach = 0.985;  // Largest distance from hip to ankle, in leg lengths.
constexpr double kRollS = 0.3;    // The heel rises for this time before the foot leaves.
constexpr double kSwayRad = 4.0 * kDegree;
constexpr double kArmSwingRad = 20.0 * kDegree;

DVec3 Turn(double yaw_rad, const DVec3& v) { return AboutY(yaw_rad) * v; }

double BallHeight(const Figure& figure) { return figure.AnkleHeight() + figure.Ball().y; }

DVec3 Beside(const Figure& figure, int foot, double yaw_rad) {
  return Turn(yaw_rad, DVec3((foot == 0 ? 1.0 : -1.0) * kHalfTrackM * figure.scale(), 0.0, 0.0));
}

double Lerp(double a, double b, double u) { return a + (b - a) * u; }

class GaitRenderer {
 public:
  GaitRenderer(const Figure& figure, const Gait& gait) : figure_(figure), gait_(gait) {}

  FigureMotion Run(double fps) const {
    FigureMotion motion;
    motion.fps = fps;
    const int count = static_cast<int>(std::lround((gait_.end_s - gait_.begin_s) * fps)) + 1;
    double height_m = 2.0 * figure_.LegLength();
    for (int i = 0; i < count; ++i) {
      motion.poses.push_back(PoseWithoutHeight(gait_.begin_s + i / fps));
      height_m = std::min(height_m, HighestPelvis(motion.poses.back()));
    }
    for (FigurePose& pose : motion.poses) pose.pelvis_m.y += height_m;
    return motion;
  }

 private:
  // The pelvis is at the height of the ground plus the bounce of a run.
  FigurePose PoseWithoutHeight(double t) const {
    FigurePose pose;
    const Waypoint middle = SmoothPath(t);
    const double phase = kPi * (t - gait_.path.front().time_s) / gait_.step_s;
    const double activity = Activity(t);
    pose.pelvis_m = middle.ground_m + DVec3(0.0, Bounce(t), 0.0);
    const double twist = kSwayRad * activity * std::sin(phase);
    pose.pelvis = AboutY(middle.yaw_rad + twist);
    pose.spine = AboutX(2.0 * kDegree) * AboutY(-twist);
    pose.chest = AboutY(-twist);
    pose.HangArms(kArmSwingRad * activity * std::sin(phase));
    for (int foot = 0; foot < 2; ++foot) {
      pose.legs[static_cast<std::size_t>(foot)] = LegAt(foot, t, middle.yaw_rad);
    }
    return pose;
  }

  // Returns 1 while the figure moves, 0 while it stands, and values between while it starts or
  // stops.
  double Activity(double t) const {
    const double in = Ease((t - gait_.path.front().time_s) / gait_.step_s);
    return in * Ease((gait_.path.back().time_s - t) / gait_.step_s);
  }

  Waypoint PathAt(double t) const {
    const std::vector<Waypoint>& path = gait_.path;
    if (t <= path.front().time_s) return path.front();
    for (std::size_t i = 1; i < path.size(); ++i) {
      if (t > path[i].time_s) continue;
      const Waypoint& a = path[i - 1];
      const Waypoint& b = path[i];
      const double u = (t - a.time_s) / (b.time_s - a.time_s);
      return {t, a.ground_m + u * (b.ground_m - a.ground_m), Lerp(a.yaw_rad, b.yaw_rad, u)};
    }
    return path.back();
  }

  Waypoint SmoothPath(double t) const {
    constexpr int kSamples = 16;
    Waypoint sum{t};
    for (int i = 0; i < kSamples; ++i) {
      const Waypoint at = PathAt(t + gait_.smooth_s * ((i + 0.5) / kSamples - 0.5));
      sum.ground_m += at.ground_m / static_cast<double>(kSamples);
      sum.yaw_rad += at.yaw_rad / kSamples;
    }
    return sum;
  }

  // Free fall while both feet are in the air, and a half sine of the same speed between flights.
  double Bounce(double t) const {
    if (gait_.flight_s <= 0.0) return 0.0;
    const double contact_s = gait_.step_s - gait_.flight_s;
    const double since =
        std::fmod(t - gait_.prints[0].front().land_s + 100.0 * gait_.step_s, gait_.step_s);
    const double speed = 0.5 * kGravity * gait_.flight_s;
    if (since < contact_s) return -speed * contact_s / kPi * std::sin(kPi * since / contact_s);
    const double fall_s = since - contact_s;
    return speed * fall_s - 0.5 * kGravity * fall_s * fall_s;
  }

  // Returns the pitch of a standing foot. It is positive if the heel is raised, and negative while
  // a foot that landed with the heel becomes flat.
  double StandingPitch(const Footprint& print, double t) const {
    const double contact_s = print.lift_s - print.land_s;
    const double roll_s = std::min(kRollS, contact_s);
    const double raised = gait_.roll_rad * Ease((t - print.lift_s + roll_s) / roll_s);
    return raised - gait_.heel_rad * (1.0 - Ease((t - print.land_s) / kHeelS));
  }

  // Returns the vector from the footprint to the ball of a foot that pitches up about its heel.
  DVec3 BallAboveHeel(const Footprint& print, double pitch) const {
    const DVec3 heel(0.0, -figure_.AnkleHeight(), -0.06 * figure_.scale());
    const DVec3 arm = figure_.Ball() - heel;
    return AboutY(print.yaw_rad) * (AboutX(std::min(0.0, pitch)) * arm - arm);
  }

  FigurePose::LegPose LegAt(int foot, double t, double heading_rad) const {
    const std::vector<Footprint>& prints = gait_.prints[static_cast<std::size_t>(foot)];
    std::size_t k = 0;
    while (k + 1 < prints.size() && t >= prints[k].lift_s && t >= prints[k + 1].land_s) ++k;
    const Footprint& from = prints[k];
    DVec3 ball = from.ball_m;
    double yaw = from.yaw_rad;
    double pitch = 0.0;
    double toe_bend = 0.0;
    if (t < from.lift_s || k + 1 == prints.size()) {
      pitch = StandingPitch(from, t);
      toe_bend = -std::max(0.0, pitch);
      ball += BallAboveHeel(from, pitch);
    } else {
      const Footprint& to = prints[k + 1];
      const DVec3 landing = to.ball_m + BallAboveHeel(to, -gait_.heel_rad);
      const double u = (t - from.lift_s) / (to.land_s - from.lift_s);
      ball += Ease(u) * (landing - ball);
      const bool climbs = landing.y > from.ball_m.y;
      ball.y = Lerp(from.ball_m.y, landing.y, climbs ? Ease(u / 0.6) : Ease((u - 0.4) / 0.6));
      ball.y += gait_.lift_m * std::sin(kPi * u) * std::sin(kPi * u);
      yaw = Lerp(from.yaw_rad, to.yaw_rad, Ease(u));
      pitch = gait_.roll_rad * (1.0 - Ease(u / 0.6)) - gait_.heel_rad * Ease((u - 0.6) / 0.4);
      toe_bend = -gait_.roll_rad * (1.0 - Ease(u / 0.3));
    }
    FigurePose::LegPose leg;
    leg.foot = AboutY(yaw) * AboutX(pitch);
    leg.ankle_m = ball - leg.foot * figure_.Ball();
    leg.knee_towards = Turn(0.5 * (yaw + heading_rad), DVec3(0.0, 0.0, 1.0));
    leg.toe_bend_rad = toe_bend;
    return leg;
  }

  // Returns by how much the pelvis can be raised before an ankle is out of reach.
  double HighestPelvis(const FigurePose& pose) const {
    const double reach = kReach * figure_.LegLength();
    double highest = 2.0 * figure_.LegLength();
    for (int foot = 0; foot < 2; ++foot) {
      const Part up_leg = foot == 0 ? Part::kLeftUpLeg : Part::kRightUpLeg;
      const DVec3 hip = pose.pelvis_m + pose.pelvis * figure_.Offset(up_leg);
      const DVec3 to_ankle = pose.legs[static_cast<std::size_t>(foot)].ankle_m - hip;
      const double across = std::min(std::hypot(to_ankle.x, to_ankle.z), 0.95 * reach);
      highest = std::min(highest, to_ankle.y + std::sqrt(reach * reach - across * across));
    }
    return highest;
  }

  const Figure& figure_;
  const Gait& gait_;
};

}  // namespace

Gait PlanWalk(const Figure& figure, const WalkOptions& options) {
  Gait gait;
  const int before = options.starts ? 0 : kLeadSteps;
  const int total = before + options.steps + (options.stops ? 0 : kLeadSteps);
  gait.step_s = options.step_s;
  gait.smooth_s = 0.7 * options.step_s;
  gait.lift_m = options.lift_m;
  const bool forward = options.length_m > 0.3 && options.side_m == 0.0;
  gait.roll_rad = forward ? 30.0 * kDegree : 0.0;
  gait.heel_rad = forward ? options.heel_rad : 0.0;
  DVec3 centre = options.start_m;
  double yaw = options.heading_rad;
  double step_height = 0.0;
  const auto on_floor = [&](DVec3 print) {
    print.y = options.start_m.y + step_height + options.slope_x * (print.x - options.start_m.x) +
              options.slope_z * (print.z - options.start_m.z) + BallHeight(figure);
    return print;
  };
  for (int foot = 0; foot < 2; ++foot) {
    Footprint print;
    print.ball_m = on_floor(centre + Beside(figure, foot, yaw));
    print.yaw_rad = yaw;
    gait.prints[static_cast<std::size_t>(foot)] = {print};
  }
  const auto middle = [&](double t) {
    const DVec3 feet = 0.5 * (gait.prints[0].back().ball_m + gait.prints[1].back().ball_m);
    return Waypoint{t, feet - DVec3(0.0, BallHeight(figure), 0.0), yaw};
  };
  gait.path.push_back(middle(options.stand_s));
  for (int k = 0; k < total; ++k) {
    const int foot = (options.first_foot + k) % 2;
    std::vector<Footprint>& prints = gait.prints[static_cast<std::size_t>(foot)];
    const std::size_t step = static_cast<std::size_t>(std::max(0, k - before));
    if (k >= before && step < options.rises_m.size()) step_height += options.rises_m[step];
    Footprint next;
    if (options.side_m != 0.0) {
      next.ball_m = on_floor(prints.back().ball_m + Turn(yaw, DVec3(options.side_m, 0.0, 0.0)));
    } else {
      if (k + 1 < total) {  // The last step closes the feet.
        yaw += options.turn_rad;
        centre += Turn(yaw, DVec3(0.0, 0.0, options.length_m));
      }
      next.ball_m = on_floor(centre + Beside(figure, foot, yaw));
    }
    next.yaw_rad = yaw;
    prints.back().lift_s = options.stand_s + k * options.step_s + 0.5 * options.support_s;
    next.land_s = options.stand_s + (k + 1) * options.step_s - 0.5 * options.support_s;
    prints.push_back(next);
    gait.path.push_back(middle(options.stand_s + (k + 1) * options.step_s));
  }
  gait.begin_s =
      options.starts ? 0.0 : options.stand_s + (before - options.cut_share) * options.step_s;
  gait.end_s = options.stand_s + total * options.step_s + options.stand_s;
  if (!options.stops) {
    gait.end_s = options.stand_s + (before + options.steps + options.cut_share) * options.step_s;
  }
  return gait;
}

Gait PlanRun(const Figure& figure, const RunOptions& options) {
  Gait gait;
  gait.step_s = options.step_s;
  gait.smooth_s = options.step_s;
  gait.lift_m = 0.2 * figure.scale();
  gait.roll_rad = 45.0 * kDegree;
  gait.flight_s = options.step_s - options.contact_s;
  for (int k = -kLeadSteps; k < options.steps + kLeadSteps; ++k) {
    const int foot = (k + kLeadSteps) % 2;
    Footprint print;
    print.ball_m = DVec3(0.0, BallHeight(figure), k * options.length_m) + Beside(figure, foot, 0.0);
    print.land_s = k * options.step_s;
    print.lift_s = print.land_s + options.contact_s;
    gait.prints[static_cast<std::size_t>(foot)].push_back(print);
    gait.path.push_back({print.land_s + 0.5 * options.contact_s,
                         DVec3(0.0, 0.0, k * options.length_m + 0.1 * figure.scale()), 0.0});
  }
  gait.begin_s = 0.1 * options.step_s;
  gait.end_s = (options.steps - 1) * options.step_s + 0.5 * options.contact_s;
  return gait;
}

FigureMotion RenderGait(const Figure& figure, const Gait& gait, double fps) {
  return GaitRenderer(figure, gait).Run(fps);
}

}  // namespace stridewire::test
