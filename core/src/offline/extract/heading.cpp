#include "offline/extract/heading.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"
#include "offline/base/statistics.h"

namespace stridewire {
namespace {

constexpr double kStepDefaultS = 0.55;
constexpr double kStepMinS = 0.25;
constexpr double kStepMaxS = 1.0;

constexpr double kDegree = std::numbers::pi / 180.0;
// Standard deviations of the noise, and of the priors for slope and oscillation, in the fit at the
// ends of a recording.
constexpr double kNoiseRad = 4.0 * kDegree;
constexpr double kSlopeRadPerS = 50.0 * kDegree;
constexpr double kOscillationRad = 8.0 * kDegree;
// Neighbouring frames are strongly correlated, so n frames count as only n * kIndependentShare
// independent measurements.
constexpr double kIndependentShare = 0.1;

struct StepTime {
  double centre = 0.0;  // Frame.
  double frames = 0.0;
};

// Returns the numbers of frames between successive heel-strikes of different feet, in chronological
// order. Skips step times outside [kStepMinS, kStepMaxS] and applies a median filter of width 3.
std::vector<StepTime> StepTimes(const FootContacts& contacts, double fps) {
  struct Strike {
    int frame;
    int foot;
  };
  std::vector<Strike> strikes;
  for (int f = 0; f < 2; ++f) {
    for (const Contact& contact : contacts.feet[f]) {
      if (contact.frames.begin > 0) strikes.push_back({contact.frames.begin, f});
    }
  }
  std::ranges::sort(strikes, {}, &Strike::frame);
  std::vector<StepTime> raw;
  for (std::size_t i = 1; i < strikes.size(); ++i) {
    const double frames = strikes[i].frame - strikes[i - 1].frame;
    if (strikes[i].foot == strikes[i - 1].foot || frames < kStepMinS * fps ||
        frames > kStepMaxS * fps) {
      continue;
    }
    raw.push_back({0.5 * (strikes[i].frame + strikes[i - 1].frame), frames});
  }
  std::vector<StepTime> smooth = raw;
  for (std::size_t i = 1; i + 1 < raw.size(); ++i) {
    smooth[i].frames = Median({raw[i - 1].frames, raw[i].frames, raw[i + 1].frames});
  }
  return smooth;
}

double StepFramesAt(const std::vector<StepTime>& times, double frame, double fps) {
  if (times.empty()) return kStepDefaultS * fps;
  const auto nearest = std::ranges::min_element(
      times, {}, [&](const StepTime& t) { return std::fabs(t.centre - frame); });
  return nearest->frames;
}

// Fits a + b t + c cos(wt) + d sin(wt) to the yaw over [begin, end) and returns a, its smoothed
// value at `centre`.
double FitAtEnd(const std::vector<double>& yaw, int begin, int end, int centre,
                double stride_frames, double fps) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  const double w = 2.0 * std::numbers::pi / stride_frames;
  const double reference = yaw[static_cast<std::size_t>(centre)];
  for (int i = begin; i < end; ++i) {
    const double t = i - centre;
    const Eigen::Vector4d row(1.0, t / fps, std::cos(w * t), std::sin(w * t));
    normal += row * row.transpose();
    right += row * (yaw[static_cast<std::size_t>(i)] - reference);
  }
  const double weight = kIndependentShare * (end - begin) * kNoiseRad * kNoiseRad;
  normal(1, 1) += weight / (kSlopeRadPerS * kSlopeRadPerS);
  normal(2, 2) += weight / (kOscillationRad * kOscillationRad);
  normal(3, 3) += weight / (kOscillationRad * kOscillationRad);
  return reference + normal.ldlt().solve(right)(0);
}

}  // namespace

std::vector<double> StrideHeading(const BodyTracks& tracks, const FootContacts& contacts) {
  const std::vector<double>& yaw = tracks.pelvis_yaw_rad;
  const int count = tracks.size();
  STRIDEWIRE_CHECK(yaw.size() == static_cast<std::size_t>(count));
  const std::vector<StepTime> times = StepTimes(contacts, tracks.fps);
  std::vector<double> sums(static_cast<std::size_t>(count) + 1, 0.0);
  for (int i = 0; i < count; ++i) {
    sums[static_cast<std::size_t>(i) + 1] =
        sums[static_cast<std::size_t>(i)] + yaw[static_cast<std::size_t>(i)];
  }
  std::vector<double> heading(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const double step = StepFramesAt(times, i, tracks.fps);
    const int half = std::max(1, static_cast<int>(std::lround(step)));
    const int begin = std::max(0, i - half);
    const int end = std::min(count, i + half + 1);
    heading[static_cast<std::size_t>(i)] =
        end - begin == 2 * half + 1
            ? (sums[static_cast<std::size_t>(end)] - sums[static_cast<std::size_t>(begin)]) /
                  (end - begin)
            : FitAtEnd(yaw, begin, end, i, 2.0 * half + 1.0, tracks.fps);
  }
  return heading;
}

}  // namespace stridewire
