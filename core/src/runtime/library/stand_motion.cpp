#include "runtime/library/stand_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/easing.h"
#include "base/trig.h"
#include "runtime/skeleton/layer_clip.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kRadPerDegree = kTwoPi / 360.0;

// Time in which an avatar reaches its stand pose.
constexpr double kSettleEaseS = 0.3;
constexpr double kSettleS = 0.5;  // Duration of the group `settle`.
// The idle motion fades in slowly, because it may begin in the middle of a weight shift.
constexpr double kIdleEaseS = 2.0;
constexpr double kIdleTailS = 2.0;
static_assert(kIdleTailS >= kIdleEaseS);
constexpr int kSettleCells = 4;
// Grid cells per second of the idle motion. They suffice for sway of 0.5 Hz: between grid points,
// the soles move by less than 0.01 mm.
constexpr int kIdleCellsPerS = 8;

// Amplitudes of the sway of the pelvis and of breathing. When a person stands quietly, the pelvis
// sways by a few millimetres, more forward than sideways, below 0.5 Hz (Winter, "Human balance and
// posture control during standing and walking", 1995). Adults breathe about 15 times per minute.
constexpr double kSwayForwardM = 0.004;
constexpr double kSwaySidewaysM = 0.0025;
constexpr int kBreathsPerLoop = 10;  // 0.25 Hz
constexpr double kChestRad = 0.7 * kRadPerDegree;
constexpr double kShoulderRad = 0.6 * kRadPerDegree;
// Weight shifts move the pelvis by this fraction of the distance between the feet.
constexpr double kShiftPart = 0.09;
constexpr double kMaxShiftM = 0.02;
constexpr double kObliquityRad = 1.2 * kRadPerDegree;
constexpr double kHeadYawRad = 3.0 * kRadPerDegree;
constexpr double kHeadPitchRad = 1.0 * kRadPerDegree;
constexpr double kArmRad = 0.8 * kRadPerDegree;

// The idle motion does not extend a leg beyond this fraction of its length, or beyond its extension
// in the stand pose if that is larger.
constexpr double kExtension = 0.995;

// A sum of sines with periods that divide kIdleLoopS.
class Harmonics {
 public:
  // Uses the multiples `first` to `last` of the loop's frequency. As in postural sway, low
  // frequencies have the largest amplitudes. The root mean square of the sum is 1.
  Harmonics(int first, int last, std::uint32_t seed) {
    double square = 0.0;
    std::uint32_t state = seed;
    for (int multiple = first; multiple <= last; ++multiple) {
      state = state * 1664525u + 1013904223u;  // The constants are those of Numerical Recipes.
      const double phase_rad = kTwoPi * (state >> 8) / (1 << 24);
      waves_.push_back({kTwoPi * multiple / kIdleLoopS, 1.0 / multiple, phase_rad});
      square += 0.5 / (static_cast<double>(multiple) * multiple);
    }
    scale_ = 1.0 / std::sqrt(square);
  }
  [[nodiscard]] double At(double time_s) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) {
      sum += wave.amplitude * Sin(wave.rad_per_s * time_s + wave.phase_rad);
    }
    return scale_ * sum;
  }

 private:
  struct Wave {
    double rad_per_s, amplitude, phase_rad;
  };
  std::vector<Wave> waves_;
  double scale_ = 1.0;
};

// From `at_s` on, the weight shifts to `weight`: 1 if the left foot carries all of it, -1 if the
// right foot does.
struct WeightShift {
  double at_s, weight;
};
constexpr std::array<WeightShift, 5> kWeightShifts{
    {{4.0, -0.7}, {13.0, 0.2}, {18.0, 1.0}, {27.0, -0.3}, {33.0, 0.6}}};
constexpr double kShiftDurationS = 1.8;

double WeightAt(double time_s) {
  double weight = kWeightShifts.back().weight;
  for (const WeightShift& shift : kWeightShifts) {
    weight += (shift.weight - weight) * SmootherStep((time_s - shift.at_s) / kShiftDurationS);
  }
  return weight;
}

// The joints above the legs, identified by their positions in the stand pose.
struct UpperBody {
  std::vector<std::size_t> spine;  // Joints above the root, up to the one that carries the arms.
  std::vector<std::size_t> neck;   // Joints above the spine, up to the head.
  struct Arm {
    std::size_t collar = 0;
    std::size_t shoulder = 0;  // Equal to `collar` if the arm has no separate collar bone.
    double side = 1.0;         // 1: left, -1: right
  };
  std::vector<Arm> arms;
};

UpperBody FindUpperBody(const Skeleton& skeleton, std::span<const Vec3> positions) {
  constexpr float kArmReachM = 0.1f;
  const std::vector<bool> is_of_legs = JointsOfLegs(skeleton);
  const auto joints = skeleton.joints.size();
  const auto parent = [&](std::size_t j) {
    return static_cast<std::size_t>(skeleton.joints[j].parent);
  };
  const auto side_m = [&](std::size_t j) { return positions[j].x - positions[0].x; };
  // The head is the highest joint near the middle of the body: twice the distance to the side is
  // subtracted from the height.
  std::size_t head = 0;
  const auto height = [&](std::size_t j) { return positions[j].y - 2.0f * std::fabs(side_m(j)); };
  for (std::size_t j = 1; j < joints; ++j) {
    if (!is_of_legs[j] && height(j) > height(head)) head = j;
  }
  std::vector<bool> is_of_trunk(joints, false);
  for (std::size_t j = head; j != 0; j = parent(j)) is_of_trunk[j] = true;

  UpperBody body;
  std::size_t carrier = head;  // The lowest joint that carries an arm.
  std::vector<float> reach_m(joints, 0.0f);
  std::vector<int> length(joints, 1);  // Number of joints in the longest chain below a joint.
  for (std::size_t j = joints - 1; j > 0; --j) {
    if (std::fabs(side_m(j)) > std::fabs(reach_m[j])) reach_m[j] = side_m(j);
    float& above_m = reach_m[parent(j)];
    if (std::fabs(reach_m[j]) > std::fabs(above_m)) above_m = reach_m[j];
    length[parent(j)] = std::max(length[parent(j)], length[j] + 1);
  }
  for (std::size_t j = 1; j < joints; ++j) {
    if (is_of_legs[j] || is_of_trunk[j] || !is_of_trunk[parent(j)]) continue;
    if (std::fabs(reach_m[j]) < kArmReachM) continue;
    UpperBody::Arm arm{.collar = j, .shoulder = j, .side = reach_m[j] > 0.0f ? 1.0 : -1.0};
    for (std::size_t child = j + 1; child < joints && length[j] >= 4; ++child) {
      if (skeleton.joints[child].parent == static_cast<int>(j) && length[child] >= 3) {
        arm.shoulder = child;
        break;
      }
    }
    body.arms.push_back(arm);
    carrier = std::min(carrier, parent(j));
  }
  for (std::size_t j = 1; j <= head; ++j) {
    if (is_of_trunk[j]) (j <= carrier ? body.spine : body.neck).push_back(j);
  }
  return body;
}

Quat AxisRotation(const Vec3& axis, double angle_rad) {
  const auto sine = static_cast<float>(Sin(0.5 * angle_rad));
  return {static_cast<float>(Cos(0.5 * angle_rad)), sine * axis.x, sine * axis.y, sine * axis.z};
}

// Axes of the world. A positive rotation about kLeftAxis bends the body forward, and a positive
// rotation about kForwardAxis bends it to the right.
const Vec3 kLeftAxis(1.0f, 0.0f, 0.0f);
const Vec3 kUpAxis(0.0f, 1.0f, 0.0f);
const Vec3 kForwardAxis(0.0f, 0.0f, 1.0f);

// Generates the idle motion around a stand pose.
class IdleGenerator {
 public:
  IdleGenerator(const Skeleton& skeleton, const LegRig& rig, const Pose& stand)
      : skeleton_(skeleton),
        rig_(rig),
        stand_(stand),
        positions_(skeleton.joints.size()),
        world_(skeleton.joints.size()),
        pose_(stand) {
    ForwardKinematics(skeleton, stand, positions_, world_);
    body_ = FindUpperBody(skeleton, positions_);
    LegPose leg;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const auto f = static_cast<std::size_t>(foot);
      const LegRig::Side& side = rig.side(foot);
      EvaluateLeg(skeleton, rig, stand, foot, leg);
      const auto hip = static_cast<std::size_t>(side.hip);
      const auto ankle = static_cast<std::size_t>(side.ankle);
      ankles_m_[f] = DVec3(stand.root_position_m) + DVec3(leg.positions_m[ankle]);
      ankle_rotations_[f] = leg.world_rotations[ankle];
      const double length_m = static_cast<double>(side.thigh_m) + side.shank_m;
      longest_m_[f] =
          std::max(static_cast<double>(glm::length(leg.positions_m[ankle] - leg.positions_m[hip])),
                   kExtension * length_m);
      hip_height_m_ = std::max<double>(leg.positions_m[hip].y - leg.positions_m[ankle].y, 0.1);
    }
    const double apart_m = std::fabs(ankles_m_[0].x - ankles_m_[1].x);
    shift_m_ = std::min(kShiftPart * apart_m, kMaxShiftM);
  }

  // Chooses how much lower the pelvis is than in the stand pose. Both legs must reach the ground in
  // the whole loop. If the pelvis were lowered only where a leg is too short, it would jerk.
  // `point_s` is the time between two points of the loop.
  void ChooseDrop(int points, double point_s) {
    drop_m_ = 0.0;
    double largest_m = 0.0;
    for (int p = 0; p < points; ++p) {
      PoseBody(p * point_s);
      largest_m = std::max(largest_m, MissingReach());
    }
    drop_m_ = largest_m;
  }

  const Pose& At(double time_s) {
    PoseBody(time_s);
    LegPose leg;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const auto f = static_cast<std::size_t>(foot);
      EvaluateLeg(skeleton_, rig_, pose_, foot, leg);
      SolveLeg(rig_, foot, leg, Vec3(ankles_m_[f] - DVec3(pose_.root_position_m)),
               ankle_rotations_[f], pose_);
    }
    return pose_;
  }

 private:
  // Rotates a joint of pose_ about an axis of the world. Its parent is assumed to be oriented as in
  // the stand pose.
  void Turn(std::size_t joint, const Vec3& axis, double angle_rad) {
    const Quat parent = joint == 0
                            ? kIdentityQuat
                            : world_[static_cast<std::size_t>(skeleton_.joints[joint].parent)];
    Quat& rotation = pose_.rotations[joint];
    rotation =
        Normalise(glm::conjugate(parent) * (AxisRotation(axis, angle_rad) * (parent * rotation)));
  }
  void TurnAll(std::span<const std::size_t> joints, const Vec3& axis, double angle_rad) {
    for (const std::size_t joint : joints) {
      Turn(joint, axis, angle_rad / static_cast<double>(joints.size()));
    }
  }

  // Sets the pose. The legs keep the local rotations of the stand pose.
  void PoseBody(double time_s) {
    pose_ = stand_;
    const double weight = WeightAt(std::fmod(time_s, kIdleLoopS));
    const double forward_m = kSwayForwardM * sway_forward_.At(time_s);
    const double sway_m = kSwaySidewaysM * sway_sideways_.At(time_s);
    pose_.root_position_m += Vec3(DVec3(shift_m_ * weight + sway_m, -drop_m_, forward_m));

    // The body sways as a whole, like an inverted pendulum. The hip above the loaded leg is higher,
    // and the spine bends back to keep the shoulders level.
    const double lean_rad = -sway_m / hip_height_m_;
    const double tilt_rad = kObliquityRad * weight;
    Turn(0, kLeftAxis, forward_m / hip_height_m_);
    Turn(0, kForwardAxis, lean_rad + tilt_rad);
    TurnAll(body_.spine, kForwardAxis, -0.9 * tilt_rad);

    // `breath` is 1 with full lungs and -1 with empty lungs. People exhale longer than they inhale.
    const double breath_rad = kTwoPi * kBreathsPerLoop / kIdleLoopS * time_s;
    const double breath = Sin(breath_rad + 0.35 * Sin(breath_rad));
    TurnAll(body_.spine, kLeftAxis, -kChestRad * breath);
    TurnAll(body_.neck, kLeftAxis, kChestRad * breath + kHeadPitchRad * head_pitch_.At(time_s));
    TurnAll(body_.neck, kUpAxis, kHeadYawRad * head_yaw_.At(time_s));
    for (const UpperBody::Arm& arm : body_.arms) {
      const Harmonics& swing = arm.side > 0.0 ? left_arm_ : right_arm_;
      if (arm.shoulder != arm.collar) {
        // The shoulder rises, and the arm keeps its direction.
        Turn(arm.collar, kForwardAxis, arm.side * kShoulderRad * breath);
        Turn(arm.shoulder, kForwardAxis, -arm.side * kShoulderRad * breath);
      }
      Turn(arm.shoulder, kLeftAxis, kArmRad * swing.At(time_s));
    }
  }

  // Returns by how much the pelvis must be lowered for the legs to reach the feet.
  [[nodiscard]] double MissingReach() const {
    double missing_m = 0.0;
    LegPose leg;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const auto f = static_cast<std::size_t>(foot);
      EvaluateLeg(skeleton_, rig_, pose_, foot, leg);
      const Vec3& hip = leg.positions_m[static_cast<std::size_t>(rig_.side(foot).hip)];
      const DVec3 reach_m = ankles_m_[f] - (DVec3(pose_.root_position_m) + DVec3(hip));
      const double square =
          longest_m_[f] * longest_m_[f] - reach_m.x * reach_m.x - reach_m.z * reach_m.z;
      missing_m = std::max(missing_m, -reach_m.y - std::sqrt(std::max(square, 0.0)));
    }
    return missing_m;
  }

  const Skeleton& skeleton_;
  const LegRig& rig_;
  const Pose& stand_;
  std::vector<Vec3> positions_;  // Positions of the joints in the stand pose.
  std::vector<Quat> world_;
  Pose pose_;
  UpperBody body_;
  // [foot]: position of the ankle in the stand pose, relative to the base frame.
  std::array<DVec3, 2> ankles_m_;
  std::array<Quat, 2> ankle_rotations_;  // [foot]
  std::array<double, 2> longest_m_{};    // [foot]: maximum distance from hip to ankle.
  double hip_height_m_ = 1.0;
  double shift_m_ = 0.0;
  double drop_m_ = 0.0;
  // The arguments are a range of frequencies, as multiples of 1 / kIdleLoopS, and a seed.
  Harmonics sway_forward_{8, 20, 1};
  Harmonics sway_sideways_{8, 20, 2};
  Harmonics head_yaw_{2, 7, 3};
  Harmonics head_pitch_{3, 9, 4};
  Harmonics left_arm_{5, 14, 5};
  Harmonics right_arm_{5, 14, 6};
};

void SetRow(const GridLayout& layout, const Pose& pose, float* row) {
  for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
    GridLayout::SetRotation(row, j, pose.rotations[j]);
  }
  layout.SetRoot(row, {DVec3(pose.root_position_m), 0.0});
}

constexpr int kIdleCells = static_cast<int>((kIdleLoopS + kIdleTailS) * kIdleCellsPerS);
constexpr std::array<int, 1> kSettleCellCounts{kSettleCells};
constexpr std::array<int, 1> kIdleCellCounts{kIdleCells};
constexpr std::array<double, 2> kSettleKeytimesS{0.0, kSettleS};
constexpr std::array<double, 2> kIdleKeytimesS{0.0, kIdleLoopS + kIdleTailS};
constexpr std::array<double, 1> kNoTurn{0.0};
constexpr std::array<std::uint8_t, 1> kNotMirrored{0};

MotionGroup MakeGroup(std::span<const int> cells, std::span<const double> keytimes_s,
                      double ease_out_s) {
  MotionGroup group;
  group.kind = MovementKind::kStand;
  group.example_count = 1;
  group.cells = cells;
  group.grid_point_count = cells.front() + 1;
  group.keytimes_s = keytimes_s;
  group.heading_change_rad = kNoTurn;
  group.ease_out_s = ease_out_s;
  group.sources = {"generated"};
  group.mirrored = kNotMirrored;
  return group;
}

}  // namespace

StandMotion::StandMotion(const Skeleton& skeleton, const LegRig& rig, const Pose& stand_pose)
    : settle(MakeGroup(kSettleCellCounts, kSettleKeytimesS, kSettleEaseS)),
      idle(MakeGroup(kIdleCellCounts, kIdleKeytimesS, kIdleEaseS)) {
  const GridLayout layout(skeleton.joint_count());
  const auto row_parts = static_cast<std::size_t>(layout.row_floats) / std::size(RowPart().floats);
  const auto allocate = [&](std::vector<RowPart>& grid, MotionGroup& group) {
    grid.resize(static_cast<std::size_t>(group.grid_point_count) * row_parts);
    group.grid = {grid.front().floats, grid.size() * std::size(RowPart().floats)};
  };
  allocate(settle_grid_, settle);
  allocate(idle_grid_, idle);
  const auto row = [&](std::vector<RowPart>& grid, int point) {
    return grid[static_cast<std::size_t>(point) * row_parts].floats;
  };
  for (int p = 0; p < settle.grid_point_count; ++p) {
    SetRow(layout, stand_pose, row(settle_grid_, p));
  }
  IdleGenerator generator(skeleton, rig, stand_pose);
  constexpr double kPointS = 1.0 / kIdleCellsPerS;
  generator.ChooseDrop(idle.grid_point_count, kPointS);
  for (int p = 0; p < idle.grid_point_count; ++p) {
    SetRow(layout, generator.At(p * kPointS), row(idle_grid_, p));
  }
}

}  // namespace stridewire
