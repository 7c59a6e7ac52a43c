#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "base/trig.h"
#include "leg_geometry.h"
#include "stridewire/offline/synthesis.h"
#include "velocity_steps.h"

namespace stridewire {

/// Measurements of planted feet, computed only from a motion and its reported footprints.
struct PlantFigures {
  int contacts = 0;
  double largest_drift_m =
      0.0;  ///< Largest horizontal distance of a planted ball from its footprint.
  /// Largest mean speed of a planted ball over a tenth of a second.
  double largest_speed_m_s = 0.0;
  double least_knee_deg = 180.0;
  /// Absolute angular acceleration of both knees in every frame, in deg/s^2.
  std::vector<double> knee_acceleration;
  VelocityStep largest_join_step;
  VelocityStep largest_inside_step;
};

/// Ball positions and foot headings in every frame.
struct FootCurves {
  std::vector<DVec3> balls[2];
  /// Headings relative to that in frame 0, in which the avatar stands at heading 0.
  std::vector<double> headings_rad[2];
};

inline FootCurves CurvesOf(const Skeleton& skeleton, const Clip& clip) {
  FootCurves curves;
  const auto n = static_cast<std::size_t>(skeleton.joint_count());
  std::vector<Vec3> positions(n);
  std::vector<Quat> rotations(n);
  for (int frame = 0; frame < clip.frame_count(); ++frame) {
    ForwardKinematics(skeleton, clip.frame(frame), positions, rotations);
    for (int f = 0; f < 2; ++f) {
      const Leg& leg = skeleton.legs[f];
      const auto ball = static_cast<std::size_t>(leg.ball);
      const DVec3 at = DVec3(positions[ball]) + DVec3(rotations[ball] * leg.ball_offset_m);
      const DVec3 foot = at - DVec3(positions[static_cast<std::size_t>(leg.ankle)]);
      curves.balls[f].push_back(at);
      const double heading = std::atan2(foot.x, foot.z);
      auto& headings = curves.headings_rad[f];
      headings.push_back(headings.empty() ? heading : heading - headings.front());
    }
  }
  for (auto& headings : curves.headings_rad) headings.front() = 0.0;
  return curves;
}

inline PlantFigures MeasurePlanting(const Skeleton& skeleton, const Clip& clip,
                                    std::span<const MovementRecord> movements) {
  PlantFigures figures;
  const FootCurves curves = CurvesOf(skeleton, clip);
  const int frames = clip.frame_count();
  std::vector<char> is_join(static_cast<std::size_t>(frames) + 1);
  for (const MovementRecord& record : movements) {
    const double at = record.start_s * clip.fps;
    for (int f = static_cast<int>(std::floor(at)); f <= static_cast<int>(std::floor(at)) + 1; ++f) {
      if (f >= 0 && f < frames) is_join[static_cast<std::size_t>(f)] = 1;
    }
    for (const PlantRecord& plant : record.plants) {
      const auto& balls = curves.balls[static_cast<int>(plant.foot)];
      const int first = static_cast<int>(std::ceil(plant.from_s * clip.fps - 1e-6));
      const int last =
          std::min(static_cast<int>(std::floor(plant.to_s * clip.fps + 1e-6)), frames - 1);
      if (first > last) continue;
      ++figures.contacts;
      const int tenth = std::max(1, static_cast<int>(std::lround(0.1 * clip.fps)));
      for (int f = first; f <= last; ++f) {
        const DVec3 at_f = balls[static_cast<std::size_t>(f)];
        figures.largest_drift_m =
            std::max(figures.largest_drift_m,
                     std::hypot(at_f.x - plant.anchor_m.x, at_f.z - plant.anchor_m.z));
        if (f - tenth < first) continue;
        const DVec3 moved = at_f - balls[static_cast<std::size_t>(f - tenth)];
        figures.largest_speed_m_s =
            std::max(figures.largest_speed_m_s, std::hypot(moved.x, moved.z) * clip.fps / tenth);
      }
    }
  }

  LegGeometry legs(skeleton, clip.frame(0));
  std::vector<double> knees[2];
  for (int f = 0; f < frames; ++f) {
    legs.Set(clip.frame(f));
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      knees[static_cast<int>(foot)].push_back(legs.KneeDegrees(foot));
    }
  }
  for (const auto& knee : knees) {
    for (std::size_t f = 0; f < knee.size(); ++f) {
      figures.least_knee_deg = std::min(figures.least_knee_deg, knee[f]);
      if (f < 2) continue;
      figures.knee_acceleration.push_back(std::fabs(knee[f] - 2.0 * knee[f - 1] + knee[f - 2]) *
                                          clip.fps * clip.fps);
    }
  }
  std::ranges::sort(figures.knee_acceleration);

  VelocitySteps steps(skeleton, clip.fps);
  for (int f = 0; f < frames; ++f) {
    const VelocityStep step = steps.Add(clip.frame(f));
    // True for the two frames around a transition between movements.
    const bool at_join =
        is_join[static_cast<std::size_t>(f)] || (f > 0 && is_join[static_cast<std::size_t>(f - 1)]);
    VelocityStep& largest = at_join ? figures.largest_join_step : figures.largest_inside_step;
    largest.joint_rad_s = std::max(largest.joint_rad_s, step.joint_rad_s);
    largest.root_m_s = std::max(largest.root_m_s, step.root_m_s);
  }
  return figures;
}

inline double Percentile(std::span<const double> sorted, double part) {
  if (sorted.empty()) return 0.0;
  return sorted[std::min(sorted.size() - 1,
                         static_cast<std::size_t>(part * static_cast<double>(sorted.size())))];
}

}  // namespace stridewire
