#include "offline/capture/figure_axes.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>
#include <utility>
#include <vector>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/capture/file_axis.h"
#include "offline/capture/leg_chain.h"

namespace stridewire {
namespace {

constexpr double kSnapCos = 0.906;  // Directions within 25 degrees of an axis snap to it.
// A rest pose is standing if the cosine of the angle between its legs and an axis is at least
// kRestCos, and if the distances from ankles to hips are at least kStraightShare of the leg length.
constexpr double kRestCos = 0.8;
constexpr double kStraightShare = 0.9;
// Limits on the cosine of the angle between an axis and the mean direction from the feet to the
// hips. If it is at least kMotionCos, the figure stands along this axis. If it is at least
// kWeakMotionCos, the feet are mostly below the hips along this axis, as in crawling.
constexpr double kMotionCos = 0.85;
constexpr double kWeakMotionCos = 0.35;
// The following distances are in leg lengths.
constexpr double kAtZero = 0.12;  // A floor at most this far from zero counts as a floor at zero.
// A figure travels horizontally if it moves at least kMinTravel along the other candidate for the
// up axis, and at least kTravelRatio times as far as along the up axis (StandsAlong).
constexpr double kMinTravel = 0.6;
constexpr double kTravelRatio = 2.0;
// A figure on a level floor moves less than this along the up axis.
constexpr double kMaxRise = 0.3;
// RestUpInWorld chooses between the up axis of the rest pose and the same axis after the fixed
// rotation of the joints above the root. If floors do not decide, the rotated axis must be nearer
// to the mean direction from the feet to the hips: its cosine must be larger by this much.
constexpr double kClearGain = 0.5;
// If the sum of the two unit foot vectors is shorter than this, the feet have no common direction.
constexpr double kClearFeet = 0.5;

DVec3 Unit(const DVec3& v) {
  const double length = glm::length(v);
  return length > 1e-12 ? v / length : DVec3(0.0);
}

DVec3 SnapAxis(const DVec3& v) {
  const DVec3 axis = AxisVector(NearestAxis(v));
  return glm::dot(Unit(v), axis) >= kSnapCos ? axis : Unit(v);
}

// Returns the rotation that takes `left`, `up` and `left` x `up` to +X, +Y and +Z.
DQuat TurnToOurAxes(const DVec3& left, const DVec3& up) {
  const DVec3 forward = glm::cross(left, up);
  return glm::normalize(glm::quat_cast(glm::transpose(glm::dmat3(left, up, forward))));
}

// Returns a quantile of `values`, which it sorts.
double Quantile(std::vector<double>& values, double q) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

class AxesFinder {
 public:
  AxesFinder(BvhFigure& figure, std::optional<BvhAxis> up, const std::string& name)
      : figure_(figure), given_up_(up), name_(name) {
    for (const FoundLeg& leg : figure.legs.legs) {
      leg_length_ += 0.5 * ChainLength(figure.joints, leg.hip, leg.ankle);
    }
    figure.ComputePose(-1, rest_, rotations_);
    Sample();
  }

  Expected<FigureAxes> Run() {
    ReadRestPose();
    axes_.rest_stands = rest_stands_;
    FindUp();
    const DVec3 world_up = AxisVector(axes_.up);
    DVec3 rest_up = AxisVector(rest_axis_);
    if (!rest_stands_) {
      // The bones of some rigs are all parallel at rest. For these, up is the world up axis in the
      // frame of the root, averaged over the motion.
      DVec3 sum(0.0);
      for (const Sampled& sample : samples_) sum += glm::conjugate(sample.root) * world_up;
      rest_up = SnapAxis(sum);
      if (rest_up == DVec3(0.0)) rest_up = world_up;
      Note(
          "the rest pose does not stand; the upright direction of the root is taken from the "
          "motion");
    }
    if (Status status = FindTurns(world_up, rest_up); !status) {
      return std::unexpected(std::move(status.error()));
    }
    return axes_;
  }

 private:
  struct Sampled {
    std::vector<DVec3> positions;
    DQuat root;               // World rotation of the root.
    DVec3 foot = DVec3(0.0);  // Sum of the unit foot vectors, in the frame of the root.
  };

  void Note(std::string text) { figure_.notes.push_back(std::move(text)); }

  void Sample() {
    const int frames = figure_.clip.frame_count() - figure_.first_frame;
    const int step = std::max(1, frames / kSampledFrames);
    for (int f = figure_.first_frame; f < figure_.clip.frame_count(); f += step) {
      Sampled& sample = samples_.emplace_back();
      figure_.ComputePose(f, sample.positions, rotations_);
      sample.root = rotations_[0];
      for (const FoundLeg& leg : figure_.legs.legs) {
        sample.foot += glm::conjugate(sample.root) *
                       Unit(rotations_[Index(leg.ankle)] * figure_.FootVector(leg));
      }
    }
    STRIDEWIRE_CHECK(!samples_.empty());
  }

  // Returns the sum of the vectors from both ankles to the hips.
  DVec3 LegsUp(const std::vector<DVec3>& p) const {
    DVec3 sum(0.0);
    for (const FoundLeg& leg : figure_.legs.legs) sum += p[Index(leg.hip)] - p[Index(leg.ankle)];
    return sum;
  }

  // Determines whether the rest pose is standing: its legs are straight, parallel to an axis, and
  // below the body.
  void ReadRestPose() {
    const DVec3 legs_up = LegsUp(rest_);
    rest_axis_ = NearestAxis(legs_up);
    const DVec3 up = AxisVector(rest_axis_);
    const FoundLeg(&legs)[2] = figure_.legs.legs;
    const DVec3 hips = 0.5 * (rest_[Index(legs[0].hip)] + rest_[Index(legs[1].hip)]);
    DVec3 body(0.0);
    double lowest = INFINITY;
    double lowest_of_legs = INFINITY;
    for (int j = 1; j < static_cast<int>(rest_.size()); ++j) {
      int top = j;
      while (top > 0 && top != legs[0].hip && top != legs[1].hip) {
        top = figure_.joints[Index(top)].parent;
      }
      double& low = top <= 0 ? lowest : lowest_of_legs;
      low = std::min(low, glm::dot(rest_[Index(j)], up));
      if (top <= 0) body += rest_[Index(j)] - hips;
    }
    rest_stands_ = glm::dot(Unit(legs_up), up) >= kRestCos && glm::dot(body, up) >= 0.0 &&
                   glm::length(legs_up) >= kStraightShare * 2.0 * leg_length_ &&
                   lowest >= lowest_of_legs - kAtZero * leg_length_;
  }

  // The extent of the sampled motion along an axis, in file units.
  struct Extent {
    double lowest = 0.0;  // Median height of the lowest joint along the axis.
    double travel = 0.0;  // Range of the root's positions, without the lowest and the highest 5 %.
  };
  Extent ExtentAlong(const DVec3& axis) const {
    std::vector<double> lowest;
    std::vector<double> root;
    for (const Sampled& sample : samples_) {
      double low = INFINITY;
      for (const DVec3& p : sample.positions) low = std::min(low, glm::dot(p, axis));
      lowest.push_back(low);
      root.push_back(glm::dot(sample.positions[0], axis));
    }
    return {Quantile(lowest, 0.5), Quantile(root, 0.95) - Quantile(root, 0.05)};
  }

  bool IsAtZero(const Extent& extent) const {
    return std::fabs(extent.lowest) < kAtZero * leg_length_;
  }

  bool HasFloorAtZero(const Extent& extent) const {
    return IsAtZero(extent) && extent.travel < kMaxRise * leg_length_;
  }

  // Returns true if the figure stands and walks with `up` as the up axis. Returns false if it could
  // also be lying in a file whose up axis is `other`.
  bool StandsAlong(const DVec3& up, const DVec3& other) const {
    const Extent along_up = ExtentAlong(up);
    const Extent along_other = ExtentAlong(other);
    const bool travels = along_other.travel > kMinTravel * leg_length_ &&
                         along_other.travel > kTravelRatio * along_up.travel;
    return travels || (HasFloorAtZero(along_up) && !HasFloorAtZero(along_other));
  }

  // Returns the up axis of the rest pose in the world. Joints above the root may rotate the whole
  // figure by a constant rotation. In some files the figure stands upright only with this rotation.
  // In others the motion of the hips undoes it. The motion shows which case applies.
  DVec3 RestUpInWorld(const DVec3& mean_legs_up) const {
    const DVec3 plain = AxisVector(rest_axis_);
    const DVec3 turned = figure_.fixed_turn * plain;
    if (glm::dot(plain, turned) > kSnapCos) return turned;
    const bool plain_has_floor = HasFloorAtZero(ExtentAlong(plain));
    if (plain_has_floor != HasFloorAtZero(ExtentAlong(turned))) {
      return plain_has_floor ? plain : turned;
    }
    const double gain = glm::dot(mean_legs_up, turned) - glm::dot(mean_legs_up, plain);
    return gain >= kClearGain ? turned : plain;
  }

  void FindUp() {
    if (given_up_) {
      axes_.up = *given_up_;
      return;
    }
    DVec3 sum(0.0);
    for (const Sampled& sample : samples_) sum += Unit(LegsUp(sample.positions));
    const DVec3 mean = sum / static_cast<double>(samples_.size());
    const BvhAxis motion_axis = NearestAxis(mean);
    const DVec3 motion_up = AxisVector(motion_axis);
    const double motion_cos = glm::dot(mean, motion_up);
    const DVec3 rest_in_world = RestUpInWorld(mean);
    const BvhAxis rest_axis = NearestAxis(rest_in_world);
    const DVec3 rest_up = AxisVector(rest_axis);
    const bool rest_decides = rest_stands_ && glm::dot(rest_in_world, rest_up) >= kRestCos;
    if (rest_decides && (rest_axis == motion_axis || motion_cos < kMotionCos)) {
      axes_.up = rest_axis;
      axes_.up_source = UpSource::kRestPose;
      if (motion_cos < kMotionCos) {
        Note(Text("up is taken as %s from the rest pose; the motion is inconclusive",
                  AxisName(rest_axis)));
      }
    } else if (rest_decides && !StandsAlong(motion_up, rest_up)) {
      axes_.up = rest_axis;
      axes_.up_source = UpSource::kRestPose;
      Note(Text("up is taken as %s from the rest pose; the figure does not stand in the motion",
                AxisName(rest_axis)));
    } else if (motion_cos >= kMotionCos) {
      axes_.up = motion_axis;
      axes_.up_source = UpSource::kMotion;
      if (!rest_decides) AvoidLying();
    } else if (motion_cos >= kWeakMotionCos) {
      axes_.up = motion_axis;
      axes_.up_source = UpSource::kGuess;
      AvoidLying();
      Note(Text("up is taken as %s, since the feet are mostly below the hips in that direction",
                AxisName(axes_.up)));
    } else {
      axes_.up_source = UpSource::kGuess;
      Note("up is taken as +y; rest pose and motion are inconclusive");
    }
    if (axes_.up != BvhAxis::kPlusY) {
      Note(Text("the up axis of the file is %s; the motion was turned to +y", AxisName(axes_.up)));
    }
  }

  // Corrects the up axis of a figure that lies during the whole motion, so that the direction from
  // the feet to the hips is not up. Such a figure is recognized by its positions: along the assumed
  // axis the feet are far from zero, and along the usual up axis the lowest joints are near zero.
  void AvoidLying() {
    const DVec3 up = AxisVector(axes_.up);
    const Extent along_up = ExtentAlong(up);
    if (IsAtZero(along_up)) return;
    for (const BvhAxis usual : {BvhAxis::kPlusY, BvhAxis::kPlusZ}) {
      const Extent along_usual = ExtentAlong(AxisVector(usual));
      if (usual == axes_.up || !IsAtZero(along_usual) ||
          along_usual.travel > kAtZero * leg_length_) {
        continue;
      }
      Note(Text("up is taken as %s; the figure lies on the floor in the motion", AxisName(usual)));
      axes_.up = usual;
      axes_.up_source = UpSource::kGuess;
      return;
    }
  }

  // Averages a vector, in the frame of the root, over the motion.
  template <typename Vector>
  DVec3 MeanInRoot(Vector vector) const {
    DVec3 sum(0.0);
    for (const Sampled& sample : samples_) sum += glm::conjugate(sample.root) * vector(sample);
    return sum / static_cast<double>(samples_.size());
  }

  // Returns the horizontal direction of the feet in the frame of the root: the mean over the
  // motion, or the direction in the rest pose if the motion has no clear direction. It is the sum
  // of one vector per foot, each of length 1 at most.
  template <typename Level>
  DVec3 FindFeet(const Level& level) const {
    DVec3 feet(0.0);
    for (const Sampled& sample : samples_) feet += level(sample.foot);
    feet /= static_cast<double>(samples_.size());
    if (glm::length(feet) >= kClearFeet) return feet;
    DVec3 at_rest(0.0);
    for (const FoundLeg& leg : figure_.legs.legs) {
      at_rest += Unit(level(figure_.FootVector(leg)));
    }
    return glm::length(at_rest) > glm::length(feet) ? at_rest : feet;
  }

  // Returns the horizontal direction from the right leg to the left one, in the frame of the root.
  // Uses the first of hips, knees and ankles that are apart.
  template <typename Level>
  DVec3 FindLeft(const Level& level) const {
    const FoundLeg(&legs)[2] = figure_.legs.legs;
    const double least = 1e-6 * leg_length_;
    for (const int FoundLeg::* part : {&FoundLeg::hip, &FoundLeg::knee, &FoundLeg::ankle}) {
      const int left = legs[0].*part;
      const int right = legs[1].*part;
      const DVec3 at_rest = level(rest_[Index(left)] - rest_[Index(right)]);
      if (rest_stands_ || part == &FoundLeg::hip) {
        if (glm::length(at_rest) > least) return at_rest;
      }
      const DVec3 in_motion = level(MeanInRoot([&](const Sampled& sample) {
        return sample.positions[Index(left)] - sample.positions[Index(right)];
      }));
      if (glm::length(in_motion) > least) return in_motion;
    }
    return DVec3(0.0);
  }

  Status FindTurns(const DVec3& world_up, const DVec3& rest_up) {
    STRIDEWIRE_CHECK(std::fabs(glm::length(world_up) - 1.0) < 1e-6 &&
                     std::fabs(glm::length(rest_up) - 1.0) < 1e-6);
    const auto level = [&](const DVec3& v) { return v - glm::dot(v, rest_up) * rest_up; };
    FoundLegs& legs = figure_.legs;
    const DVec3 feet = FindFeet(level);
    const bool feet_are_clear = glm::length(feet) >= kClearFeet;
    DVec3 across = FindLeft(level);
    if (!legs.sides_known) {
      // The feet point forward, so left is up x forward.
      if (!feet_are_clear) {
        Note("left and right are guessed, since the feet have no clear direction");
      }
      if (glm::dot(across, glm::cross(rest_up, feet)) < 0.0) {
        std::swap(legs.legs[0], legs.legs[1]);
        across = -across;
      }
    }
    DVec3 left = legs.sides_known || !feet_are_clear ? across : glm::cross(rest_up, feet);
    if (glm::length(left) < 1e-9) left = glm::cross(rest_up, feet);
    if (glm::length(left) < 1e-9) {
      return Fail(ErrorCode::kUnsupported,
                  "both legs are at the same place and the feet have no direction, so left and "
                  "right are unknown; export a figure whose legs are apart",
                  name_);
    }
    left = Unit(level(SnapAxis(left)));
    if (glm::dot(glm::cross(left, rest_up), feet) < 0.0) {
      Note("the feet point backwards; left and right may be swapped");
    }
    const DVec3 other = std::fabs(world_up.x) > 0.9 ? DVec3(0, 0, 1) : DVec3(1, 0, 0);
    axes_.world_turn = TurnToOurAxes(Unit(other - glm::dot(other, world_up) * world_up), world_up);
    if (!rest_stands_) {
      // The direction from the motion differs between the files of one figure. All files must give
      // the same skeleton, so joint frames are rotated only by the up axis.
      axes_.joint_turn = axes_.world_turn;
      return {};
    }
    axes_.joint_turn = TurnToOurAxes(left, rest_up);
    // Applies the rotation of the joint frames to the world as well if this makes +Y the up axis.
    const DQuat turn = glm::normalize(axes_.joint_turn * glm::conjugate(figure_.fixed_turn));
    if ((turn * world_up).y > 0.999) {
      axes_.world_turn = turn;
    } else if ((axes_.joint_turn * world_up).y > 0.999) {
      axes_.world_turn = axes_.joint_turn;
    }
    return {};
  }

  BvhFigure& figure_;
  std::optional<BvhAxis> given_up_;
  const std::string& name_;
  double leg_length_ = 0.0;  // Mean length of both legs.
  std::vector<DVec3> rest_;
  std::vector<DQuat> rotations_;  // Scratch memory of ComputePose.
  std::vector<Sampled> samples_;
  bool rest_stands_ = false;
  // Up direction of the legs in the rest pose, in the frame of the root.
  BvhAxis rest_axis_ = BvhAxis::kPlusY;
  FigureAxes axes_;
};

}  // namespace

Expected<FigureAxes> FindFigureAxes(BvhFigure& figure, std::optional<BvhAxis> up,
                                    const std::string& name) {
  return AxesFinder(figure, up, name).Run();
}

}  // namespace stridewire
