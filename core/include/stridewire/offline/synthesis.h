#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/avatar.h"
#include "stridewire/runtime/clip.h"

namespace stridewire {

/// A time span within a movement during which a foot stands on the ground. Times are seconds since
/// the start of the choreography.
struct PlantRecord {
  Foot foot = Foot::kLeft;
  double from_s = 0.0;
  double to_s = 0.0;
  /// Target of the ball. Without planting, this is the position of the ball at `from_s`.
  DVec3 anchor_m = DVec3(0.0);
  double drift_m = 0.0;  ///< Largest horizontal distance of the ball from `anchor_m`.
};

/// Describes one played movement. Times are seconds since the start of the choreography.
struct MovementRecord {
  MovementKind kind = MovementKind::kStand;
  /// Id of the request; 0 if the planner inserted this movement, for example a closing step.
  std::uint64_t request_id = 0;
  int group = -1;
  double start_s = 0.0;
  double end_s = 0.0;
  std::vector<double> keytimes_s;
  ParameterValues requested;
  ParameterValues applied;  ///< `requested`, clamped to the hull of the examples plus 10 %.
  /// With weight correction: sum of the parameters of the blended examples and variants, each
  /// multiplied by its weight. It usually differs from `applied`, because the weights are chosen so
  /// that `measured` equals `applied`. Without weight correction: same as `applied`.
  ParameterValues corrected;
  ParameterValues measured;  ///< Parameters measured on the movement, a(p) in the paper.
  bool extrapolated = false;
  bool clamped = false;
  std::vector<float> weights;  ///< [row]: weights of the examples, then of the variants.
  std::vector<PlantRecord> plants;
  /// Steps only: horizontal distance of the moving foot from the requested footprint when the foot
  /// has just landed. Without planting: distance between the measured and the requested position of
  /// the foot at the end.
  double landing_error_m = 0.0;
  /// Steps only: difference between the headings of that foot and of the requested footprint.
  /// Without planting: difference between the measured and the requested turn.
  double landing_error_rad = 0.0;
  BaseFrame base;  ///< Base frame after the movement.
};

/// The outcome of one walk.
struct WalkRecord {
  std::uint64_t request_id = 0;
  bool arrived = false;
  std::string reason;  ///< Reason why the walk failed; empty if `arrived`.
  double end_s = 0.0;
  BaseFrame base;          ///< Base frame at the end of the walk.
  double speed_m_s = 0.0;  ///< AvatarEvent::speed_m_s
};

/// A step or jump that was skipped because it was out of reach.
struct SkippedRequest {
  std::uint64_t request_id = 0;
  std::string reason;
  double time_s = 0.0;
  FootprintError missed;
};

/// Starts, changes or stops a layer when a movement begins.
struct LayerCue {
  /// Index in SynthesisInput::requests. The cue takes effect when this request starts. If the index
  /// equals the number of requests, the cue has no effect, because no movement follows.
  std::size_t before = 0;
  std::string layer;  ///< Name of the layer.
  bool enabled = true;
  double weight = 1.0;
  double blend_s = 0.3;
  double speed = 1.0;
};

struct Synthesis {
  Clip clip;  ///< Poses in world space; frame 0 is the standing pose before the first tick.
  std::vector<MovementRecord> movements;
  std::vector<WalkRecord> walks;
  std::vector<SkippedRequest> skipped;
  /// Reason why the feet are apart at the end of the choreography; empty if they are together.
  std::string stop_reason;
};

inline constexpr int kMaxSynthesisFrames = 1 << 20;  ///< Maximum number of frames of a Synthesis.

/// Arguments of Synthesize.
struct SynthesisInput {
  std::shared_ptr<const MotionLibrary> library;
  BaseFrame start;
  std::span<const MovementRequest> requests;
  double fps = 60.0;  ///< Ticks per second, 10 to 1000.
  AvatarOptions options;
  /// Must be sorted by `before`. Each cue takes effect in the frame after its request has started,
  /// has been skipped or has failed.
  std::span<const LayerCue> layers;
};

/// Plays requests on an avatar without a server and records one pose per tick until the avatar is
/// idle.
///
/// Errors: kOutOfRange if `fps` is out of range. kLimitExceeded if the result exceeds
/// kMaxSynthesisFrames. For requests, the errors of Avatar::Enqueue, and kUnsupported if no
/// transition path leads to a request. For layers, the errors of Avatar::SetLayer. For requests and
/// layers, Error::where contains the path in a choreography file, for example "movements[3].step".
/// The list `movements` of such a file contains both.
[[nodiscard]] Expected<Synthesis> Synthesize(const SynthesisInput& input);

}  // namespace stridewire
