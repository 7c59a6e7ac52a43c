#include "runtime/plan/foot_planner.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/plan/foot_sampler.h"
#include "runtime/plan/sole_levels.h"
#include "runtime/plan/swing_path.h"
#include "runtime/plan/terrain_swing.h"
#include "runtime/plan/transition_samples.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/foot_plant_constants.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// Velocities are differences between two samples, this long before and after a time.
constexpr double kVelocityStepS = 0.004;

// Maximum shift of the root towards the centre between the feet (ShiftToCentre).
constexpr double kMaxCentreShiftM = 0.1;
// Maximum sideways correction per step towards the line of the walk.
constexpr double kMaxAsideM = 0.05;

// On level ground, a swinging foot stays at least kLevelClearanceM above the ground. A foot that
// has just left the ground may be kMaxSinkM below it, because its toes leave last. It is lifted by
// at most kMaxEarlyLiftM.
constexpr double kLevelClearanceM = 0.012;
constexpr double kMaxEarlyLiftM = 0.03;
// Fractions of the difference pose that have faded out. If less than kLeastSettled has faded out
// when a foot leaves the ground, ReleaseHeight corrects the height of the foot only in part.
// Samples at which less than kMostlySettled has faded out do not change the correction.
constexpr double kLeastSettled = 0.2;
constexpr double kMostlySettled = 0.7;

// Sideways distances between the balls of the feet. A swinging foot that would pass the standing
// foot closer than kMinPassingWidthM is pushed outward by up to kMaxPushM. This is checked while
// the feet are within kPassingLengthM of each other in the walking direction. If a step starts or
// lands closer than kCrossingWidthM, the legs cross intentionally. If a request does not specify
// the sideways distance, the foot lands at least kMinLandingWidthM to the side of the other foot.
constexpr double kMinPassingWidthM = 0.11;
constexpr double kMinLandingWidthM = 0.05;
constexpr double kPassingLengthM = 0.2;
constexpr double kCrossingWidthM = 0.04;
constexpr double kMaxPushM = 0.08;
// Fractions of the swing at which the moving foot is sampled: shortly after its release, and in the
// middle of the swing.
constexpr std::array<double, 2> kEarlySamples{0.1, 0.18};
constexpr std::array<double, 5> kSwingSamples{0.25, 0.375, 0.5, 0.625, 0.75};

// A landing foot may briefly be this far below the ground.
constexpr double kMaxLandingSinkM = 0.008;

// While the difference pose fades out, standing feet are lifted or lowered by at most this.
constexpr double kMaxSettleLiftM = 0.05;

double ValueOr(const MotionGroup& group, const ParameterValues& values, ParameterName name,
               double otherwise) {
  const int l = group.FindParameter(name);
  return l < 0 ? otherwise : values.values[static_cast<std::size_t>(l)];
}

class Planner {
 public:
  explicit Planner(const FootPlanJob& job)
      : library_(job.library),
        skeleton_(job.library.skeleton()),
        rig_(job.library.leg_rig()),
        group_(job.library.group(job.movement.group)),
        cache_(job.scratch.cache()),
        pose_(job.pose),
        movement_(job.movement),
        sampler_(job.scratch, job.pose),
        transition_(job.transition) {}

  FeetAt FeetOf(ConstPoseSpan pose) const {
    FeetAt feet;
    LegPose leg;
    for (std::size_t f = 0; f < 2; ++f) {
      EvaluateLeg(skeleton_, rig_, pose, static_cast<Foot>(f), leg);
      feet[f] = FootOf(rig_, static_cast<Foot>(f), DVec3(pose.root_position_m), leg);
    }
    return feet;
  }
  // Samples the feet at all times that the plan depends on. The difference pose of the movement
  // must be set.
  void SampleKeyPoses(const SwingTimes& swing) {
    const auto around = [&](double time_s, std::size_t before) {
      times_s_[before] = std::max(0.0, time_s - kVelocityStepS);
      times_s_[before + 1] = time_s;
      times_s_[before + 2] = std::min(movement_.duration_s(), time_s + kVelocityStepS);
    };
    around(swing.release_s, kRelease - 1);
    around(swing.land_s, kLanding - 1);
    const auto during = [&](std::span<const double> samples, std::size_t first) {
      for (std::size_t i = 0; i < samples.size(); ++i) {
        times_s_[first + i] = swing.release_s + samples[i] * (swing.land_s - swing.release_s);
      }
    };
    during(kEarlySamples, kEarly);
    during(kSwingSamples, kSwing);
    times_s_[kEntry] = movement_.start_offset_s;
    times_s_[kEntry + 1] = movement_.start_offset_s + kBlendStepS;
    times_s_[kBlendedEnd] = movement_.duration_s();
    sampler_.SetDifference(movement_);
    sampler_.Sample(movement_, times_s_, kBlendedEnd);
  }
  FeetAt KeyPoseAt(std::size_t time) const {
    return {sampler_.FootAt(time, Foot::kLeft), sampler_.FootAt(time, Foot::kRight)};
  }
  FeetAt Landing() const { return KeyPoseAt(kLanding); }
  std::array<FeetAt, 2> Entry() const { return {KeyPoseAt(kEntry), KeyPoseAt(kEntry + 1)}; }
  // Returns the vector from one ball to the other at the end of the blend.
  DVec3 EndVector(Foot from, Foot to) const {
    return sampler_.Ball(kBlendedEnd, to) - sampler_.Ball(kBlendedEnd, from);
  }

  // Chooses the base position so that the standing feet keep their positions, on average.
  // Also computes the heights for Level. The feet stand until `stance_end_s`.
  void SolveBase(const FootLocks& locks, std::span<const Foot> staying, double stance_end_s) {
    movement_.base.position_m = DVec3(0.0);
    std::array<double, kStanceSamples.size()> times_s;
    for (std::size_t i = 0; i < times_s.size(); ++i) times_s[i] = kStanceSamples[i] * stance_end_s;
    sampler_.Sample(movement_, times_s, 0);
    DVec3 position(0.0);
    for (const Foot foot : staying) {
      const auto f = static_cast<std::size_t>(foot);
      const DVec3 stands = locks[f].print.position_m;
      const DVec3 start = sampler_.Ball(0, foot);
      double lowest_m = start.y;
      for (const std::size_t i : kLevelSamples) {
        lowest_m = std::min(lowest_m, sampler_.Ball(i, foot).y);
      }
      position += DVec3(stands.x - start.x,
                        stands.y + rig_.sides[f].ball_height_m +
                            SlopeRise(rig_.sides[f], locks[f].normal) - lowest_m,
                        stands.z - start.z);
    }
    movement_.base.position_m = position / static_cast<double>(staying.size());
    for (const Foot foot : staying) {
      const auto f = static_cast<std::size_t>(foot);
      const double ground_m =
          locks[f].print.position_m.y + SlopeRise(rig_.sides[f], locks[f].normal);
      const double raised_m = movement_.base.position_m.y - ground_m;
      std::array<double, kStanceSamples.size()> above_m;
      std::array<HeightRange, kStanceSamples.size()> ranges;
      for (std::size_t i = 0; i < times_s.size(); ++i) {
        above_m[i] = raised_m + sampler_.LowestSole(i, foot);
        ranges[i].min_m = LevellingRange(above_m[i], kStanceSlackM).min_m;
        ranges[i].max_m =
            LevellingRange(raised_m + sampler_.LowestPoint(i, foot), kStanceSlackM).max_m;
      }
      level_[f] = LevellingQuartic(above_m, ranges);
    }
  }
  // Returns the heights that keep the sole of a standing foot on the ground during the movement.
  // Valid after SolveBase.
  const Quartic& Level(std::size_t foot) const { return level_[foot]; }

  // Chooses the footprint of a step's moving foot. Returns the blended foot at landing, before
  // planting.
  BlendedFoot ChooseLanding(const FootLocks& locks, const LandingTarget& target, Foot moving) {
    const RequestPlan& request = target.request;
    FootPlan& plan = movement_.feet;
    const auto m = static_cast<std::size_t>(moving);
    const std::size_t x = 1 - m;
    const double end_heading_rad =
        movement_.base.heading_rad + movement_.heading_change_rad + movement_.extra_turn_rad;
    const DVec3 blended = RotateYaw(-end_heading_rad, EndVector(OtherFoot(moving), moving));
    // Left and right steps of a capture are not equally wide. If each foot were placed only
    // relative to the other, the walk would drift sideways. Therefore, steps are steered back
    // towards LandingTarget::line_m.
    const double aside_m =
        std::clamp(RotateYaw(-end_heading_rad, target.line_m - movement_.base.position_m).x,
                   -kMaxAsideM, kMaxAsideM);
    DVec3 vector{ValueOr(group_, request.applied, ParameterName::kEndX, blended.x + aside_m),
                 GroundRise(ValueOr(group_, request.applied, ParameterName::kEndY, 0.0)),
                 ValueOr(group_, request.applied, ParameterName::kEndZ, blended.z)};
    if (!request.is_side_given) {
      const double outward = moving == Foot::kLeft ? 1.0 : -1.0;
      vector.x = outward * std::max(outward * vector.x, kMinLandingWidthM);
    }
    FootTrajectory& trajectory = plan.feet[m];
    const double rise_m = vector.y;
    trajectory.to.position_m = locks[x].print.position_m + RotateYaw(end_heading_rad, vector);
    double turn_rad = 0.0;
    const BlendedFoot landing = sampler_.FootAt(kLanding, moving);
    const double landing_rad = landing.heading_rad;
    if (request.exact) {
      DVec3 residual = request.exact->position_m - trajectory.to.position_m;
      const double length_m = std::sqrt(residual.x * residual.x + residual.z * residual.z);
      const double part =
          std::min(1.0, request.most_residual_m / std::max(length_m, request.most_residual_m));
      plan.missed_m = (1.0 - part) * DVec3(residual.x, 0.0, residual.z);
      residual.x *= part;
      residual.z *= part;
      trajectory.to.position_m += residual;
      const double wanted_rad = WrapAngle(request.exact->heading_rad - landing_rad);
      turn_rad = std::clamp(wanted_rad, -kMaxFootTurnRad, kMaxFootTurnRad);
      plan.missed_rad = wanted_rad - turn_rad;
    } else {
      const auto missed = [&](ParameterName name) {
        return ValueOr(group_, request.requested, name, 0.0) -
               ValueOr(group_, request.applied, name, 0.0);
      };
      plan.missed_m = RotateYaw(
          end_heading_rad, DVec3(missed(ParameterName::kEndX), 0.0, missed(ParameterName::kEndZ)));
      const double turned_rad = movement_.heading_change_rad + movement_.extra_turn_rad;
      plan.missed_rad = request.turn_rad.value_or(turned_rad) - turned_rad;
    }
    trajectory.to.heading_rad = landing_rad + turn_rad;
    trajectory.turn_rad[2] = turn_rad;
    if (target.terrain != nullptr) LandOnGround(*target.terrain, rig_.side(moving), trajectory);
    const double ground_m =
        locks[x].print.position_m.y + SlopeRise(rig_.sides[x], locks[x].normal) + rise_m;
    trajectory.height_m[2] = trajectory.to.position_m.y +
                             SlopeRise(rig_.sides[m], trajectory.normals[1]) - ground_m +
                             LandingLevelling(moving, ground_m);
    return landing;
  }

  // Returns by how much the sole of the moving foot must be raised between its landing and the end
  // of the movement, so that it stands on ground at height `ground_m`.
  double LandingLevelling(Foot moving, double ground_m) const {
    const double at_landing_m = sampler_.LowestSole(kLanding, moving) - ground_m;
    const double at_end_m = sampler_.LowestSole(kBlendedEnd, moving) - ground_m;
    double lowest_m = std::min(at_landing_m, at_end_m);
    for (std::size_t i = 0; i < TransitionSamples::kLandingSamples.size(); ++i) {
      const double sole_m =
          transition_.feet().LowestFlatSole(TransitionSamples::kLanding + i, moving);
      lowest_m = std::min(lowest_m, sole_m - ground_m + kMaxLandingSinkM - kMaxSinkM);
    }
    const HeightRange lowest = LevellingRange(lowest_m);
    const HeightRange highest = LevellingRange(std::max(at_landing_m, at_end_m));
    // If no correction keeps both the lowest and the highest sole within the limits, the lowest one
    // may sink by up to another kMaxSinkM.
    if (lowest.min_m > highest.max_m) return std::max(highest.max_m, lowest.min_m - kMaxSinkM);
    return std::clamp(0.0, lowest.min_m, highest.max_m);
  }

  // Returns for each foot by how much its sole must be raised at the end of a jump, so that it
  // stands on ground at height `ground_m`. Otherwise, blends of very different jumps would end with
  // a foot above or below the ground.
  std::array<double, 2> EndLevelling(double ground_m) const {
    std::array<double, 2> raise_m{};
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      raise_m[static_cast<std::size_t>(foot)] =
          Levelling(sampler_.LowestSole(kBlendedEnd, foot) - ground_m);
    }
    return raise_m;
  }

  // Keeps the sole of the moving foot on the ground, at height `ground_m`, until the foot is
  // released. Returns the height offset of the foot from the end of the blend-in until its release.
  // `start_m` is the offset at the start of the step. `settled_m` is the offset at the end of the
  // blend-in before this correction.
  double ReleaseHeight(Foot moving, double ground_m, double start_m, double settled_m) const {
    const auto settled_at = [&](double time_s) {
      return 1.0 - EaseOut((time_s - movement_.start_offset_s) / movement_.ease_out_s);
    };
    const double settled = settled_at(times_s_[kRelease]);
    const double height_m = start_m + settled * (settled_m - start_m);
    double raise_m = Levelling(sampler_.LowestSole(kRelease, moving) + height_m - ground_m) /
                     std::max(settled, kLeastSettled);
    for (std::size_t i = 0; i < TransitionSamples::kReleaseSamples.size(); ++i) {
      const std::size_t at = TransitionSamples::kRelease + i;
      const double settled_i = settled_at(transition_.time_s(at));
      if (settled_i < kMostlySettled) continue;
      const double before_m = start_m + settled_i * (settled_m - start_m);
      const double base_m = before_m - ground_m;
      const double least_m =
          LevellingRange(transition_.feet().LowestFlatSole(at, moving) + base_m).min_m;
      const double most_m =
          LevellingRange(transition_.feet().LowestSole(at, moving) + base_m).max_m;
      raise_m = std::clamp(raise_m, std::min(least_m, most_m), most_m);
    }
    // If the blend-in ends before the release, the foot reaches its new height while its heel is
    // still down. The foot is then lowered by only a part of the correction: half of it, or all but
    // kMaxSinkM of it, whichever is more.
    if (raise_m < 0.0 && settled == 1.0) raise_m = std::min(0.5 * raise_m, raise_m + kMaxSinkM);
    return settled_m + raise_m;
  }

  // Keeps both feet on their footprints while an avatar stands. `previous` are the feet of the pose
  // that the movement blends from, before planting.
  void StandStill(const FootLocks& locks, const FeetAt& previous) {
    for (std::size_t f = 0; f < 2; ++f) {
      FootTrajectory& trajectory = movement_.feet.feet[f];
      const double rest_m = rig_.sides[f].ball_height_m + SlopeRise(rig_.sides[f], locks[f].normal);
      const double begin_m = previous[f].ball_m.y + locks[f].height_m - locks[f].print.position_m.y;
      trajectory.height_m = {begin_m, rest_m, rest_m};
      trajectory.locks_height = true;
    }
  }

  // Returns the positions where the feet of a jump land, [foot].
  std::array<DVec3, 2> ChooseJumpLanding(const FootLocks& locks, const RequestPlan& request) {
    const DVec3 centre =
        0.5 * (locks[0].print.position_m + locks[1].print.position_m) +
        RotateYaw(movement_.base.heading_rad,
                  DVec3(0.0, ValueOr(group_, request.applied, ParameterName::kHeight, 0.0),
                        ValueOr(group_, request.applied, ParameterName::kLength, 0.0)));
    const DVec3 apart = 0.5 * EndVector(Foot::kRight, Foot::kLeft);
    const DVec3 flat(apart.x, 0.0, apart.z);
    return {centre + 1.0 * flat, centre + -1.0 * flat};
  }

  // Computes offsets and their velocities at release and landing, so that the path of the foot is
  // smooth.
  void BlendSwing(Foot foot, const BlendedFoot& landing, FootTrajectory& trajectory) {
    const auto velocity_around = [&](std::size_t time) {
      const DVec3 way_m = sampler_.Ball(time + 1, foot) - sampler_.Ball(time - 1, foot);
      return way_m / (times_s_[time + 1] - times_s_[time - 1]);
    };
    trajectory.release_velocity_m_s = -velocity_around(kRelease);
    const BlendedFoot released = sampler_.FootAt(kRelease, foot);
    trajectory.release_offset_m = trajectory.from.position_m - released.ball_m;
    const FootCorrection at_release = CorrectFoot(movement_, foot, trajectory.release_s, released);
    trajectory.release_turn_rad = at_release.turn_rad - at_release.free_turn_rad;
    trajectory.land_velocity_m_s = -velocity_around(kLanding);
    trajectory.land_offset_m = trajectory.to.position_m - landing.ball_m;
  }

  // Sets the lifts (FootTrajectory::lift_m) that keep the moving foot of a step without terrain
  // above the ground between its footprints.
  void LiftOverLevelGround(Foot moving) {
    std::array<double, 3>& lift_m = movement_.feet.foot(moving).lift_m;
    lift_m[kEarlyLift] =
        std::min(LevelLift(moving, kEarlyLift, -kMaxSinkM, kEarlySamples, kEarly), kMaxEarlyLiftM);
    lift_m[kMiddleLift] = std::min(
        LevelLift(moving, kMiddleLift, kLevelClearanceM, kSwingSamples, kSwing), kMaxLiftM);
  }

  // Lifts standing feet so that their balls and ankles do not sink into level ground while the
  // difference pose fades out. The lift is limited so that soles do not hover. It may be negative
  // for a foot that stands throughout the movement.
  void LiftWhileSettling() {
    const FootSampler& feet = transition_.feet();
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      FootTrajectory& trajectory = movement_.feet.foot(foot);
      const bool stays = trajectory.release_s == FootTrajectory::kNever;
      HeightRange lift{stays ? -kMaxSettleLiftM : 0.0, kMaxSettleLiftM};
      for (std::size_t i = 0; i < TransitionSamples::kSettleSamples.size(); ++i) {
        const std::size_t at = TransitionSamples::kSettle + i;
        const double time_s = transition_.time_s(at);
        if (time_s > trajectory.release_s) break;
        const double raised_m = FootOffset(movement_, foot, time_s, feet.Ball(at, foot)).y -
                                trajectory.from.position_m.y;
        const double share = SettleLiftShare(1.0 - EaseOut(TransitionSamples::kSettleSamples[i]));
        lift.min_m =
            std::max(lift.min_m, (-kMaxSinkM - raised_m - feet.LowestFlatSole(at, foot)) / share);
        lift.max_m =
            std::min(lift.max_m, (kMaxHoverM - raised_m - feet.LowestSole(at, foot)) / share);
      }
      // If no lift prevents both sinking and hovering, lift.min_m exceeds lift.max_m. The foot then
      // gets the smallest lift between these two values.
      const auto [least, most] = std::minmax(lift.min_m, lift.max_m);
      trajectory.settle_lift_m = std::clamp(stays ? 0.0 : std::max(least, 0.0), least, most);
    }
  }

  // Returns by how much the swinging foot must be pushed outward to pass the standing leg.
  double PushAside(Foot moving) {
    const FootTrajectory& trajectory = movement_.feet.foot(moving);
    const double outward = moving == Foot::kLeft ? 1.0 : -1.0;
    const DVec3 stands = movement_.feet.foot(OtherFoot(moving)).from.position_m;
    const auto vector = [&](const DVec3& ball, double part) {
      const double heading = movement_.base.heading_rad + part * movement_.heading_change_rad;
      return RotateYaw(-heading, ball - stands);
    };
    // If a step starts or lands across the other foot, the crossing is intentional.
    if (outward * vector(trajectory.from.position_m, 0.0).x < kCrossingWidthM ||
        outward * vector(trajectory.to.position_m, 1.0).x < kCrossingWidthM) {
      return 0.0;
    }
    double push_m = 0.0;
    for (std::size_t i = 0; i < kSwingSamples.size(); ++i) {
      const double part = kSwingSamples[i];
      const double time_s = times_s_[kSwing + i];
      const DVec3 blended_m = sampler_.Ball(kSwing + i, moving);
      const DVec3 ball = blended_m + FootOffset(movement_, moving, time_s, blended_m);
      const DVec3 apart = vector(ball, part);
      if (std::fabs(apart.z) > kPassingLengthM) continue;
      const double lift = 4.0 * part * (1.0 - part);
      push_m = std::max(push_m, (kMinPassingWidthM - outward * apart.x) / (lift * lift));
    }
    return std::min(push_m, kMaxPushM);
  }

  // Returns the horizontal shift that keeps the root midway between the feet at the end of a step.
  // The root follows the supporting foot, so it does not adapt to where the moving foot lands. The
  // shift is half of the vector from the landing place of the blend to the planned one, limited to
  // kMaxCentreShiftM. Both places are relative to the supporting foot.
  DVec3 ShiftToCentre(Foot moving) const {
    const FootPlan& plan = movement_.feet;
    const Foot fixed = OtherFoot(moving);
    const DVec3 planned_m = plan.foot(moving).to.position_m - plan.foot(fixed).to.position_m;
    DVec3 shift = 0.5 * (planned_m - EndVector(fixed, moving));
    shift.y = 0.0;
    const double length_m = std::sqrt(shift.x * shift.x + shift.z * shift.z);
    return shift * std::min(1.0, kMaxCentreShiftM / std::max(length_m, kMaxCentreShiftM));
  }

  // Returns the horizontal shift, limited to kMaxRootShiftM, that moves the root towards a position
  // over `place_m` by the end of the movement.
  DVec3 RootShift(const DVec3& place_m) {
    const double end_s = movement_.duration_s();
    EvaluateMovement(group_, library_.layout(), movement_, end_s, cache_, pose_);
    const FeetAt feet = FeetOf(pose_);
    DVec3 shift = place_m - DVec3(pose_.root_position_m);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const FootCorrection correction =
          CorrectFoot(movement_, foot, end_s, feet[static_cast<std::size_t>(foot)]);
      shift -= correction.root_weight * correction.offset_m + correction.root_shift_m;
    }
    shift.y = 0.0;
    const double length_m = std::sqrt(shift.x * shift.x + shift.z * shift.z);
    return shift * std::min(1.0, kMaxRootShiftM / std::max(length_m, kMaxRootShiftM));
  }

 private:
  // Returns the smallest value of FootTrajectory::lift_m[lift] that keeps the moving foot at least
  // `clearance_m` above level ground at the fractions `samples` of its swing. `first` is the index
  // in times_s_ of the first of them.
  double LevelLift(Foot moving, std::size_t lift, double clearance_m,
                   std::span<const double> samples, std::size_t first) const {
    const FootTrajectory& trajectory = movement_.feet.foot(moving);
    const double from_m = trajectory.from.position_m.y;
    double lift_m = 0.0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const DVec3 offset_m =
          FootOffset(movement_, moving, times_s_[first + i], sampler_.Ball(first + i, moving));
      const double ground_m = from_m + samples[i] * (trajectory.to.position_m.y - from_m);
      const double above_m = sampler_.LowestSole(first + i, moving) + offset_m.y - ground_m;
      lift_m = std::max(lift_m, (clearance_m - above_m) / LiftShare(lift, samples[i]));
    }
    return lift_m;
  }

  const MotionLibrary& library_;
  const Skeleton& skeleton_;
  const LegRig& rig_;
  const MotionGroup& group_;
  GridCache& cache_;
  PoseSpan pose_;
  Movement& movement_;
  FootSampler sampler_;
  const TransitionSamples& transition_;
  std::array<Quartic, 2> level_{};  // [foot]

  // Indices of the times that SampleKeyPoses samples. For velocities, the times before and after
  // kRelease and kLanding are sampled as well.
  static constexpr std::size_t kRelease = 1;
  static constexpr std::size_t kLanding = 4;
  static constexpr std::size_t kEarly = 6;
  static constexpr std::size_t kSwing = kEarly + kEarlySamples.size();
  // Indices of two times: the start of the movement, and kBlendStepS later.
  static constexpr std::size_t kEntry = kSwing + kSwingSamples.size();
  // Index of the end of the movement, sampled without the difference pose.
  static constexpr std::size_t kBlendedEnd = kEntry + 2;
  static_assert(kBlendedEnd < FootSampler::kMaxTimes);
  std::array<double, kBlendedEnd + 1> times_s_;
};

}  // namespace

namespace {

// Plans the feet of a movement for `target`. If `target` is null, repeats the plan from `decision`,
// which another program has made. A replica that receives the decision computes the same plan,
// because it uses the same code.
std::array<FeetAt, 2> Plan(const FootPlanJob& job, const LandingTarget* target,
                           const LandingDecision& decision) {
  const auto& [library, locks, source, scratch, pose, movement, transition] = job;
  const MotionGroup& group = library.group(movement.group);
  STRIDEWIRE_CHECK(&scratch.library() == &library && library.leg_rig().is_usable);
  Planner planner(job);
  const bool is_step = IsStep(group.kind);
  const Foot moving = is_step ? MovingFoot(group.kind) : Foot::kLeft;
  const Foot fixed = OtherFoot(moving);
  const auto m = static_cast<std::size_t>(moving);
  const auto x = static_cast<std::size_t>(fixed);
  const SwingTimes times = SwingTimesOf(group.kind, movement);
  STRIDEWIRE_CHECK(times.release_s < times.land_s && times.land_s <= movement.duration_s());
  if (target == nullptr) {
    movement.extra_turn_rad = decision.extra_turn_rad;
  } else if (target->request.turn_rad) {
    movement.extra_turn_rad =
        std::clamp(*target->request.turn_rad - movement.heading_change_rad,
                   -target->request.max_extra_turn_rad, target->request.max_extra_turn_rad);
  }

  constexpr std::array<Foot, 2> kBoth{Foot::kLeft, Foot::kRight};
  const std::array<Foot, 1> stays{fixed};
  if (is_step) {
    planner.SolveBase(locks, stays, movement.duration_s());
  } else {
    planner.SolveBase(locks, kBoth, times.release_s);
  }

  // The difference pose is D = P - M, where P is the pose in which the previous movement ended, and
  // M is the blended pose at the start of this movement.
  EvaluateBlend(group, library.layout(), movement, movement.start_offset_s, scratch.cache(),
                movement.difference);
  const FeetAt start = planner.FeetOf(movement.difference);
  const FeetAt previous = planner.FeetOf(source.before);
  Subtract(source.before, movement.difference, movement.difference);
  if (source.earlier) {
    SetDifferenceVelocity(group, library.layout(), source.before, *source.earlier, scratch.cache(),
                          pose, movement);
  }
  planner.SampleKeyPoses(times);
  const bool is_on_terrain =
      target == nullptr ? decision.is_on_terrain : target->terrain != nullptr;
  if (group.kind != MovementKind::kStand) {
    transition.Sample(movement, times, is_step && !is_on_terrain);
  }

  FootPlan& plan = movement.feet;
  plan = {};
  plan.is_active = true;
  plan.keeps_above_ground = is_on_terrain;
  for (std::size_t f = 0; f < 2; ++f) {
    FootTrajectory& trajectory = plan.feet[f];
    const FootLock& lock = locks[f];
    trajectory.from = trajectory.to = lock.print;
    trajectory.normals.fill(lock.normal);
    // While the difference pose fades out, it moves and turns the feet. The plan compensates for
    // this, so that a foot on the ground neither sinks nor turns. Only the supporting foot may sink
    // to its resting height.
    const double sink_m = previous[f].ball_m.y - start[f].ball_m.y;
    const double turn_rad = WrapAngle(previous[f].heading_rad - start[f].heading_rad);
    const bool stays_down = is_step && f == x;
    trajectory.height_m = {lock.height_m, lock.height_m + sink_m, 0.0};
    if (stays_down) {
      trajectory.height_m[1] = planner.Level(f).constant;
      trajectory.level_m = planner.Level(f).coefficients;
    } else if (is_step) {
      const double ground_m =
          lock.print.position_m.y + SlopeRise(library.leg_rig().sides[f], lock.normal);
      trajectory.height_m[1] =
          planner.ReleaseHeight(moving, ground_m, lock.height_m, trajectory.height_m[1]);
    }
    trajectory.turn_rad = {lock.turn_rad, lock.turn_rad + turn_rad, lock.turn_rad + turn_rad};
    trajectory.height_m[2] = trajectory.height_m[1];
    trajectory.root_weight = is_step ? (f == x ? 1.0 : 0.0) : 0.5;
  }
  if (group.kind == MovementKind::kStand) {
    planner.StandStill(locks, previous);
    return planner.Entry();
  }
  for (const Foot foot : kBoth) {
    if (is_step && foot != moving) continue;
    plan.foot(foot).release_s = times.release_s;
    plan.foot(foot).land_s = times.land_s;
  }

  if (is_step) {
    FootTrajectory& trajectory = plan.feet[m];
    BlendedFoot landing;
    if (target == nullptr) {
      landing = planner.Landing()[m];
      trajectory.to.position_m = decision.to_m[m];
      trajectory.to.heading_rad = landing.heading_rad + decision.turn_rad;
      trajectory.turn_rad[2] = decision.turn_rad;
      if (decision.is_on_terrain) trajectory.normals[1] = decision.normal;
      trajectory.height_m[2] = decision.height_m;
    } else {
      landing = planner.ChooseLanding(locks, *target, moving);
    }
    planner.BlendSwing(moving, landing, trajectory);
    plan.feet[x].root_shift_m = planner.ShiftToCentre(moving);
    if (!plan.keeps_above_ground) planner.LiftOverLevelGround(moving);
    if (target == nullptr) {
      if (plan.keeps_above_ground) trajectory.lift_m = decision.lift_m;
      trajectory.mid_swing_offset_m = decision.mid_swing_offset_m;
      trajectory.root_shift_m = decision.root_shift_m;
      return planner.Entry();
    }
    const double push_m = planner.PushAside(moving);
    double root_sink_m = 0.0;
    if (target->terrain != nullptr) {
      ClearGround(job, moving, *target->terrain);
      root_sink_m = RootSink(job, moving);
    }
    if (push_m > 0.0) {
      trajectory.mid_swing_offset_m +=
          RotateYaw(movement.base.heading_rad + 0.5 * movement.heading_change_rad,
                    DVec3(moving == Foot::kLeft ? push_m : -push_m, 0.0, 0.0));
    }
    if (target->request.root_m)
      trajectory.root_shift_m = planner.RootShift(*target->request.root_m);
    trajectory.root_shift_m.y = -root_sink_m;
    return planner.Entry();
  }

  std::array<DVec3, 2> to_m = decision.to_m;
  if (target != nullptr) to_m = planner.ChooseJumpLanding(locks, target->request);
  const FeetAt landing = planner.Landing();
  const std::array<double, 2> raise_m = planner.EndLevelling(0.5 * (to_m[0].y + to_m[1].y));
  for (const Foot foot : kBoth) {
    const auto f = static_cast<std::size_t>(foot);
    FootTrajectory& trajectory = plan.feet[f];
    trajectory.to.position_m = to_m[f];
    trajectory.to.heading_rad = landing[f].heading_rad;
    trajectory.turn_rad[2] = 0.0;
    trajectory.height_m[2] = raise_m[f];
    planner.BlendSwing(foot, landing[f], trajectory);
  }
  return planner.Entry();
}

}  // namespace

std::array<FeetAt, 2> PlanFeet(const FootPlanJob& job, const LandingTarget& target) {
  return Plan(job, &target, {});
}

std::array<FeetAt, 2> PlanFeet(const FootPlanJob& job, const LandingDecision& decision) {
  return Plan(job, nullptr, decision);
}

void LiftWhileSettling(const FootPlanJob& job) {
  const FootPlan& plan = job.movement.feet;
  if (!plan.is_active || plan.keeps_above_ground) return;
  if (IsStep(job.library.group(job.movement.group).kind)) Planner(job).LiftWhileSettling();
}

}  // namespace stridewire
