#include "offline/extract/posture.h"

#include <algorithm>

namespace stridewire {
namespace {

// Limits below which a figure lies or crawls: the height of the pelvis as a fraction of the leg
// length, and the sine of the angle between trunk and ground.
constexpr double kLowPelvisShare = 0.65;
constexpr double kFlatTrunkSine = 0.45;
// When a figure crawls on hands and feet, the pelvis is higher, but the upper end of the trunk is
// at most slightly above it.
constexpr double kRaisedPelvisShare = 0.85;
constexpr double kLevelTrunkSine = 0.1;

}  // namespace

double PelvisHeight(const BodyTracks& tracks, int frame) {
  const auto i = static_cast<std::size_t>(frame);
  return tracks.pelvis_m[i].y - std::min(tracks.feet[0].ball_m[i].y, tracks.feet[1].ball_m[i].y);
}

bool LiesOrCrawls(const BodyTracks& tracks, int frame) {
  const auto i = static_cast<std::size_t>(frame);
  if (tracks.trunk_m.empty()) return false;
  const DVec3 trunk = tracks.trunk_m[i] - tracks.pelvis_m[i];
  const double height = PelvisHeight(tracks, frame) / tracks.leg_length_m;
  const double sine = trunk.y / std::max(1e-6, glm::length(trunk));
  return (height < kLowPelvisShare && sine < kFlatTrunkSine) ||
         (height < kRaisedPelvisShare && sine < kLevelTrunkSine);
}

}  // namespace stridewire
