#include "offline/complete/step_maker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/easing.h"
#include "base/trig.h"
#include "offline/base/moving_window.h"
#include "offline/builtin/leg_ik.h"
#include "offline/builtin/mirror.h"
#include "offline/builtin/swing_detour.h"
#include "offline/extract/extract.h"

namespace stridewire::complete {
namespace {

constexpr double kFps = 120.0;

// Steps that start in a stand begin with a weight shift, which takes time because the body has no
// momentum. Steps that end in a stand end with settling.
constexpr double kWeightShiftS = 0.28;
constexpr double kSettleS = 0.24;
// Duration of the weight shift for steps that begin and end in a stand, such as turns on the spot.
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
// Minimum weight of the captured stride in the middle of a swing, for the rotation and the height
// of the foot. It prevents feet from dragging along the ground in short steps.
constexpr double kMinSwingShare = 0.45;
// Minimum heights of the ball and of the toe tip during a swing. The foot is lifted in increments
// of kLiftStepM until it reaches them.
constexpr double kClearanceM = 0.024;
constexpr double kTipClearanceM = 0.02;
constexpr double kLiftStepM = 0.004;
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
// Part of the step's duration in which the correction of the fixed leg fades in, and out.
constexpr double kStanceFade = 0.35;

std::size_t Index(Foot foot) { return static_cast<std::size_t>(foot); }

// The cubic curve with given positions and velocities at both ends.
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

// Generates one step. First, it evaluates what the captures and the timing determine, at a series
// of times (Moment). Then it searches for the detour, the lift and the lowering of the root, which
// are cheap corrections of these moments.
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
    SetTiming();
    PlanRoot();
    const int frames = static_cast<int>(std::floor(end_s_ * kFps + 0.5)) + 1;
    moments_.reserve(static_cast<std::size_t>(frames));
    for (int f = 0; f < frames; ++f) moments_.push_back(MomentAt(f / kFps));
    StraightenStance();
    PlanSwing();
  }

  RawExample Run(std::span<const ParameterName> names, std::string source) {
    RawExample example;
    example.keytimes_s = {0.0, toe_off_s_, strike_s_, end_s_};
    example.heading_change_rad = feet_.turn_rad;
    example.source = std::move(source);
    example.clip.fps = kFps;
    const auto frames = static_cast<int>(moments_.size());
    example.clip.Resize(frames, person_.skeleton.joint_count());
    const std::vector<double> lowered_m = Lowering();
    const DVec3 origin = moments_.front().root_m;
    for (int f = 0; f < frames; ++f) {
      const auto i = static_cast<std::size_t>(f);
      Pose pose = PoseAt(moments_[i], lowered_m[i]);
      pose.root_position_m -=
          Vec3(static_cast<float>(origin.x), 0.0f, static_cast<float>(origin.z));
      PoseSpan out = example.clip.frame(f);
      out.root_position_m = pose.root_position_m;
      std::ranges::copy(pose.rotations, out.rotations.begin());
    }
    MakeSignContinuous(example.clip);
    MeasureStepParameters(person_.skeleton, names, moving_, example);
    return example;
  }

 private:
  struct Leg {
    LegPose pose;          // Before inverse kinematics, relative to the root.
    DQuat ankle_rotation;  // World rotation of the foot in the step.
    // Position of the ball relative to the fixed ball, before the detour and the lift are added.
    DVec3 ball_m = DVec3(0.0);
    DVec3 hip_m = DVec3(0.0);  // Relative to the root.
    DVec3 ankle_to_ball = DVec3(0.0);
    DVec3 ankle_to_tip = DVec3(0.0);
    DVec3 ankle_to_heel = DVec3(0.0);
  };
  struct Moment {
    double generic = 0.0;
    DVec3 root_m = DVec3(0.0);  // Root before it is lowered so that the legs reach the feet.
    Pose posture;               // Pose before inverse kinematics, with the root at the origin.
    std::array<Leg, 2> legs;    // [Foot]
  };

  static double Share(double share) { return std::clamp(share, 0.0, kMaxShare); }
  static double ToFrames(double time_s) { return std::floor(time_s * kFps + 0.5) / kFps; }

  void SetTiming() {
    const auto& keys = stride_.keytimes_s;
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
  [[nodiscard]] double HeadingAt(double time_s) const {
    return feet_.turn_rad * SmootherStep(time_s / end_s_);
  }
  // Progress of the swing, 0 to 1.
  static double SwingAt(double generic) {
    return std::clamp((generic - kSwingBegin) / (kSwingEnd - kSwingBegin), 0.0, 1.0);
  }
  // Weight of the captured stride for the swinging foot.
  [[nodiscard]] double SwingShareAt(double time_s) const {
    const double share = ShareAt(time_s);
    return share + std::max(0.0, kMinSwingShare - share) * Bump(SwingAt(GenericAt(time_s)));
  }

  [[nodiscard]] Moment MomentAt(double time_s) const {
    Moment moment;
    moment.generic = GenericAt(time_s);
    const PostureSample stride = stride_.At(moment.generic);
    moment.root_m = RootAt(time_s, stride);
    moment.posture = PostureAt(time_s, stride);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      moment.legs[Index(foot)] = LegAt(foot, time_s, stride, moment.posture);
    }
    return moment;
  }
  [[nodiscard]] Leg LegAt(Foot foot, double time_s, const PostureSample& stride,
                          const Pose& posture) const {
    const LegRig::Side& side = person_.rig.side(foot);
    Leg leg;
    LegPose& pose = leg.pose;
    EvaluateLeg(person_.skeleton, person_.rig, posture, foot, pose);
    leg.ankle_rotation = AnkleRotationAt(foot, time_s, stride);
    leg.ball_m = PlainBallAt(foot, time_s, stride);
    leg.hip_m = DVec3(pose.positions_m[static_cast<std::size_t>(side.hip)]);
    const auto ankle = static_cast<std::size_t>(side.ankle);
    const auto from_ankle = [&](const Vec3& point) {
      return leg.ankle_rotation * (glm::conjugate(DQuat(pose.world_rotations[ankle])) *
                                   DVec3(point - pose.positions_m[ankle]));
    };
    leg.ankle_to_ball = from_ankle(pose.ball_m);
    leg.ankle_to_tip = from_ankle(pose.toe_tip_m);
    leg.ankle_to_heel = leg.ankle_rotation * DVec3(side.heel_m);
    return leg;
  }

  void PlanRoot() {
    const PostureSample& first = stride_.points.front();
    const PostureSample& last = stride_.points.back();
    captured_ = {first.root_m, stride_.MeasuredStartVelocity(), last.root_m,
                 stride_.MeasuredEndVelocity(), stride_.keytimes_s[3]};
    const auto state = [&](const PostureSample& stride, const DVec3& feet_m, double share) {
      DVec3 from_feet = RootFromFeet(stride) - RootFromFeet(person_.stand);
      // On straight legs, a body falls with the square of the distance between the feet.
      from_feet *= DVec3(share, share * share, share);
      from_feet += RootFromFeet(person_.stand);
      return 0.5 * DVec3(feet_m.x, 0.0, feet_m.z) + from_feet;
    };
    root_.from = state(first, feet_.start_m, start_share_);
    root_.to = RotateYaw(feet_.turn_rad, state(last, feet_.end_m, end_share_));
    root_.from_velocity = start_share_ * stride_.start_velocity;
    root_.to_velocity = RotateYaw(feet_.turn_rad, end_share_ * stride_.end_velocity);
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

  // Returns the root before it is lowered so that the legs reach the feet.
  [[nodiscard]] DVec3 RootAt(double time_s, const PostureSample& stride) const {
    const double generic = GenericAt(time_s);
    const double share = std::min(1.0, ShareAt(time_s));
    const double captured_s = CapturedTimeAt(generic);
    DVec3 deviation = share * (stride.root_m - captured_.At(captured_s));
    const double heading = HeadingAt(time_s);
    // The speed of the pelvis oscillates in proportion to the walking speed.
    const double usual_m_s = share * captured_.VelocityAt(captured_s).z;
    const double speed_m_s = RotateYaw(-heading, root_.VelocityAt(time_s)).z;
    if (usual_m_s > 0.0) deviation.z *= std::clamp(speed_m_s / usual_m_s, 0.0, 1.0);
    // The ball of the fixed foot is the origin, and the root is midway between the feet. In
    // strides, momentum carries the body, so the weight shifts less.
    const double to_fixed_m = -0.5 * (feet_.start_m.x + feet_.end_m.x) * 0.5;
    const DVec3 sway(kSwayShare * (1.0 - share) * to_fixed_m * Bump(time_s / end_s_), 0.0, 0.0);
    return root_.At(time_s) + RotateYaw(heading, deviation + sway);
  }

  // Raises or lowers the root in single support until the fixed leg is bent as in a blend of the
  // stand and the captured stride. Blended heights of the root would bend it further, because a
  // body falls less than in proportion to the length of the step.
  void StraightenStance() {
    const auto f = Index(fixed_);
    const double stand_m = LegLength(person_.skeleton, person_.rig, person_.stand, fixed_);
    const double fade_s = kStanceFade * end_s_;
    for (std::size_t i = 0; i < moments_.size(); ++i) {
      Moment& moment = moments_[i];
      const double time_s = static_cast<double>(i) / kFps;
      const double share = std::min(1.0, ShareAt(time_s));
      const double leg_m = stand_m + share * (stride_.LegAt(moment.generic) - stand_m);
      const DVec3 hip = moment.root_m + moment.legs[f].hip_m;
      const double change_m =
          builtin::HighestHipM(hip, TargetAt(fixed_, moment).ankle_m, leg_m) - hip.y;
      moment.root_m.y += change_m * SmoothStep(std::min(time_s, end_s_ - time_s) / fade_s);
    }
  }

  [[nodiscard]] DVec3 PlainBallAt(Foot foot, double time_s, const PostureSample& stride) const {
    const auto f = Index(foot);
    const double share = foot == moving_ ? SwingShareAt(time_s) : ShareAt(time_s);
    const double stand_y = person_.stand.balls_m[f].y;
    DVec3 ball(0.0, stand_y + share * (stride.balls_m[f].y - stand_y), 0.0);
    if (foot == fixed_) return ball;
    const DVec3 end = RotateYaw(feet_.turn_rad, feet_.end_m);
    const DVec3 place =
        feet_.start_m + SmootherStep(SwingAt(GenericAt(time_s))) * (end - feet_.start_m);
    ball.x = place.x;
    ball.z = place.z;
    return ball;
  }
  [[nodiscard]] DVec3 BallAt(Foot foot, const Moment& moment) const {
    DVec3 ball = moment.legs[Index(foot)].ball_m;
    if (foot == fixed_) return ball;
    const double bump = Bump(SwingAt(moment.generic));
    const DVec3 outward = RotateYaw(0.5 * feet_.turn_rad, DVec3(SideSign(moving_), 0.0, 0.0));
    ball.x += detour_m_ * bump * outward.x;
    ball.z += detour_m_ * bump * outward.z;
    ball.y += lift_m_ * bump;
    return ball;
  }

  // Yaw of a foot relative to the heading at the start of the step.
  [[nodiscard]] double FootYawAt(Foot foot, double time_s) const {
    if (foot == fixed_) return 0.0;
    return feet_.turn_rad * SmootherStep((SwingAt(GenericAt(time_s)) - 0.08) / 0.84);
  }
  [[nodiscard]] DQuat AnkleRotationAt(Foot foot, double time_s, const PostureSample& stride) const {
    const double share = foot == moving_ ? SwingShareAt(time_s) : ShareAt(time_s);
    const auto f = Index(foot);
    return DQuat(YawRotation(FootYawAt(foot, time_s))) *
           Blend(person_.stand.ankles[f], stride.ankles[f], std::min(1.0, share));
  }

  // Computes the pose before inverse kinematics, with the root at the origin.
  [[nodiscard]] Pose PostureAt(double time_s, const PostureSample& stride) const {
    const double share = std::min(1.0, ShareAt(time_s));
    PostureSample sample = Blend(person_.stand, stride, share);
    // The legs use a larger weight of the captured swing, so that they bend in the plane of the
    // capture.
    const double leg_share = std::min(1.0, SwingShareAt(time_s));
    for (const int joint : person_.rig.side(moving_).chain) {
      const auto j = static_cast<std::size_t>(joint);
      if (j == 0) continue;
      sample.rotations[j] = Blend(person_.stand.rotations[j], stride.rotations[j], leg_share);
    }
    const double heading = HeadingAt(time_s);
    const DQuat root = DQuat(YawRotation(heading)) * sample.rotations[0];
    sample.rotations[0] = root;
    // If a foot is turned relative to the body, its leg turns by half the angle.
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const double half = 0.5 * (FootYawAt(foot, time_s) - heading);
      const auto& side = person_.rig.side(foot);
      const auto hip = static_cast<std::size_t>(side.chain[static_cast<std::size_t>(side.hip)]);
      DQuat above(1.0, 0.0, 0.0, 0.0);
      for (int i = 0; i < side.hip; ++i) {
        above = above *
                sample.rotations[static_cast<std::size_t>(side.chain[static_cast<std::size_t>(i)])];
      }
      sample.rotations[hip] =
          glm::conjugate(above) * DQuat(YawRotation(half)) * above * sample.rotations[hip];
    }
    sample.root_m = DVec3(0.0);
    return ToPose(sample);
  }

  struct LegTarget {
    DVec3 ankle_m = DVec3(0.0);  // Relative to the fixed ball.
    DVec3 tip_m = DVec3(0.0);
    DVec3 heel_m = DVec3(0.0);
  };

  [[nodiscard]] LegTarget TargetAt(Foot foot, const Moment& moment) const {
    const Leg& leg = moment.legs[Index(foot)];
    LegTarget target;
    target.ankle_m = BallAt(foot, moment) - leg.ankle_to_ball;
    target.tip_m = target.ankle_m + leg.ankle_to_tip;
    target.heel_m = target.ankle_m + leg.ankle_to_heel;
    return target;
  }

  // Returns the horizontal distance between the swinging and the fixed foot, each of which is a
  // line from heel to toe tip.
  [[nodiscard]] double FeetApart(const Moment& moment) const {
    const LegTarget swinging = TargetAt(moving_, moment);
    const LegTarget still = TargetAt(fixed_, moment);
    double nearest = kDetours.max_m;
    for (int i = 0; i <= 4; ++i) {
      for (int k = 0; k <= 4; ++k) {
        const DVec3 a = swinging.heel_m + 0.25 * i * (swinging.tip_m - swinging.heel_m);
        const DVec3 b = still.heel_m + 0.25 * k * (still.tip_m - still.heel_m);
        nearest = std::min(nearest, std::hypot(a.x - b.x, a.z - b.z));
      }
    }
    return nearest;
  }

  // Returns the moment nearest to a fraction of the swing, 0 to 1.
  [[nodiscard]] const Moment& MomentOfSwing(double part) const {
    const double time_s = toe_off_s_ + part * (strike_s_ - toe_off_s_);
    return moments_[static_cast<std::size_t>(std::floor(time_s * kFps + 0.5))];
  }

  // If the step turns, leads the swinging foot around the fixed one. Raises it until it clears the
  // ground.
  void PlanSwing() {
    if (feet_.turn_rad != 0.0) PlanDetour();
    const LegRig::Side& side = person_.rig.side(moving_);
    const double ball_y = person_.stand.balls_m[Index(moving_)].y;
    struct Check {
      const Moment* moment;
      double ball_m;  // Minimum height of the ball.
      double tip_m;   // Minimum height of the toe tip.
    };
    std::vector<Check> checks;
    for (int i = 4; i <= 17; ++i) {
      const double part = 0.05 * i;
      const bool is_early = part < 0.3;
      checks.push_back({&MomentOfSwing(part), ball_y + (is_early ? 0.0 : kClearanceM),
                        side.toe_height_m + (is_early ? 0.0 : kTipClearanceM)});
    }
    const auto is_clear = [&](const Check& check) {
      return BallAt(moving_, *check.moment).y >= check.ball_m &&
             TargetAt(moving_, *check.moment).tip_m.y >= check.tip_m;
    };
    while (!std::ranges::all_of(checks, is_clear) && lift_m_ < kMaxLiftM) lift_m_ += kLiftStepM;
  }

  void PlanDetour() {
    detour_m_ = builtin::FindDetour(kDetours, [&](double detour_m) {
      detour_m_ = detour_m;
      double nearest = kDetours.max_m;
      for (int i = 1; i < 10; ++i) nearest = std::min(nearest, FeetApart(MomentOfSwing(0.1 * i)));
      return nearest;
    });
  }

  // Returns by how much the root must be lowered for the legs to reach the feet.
  [[nodiscard]] double MissingReach(const Moment& moment) const {
    double missing = 0.0;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const DVec3 hip = moment.root_m + moment.legs[Index(foot)].hip_m;
      const double highest_m =
          builtin::HighestHipM(hip, TargetAt(foot, moment).ankle_m, reach_m_[Index(foot)]);
      missing = std::max(missing, hip.y - highest_m);
    }
    return missing;
  }

  // Returns the largest distance from hip to ankle.
  [[nodiscard]] double ReachOf(Foot foot) const {
    LegPose leg;
    EvaluateLeg(person_.skeleton, person_.rig, ToPose(person_.stand), foot, leg);
    const LegRig::Side& side = person_.rig.side(foot);
    const Vec3 reach = leg.positions_m[static_cast<std::size_t>(side.ankle)] -
                       leg.positions_m[static_cast<std::size_t>(side.hip)];
    const double standing = glm::length(reach) / (side.thigh_m + side.shank_m);
    return std::max(kMaxExtension, standing) * (side.thigh_m + side.shank_m);
  }

  // Returns how far the root is lowered at each moment so that the legs reach the feet. At both
  // ends, the lowering depends only on the pose at that end, so that successive steps fit together.
  [[nodiscard]] std::vector<double> Lowering() const {
    constexpr int kRounds = 3;
    constexpr int kHalf = 10;
    constexpr double kFramesFromEnds = 8.0;
    std::vector<double> weights;
    for (int k = -kHalf; k <= kHalf; ++k) weights.push_back(1.0 - std::fabs(k) / (kHalf + 1.0));
    const std::size_t count = moments_.size();
    std::vector<double> reach_missing;
    reach_missing.reserve(count);
    for (const Moment& moment : moments_) reach_missing.push_back(MissingReach(moment));
    const double first = reach_missing.front();
    const double last = reach_missing.back();
    std::vector<double> lowered(count, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
      const double part = static_cast<double>(i) / static_cast<double>(count - 1);
      lowered[i] = first + (last - first) * SmootherStep(part);
    }
    std::vector<double> missing(count);
    for (int round = 0; round < kRounds; ++round) {
      for (std::size_t i = 0; i < count; ++i) {
        missing[i] = std::max(0.0, reach_missing[i] - lowered[i]);
      }
      const std::vector<double> smooth = MovingMean(MovingMaximum(missing, kHalf), weights);
      for (std::size_t i = 0; i < count; ++i) {
        const auto to_end = static_cast<double>(std::min(i, count - 1 - i));
        lowered[i] += smooth[i] * SmoothStep(to_end / kFramesFromEnds);
      }
    }
    return lowered;
  }

  [[nodiscard]] Pose PoseAt(const Moment& moment, double lowered_m) const {
    Pose pose = moment.posture;
    DVec3 root = moment.root_m;
    root.y -= lowered_m;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const Leg& leg = moment.legs[Index(foot)];
      SolveLeg(person_.rig, foot, leg.pose, Vec3(TargetAt(foot, moment).ankle_m - root),
               Quat(leg.ankle_rotation), pose);
    }
    pose.root_position_m = Vec3(root);
    return pose;
  }

  const Person& person_;
  const StrideModel& stride_;
  Foot moving_;
  Foot fixed_;
  StepFeet feet_;
  double start_share_ = 0.0;
  double end_share_ = 0.0;
  double toe_off_s_ = 0.0;
  double strike_s_ = 0.0;
  double end_s_ = 0.0;
  std::array<double, 2> reach_m_{};  // [Foot]: largest distance from hip to ankle.
  HermiteCurve captured_;            // Curve with the start and end of the captured root.
  HermiteCurve root_;                // Curve with the start and end of the generated root.
  std::vector<Moment> moments_;      // [frame]
  double detour_m_ = 0.0;
  double lift_m_ = 0.0;
};

}  // namespace

DVec3 Person::StandVector(Foot moving) const {
  return stand.balls_m[Index(moving)] - stand.balls_m[Index(OtherFoot(moving))];
}

RawExample MakeStep(const Person& person, Foot moving, const StepFeet& feet,
                    std::span<const ParameterName> names, std::string source) {
  return StepGenerator(person, moving, feet).Run(names, std::move(source));
}

RawExample MakeBackwardStep(const Person& person, Foot moving, const StepFeet& feet,
                            std::span<const ParameterName> names, std::string source) {
  const StepFeet reversed = {feet.end_m, feet.start_m, 0.0};
  RawExample step = builtin::Reversed(MakeStep(person, moving, reversed, names, std::move(source)),
                                      kBackwardSlowdown);
  MeasureStepParameters(person.skeleton, names, moving, step);
  return step;
}

}  // namespace stridewire::complete
