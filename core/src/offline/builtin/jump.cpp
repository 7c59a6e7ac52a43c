#include "offline/builtin/jump.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/check.h"
#include "base/trig.h"
#include "offline/builtin/curve.h"
#include "offline/builtin/elementary.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/foot_path.h"
#include "offline/builtin/gait_state.h"
#include "offline/builtin/leg_ik.h"
#include "offline/builtin/step.h"
#include "offline/builtin/upper_body_path.h"

namespace stridewire::builtin {
namespace {

constexpr double kGravity = 9.81;
constexpr double kCrouchS = 0.45, kPushS = 0.28, kAbsorbS = 0.35, kStandUpS = 0.45;
constexpr double kToeOffKneeRad = 24.0 * kDegree;

/// A jump over a length, described by curves over time.
class JumpPath {
 public:
  JumpPath(const Skeleton& figure, double length_m) : figure_(figure), length_m_(length_m) {
    // The height of the centre of mass at landing depends on the pose, whose curves depend on the
    // times. After three iterations, the times change by less than a frame.
    double lower_m = 0.15;
    for (int i = 0; i < 3; ++i) {
      PlanTimes(lower_m);
      PlanBody();
      PlanFeet();
      PlanCentre();
      lower_m = toe_off_centre_.y -
                CentreHeightAtKnee(landing_s(), landing_z(), (28.0 + 6.0 * length_m_) * kDegree);
    }
    PlanFlight();
  }

  [[nodiscard]] std::vector<double> keytimes_s() const { return {times_.begin(), times_.end()}; }
  [[nodiscard]] double end_s() const { return times_.back(); }

  [[nodiscard]] FigurePose At(double time_s) const {
    return PoseWithCentre(time_s, Centre(time_s));
  }

 private:
  [[nodiscard]] double lowest_s() const { return times_[1]; }
  [[nodiscard]] double toe_off_s() const { return times_[2]; }
  [[nodiscard]] double landing_s() const { return times_[3]; }
  [[nodiscard]] double absorbed_s() const { return times_[4]; }

  void PlanTimes(double lower_m) {
    const double rise = 0.06 + 0.10 * length_m_;
    const double up = std::sqrt(2.0 * kGravity * rise);
    const double flight = (up + std::sqrt(up * up + 2.0 * kGravity * lower_m)) / kGravity;
    times_[0] = 0.0;
    const std::array lengths = {kCrouchS, kPushS, flight, kAbsorbS, kStandUpS};
    for (std::size_t i = 0; i < lengths.size(); ++i)
      times_[i + 1] = times_[i] + ToWholeFrames(lengths[i]);
    for (double& time_s : times_) time_s = ToWholeFrames(time_s);
    STRIDEWIRE_CHECK(std::ranges::is_sorted(times_));
    const double flight_s = landing_s() - toe_off_s();
    // Vertical velocity for the rounded flight time.
    velocity_.y = 0.5 * kGravity * flight_s - lower_m / flight_s;
  }

  void PlanBody() {
    const UpperBody standing = StandingUpperBody();
    const double d = length_m_;
    const double rest = standing.thorax_lean;
    lean_ =
        Curve({{0.0, rest, 0.0},
               {lowest_s(), (34.0 + 8.0 * d) * kDegree, 0.0},
               {toe_off_s(), (10.0 + 4.0 * d) * kDegree},
               {toe_off_s() + 0.4 * (landing_s() - toe_off_s()), (8.0 + 3.0 * d) * kDegree, 0.0},
               {landing_s(), (20.0 + 8.0 * d) * kDegree},
               {absorbed_s(), (34.0 + 9.0 * d) * kDegree, 0.0},
               {end_s(), rest, 0.0}});
    const double arm = standing.arm_flexion[0];
    arm_ = Curve({{0.0, arm, 0.0},
                  {0.9 * lowest_s(), -60.0 * kDegree, 0.0},
                  {toe_off_s(), 100.0 * kDegree},
                  {toe_off_s() + 0.3 * (landing_s() - toe_off_s()), 112.0 * kDegree, 0.0},
                  {landing_s(), 62.0 * kDegree},
                  {absorbed_s(), 12.0 * kDegree},
                  {end_s(), arm, 0.0}});
    const double elbow = standing.elbow_flexion[0];
    elbow_ = Curve({{0.0, elbow, 0.0},
                    {0.9 * lowest_s(), 8.0 * kDegree, 0.0},
                    {0.5 * (lowest_s() + toe_off_s()), 34.0 * kDegree, 0.0},
                    {toe_off_s(), 26.0 * kDegree, 0.0},
                    {landing_s(), 24.0 * kDegree},
                    {absorbed_s(), 38.0 * kDegree, 0.0},
                    {end_s(), elbow, 0.0}});
  }

  void PlanFeet() {
    const double push_s = toe_off_s() - lowest_s();
    // The ankles extend last. At toe-off, they rise at three quarters of the speed of the body.
    toe_off_pitch_rad_ = (36.0 + 11.0 * length_m_) * kDegree;
    const double rate = 0.75 * velocity_.y / kBallAheadOfAnkleM;
    push_pitch_ = Curve({{0.0, 0.0, 0.0},
                         {lowest_s() + 0.3 * push_s, 0.0, 0.0},
                         {toe_off_s(), -toe_off_pitch_rad_, -rate}});
    const double strike = (3.0 + 9.0 * length_m_) * kDegree;
    landing_pitch_ = Curve({{landing_s(), strike, -strike / 0.12}, {landing_s() + 0.09, 0.0, 0.0}});
  }

  // Plans the path of the centre of mass: down and forwards over the balls, along a parabola in
  // flight, and down again after landing.
  void PlanCentre() {
    const FigurePose standing = StandingPose();
    DVec3 rest = BodyCentre(figure_, standing);
    // Measures z from the balls of the feet.
    rest.z += MakeGaitState(0.0).pelvis_ahead_m - StandingBall(Foot::kLeft).z;

    // At toe-off, the centre of mass is ahead of the balls of the feet. It is as high as knees with
    // the bend kToeOffKneeRad allow.
    const double toe_off_z = -0.02 + 0.19 * length_m_;
    const double low = CentreHeightAtKnee(toe_off_s(), toe_off_z, kToeOffKneeRad);
    toe_off_centre_ = DVec3(0.0, low, toe_off_z);

    const double flight_s = landing_s() - toe_off_s();
    velocity_.z = (landing_z() - toe_off_z) / flight_s;
    const double landing_y = low + velocity_.y * flight_s - 0.5 * kGravity * flight_s * flight_s;
    const double falling = velocity_.y - kGravity * flight_s;
    const double crouch_y = rest.y - (0.12 + 0.08 * length_m_);
    centre_y_before_ =
        Curve({{0.0, rest.y, 0.0}, {lowest_s(), crouch_y, 0.0}, {toe_off_s(), low, velocity_.y}});
    centre_z_before_ = Curve({{0.0, rest.z, 0.0},
                              {lowest_s(), rest.z + 0.02, 0.05},
                              {toe_off_s(), toe_off_z, velocity_.z}});
    const double absorb_s = absorbed_s() - landing_s();
    const double absorb_m = 0.045 - 0.05 * falling;
    centre_y_after_ = Curve({{landing_s(), landing_y, falling},
                             {landing_s() + 0.35 * absorb_s, landing_y - 0.66 * absorb_m},
                             {absorbed_s(), landing_y - absorb_m, 0.0},
                             {end_s(), rest.y, 0.0}});
    centre_z_after_ = Curve({{landing_s(), landing_z(), velocity_.z},
                             {absorbed_s(), landing_z() + velocity_.z * absorb_s / 2.4, 0.0},
                             {end_s(), length_m_ + rest.z, 0.0}});
  }

  // In flight, length and angle of the line from hip to ankle are prescribed, so that the leg can
  // reach the foot.
  void PlanFlight() {
    const double h = 1e-4;
    const LegAim leave = AimAt(toe_off_s()), land = AimAt(landing_s());
    const LegAim before = AimAt(toe_off_s() - h), after = AimAt(landing_s() + h);
    const double flight_s = landing_s() - toe_off_s();
    const double tucked = std::min(leave.length_m, land.length_m) - 0.03 - 0.07 * length_m_;
    leg_length_ = Curve(
        {{0.0, leave.length_m, flight_s * std::min(0.8, (leave.length_m - before.length_m) / h)},
         {0.55, tucked, 0.0},
         {1.0, land.length_m, flight_s * std::max(-1.5, (after.length_m - land.length_m) / h)}});
    leg_angle_ = Curve({{0.0, leave.angle_rad, flight_s * (leave.angle_rad - before.angle_rad) / h},
                        {1.0, land.angle_rad, flight_s * (after.angle_rad - land.angle_rad) / h}});
    const double strike = landing_pitch_.At(landing_s());
    flight_pitch_ = Curve({{0.0, -toe_off_pitch_rad_, -0.5},
                           {0.12, -1.05 * toe_off_pitch_rad_},
                           {0.9, strike, 0.0},
                           {1.0, strike, 0.0}});
    flight_toe_bend_ = Curve({{0.0, toe_off_pitch_rad_, 0.0}, {0.5, 0.0, 0.0}});
  }

  struct LegAim {
    // Length and angle of the line from hip to ankle, seen from the side. A positive angle is
    // forward.
    double length_m, angle_rad;
  };

  [[nodiscard]] LegAim AimAt(double time_s) const {
    const FigurePose pose = PoseWithCentre(time_s, Centre(time_s));
    const DVec3 leg = PoseOfFoot(Foot::kLeft, time_s, pose).ankle_m -
                      pose.root_m;  // The hips are at the same z as the root.
    return {std::sqrt(leg.y * leg.y + leg.z * leg.z), Atan2(leg.z, -leg.y)};
  }

  // Returns z of the centre of mass at landing, which is behind the feet.
  [[nodiscard]] double landing_z() const { return 0.84 * length_m_ - 0.08; }

  // Returns the height of the centre of mass at which the knees are bent by `knee_rad`, if the
  // centre of mass is `z_m` ahead of the origin.
  [[nodiscard]] double CentreHeightAtKnee(double time_s, double z_m, double knee_rad) const {
    double low = 0.5, high = 1.5;
    for (int i = 0; i < 28; ++i) {
      const double y = 0.5 * (low + high);
      const FigurePose pose = PoseWithCentre(time_s, DVec3(0.0, y, z_m));
      const DVec3 hip = pose.root_m + pose.rotations[kHips] * DVec3(kHipHalfWidthM, 0.0, 0.0);
      const DVec3 leg = hip - PoseOfFoot(Foot::kLeft, time_s, pose).ankle_m;
      (std::sqrt(glm::dot(leg, leg)) < ReachAtKnee(knee_rad) ? low : high) = y;
    }
    return low;
  }

  [[nodiscard]] DVec3 Centre(double time_s) const {
    if (time_s <= toe_off_s())
      return {0.0, centre_y_before_.At(time_s), centre_z_before_.At(time_s)};
    if (time_s >= landing_s()) return {0.0, centre_y_after_.At(time_s), centre_z_after_.At(time_s)};
    const double t = time_s - toe_off_s();
    return toe_off_centre_ + velocity_ * t + DVec3(0.0, -0.5 * kGravity * t * t, 0.0);
  }

  [[nodiscard]] FootPose PoseOfFoot(Foot foot, double time_s, const FigurePose& pose) const {
    const DVec3 ball(StandingBall(foot).x, 0.0, 0.0);
    if (time_s <= toe_off_s()) {
      return FootOnGround(foot, ball, push_pitch_.At(time_s), 0.0);
    }
    if (time_s >= landing_s()) {
      return FootOnGround(foot, ball + DVec3(0.0, 0.0, length_m_), landing_pitch_.At(time_s), 0.0);
    }
    const double u = (time_s - toe_off_s()) / (landing_s() - toe_off_s());
    const double angle = leg_angle_.At(u), length = leg_length_.At(u);
    FootPose foot_pose;
    foot_pose.ankle_m = pose.root_m + DVec3(0.0, -length * Cos(angle), length * Sin(angle));
    foot_pose.pitch_rad = flight_pitch_.At(u);
    foot_pose.toe_pitch_rad = foot_pose.pitch_rad + flight_toe_bend_.At(u);
    foot_pose.ankle_m.x = FootOnGround(foot, ball, foot_pose.pitch_rad, 0.0).ankle_m.x;
    return foot_pose;
  }

  // Solves for the root iteratively, because the legs follow the root and move the centre of mass.
  // Legs on the ground compensate for a part of each shift, so each shift is 15 % larger than the
  // error.
  [[nodiscard]] FigurePose PoseWithCentre(double time_s, const DVec3& centre_m) const {
    UpperBody body = StandingUpperBody();
    body.thorax_lean = lean_.At(time_s);
    body.head_nod = 0.3 * body.thorax_lean;
    body.arm_flexion[0] = body.arm_flexion[1] = arm_.At(time_s);
    body.elbow_flexion[0] = body.elbow_flexion[1] = elbow_.At(time_s);
    const double tilt = 0.55 * (body.thorax_lean - StandingUpperBody().thorax_lean);
    FigurePose pose;
    pose.root_m = centre_m + DVec3(0.0, -0.05, 0.0);
    pose.rotations[kHips] = RotateX(tilt);
    SetUpperBody(body, 0.0, 0.0, tilt, pose);
    for (int i = 0; i < 60; ++i) {
      SolveLeg(Foot::kLeft, PoseOfFoot(Foot::kLeft, time_s, pose), pose);
      SolveLeg(Foot::kRight, PoseOfFoot(Foot::kRight, time_s, pose), pose);
      DVec3 miss = centre_m - BodyCentre(figure_, pose);
      miss.x =
          -pose.root_m.x;  // The jump is symmetric, so the sideways error equals that of the root.
      pose.root_m += 1.15 * miss;
      if (glm::dot(miss, miss) < 1e-20) break;
    }
    SolveLeg(Foot::kLeft, PoseOfFoot(Foot::kLeft, time_s, pose), pose);
    SolveLeg(Foot::kRight, PoseOfFoot(Foot::kRight, time_s, pose), pose);
    return pose;
  }

  const Skeleton& figure_;
  double length_m_;
  std::array<double, 6> times_{};
  Curve lean_, arm_, elbow_, push_pitch_, landing_pitch_;
  // Curves over the fraction of the flight, 0 to 1.
  Curve leg_length_, leg_angle_, flight_pitch_, flight_toe_bend_;
  Curve centre_y_before_, centre_z_before_, centre_y_after_, centre_z_after_;
  DVec3 velocity_ = DVec3(0.0), toe_off_centre_ = DVec3(0.0);
  double toe_off_pitch_rad_ = 0.0;
};

}  // namespace

RawExample MakeJump(const Skeleton& figure, double length_m) {
  STRIDEWIRE_CHECK(length_m > 0.0 && figure.joint_count() == kFigureJointCount);
  const JumpPath path(figure, length_m);
  RawExample example;
  example.keytimes_s = path.keytimes_s();
  example.parameters = {length_m};
  const int tenths = static_cast<int>(std::floor(length_m * 10.0 + 0.5));
  example.source =
      "generated jump " + std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " m";
  example.clip.fps = kClipFps;
  const int frames = static_cast<int>(std::floor(path.end_s() * kClipFps + 0.5)) + 1;
  example.clip.Resize(frames, figure.joint_count());
  const double start_z = path.At(0.0).root_m.z;
  for (int f = 0; f < frames; ++f) {
    FigurePose pose = path.At(f / kClipFps);
    pose.root_m.z -= start_z;
    StorePose(pose, example.clip.frame(f));
  }
  return example;
}

}  // namespace stridewire::builtin
