#include "corpus/postures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace stridewire::test {
namespace {

double SideOf(int foot) { return foot == 0 ? 1.0 : -1.0; }

FigureMotion Sample(double fps, double seconds, const std::function<FigurePose(double)>& pose) {
  FigureMotion motion;
  motion.fps = fps;
  const int count = static_cast<int>(std::lround(seconds * fps)) + 1;
  for (int i = 0; i < count; ++i) motion.poses.push_back(pose(i / fps));
  return motion;
}

FigurePose Standing(const Figure& figure) {
  FigurePose pose;
  pose.pelvis_m = DVec3(0.0, figure.AnkleHeight() + 0.97 * figure.LegLength(), 0.0);
  for (int foot = 0; foot < 2; ++foot) {
    pose.legs[static_cast<std::size_t>(foot)].ankle_m =
        DVec3(SideOf(foot) * kHalfTrackM * figure.scale(), figure.AnkleHeight(), 0.0);
  }
  pose.HangArms(0.0);
  return pose;
}

// Stretches both legs below the pelvis, bent forward by angles.
void StretchLegs(const Figure& figure, double left_rad, double right_rad, FigurePose& pose) {
  for (int foot = 0; foot < 2; ++foot) {
    FigurePose::LegPose& leg = pose.legs[static_cast<std::size_t>(foot)];
    const Part up_leg = foot == 0 ? Part::kLeftUpLeg : Part::kRightUpLeg;
    leg.foot = pose.pelvis * AboutX(-(foot == 0 ? left_rad : right_rad));
    leg.ankle_m = pose.pelvis_m + pose.pelvis * figure.Offset(up_leg) +
                  leg.foot * DVec3(0.0, -0.98 * figure.LegLength(), 0.0);
    leg.knee_towards = pose.pelvis * DVec3(0.0, 0.0, 1.0);
  }
}

}  // namespace

FigurePose RestPose(const Figure& figure) {
  FigurePose pose;
  pose.pelvis_m = DVec3(0.0, figure.AnkleHeight() + figure.LegLength(), 0.0);
  StretchLegs(figure, 0.0, 0.0, pose);
  return pose;
}

FigureMotion StandStill(const Figure& figure, double fps, double seconds) {
  return Sample(fps, seconds, [&](double t) {
    FigurePose pose = Standing(figure);
    pose.pelvis_m += DVec3(0.01 * std::sin(1.9 * t), 0.0, 0.008 * std::sin(1.3 * t));
    pose.chest = AboutX(2.0 * kDegree * std::sin(1.5 * t));
    return pose;
  });
}

FigureMotion DanceOnOneLeg(const Figure& figure, double fps, double seconds) {
  // The foot moves from one of these places to the next, and rests at each.
  static constexpr double kPlaces[][3] = {{0.25, 0.35, 0.1},  {0.3, 0.25, 0.3}, {0.2, 0.5, 0.25},
                                          {0.35, 0.3, -0.15}, {0.2, 0.2, 0.05}, {0.3, 0.4, 0.2}};
  constexpr double kMoveS = 0.9;
  constexpr double kRestS = 0.4;
  return Sample(fps, seconds, [&](double t) {
    FigurePose pose = Standing(figure);
    pose.pelvis_m += DVec3(-0.08 + 0.01 * std::sin(2.0 * t), -0.04, 0.01 * std::sin(1.4 * t));
    const int k = static_cast<int>(t / (kMoveS + kRestS));
    const double u = Ease((t - k * (kMoveS + kRestS)) / kMoveS);
    DVec3 place(0.0);
    for (int axis = 0; axis < 3; ++axis) {
      place[axis] = (1.0 - u) * kPlaces[k % 6][axis] + u * kPlaces[(k + 1) % 6][axis];
    }
    pose.legs[0].ankle_m = figure.scale() * place;
    pose.legs[0].foot = AboutX(15.0 * kDegree);
    pose.HangArms(0.3 * std::sin(1.7 * t));
    return pose;
  });
}

FigureMotion Sit(const Figure& figure, double fps, double seconds) {
  return Sample(fps, seconds, [&](double t) {
    FigurePose pose = Standing(figure);
    pose.pelvis_m = DVec3(0.0, figure.AnkleHeight() + 0.5 * figure.LegLength(), 0.0);
    pose.spine = AboutX(5.0 * kDegree * std::sin(1.1 * t));
    for (FigurePose::LegPose& leg : pose.legs) leg.ankle_m.z = 0.45 * figure.LegLength();
    return pose;
  });
}

FigureMotion Lie(const Figure& figure, double fps, double seconds) {
  return Sample(fps, seconds, [&](double t) {
    FigurePose pose;
    pose.pelvis_m = DVec3(0.0, 0.13 * figure.scale(), 0.0);
    pose.pelvis = AboutX(-0.5 * std::numbers::pi) * AboutY(10.0 * kDegree * std::sin(1.2 * t));
    StretchLegs(figure, 0.05 * std::sin(1.7 * t), 0.05 * std::sin(1.3 * t + 1.0), pose);
    pose.HangArms(0.05 * std::sin(t));
    return pose;
  });
}

FigureMotion Crawl(const Figure& figure, double fps, double seconds) {
  constexpr double kStepS = 0.7;
  constexpr double kStepM = 0.3;
  const double half_leg = 0.5 * figure.LegLength();
  return Sample(fps, seconds, [&](double t) {
    FigurePose pose;
    pose.pelvis_m = DVec3(0.0, 0.05 + half_leg, kStepM * t / kStepS);
    pose.pelvis = AboutX(72.0 * kDegree);  // The hands reach the floor.
    for (int foot = 0; foot < 2; ++foot) {
      // Each knee rests for one step and moves two step lengths ahead in the next.
      const double cycle = t / kStepS + foot;
      const double done = 2.0 * std::floor(0.5 * cycle);
      const double u = cycle - done - 1.0;
      const double ahead = kStepM * (done + 2.0 * Ease(u) - foot - 0.5);
      const double lift = u > 0.0 ? 0.04 * std::sin(std::numbers::pi * u) : 0.0;
      FigurePose::LegPose& leg = pose.legs[static_cast<std::size_t>(foot)];
      const double x = SideOf(foot) * 0.09 * figure.scale();
      leg.ankle_m = DVec3(x, 0.06 + lift, ahead - 0.98 * half_leg);
      leg.foot = AboutX(85.0 * kDegree);
      leg.knee_towards = DVec3(0.0, -1.0, 0.3);
      FigurePose::ArmPose& arm = pose.arms[static_cast<std::size_t>(foot)];
      arm.arm = AboutY(-SideOf(foot) * 90.0 * kDegree) *
                AboutZ(0.25 * SideOf(foot) * std::sin(std::numbers::pi * cycle));
    }
    return pose;
  });
}

FigureMotion Hang(const Figure& figure, double fps, double seconds) {
  return Sample(fps, seconds, [&](double t) {
    FigurePose pose;
    pose.pelvis_m = DVec3(0.0, 1.35 * figure.scale(), 0.06 * std::sin(2.2 * t));
    pose.pelvis = AboutX(6.0 * kDegree * std::sin(2.2 * t));
    StretchLegs(figure, 0.2 * std::sin(2.2 * t), 0.2 * std::sin(2.2 * t + 0.6), pose);
    for (int side = 0; side < 2; ++side) {
      pose.arms[static_cast<std::size_t>(side)].arm = AboutZ(SideOf(side) * 80.0 * kDegree);
    }
    return pose;
  });
}

FigureMotion StandingJump(const Figure& figure, double fps, double length_m) {
  constexpr double kGravity = 9.81;
  constexpr double kStandS = 0.8;
  constexpr double kDownS = 0.4;
  constexpr double kPushS = 0.25;
  constexpr double kFlightS = 0.4;
  constexpr double kLeanM = 0.1;
  const double crouch_m = 0.25 * figure.scale();
  const double up_m_s = 0.5 * kGravity * kFlightS;
  const double ahead_m_s = (length_m - 2.0 * kLeanM) / kFlightS;
  const double moving_s = 2.0 * (kDownS + kPushS) + kFlightS;
  // A cubic that starts at rest and reaches `value` with `speed` after `duration_s`.
  const auto push = [](double t, double duration_s, double value, double speed) {
    const double s = t / duration_s;
    return s * s * (value * (3.0 - 2.0 * s) + speed * duration_s * (s - 1.0));
  };
  return Sample(fps, 2.0 * kStandS + moving_s, [&](double time) {
    FigurePose pose = Standing(figure);
    const double standing_m = figure.AnkleHeight() + 0.93 * figure.LegLength();
    const double t = time - kStandS;
    const bool lands = t > 0.5 * moving_s;  // The landing is the reversed take-off.
    const double r = lands ? moving_s - t : t;
    double y = 0.0;
    double pelvis_z = 0.0;
    double foot_z = 0.0;
    double lift = 0.0;
    if (r > 0.0 && r <= kDownS) {
      y = -crouch_m * Ease(r / kDownS);
    } else if (r > kDownS && r <= kDownS + kPushS) {
      y = -crouch_m + push(r - kDownS, kPushS, crouch_m, up_m_s);
      pelvis_z = push(r - kDownS, kPushS, kLeanM, ahead_m_s);
    } else if (r > kDownS + kPushS) {
      const double f = r - kDownS - kPushS;
      lift = up_m_s * f - 0.5 * kGravity * f * f;
      y = lift;
      pelvis_z = kLeanM + ahead_m_s * f;
      foot_z = length_m * f / kFlightS;
    }
    if (lands) {
      pelvis_z = length_m - pelvis_z;
      foot_z = length_m - foot_z;
    }
    pose.pelvis_m = DVec3(0.0, standing_m + y, pelvis_z);
    for (FigurePose::LegPose& leg : pose.legs) leg.ankle_m += DVec3(0.0, lift, foot_z);
    pose.arms[1].arm = AboutX(-2.0 * y) * AboutZ(75.0 * kDegree);
    pose.arms[0].arm = AboutX(-2.0 * y) * AboutZ(-75.0 * kDegree);
    return pose;
  });
}

void StayInPlace(FigureMotion& motion) {
  if (motion.poses.empty()) return;
  const DVec3 start = motion.poses.front().pelvis_m;
  for (FigurePose& pose : motion.poses) {
    const DVec3 travel(pose.pelvis_m.x - start.x, 0.0, pose.pelvis_m.z - start.z);
    pose.pelvis_m -= travel;
    for (FigurePose::LegPose& leg : pose.legs) leg.ankle_m -= travel;
  }
}

}  // namespace stridewire::test
