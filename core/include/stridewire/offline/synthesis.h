#pragma once

#include <span>
#include <string>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/avatar.h"
#include "stridewire/runtime/clip.h"

namespace stridewire {

/// A foot that stands during a movement, as its keytimes say.
struct PlantRecord {
  Foot foot = Foot::kLeft;
  double from_s = 0.0;
  double to_s = 0.0;
  DVec3 anchor_m = DVec3(0.0);  ///< Where its ball is to stand; unplanted: where it is at first
  double drift_m = 0.0;         ///< How far the ball gets from there in any frame, horizontally
};

/// What became of one movement. Times count from the start of the choreography.
struct MovementRecord {
  MovementKind kind = MovementKind::kStand;
  std::uint64_t request_id = 0;  ///< 0: inserted (closing step)
  int group = -1;
  double start_s = 0.0;
  double end_s = 0.0;
  std::vector<double> keytimes_s;
  ParameterValues requested;
  ParameterValues applied;  ///< After clamping to what the examples span
  ParameterValues
      corrected;  ///< sum w_i p_i, p_i of the examples: not `applied`, so that `measured` is
  ParameterValues measured;  ///< a(p) of the synthesized movement
  bool extrapolated = false;
  bool clamped = false;
  std::vector<float> weights;
  std::vector<PlantRecord> plants;
  // Steps: how far from where it was asked to the moving foot is when it first stands, horizontally, and
  // how far turned; without planting what `measured` misses of `requested`.
  double landing_error_m = 0.0;
  double landing_error_rad = 0.0;
  BaseFrame base;  ///< After the movement
};

/// How a walk ended.
struct WalkRecord {
  std::uint64_t request_id = 0;
  bool arrived = false;
  std::string reason;  ///< Why not
  double end_s = 0.0;
  BaseFrame base;  ///< Where it ended
};

/// A step that was not played, since it would have missed a footprint it had to meet.
struct UnreachableFootprint {
  std::uint64_t request_id = 0;
  std::string reason;
  double time_s = 0.0;
  FootprintError missed;
};

/// A layer that begins, changes or ends when a movement of the list begins.
struct LayerCue {
  std::size_t before =
      0;  ///< Which, from 0; as many as there are: after all of them, which shows nothing
  std::string layer;  ///< Its name
  bool is_off = false;
  double weight = 1.0;
  double blend_s = 0.3;
  double speed = 1.0;
};

struct Synthesis {
  Clip clip;  ///< World poses; frame 0 is the stand before the first tick
  std::vector<MovementRecord> movements;
  std::vector<WalkRecord> walks;
  std::vector<UnreachableFootprint> unreachable_footprints;
};

inline constexpr int kMaxSynthesisFrames = 1 << 20;

/// Runs an avatar through requests, without a server: what `fps` ticks a second would show, until it
/// stands idle. kUnsupported, kOutOfRange: a request is refused or no way leads to it (`where`); kLimitExceeded:
/// more than kMaxSynthesisFrames. `layers` in the order of `before`: each is on its way from the frame after the one its
/// movement (or a step inserted for it) begins in; kNotFound, kOutOfRange, kLimitExceeded as LayerStack::Set. Errors name
/// movements by their place in a choreography, where layers count among them.
[[nodiscard]] Expected<Synthesis> Synthesize(std::shared_ptr<const MotionLibrary> library,
                                             const BaseFrame& start,
                                             std::span<const MovementRequest> requests, double fps,
                                             const AvatarOptions& options = {},
                                             std::span<const LayerCue> layers = {});

}  // namespace stridewire
