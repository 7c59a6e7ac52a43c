#include "offline/complete/step_maker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <ranges>
#include <utility>

#include "base/check.h"
#include "base/easing.h"
#include "offline/base/moving_window.h"
#include "offline/build/bend_toes.h"
#include "offline/builtin/gait_state.h"
#include "offline/builtin/leg_ik.h"
#include "offline/builtin/swing_detour.h"
#include "offline/extract/extract.h"
#include "runtime/library/keytimes.h"

namespace stridewire::complete {
namespace {

// Keytimes of steps forward are multiples of 1 / kFps.
constexpr double kFps = 120.0;
// The reach of the legs is checked about this many times per second.
constexpr double kReachFps = 60.0;

// Steps that start in a stand begin with a weight shift, which takes time because the body has no
// momentum. Steps that end in a stand end with settling.
constexpr double kWeightShiftS = 0.28;
constexpr double kSettleS = 0.24;
// The same durations for steps that begin and end in a stand, such as turns on the spot.
constexpr double kWeightShiftInPlaceS = 0.18;
constexpr double kSettleInPlaceS = 0.15;
constexpr double kMinSwingS = 0.36;
constexpr double kMaxSwingS = 0.62;
// A step backward takes longer than the same step forward, by this factor.
constexpr double kBackwardSlowdown = 1.15;

// Generic times between which the moving foot moves to its new place. The foot leaves the ground a
// little before the toe-off detected in the captures, and rests a little after the heel-strike.
constexpr double kSwingBegin = 0.92;
constexpr double kSwingEnd = 2.06;
// SwungAt limits the progress of the foot to that of the captured foot. The limit fades in and out
// during this fraction of the swing at each end.
constexpr double kSwingFade = 0.2;
// The limit is a smooth minimum. This is the width of its rounded corner, as a fraction of the way
// between the footprints.
constexpr double kSwingRounding = 0.02;
// Minimum weight of the captured stride in the middle of a swing, for the rotation and the height
// of the foot. It prevents feet from dragging along the ground in short steps.
constexpr double kMinSwingShare = 0.45;
// Minimum heights of the ball and of the toe tip above their heights in the stand pose, from 30 %
// of the swing on. The foot is lifted by up to kMaxLiftM to reach them.
constexpr double kClearanceM = 0.026;
constexpr double kTipClearanceM = 0.022;
constexpr double kMaxLiftM = 0.12;
constexpr builtin::DetourRange kDetours = {.max_m = 0.35, .step_m = 0.01, .clearance_m = 0.09};

// Distance by which the weight shifts towards the fixed foot in steps from and to a stand, as a
// fraction of the distance to that foot.
constexpr double kSwayShare = 0.45;
// Maximum weight of the captured stride. Weights above 1 extrapolate it.
constexpr double kMaxShare = 1.15;
// Maximum distance from hip to ankle, as a fraction of the leg length. If the legs of the stand
// pose are straighter, their extension is the maximum.
constexpr double kMaxExtension = 0.996;
// StanceRiseAt fades in during this fraction of the step at its start, and out at its end.
constexpr double kStanceFade = 0.35;

// Most steps do not turn, so these functions avoid trigonometry for the angle 0.
DVec3 Turned(double yaw_rad, const DVec3& v) { return yaw_rad == 0.0 ? v : RotateYaw(yaw_rad, v); }
DQuat Turned(double yaw_rad, const DQuat& q) {
  return yaw_rad == 0.0 ? q : DQuat(YawRotation(yaw_rad)) * q;
}

std::size_t Index(Foot foot) { return static_cast<std::size_t>(foot); }

// A cubic curve with the given positions and velocities at both ends.
struct HermiteCurve {
  DVec3 from = DVec3(0.0);
  DVec3 from_velocity = DVec3(0.0);
  DVec3 to = DVec3(0.0);
  DVec3 to_velocity = DVec3(0.0);
  double duration_s = 1.0;

  [[nodiscard]] DVec3 At(double time_s) const {
    const double u = std::clamp(time_s / duration_s, 0.0, 1.0);
    const double u2 = u * u;
    const double u3 = u2 * u;
    return (2.0 * u3 - 3.0 * u2 + 1.0) * from +
           duration_s * ((u3 - 2.0 * u2 + u) * from_velocity + (u3 - u2) * to_velocity) +
           (3.0 * u2 - 2.0 * u3) * to;
  }
  [[nodiscard]] DVec3 VelocityAt(double time_s) const {
    const double u = std::clamp(time_s / duration_s, 0.0, 1.0);
    const double u2 = u * u;
    return 6.0 * (u - u2) / duration_s * (to - from) + (3.0 * u2 - 4.0 * u + 1.0) * from_velocity +
           (3.0 * u2 - 2.0 * u) * to_velocity;
  }
};

// Generates one step. First, it searches for the sideways detour of the swinging foot around the
// other foot, for its lift, and for the lowering of the root. For these it evaluates only feet,
// hips and root. Then it generates the frames.
class StepGenerator {
 public:
  StepGenerator(const Person& person, Foot moving, const StepFeet& feet)
      : person_(person),
        stride_(person.strides[Index(moving)]),
        moving_(moving),
        fixed_(OtherFoot(moving)),
        feet_(feet),
        reach_m_{ReachOf(Foot::kLeft), ReachOf(Foot::kRight)} {
    const double stand_z = person.StandVector(moving).z;
    start_share_ = Share((stand_z - feet.start_m.z) / (stand_z + stride_.start_length_m));
    end_share_ = Share((feet.end_m.z - stand_z) / (stride_.end_length_m - stand_z));
    in_stride_ = std::min(1.0, 2.0 * std::min(start_share_, end_share_));
    outward_ = RotateYaw(0.5 * feet.turn_rad, DVec3(SideSign(moving), 0.0, 0.0));
    stand_leg_m_ = LegLength(person.skeleton, person.rig, person.stand, fixed_);
    SetTiming();
    PlanRoot();
    for (const LegRig::Side& side : person.rig.sides) {
      for (std::size_t i = 0; i < side.chain.size(); ++i) {
        if (static_cast<int>(i) >= side.hip && static_cast<int>(i) <= side.ankle) continue;
        reach_joints_.push_back(static_cast<std::size_t>(side.chain[i]));
      }
    }
  }

  [[nodiscard]] std::vector<double> Keytimes() const {
    return {0.0, toe_off_s_, strike_s_, end_s_};
  }

  // Returns a clip with a frame at each of these times, which are between 0 and the last keytime.
  // If they are in decreasing order, the clip is the step in reverse. Does not set the frame rate.
  Clip Run(std::span<const double> times_s) {
    PlanSwing();
    PlanLowering();
    Clip clip;
    const auto frames = static_cast<int>(times_s.size());
    clip.Resize(frames, person_.skeleton.joint_count());
    std::vector<DVec3> roots_m;
    for (int f = 0; f < frames; ++f) {
      roots_m.push_back(SetRotations(times_s[static_cast<std::size_t>(f)], clip.frame(f)));
    }
    const DVec3 origin(roots_m.front().x, 0.0, roots_m.front().z);
    for (int f = 0; f < frames; ++f) {
      const auto i = static_cast<std::size_t>(f);
      clip.root_positions_m[i] = Vec3(roots_m[i] - origin);
    }
    MakeSignContinuous(clip);
    return clip;
  }

 private:
  // State of a foot at one time. Horizontal positions are relative to the ball of the fixed foot,
  // heights to the ground.
  struct FootState {
    DQuat ankle_rotation;       // World rotation of the ankle.
    DVec3 ball_m = DVec3(0.0);  // Without the detour and the lift, which BallOf adds.
    double swing = 0.0;         // Factor of the detour and the lift.
    DVec3 ankle_to_ball = DVec3(0.0);
    DVec3 ankle_to_tip = DVec3(0.0);
    DVec3 ankle_to_heel = DVec3(0.0);
  };

  static double Share(double share) { return std::clamp(share, 0.0, kMaxShare); }
  static double ToFrames(double time_s) { return std::floor(time_s * kFps + 0.5) / kFps; }

  // Returns the factor by which a step takes longer than the captured stride if its length is the
  // fraction `share` of the length of that stride. People take fewer steps per minute if the steps
  // are shorter (see builtin::SteadyStepTime). Steps of people who walk slowly are not slowed down
  // further: none takes longer than the slowest step of the generated library, unless the captured
  // stride does.
  [[nodiscard]] double Slowdown(double share) const {
    const double full_m = 0.5 * (stride_.start_length_m + stride_.end_length_m);
    const double slowdown =
        builtin::SteadyStepTime(std::min(share, 1.0) * full_m) / builtin::SteadyStepTime(full_m);
    const double slowest = builtin::SteadyStepTime(0.0) / stride_.keytimes_s.back();
    return std::min(slowdown, std::max(slowest, 1.0));
  }

  void SetTiming() {
    const double slowdown = 1.0 + in_stride_ * (Slowdown(0.5 * (start_share_ + end_share_)) - 1.0);
    std::array<double, kIntervals + 1> keys = stride_.keytimes_s;
    for (double& key : keys) key *= slowdown;
    const auto mix = [](double stand, double stride, double share) {
      return stand + std::min(1.0, 2.0 * share) * (stride - stand);
    };
    const double in_place = 1.0 - std::min(1.0, 2.0 * std::max(start_share_, end_share_));
    const double shift_s = kWeightShiftS + in_place * (kWeightShiftInPlaceS - kWeightShiftS);
    const double settle_s = kSettleS + in_place * (kSettleInPlaceS - kSettleS);
    toe_off_s_ = ToFrames(mix(shift_s, keys[1], start_share_));
    const double swing_s = std::clamp(keys[2] - keys[1], kMinSwingS, kMaxSwingS);
    strike_s_ = toe_off_s_ + ToFrames(swing_s);
    end_s_ = strike_s_ + ToFrames(mix(settle_s, keys[3] - keys[2], end_share_));
  }

  [[nodiscard]] double GenericAt(double time_s) const {
    if (time_s <= toe_off_s_) return time_s / toe_off_s_;
    if (time_s <= strike_s_) return 1.0 + (time_s - toe_off_s_) / (strike_s_ - toe_off_s_);
    return 2.0 + std::min(1.0, (time_s - strike_s_) / (end_s_ - strike_s_));
  }
  // Returns the time in the captured stride at a generic time.
  [[nodiscard]] double CapturedTimeAt(double generic) const {
    const auto i = static_cast<std::size_t>(std::min(2.0, std::floor(generic)));
    const auto& keys = stride_.keytimes_s;
    return keys[i] + (generic - static_cast<double>(i)) * (keys[i + 1] - keys[i]);
  }
  [[nodiscard]] double ShareAt(double time_s) const {
    return start_share_ + (end_share_ - start_share_) * SmootherStep(time_s / end_s_);
  }
  // Weight of the captured stride for the rotations of the root and the upper body. It decreases
  // less than ShareAt, because people move their pelvis, trunk and arms almost as far in short
  // strides as in long ones (decision 0035).
  [[nodiscard]] double BodyShareAt(double time_s) const {
    const double share = std::min(1.0, ShareAt(time_s));
    return share * (2.0 - share);
  }
  [[nodiscard]] double HeadingAt(double time_s) const {
    return feet_.turn_rad * SmootherStep(time_s / end_s_);
  }
  // Progress of the swing, 0 to 1.
  static double SwingAt(double generic) {
    return std::clamp((generic - kSwingBegin) / (kSwingEnd - kSwingBegin), 0.0, 1.0);
  }
  // Weight of the captured stride for the swinging foot, at least kMinSwingShare in mid-swing.
  [[nodiscard]] double SwingShareAt(double time_s) const {
    const double share = ShareAt(time_s);
    return share + std::max(0.0, kMinSwingShare - share) * Bump(SwingAt(GenericAt(time_s)));
  }

  // Sets the rotations of all joints at a time, and returns the root relative to the fixed ball.
  DVec3 SetRotations(double time_s, PoseSpan pose) {
    stride_.Sample(GenericAt(time_s), sample_);
    SetPosture(time_s, pose);
    DVec3 root = RootAt(time_s);
    root.y -= LoweredAt(time_s);
    LegPose leg;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const FootState state = FootAt(foot, time_s);
      EvaluateLeg(person_.skeleton, person_.rig, pose, foot, leg);
      SolveLeg(person_.rig, foot, leg, Vec3(TargetOf(state).ankle_m - root),
               Quat(state.ankle_rotation), pose);
      pose.root_position_m = Vec3(root);
      RaiseToeTip(person_.skeleton, person_.rig, foot,
                  person_.rig.side(foot).toe_height_m - kMaxToeSinkM, pose);
    }
    return root;
  }

  // The following functions expect that `sample_` is the captured stride at `time_s`.

  [[nodiscard]] FootState FootAt(Foot foot, double time_s) const {
    FootState state;
    state.ankle_rotation = AnkleRotationAt(foot, time_s);
    state.ball_m = PlainBallAt(foot, time_s);
    state.swing = foot == fixed_ ? 0.0 : Bump(SwingAt(GenericAt(time_s)));
    // Follows the joints from the ankle to the ball.
    const LegRig::Side& side = person_.rig.side(foot);
    const double share = LegShareAt(foot, time_s);
    DVec3 position(0.0);
    DQuat rotation = state.ankle_rotation;
    for (std::size_t i = static_cast<std::size_t>(side.ankle) + 1; i < side.chain.size(); ++i) {
      const auto j = static_cast<std::size_t>(side.chain[i]);
      position += rotation * DVec3(person_.skeleton.joints[j].offset_m);
      rotation = rotation * MixedRotation(j, share);
    }
    const ::stridewire::Leg& leg = person_.skeleton.leg(foot);
    state.ankle_to_ball = position + rotation * DVec3(leg.ball_offset_m);
    state.ankle_to_tip = position + rotation * DVec3(leg.toe_tip_offset_m);
    state.ankle_to_heel = state.ankle_rotation * DVec3(side.heel_m);
    return state;
  }
  // Weight of the captured stride for the joints of a leg. The moving leg has the weight of the
  // swinging foot, which is larger during the swing, so that it bends in the plane of the capture.
  [[nodiscard]] double LegShareAt(Foot foot, double time_s) const {
    return std::min(1.0, foot == moving_ ? SwingShareAt(time_s) : ShareAt(time_s));
  }

  void PlanRoot() {
    const PostureSample& first = stride_.points.front();
    const PostureSample& last = stride_.points.back();
    captured_ = {first.root_m, stride_.MeasuredStartVelocity(), last.root_m,
                 stride_.MeasuredEndVelocity(), stride_.keytimes_s[3]};
    const auto state = [&](const PostureSample& stride, const DVec3& feet_m, double share) {
      DVec3 from_feet = RootFromFeet(stride) - RootFromFeet(person_.stand);
      // With straight legs, the body is lower by an amount that is proportional to the square of
      // the distance between the feet.
      from_feet *= DVec3(share, share * share, share);
      from_feet += RootFromFeet(person_.stand);
      return 0.5 * DVec3(feet_m.x, 0.0, feet_m.z) + from_feet;
    };
    root_.from = state(first, feet_.start_m, start_share_);
    root_.to = RotateYaw(feet_.turn_rad, state(last, feet_.end_m, end_share_));
    root_.from_velocity = start_share_ / Slowdown(start_share_) * stride_.start_velocity;
    root_.to_velocity =
        RotateYaw(feet_.turn_rad, end_share_ / Slowdown(end_share_) * stride_.end_velocity);
    // A cubic curve would overshoot if it had to cover a short distance from a high speed.
    const auto limit = [&](DVec3& velocity) {
      const DVec3 path = root_.to - root_.from;
      const double max_speed = 3.0 * std::hypot(path.x, path.z) / end_s_;
      const double speed = std::hypot(velocity.x, velocity.z);
      if (speed > max_speed && speed > 0.0) velocity *= max_speed / speed;
    };
    limit(root_.from_velocity);
    limit(root_.to_velocity);
    root_.duration_s = end_s_;
  }

  // Returns the position of the root without the lowering that lets the legs reach the feet.
  [[nodiscard]] DVec3 RootAt(double time_s) const {
    const double generic = GenericAt(time_s);
    const double share = std::min(1.0, ShareAt(time_s));
    const double captured_s = CapturedTimeAt(generic);
    DVec3 deviation = share * (sample_.root_m - captured_.At(captured_s));
    const double heading = HeadingAt(time_s);
    // The amplitude of the pelvis's forward oscillation is proportional to the walking speed. If
    // the root is slower than in a blend of the stand and the captured stride, the deviation is
    // reduced accordingly. It is never increased.
    const double usual_m_s = share * captured_.VelocityAt(captured_s).z;
    const double speed_m_s = Turned(-heading, root_.VelocityAt(time_s)).z;
    if (usual_m_s > 0.0) deviation.z *= std::clamp(speed_m_s / usual_m_s, 0.0, 1.0);
    // The ball of the fixed foot is the origin, and the root is about midway between the feet. In
    // strides, momentum carries the body, so the weight shifts less towards the fixed foot.
    const double to_fixed_m = -0.5 * (feet_.start_m.x + feet_.end_m.x) * 0.5;
    const DVec3 sway(kSwayShare * (1.0 - share) * to_fixed_m * Bump(time_s / end_s_), 0.0, 0.0);
    DVec3 root = root_.At(time_s) + Turned(heading, deviation + sway);
    root.y += StanceRiseAt(time_s, root);
    return root;
  }

  // Returns how far the root is raised in the middle of the step so that the leg of the fixed foot
  // bends as in a blend of the stand and the captured stride. The path of the root does not depend
  // on the leg. Without a correction, the leg would therefore bend further in short steps. Starts
  // and stops are not corrected, because a rise would make the pelvis accelerate more.
  [[nodiscard]] double StanceRiseAt(double time_s, const DVec3& root) const {
    const double fade_s = kStanceFade * end_s_;
    const double share = std::min(1.0, ShareAt(time_s));
    const double leg_m = stand_leg_m_ + share * (stride_.LegAt(GenericAt(time_s)) - stand_leg_m_);
    const DVec3 hip = root + HipAt(fixed_, time_s, RootRotationAt(time_s));
    const double rise_m =
        builtin::HighestHipM(hip, TargetOf(FootAt(fixed_, time_s)).ankle_m, leg_m) - hip.y;
    return in_stride_ * rise_m * SmoothStep(std::min(time_s, end_s_ - time_s) / fade_s);
  }

  // Returns the fraction of the way between its footprints that the moving foot has covered. In
  // strides, the foot never covers a larger fraction than the captured foot has covered, except
  // near both ends of the swing. Late in the swing, the leg could otherwise not reach the foot, and
  // the root would have to be lowered. Starts and stops have no such limit, because it would make
  // the pelvis accelerate more.
  [[nodiscard]] double SwungAt(double time_s) const {
    const auto f = Index(moving_);
    const double swing = SwingAt(GenericAt(time_s));
    const double from_m = stride_.points.front().balls_m[f].z;
    const double to_m = stride_.points.back().balls_m[f].z;
    const double captured = (sample_.balls_m[f].z - from_m) / (to_m - from_m);
    const double plain = SmootherStep(swing);
    const double weight = in_stride_ * SmoothStep(std::min(swing, 1.0 - swing) / kSwingFade);
    const double lead = captured - plain;
    const double lag = 0.5 * (lead - std::sqrt(lead * lead + kSwingRounding * kSwingRounding));
    return plain + weight * lag;
  }

  [[nodiscard]] DVec3 PlainBallAt(Foot foot, double time_s) const {
    const auto f = Index(foot);
    const double share = foot == moving_ ? SwingShareAt(time_s) : ShareAt(time_s);
    const double stand_y = person_.stand.balls_m[f].y;
    DVec3 ball(0.0, stand_y + share * (sample_.balls_m[f].y - stand_y), 0.0);
    if (foot == fixed_) return ball;
    const DVec3 end = Turned(feet_.turn_rad, feet_.end_m);
    const DVec3 place = feet_.start_m + SwungAt(time_s) * (end - feet_.start_m);
    ball.x = place.x;
    ball.z = place.z;
    return ball;
  }
  // Returns the position of the ball with the detour and the lift.
  [[nodiscard]] DVec3 BallOf(const FootState& foot) const {
    return foot.ball_m + foot.swing * (detour_m_ * outward_ + DVec3(0.0, lift_m_, 0.0));
  }

  // Yaw of a foot relative to the heading at the start of the step.
  [[nodiscard]] double FootYawAt(Foot foot, double time_s) const {
    if (foot == fixed_) return 0.0;
    return feet_.turn_rad * SmootherStep((SwingAt(GenericAt(time_s)) - 0.08) / 0.84);
  }
  [[nodiscard]] DQuat AnkleRotationAt(Foot foot, double time_s) const {
    const double share = foot == moving_ ? SwingShareAt(time_s) : ShareAt(time_s);
    const auto f = Index(foot);
    return Turned(FootYawAt(foot, time_s),
                  Blend(person_.stand.ankles[f], sample_.ankles[f], std::min(1.0, share)));
  }

  // Returns a blend of the rotations of a joint in the stand pose and in the captured stride.
  // `share` is the weight of the stride. The turn of the step and inverse kinematics are not
  // included.
  [[nodiscard]] DQuat MixedRotation(std::size_t joint, double share) const {
    return Blend(person_.stand.rotations[joint], sample_.rotations[joint], share);
  }
  [[nodiscard]] DQuat RootRotationAt(double time_s) const {
    return Turned(HeadingAt(time_s), MixedRotation(0, BodyShareAt(time_s)));
  }

  // Sets the rotations of all joints before inverse kinematics.
  void SetPosture(double time_s, PoseSpan posture) {
    const double share = BodyShareAt(time_s);
    std::vector<DQuat>& mixed = mixed_;
    mixed.resize(posture.rotations.size());
    for (std::size_t j = 0; j < mixed.size(); ++j) mixed[j] = MixedRotation(j, share);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const double leg_share = LegShareAt(foot, time_s);
      for (const int joint : person_.rig.side(foot).chain) {
        const auto j = static_cast<std::size_t>(joint);
        mixed[j] = MixedRotation(j, leg_share);
      }
    }
    mixed[0] = RootRotationAt(time_s);
    const double heading = HeadingAt(time_s);
    // If a foot is turned relative to the body, its leg turns by half the angle.
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const double half = 0.5 * (FootYawAt(foot, time_s) - heading);
      if (half == 0.0) continue;
      const auto& side = person_.rig.side(foot);
      const auto hip = static_cast<std::size_t>(side.chain[static_cast<std::size_t>(side.hip)]);
      DQuat above(1.0, 0.0, 0.0, 0.0);
      for (int i = 0; i < side.hip; ++i) {
        above = above * mixed[static_cast<std::size_t>(side.chain[static_cast<std::size_t>(i)])];
      }
      mixed[hip] = glm::conjugate(above) * DQuat(YawRotation(half)) * above * mixed[hip];
    }
    for (std::size_t j = 0; j < mixed.size(); ++j) {
      posture.rotations[j] = Normalise(Quat(mixed[j]));
    }
  }

  struct LegTarget {
    DVec3 ankle_m = DVec3(0.0);  // Relative to the fixed ball.
    DVec3 tip_m = DVec3(0.0);
    DVec3 heel_m = DVec3(0.0);
  };

  [[nodiscard]] LegTarget TargetOf(const FootState& foot) const {
    LegTarget target;
    target.ankle_m = BallOf(foot) - foot.ankle_to_ball;
    target.tip_m = target.ankle_m + foot.ankle_to_tip;
    target.heel_m = target.ankle_m + foot.ankle_to_heel;
    return target;
  }

  // Returns the horizontal distance between two feet, each of which is a line from heel to toe tip.
  [[nodiscard]] double Distance(const FootState& one, const FootState& other) const {
    const LegTarget from = TargetOf(one);
    const LegTarget to = TargetOf(other);
    double nearest = kDetours.max_m;
    for (int i = 0; i <= 4; ++i) {
      for (int k = 0; k <= 4; ++k) {
        const DVec3 a = from.heel_m + 0.25 * i * (from.tip_m - from.heel_m);
        const DVec3 b = to.heel_m + 0.25 * k * (to.tip_m - to.heel_m);
        nearest = std::min(nearest, std::hypot(a.x - b.x, a.z - b.z));
      }
    }
    return nearest;
  }

  // Returns the state of a foot in the frame nearest to a fraction of the swing, 0 to 1.
  FootState FootInSwing(Foot foot, double part) {
    const double time_s = ToFrames(toe_off_s_ + part * (strike_s_ - toe_off_s_));
    stride_.Sample(GenericAt(time_s), reach_joints_, sample_);
    return FootAt(foot, time_s);
  }

  // Plans the detour and the lift of the swinging foot. If the step turns, the foot moves around
  // the fixed one. The lift is the smallest one at which the foot clears the ground. Both depend
  // continuously on the captures. Otherwise, rounding errors could change steps visibly.
  void PlanSwing() {
    if (feet_.turn_rad != 0.0) PlanDetour();
    const LegRig::Side& side = person_.rig.side(moving_);
    const double ball_y = person_.stand.balls_m[Index(moving_)].y;
    double lift_m = 0.0;
    for (int i = 4; i <= 17; ++i) {
      const double part = 0.05 * i;
      const bool is_early = part < 0.3;
      const FootState foot = FootInSwing(moving_, part);
      const double ball_m = ball_y + (is_early ? 0.0 : kClearanceM) - BallOf(foot).y;
      const double tip_m =
          side.toe_height_m + (is_early ? 0.0 : kTipClearanceM) - TargetOf(foot).tip_m.y;
      lift_m = std::max(lift_m, std::max(ball_m, tip_m) / foot.swing);
    }
    lift_m_ = std::min(lift_m, kMaxLiftM);
  }

  void PlanDetour() {
    std::vector<std::pair<FootState, FootState>> feet;
    for (int i = 1; i < 10; ++i) {
      feet.emplace_back(FootInSwing(moving_, 0.1 * i), FootInSwing(fixed_, 0.1 * i));
    }
    detour_m_ = builtin::FindExactDetour(kDetours, [&](double detour_m) {
      detour_m_ = detour_m;
      double nearest = kDetours.max_m;
      for (const auto& [swinging, still] : feet) {
        nearest = std::min(nearest, Distance(swinging, still));
      }
      return nearest;
    });
  }

  // Returns the position of a hip relative to the root, whose rotation is `rotation`.
  [[nodiscard]] DVec3 HipAt(Foot foot, double time_s, DQuat rotation) const {
    const LegRig::Side& side = person_.rig.side(foot);
    const double leg_share = LegShareAt(foot, time_s);
    DVec3 position(0.0);
    for (int i = 1; i <= side.hip; ++i) {
      const auto j = static_cast<std::size_t>(side.chain[static_cast<std::size_t>(i)]);
      position += rotation * DVec3(person_.skeleton.joints[j].offset_m);
      if (i < side.hip) rotation = rotation * MixedRotation(j, leg_share);
    }
    return position;
  }

  // Returns by how much the root must be lowered for the legs to reach the feet.
  [[nodiscard]] double MissingReachAt(double time_s) const {
    double missing = 0.0;
    const DVec3 root = RootAt(time_s);
    const DQuat root_rotation = RootRotationAt(time_s);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const DVec3 hip = root + HipAt(foot, time_s, root_rotation);
      const double highest_m =
          builtin::HighestHipM(hip, TargetOf(FootAt(foot, time_s)).ankle_m, reach_m_[Index(foot)]);
      missing = std::max(missing, hip.y - highest_m);
    }
    return missing;
  }

  // Returns the maximum distance from hip to ankle that a leg may have (kMaxExtension).
  [[nodiscard]] double ReachOf(Foot foot) const {
    LegPose leg;
    EvaluateLeg(person_.skeleton, person_.rig, ToPose(person_.stand), foot, leg);
    const LegRig::Side& side = person_.rig.side(foot);
    const Vec3 reach = leg.positions_m[static_cast<std::size_t>(side.ankle)] -
                       leg.positions_m[static_cast<std::size_t>(side.hip)];
    const double standing = glm::length(reach) / (side.thigh_m + side.shank_m);
    return std::max(kMaxExtension, standing) * (side.thigh_m + side.shank_m);
  }

  // Plans how far the root is lowered so that the legs reach the feet. At both ends, the lowering
  // depends only on the pose at that end, so that successive steps fit together.
  void PlanLowering() {
    constexpr int kRounds = 3;
    constexpr int kHalf = 4;  // Half the width of the window of the moving maximum, in samples.
    constexpr double kSamplesFromEnds = 4.0;
    const auto intervals = static_cast<std::size_t>(std::ceil(end_s_ * kReachFps));
    const std::size_t count = intervals + 1;
    std::vector<double> reach_missing(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double time_s = end_s_ * static_cast<double>(i) / static_cast<double>(intervals);
      stride_.Sample(GenericAt(time_s), reach_joints_, sample_);
      reach_missing[i] = MissingReachAt(time_s);
    }
    const double first = reach_missing.front();
    const double last = reach_missing.back();
    lowered_m_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double part = static_cast<double>(i) / static_cast<double>(intervals);
      lowered_m_[i] = first + (last - first) * SmootherStep(part);
    }
    std::vector<double> weights;
    for (int k = -kHalf; k <= kHalf; ++k) weights.push_back(1.0 - std::fabs(k) / (kHalf + 1.0));
    std::vector<double> missing(count);
    for (int round = 0; round < kRounds; ++round) {
      for (std::size_t i = 0; i < count; ++i) {
        missing[i] = std::max(0.0, reach_missing[i] - lowered_m_[i]);
      }
      if (*std::ranges::max_element(missing) == 0.0) break;
      const std::vector<double> smooth = MovingMean(MovingMaximum(missing, kHalf), weights);
      for (std::size_t i = 0; i < count; ++i) {
        const auto to_end = static_cast<double>(std::min(i, intervals - i));
        lowered_m_[i] += smooth[i] * SmoothStep(to_end / kSamplesFromEnds);
      }
    }
  }

  [[nodiscard]] double LoweredAt(double time_s) const {
    const double at = time_s / end_s_ * static_cast<double>(lowered_m_.size() - 1);
    const auto i = std::min(static_cast<std::size_t>(at), lowered_m_.size() - 2);
    const double part = at - static_cast<double>(i);
    return lowered_m_[i] + part * (lowered_m_[i + 1] - lowered_m_[i]);
  }

  const Person& person_;
  const StrideModel& stride_;
  Foot moving_;
  Foot fixed_;
  StepFeet feet_;
  // Forward distance between the feet at the start and at the end: 0 as in a stand, 1 as in the
  // captured stride.
  double start_share_ = 0.0;
  double end_share_ = 0.0;
  // 0 if one of these shares is 0, and 1 if both are at least 0.5. In between, proportional to the
  // smaller share.
  double in_stride_ = 0.0;
  double toe_off_s_ = 0.0;
  double strike_s_ = 0.0;
  double end_s_ = 0.0;
  double stand_leg_m_ = 0.0;         // Distance from hip to ankle of the fixed foot in the stand.
  std::array<double, 2> reach_m_{};  // [Foot]: largest distance from hip to ankle.
  // Smooth paths of the root from its first to its last position, with its velocities there.
  HermiteCurve captured_;          // In the captured stride.
  HermiteCurve root_;              // In the generated step.
  DVec3 outward_ = DVec3(0.0);     // Direction of a detour, away from the fixed foot.
  std::vector<double> lowered_m_;  // Lowering of the root, evenly sampled from 0 to end_s_.
  double detour_m_ = 0.0;
  double lift_m_ = 0.0;
  PostureSample sample_;      // The captured stride at the current time.
  std::vector<DQuat> mixed_;  // Scratch memory of SetPosture.
  // Joints on which hips and feet depend, except for those that inverse kinematics sets.
  std::vector<std::size_t> reach_joints_;
};

// Returns the time of each grid point.
std::vector<double> GridTimes(std::span<const double> keytimes_s, std::span<const int> cells) {
  const TimeWarp warp(keytimes_s, cells);
  const int points = 1 + std::accumulate(cells.begin(), cells.end(), 0);
  std::vector<double> times_s;
  times_s.reserve(static_cast<std::size_t>(points));
  for (int p = 0; p < points; ++p) times_s.push_back(warp.TimeAt(p));
  return times_s;
}

// Returns the generator of a step forward. A step backward is this step in reverse.
StepGenerator ForwardGenerator(const Person& person, const StepSpec& step) {
  if (!step.is_backward) return {person, step.moving, step.feet};
  STRIDEWIRE_CHECK(step.feet.turn_rad == 0.0);
  return {person, step.moving, {step.feet.end_m, step.feet.start_m, 0.0}};
}

std::vector<double> KeytimesOf(const StepSpec& step, const StepGenerator& forward) {
  std::vector<double> keys = forward.Keytimes();
  if (!step.is_backward) return keys;
  std::vector<double> reversed;
  for (const double key : std::views::reverse(keys)) {
    reversed.push_back(kBackwardSlowdown * (keys.back() - key));
  }
  return reversed;
}

}  // namespace

DVec3 Person::StandVector(Foot moving) const {
  return stand.balls_m[Index(moving)] - stand.balls_m[Index(OtherFoot(moving))];
}

std::vector<double> StepKeytimes(const Person& person, const StepSpec& step) {
  return KeytimesOf(step, ForwardGenerator(person, step));
}

RawExample MakeStep(const Person& person, const StepSpec& step, std::span<const int> cells,
                    std::span<const ParameterName> names, std::string source) {
  StepGenerator forward = ForwardGenerator(person, step);
  RawExample example;
  example.keytimes_s = KeytimesOf(step, forward);
  example.heading_change_rad = step.feet.turn_rad;
  example.source = std::move(source);
  example.frame_times_s = GridTimes(example.keytimes_s, cells);
  std::vector<double> times_s = example.frame_times_s;
  if (step.is_backward) {
    for (double& time_s : times_s) {
      time_s = (example.keytimes_s.back() - time_s) / kBackwardSlowdown;
    }
  }
  example.clip = forward.Run(times_s);
  example.clip.fps = static_cast<double>(times_s.size() - 1) / example.keytimes_s.back();
  MeasureStepParameters(person.skeleton, names, step.moving, example);
  return example;
}

}  // namespace stridewire::complete
