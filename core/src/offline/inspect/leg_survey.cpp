#include "offline/inspect/leg_survey.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "offline/base/degrees.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// A leg is bent if the distance of its knee from the line between hip and ankle is more than this
// fraction of the thigh, which corresponds to a bend of the knee by about 20 degrees.
constexpr float kBent = 0.17f;
// A foot that points along the line from hip to ankle has no direction. If it points downward, as
// in a swing, its direction is uncertain, because a small tilt changes it by a large angle.
constexpr float kLeastFootPart = 0.5f;
constexpr float kCertainFootPart = 0.8f;

// Returns the forward direction of the pelvis, computed from the line between the hips.
Vec3 PelvisForward(const LegRig& rig, const std::array<LegPose, 2>& legs) {
  const auto hip = [&](Foot foot) {
    const auto f = static_cast<std::size_t>(foot);
    return legs[f].positions_m[static_cast<std::size_t>(rig.side(foot).hip)];
  };
  return glm::cross(hip(Foot::kLeft) - hip(Foot::kRight), Vec3(0.0f, 1.0f, 0.0f));
}

// Returns the angle between two directions in degrees. Returns 0 if one of them is zero.
double DegreesBetween(const Vec3& a, const Vec3& b) {
  const float lengths = glm::length(a) * glm::length(b);
  if (lengths < 1e-6f) return 0.0;
  const auto cosine = static_cast<double>(glm::dot(a, b) / lengths);
  return kDegreesPerRadian * std::acos(std::clamp(cosine, -1.0, 1.0));
}

// Returns the angle between the bend of a knee and the foot. Returns nullopt if one of them has no
// direction. `forward` is the direction of the pelvis.
std::optional<double> KneeDegrees(const LegRig::Side& side, const LegPose& leg,
                                  const Vec3& forward) {
  const Vec3& hip = leg.positions_m[static_cast<std::size_t>(side.hip)];
  const Vec3& knee = leg.positions_m[static_cast<std::size_t>(side.knee)];
  const Vec3& ankle = leg.positions_m[static_cast<std::size_t>(side.ankle)];
  const Vec3 line = ankle - hip;
  const float length = glm::length(line);
  if (length < 1e-3f) return std::nullopt;
  const Vec3 along = line / length;
  const Vec3 bend = knee - hip - glm::dot(knee - hip, along) * along;
  const Vec3 foot = leg.ball_m - ankle;
  const Vec3 ahead = foot - glm::dot(foot, along) * along;
  const float bend_m = glm::length(bend);
  const float ahead_m = glm::length(ahead);
  if (bend_m < kBent * side.thigh_m || ahead_m < kLeastFootPart * glm::length(foot)) {
    return std::nullopt;
  }
  const double to_foot_deg = DegreesBetween(bend, ahead);
  if (ahead_m >= kCertainFootPart * glm::length(foot)) return to_foot_deg;
  return std::min(to_foot_deg, DegreesBetween(bend, forward - glm::dot(forward, along) * along));
}

// Heights above level ground of the ball of a foot and of the lowest point of its sole.
struct SoleHeights {
  double ball_m = 0.0;
  double lowest_m = 0.0;
};

SoleHeights HeightsOf(const LegRig::Side& side, const LegPose& leg, double root_y_m) {
  const double ball_m = root_y_m + leg.ball_m.y - side.ball_height_m;
  return {ball_m, std::min({ball_m, root_y_m + leg.heel_m.y - side.ball_height_m,
                            root_y_m + leg.toe_tip_m.y - side.toe_height_m})};
}

// Returns by how much a foot hovers during a contact, from the heights of its sole in every frame.
double HoverOf(const PlantRecord& plant, const std::vector<double>& heights_m, double fps,
               bool has_stand) {
  constexpr double kSlack = 1e-6;
  const auto last_frame = static_cast<int>(heights_m.size()) - 1;
  const int first = static_cast<int>(std::ceil(plant.from_s * fps - kSlack));
  const int last = std::min(static_cast<int>(std::floor(plant.to_s * fps + kSlack)), last_frame);
  if (first > last) return 0.0;
  const auto [lowest, highest] =
      std::minmax_element(heights_m.begin() + first, heights_m.begin() + last + 1);
  return std::max(0.0, has_stand ? *highest : *lowest);
}

}  // namespace

void SurveyLegs(const MotionLibrary& library, const Synthesis& synthesis, bool has_stand,
                LegDeviations& deviations) {
  const LegRig& rig = library.leg_rig();
  if (!rig.is_usable) return;
  std::array<LegPose, 2> legs;
  std::array<std::vector<double>, 2> heights_m;
  for (int frame = 0; frame < synthesis.clip.frame_count(); ++frame) {
    const ConstPoseSpan pose = synthesis.clip.frame(frame);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      EvaluateLeg(library.skeleton(), rig, pose, foot, legs[static_cast<std::size_t>(foot)]);
    }
    const Vec3 forward = PelvisForward(rig, legs);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const auto f = static_cast<std::size_t>(foot);
      if (const auto knee_deg = KneeDegrees(rig.side(foot), legs[f], forward)) {
        deviations.knee_deg = std::max(deviations.knee_deg.value_or(0.0), *knee_deg);
      }
      const SoleHeights heights =
          HeightsOf(rig.side(foot), legs[f], static_cast<double>(pose.root_position_m.y));
      heights_m[f].push_back(has_stand ? heights.lowest_m : heights.ball_m);
      deviations.sink_m = std::max(deviations.sink_m, -heights.ball_m);
      ++deviations.feet;
    }
  }
  for (const MovementRecord& movement : synthesis.movements) {
    for (const PlantRecord& plant : movement.plants) {
      deviations.hover_m = std::max(deviations.hover_m,
                                    HoverOf(plant, heights_m[static_cast<std::size_t>(plant.foot)],
                                            synthesis.clip.fps, has_stand));
    }
  }
}

}  // namespace stridewire
