#include "synthetic_walker.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stridewire {
namespace {

constexpr double kThighM = 0.45;
constexpr double kShankM = 0.45;
constexpr double kAnkleHeightM = 0.08;
constexpr double kHipHeightM = 0.90;
constexpr double kHalfHipsM = 0.09;
constexpr double kLiftM = 0.12;
constexpr double kPi = std::numbers::pi;

Quat Pitch(double angle_rad) {
  return Quat(static_cast<float>(std::cos(0.5 * angle_rad)),
              static_cast<float>(std::sin(0.5 * angle_rad)), 0.0f, 0.0f);
}

double Ease(double u) { return 0.5 - 0.5 * std::cos(kPi * std::clamp(u, 0.0, 1.0)); }

double SideOf(int foot) { return foot == 0 ? 1.0 : -1.0; }

}  // namespace

Skeleton SyntheticWalker::MakeSkeleton() const {
  const auto s = static_cast<float>(leg_scale);
  Skeleton skeleton;
  skeleton.joints = {{"Hips", -1, Vec3(0.0f)}};
  for (const int f : {0, 1}) {
    const std::string side = f == 0 ? "Left" : "Right";
    const int hip = skeleton.joint_count();
    const auto x = static_cast<float>(SideOf(f) * kHalfHipsM);
    skeleton.joints.push_back({side + "UpLeg", 0, Vec3(x, 0.0f, 0.0f) * s});
    skeleton.joints.push_back({side + "Leg", hip, Vec3(0.0f, -0.45f, 0.0f) * s});
    skeleton.joints.push_back({side + "Foot", hip + 1, Vec3(0.0f, -0.45f, 0.0f) * s});
    skeleton.joints.push_back({side + "ToeBase", hip + 2, Vec3(0.0f, -0.05f, 0.14f) * s});
    skeleton.end_sites.push_back({hip + 3, Vec3(0.0f, 0.0f, 0.07f) * s});
    Leg& leg = skeleton.legs[f];
    leg.hip = hip;
    leg.knee = hip + 1;
    leg.ankle = hip + 2;
    leg.ball = hip + 3;
    leg.toe_tip_offset_m = Vec3(0.0f, 0.0f, 0.07f) * s;
  }
  skeleton.joints.push_back({"Spine", 0, Vec3(0.0f, 0.45f, 0.0f) * s});
  const int spine = skeleton.joint_count() - 1;
  skeleton.joints.push_back({"LeftArm", spine, Vec3(0.18f, 0.0f, 0.0f) * s});
  skeleton.joints.push_back({"RightArm", spine, Vec3(-0.18f, 0.0f, 0.0f) * s});
  skeleton.end_sites.push_back({spine + 1, Vec3(0.0f, -0.6f, 0.0f) * s});
  skeleton.end_sites.push_back({spine + 2, Vec3(0.0f, -0.6f, 0.0f) * s});
  return skeleton;
}

Capture SyntheticWalker::Render(std::vector<Instant> instants) const {
  for (Instant& now : instants) {
    for (DVec3* point : {&now.pelvis_m, &now.ankle_m[0], &now.ankle_m[1]}) {
      point->y += slope * point->z;
    }
  }
  Capture capture;
  capture.path = "synthetic.bvh";
  capture.skeleton = MakeSkeleton();
  capture.clip.fps = fps;
  capture.clip.Resize(static_cast<int>(instants.size()), capture.skeleton.joint_count());
  for (std::size_t i = 0; i < instants.size(); ++i) {
    const Instant& now = instants[i];
    const PoseSpan pose = capture.clip.frame(static_cast<int>(i));
    pose.root_position_m = Vec3(leg_scale * (start_m + RotateYaw(heading_rad, now.pelvis_m)));
    pose.rotations[0] = YawRotation(heading_rad + now.pelvis_yaw_rad);
    for (int f = 0; f < 2; ++f) {
      // Solves the leg in the frame of the pelvis without sideways motion: the hips are as wide as
      // the track.
      const DVec3 hip(SideOf(f) * kHalfHipsM, 0.0, 0.0);
      const DVec3 reach = RotateYaw(-now.pelvis_yaw_rad, now.ankle_m[f] - now.pelvis_m) - hip;
      const double distance = std::min(std::hypot(reach.y, reach.z), kThighM + kShankM - 1e-4);
      const double bend = std::acos(std::clamp(
          (kThighM * kThighM + distance * distance - kShankM * kShankM) / (2 * kThighM * distance),
          -1.0, 1.0));
      const double forward = std::atan2(reach.z, -reach.y);
      const double thigh = forward + bend;
      const double knee = std::acos(std::clamp(
          (kThighM * kThighM + kShankM * kShankM - distance * distance) / (2 * kThighM * kShankM),
          -1.0, 1.0));
      const double shank = thigh - (kPi - knee);
      const auto hip_joint = static_cast<std::size_t>(capture.skeleton.legs[f].hip);
      pose.rotations[hip_joint] = Pitch(-thigh);
      pose.rotations[hip_joint + 1] = Pitch(thigh - shank);
      pose.rotations[hip_joint + 2] = Pitch(shank) * YawRotation(-now.pelvis_yaw_rad);
    }
  }
  return capture;
}

Capture SyntheticWalker::Walk(const std::vector<WalkerStep>& steps) const {
  truth = {};
  DVec3 feet[2] = {{kHalfHipsM, kAnkleHeightM, 0.0}, {-kHalfHipsM, kAnkleHeightM, 0.0}};
  std::vector<Instant> instants;
  const auto middle = [&] { return 0.5 * (feet[0] + feet[1]); };
  const auto hold = [&](double seconds) {
    Instant now;
    now.pelvis_m = middle() + DVec3(0.0, kHipHeightM - kAnkleHeightM - 0.04, 0.0);
    now.ankle_m[0] = feet[0];
    now.ankle_m[1] = feet[1];
    for (int i = 0; i < std::lround(seconds * fps); ++i) instants.push_back(now);
  };
  hold(stand_s);
  // Over a step, including half of each double support, the pelvis moves between the centres of the
  // feet.
  double stride_phase = 0.0;
  for (const WalkerStep& step : steps) {
    const int moving = static_cast<int>(step.foot);
    const DVec3 from = feet[moving];
    const DVec3 middle_from = middle();
    const DVec3& fixed = feet[1 - moving];
    DVec3 to(from.x, fixed.y + step.rise_m, fixed.z + step.length_m);
    const int half = static_cast<int>(std::lround(0.5 * double_support_s * fps));
    const int swing = static_cast<int>(std::lround(swing_s * fps));
    const DVec3 middle_to = 0.5 * (to + fixed);
    truth.toe_off_s.push_back((static_cast<double>(instants.size()) + half) / fps);
    truth.heel_strike_s.push_back((static_cast<double>(instants.size()) + half + swing) / fps);
    const int count = 2 * half + swing;
    for (int i = 0; i < count; ++i) {
      const double u = static_cast<double>(i) / count;
      const double v = Ease(static_cast<double>(i - half) / swing);
      Instant now;
      now.pelvis_m = middle_from + u * (middle_to - middle_from) +
                     DVec3(0.0, kHipHeightM - kAnkleHeightM - 0.04, 0.0);
      now.ankle_m[1 - moving] = fixed;
      now.ankle_m[moving] = from + v * (to - from) + DVec3(0.0, kLiftM * std::sin(kPi * v), 0.0);
      now.pelvis_yaw_rad = pelvis_swing_rad * std::sin(kPi * (stride_phase + u));
      instants.push_back(now);
    }
    stride_phase += 1.0;
    feet[moving] = to;
  }
  hold(stand_s);
  return Render(std::move(instants));
}

Capture SyntheticWalker::Jump(double length_m) const {
  truth = {};
  constexpr double kG = 9.81;
  constexpr double kFlightS = 0.4;
  constexpr double kCrouchM = 0.25;
  constexpr double kLeanM = 0.1;
  const double up = 0.5 * kG * kFlightS;
  const double ahead = (length_m - 2.0 * kLeanM) / kFlightS;
  constexpr double kDownS = 0.4;
  constexpr double kPushS = 0.25;
  const double total = 2.0 * stand_s + 2.0 * (kDownS + kPushS) + kFlightS;
  // Cubic that starts at rest and reaches `value` with `speed` after `duration`.
  const auto push = [](double t, double duration, double value, double speed) {
    const double s = t / duration;
    return s * s * (value * (3.0 - 2.0 * s) + speed * duration * (s - 1.0));
  };
  const double y0 = kHipHeightM - 0.04;
  std::vector<Instant> instants;
  const auto frames = static_cast<int>(std::lround(total * fps));
  for (int i = 0; i < frames; ++i) {
    const double t = i / fps - stand_s;
    Instant now;
    double y = y0, z = 0.0, lift = 0.0, foot_z = 0.0;
    const double half = 0.5 * (2.0 * (kDownS + kPushS) + kFlightS);
    const bool second = t > half;
    const double r = second ? 2.0 * half - t : t;  // The landing is the reversed take-off.
    if (r > 0.0 && r <= kDownS) {
      y = y0 - kCrouchM * Ease(r / kDownS);
    } else if (r > kDownS && r <= kDownS + kPushS) {
      y = y0 - kCrouchM + push(r - kDownS, kPushS, kCrouchM, up);
      z = push(r - kDownS, kPushS, kLeanM, ahead);
    } else if (r > kDownS + kPushS) {
      const double f = r - kDownS - kPushS;
      y = y0 + up * f - 0.5 * kG * f * f;
      z = kLeanM + ahead * f;
      lift = up * f - 0.5 * kG * f * f;
      foot_z = length_m * f / kFlightS;
    }
    if (second) {
      z = length_m - z;
      foot_z = length_m - foot_z;
    }
    now.pelvis_m = DVec3(0.0, y, z);
    for (int k = 0; k < 2; ++k) {
      now.ankle_m[k] = DVec3(SideOf(k) * kHalfHipsM, kAnkleHeightM + lift, foot_z);
    }
    instants.push_back(now);
  }
  truth.toe_off_s = {stand_s + kDownS + kPushS};
  truth.heel_strike_s = {stand_s + kDownS + kPushS + kFlightS};
  return Render(std::move(instants));
}

Capture SyntheticWalker::Run(int steps) const {
  constexpr double kSpeed = 2.7;
  constexpr double kStanceS = 0.2;
  constexpr double kFlightS = 0.1;
  constexpr double kPeriodS = kStanceS + kFlightS;
  truth = {};
  std::vector<Instant> instants;
  const auto frames = static_cast<int>(std::lround(steps * kPeriodS * fps));
  for (int i = 0; i < frames; ++i) {
    const double t = i / fps;
    const double phase = std::fmod(t, kPeriodS);
    const double air = phase - kStanceS;  // Positive in flight.
    Instant now;
    const double bounce =
        air > 0.0 ? 0.5 * 9.81 * air * (kFlightS - air) : -0.03 * std::sin(kPi * phase / kStanceS);
    now.pelvis_m = DVec3(0.0, kHipHeightM - 0.06 + bounce, kSpeed * t);
    for (int f = 0; f < 2; ++f) {
      // Foot f stands in every second period. It stands where the pelvis is in the middle of its
      // stance.
      const double own = t - f * kPeriodS;
      const double stride = std::floor(own / (2.0 * kPeriodS));
      const double since = own - 2.0 * kPeriodS * stride;
      const double stance_z = kSpeed * ((2.0 * stride + f) * kPeriodS + 0.5 * kStanceS);
      const double v = Ease((since - kStanceS) / (2.0 * kPeriodS - kStanceS));
      now.ankle_m[f] = DVec3(SideOf(f) * kHalfHipsM, kAnkleHeightM + 0.25 * std::sin(kPi * v),
                             stance_z + 2.0 * kPeriodS * kSpeed * v);
    }
    instants.push_back(now);
  }
  return Render(std::move(instants));
}

Capture SyntheticWalker::Stand(double seconds) const {
  SyntheticWalker still = *this;
  still.stand_s = 0.5 * seconds;
  return still.Walk({});
}

void RemoveTravel(Capture& capture) {
  for (Vec3& position : capture.clip.root_positions_m) position.z = 0.0f;
}

void PrependStillPose(int frames, double lower_m, Capture& capture) {
  const Clip motion = capture.clip;
  capture.clip.Resize(frames + motion.frame_count(), motion.joint_count);
  for (int f = 0; f < capture.clip.frame_count(); ++f) {
    const PoseSpan to = capture.clip.frame(f);
    const ConstPoseSpan from = motion.frame(std::max(0, f - frames));
    to.root_position_m = from.root_position_m;
    if (f < frames) {
      to.root_position_m.y -= static_cast<float>(lower_m);
      std::ranges::fill(to.rotations, kIdentityQuat);
    } else {
      std::ranges::copy(from.rotations, to.rotations.begin());
    }
  }
}

}  // namespace stridewire
