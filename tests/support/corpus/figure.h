#pragma once

#include <array>
#include <numbers>
#include <vector>

#include "stridewire/base/math.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire::test {

/// The joints of the hand-made figure, parents first. At identity rotations the figure faces +Z
/// with +Y up and stretches its arms sideways.
enum class Part {
  kHips,
  kLeftUpLeg,
  kLeftLeg,
  kLeftFoot,
  kLeftToes,
  kRightUpLeg,
  kRightLeg,
  kRightFoot,
  kRightToes,
  kSpine,
  kChest,
  kNeck,
  kHead,
  kLeftShoulder,
  kLeftArm,
  kLeftForeArm,
  kLeftHand,
  kRightShoulder,
  kRightArm,
  kRightForeArm,
  kRightHand
};
inline constexpr int kPartCount = 21;
inline constexpr double kDegree = std::numbers::pi / 180.0;
/// Sideways distance of a foot from the middle of both feet, at scale 1.
inline constexpr double kHalfTrackM = 0.10;

/// Rotations by an angle about the x axis (positive bends forward), y axis (positive turns left)
/// and z axis.
[[nodiscard]] DQuat AboutX(double angle_rad);
[[nodiscard]] DQuat AboutY(double angle_rad);
[[nodiscard]] DQuat AboutZ(double angle_rad);

/// Smooth step from 0 to 1 with zero speed at both ends; constant outside [0, 1].
[[nodiscard]] double Ease(double u);

/// Body proportions of the figure. At scale 1 its legs are 0.86 m long.
class Figure {
 public:
  explicit Figure(double scale = 1.0) : scale_(scale) {}

  [[nodiscard]] static int Parent(Part part);
  /// Position of a joint in the frame of its parent, in metres.
  [[nodiscard]] DVec3 Offset(Part part) const;
  /// End of the chain below a hand, the head or the toes, in the frame of that joint.
  [[nodiscard]] DVec3 End(Part part) const;

  [[nodiscard]] double scale() const { return scale_; }
  [[nodiscard]] double LegLength() const { return 0.86 * scale_; }
  [[nodiscard]] double AnkleHeight() const { return 0.08 * scale_; }
  /// The ball of the foot (the toe joint) in the frame of the ankle.
  [[nodiscard]] DVec3 Ball() const { return Offset(Part::kLeftToes); }

 private:
  double scale_;
};

/// A pose described by the values that determine contacts: position and rotation of the pelvis and
/// of both feet. The remaining members are rotations of the upper body.
struct FigurePose {
  struct LegPose {
    DVec3 ankle_m = DVec3(0.0);
    DQuat foot = DQuat(1.0, 0.0, 0.0, 0.0);     ///< World rotation of the foot.
    DVec3 knee_towards = DVec3(0.0, 0.0, 1.0);  ///< World direction in which the knee bends.
    double toe_bend_rad = 0.0;                  ///< Positive bends the toes down.
  };
  struct ArmPose {
    DQuat arm = DQuat(1.0, 0.0, 0.0, 0.0);      ///< Relative to the shoulder.
    DQuat forearm = DQuat(1.0, 0.0, 0.0, 0.0);  ///< Relative to the upper arm.
  };

  DVec3 pelvis_m = DVec3(0.0);
  DQuat pelvis = DQuat(1.0, 0.0, 0.0, 0.0);
  DQuat spine = DQuat(1.0, 0.0, 0.0, 0.0);  ///< Relative to the pelvis.
  DQuat chest = DQuat(1.0, 0.0, 0.0, 0.0);  ///< Relative to the spine.
  DQuat head = DQuat(1.0, 0.0, 0.0, 0.0);   ///< Relative to the neck.
  std::array<LegPose, 2> legs;              ///< Indexed by Foot.
  std::array<ArmPose, 2> arms;              ///< Left and right.

  /// Lets the arms hang down and swing: positive angles move the left hand back and the right hand
  /// forward.
  void HangArms(double swing_rad);
};

/// Returns the rotation of every joint relative to its parent. Analytic inverse kinematics places
/// the legs. If an ankle is out of reach, the leg is stretched towards it.
[[nodiscard]] std::array<DQuat, kPartCount> LocalRotations(const Figure& figure,
                                                           const FigurePose& pose);

/// A motion of the figure in metres, +Y up.
struct FigureMotion {
  double fps = 30.0;
  std::vector<FigurePose> poses;
};

}  // namespace stridewire::test
