#include "stridewire/offline/synthesis.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "base/check.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/leg_rig.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

// The frames in [from_s, to_s], with a tolerance of a millionth of a frame. Empty if first > last.
struct Frames {
  Frames(const Clip& clip, double from_s, double to_s)
      : first(static_cast<int>(std::ceil(from_s * clip.fps - 1e-6))),
        last(std::min(static_cast<int>(std::floor(to_s * clip.fps + 1e-6)),
                      clip.frame_count() - 1)) {}
  int first;
  int last;
};

DVec3 Ball(const MotionLibrary& library, const Clip& clip, int frame, Foot foot) {
  return DVec3(BallPosition(library.skeleton(), clip.frame(frame), foot));
}

// Returns the contacts of planted feet according to the plan of the movement. In a step, the last
// contact is that of the landing foot.
std::vector<PlantRecord> PlantsOf(const MovementRecord& record, const Movement& movement) {
  std::vector<PlantRecord> plants;
  const Foot last = IsStep(record.kind) ? MovingFoot(record.kind) : Foot::kRight;
  for (const Foot foot : {OtherFoot(last), last}) {
    const FootTrajectory& track = movement.feet.foot(foot);
    const double end_s = record.start_s + movement.duration_s();
    const double release_s = std::min(record.start_s + track.release_s, end_s);
    plants.push_back({foot, record.start_s, release_s, track.from.position_m, 0.0});
    if (record.start_s + track.land_s <= end_s) {
      plants.push_back({foot, record.start_s + track.land_s, end_s, track.to.position_m, 0.0});
    }
  }
  return plants;
}

// Returns the contacts of a movement without planting, from its keytimes. The fixed foot of a step
// stands from start to end. Of the moving foot, only the contact after heel-strike is returned. In
// a jump, both feet stand before toe-off and after landing.
std::vector<PlantRecord> PlantsOf(const MovementRecord& record) {
  std::vector<PlantRecord> plants;
  const std::size_t n = record.keytimes_s.size() - 1;
  const auto add = [&](Foot foot, std::size_t from, std::size_t to) {
    plants.push_back({foot, record.keytimes_s[from], record.keytimes_s[to], {}, 0.0});
  };
  const ContactKeytimes contact = ContactKeytimesOf(record.kind, static_cast<int>(n));
  if (IsStep(record.kind)) {
    const Foot moving = MovingFoot(record.kind);
    add(OtherFoot(moving), 0, n);
    if (n >= 2) add(moving, contact.landing, n);
  } else if (record.kind == MovementKind::kJump) {
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      add(foot, 0, contact.toe_off);
      add(foot, contact.landing, n);
    }
  }
  return plants;
}

// Returns the footprint that a planted step was requested to reach.
Footprint RequestedFootprint(MovementKind kind, const FootPlan& feet) {
  Footprint requested = feet.foot(MovingFoot(kind)).to;
  requested.position_m += feet.missed_m;
  requested.heading_rad += feet.missed_rad;
  return requested;
}

void MeasurePlants(const MotionLibrary& library, const Clip& clip, MovementRecord& record) {
  const bool is_planted = !record.plants.empty();
  if (!is_planted) record.plants = PlantsOf(record);
  for (PlantRecord& plant : record.plants) {
    const Frames frames(clip, plant.from_s, plant.to_s);
    if (!is_planted && frames.first <= frames.last) {
      plant.anchor_m = Ball(library, clip, frames.first, plant.foot);
    }
    for (int frame = frames.first; frame <= frames.last; ++frame) {
      const DVec3 away = Ball(library, clip, frame, plant.foot) - plant.anchor_m;
      plant.drift_m = std::max(plant.drift_m, std::hypot(away.x, away.z));
    }
  }
}

// Returns true for the event that ends a walk: kFinished of kind kStand, or kRejected.
bool EndsWalk(const AvatarEvent& event, const std::set<std::uint64_t>& walks) {
  return walks.contains(event.request_id) &&
         (event.type == AvatarEventType::kRejected ||
          (event.type == AvatarEventType::kFinished && event.kind == MovementKind::kStand));
}

// Returns the path of a request in the choreography file, whose list also contains layers.
std::string PathOf(std::size_t request, std::span<const LayerCue> layers) {
  const auto before =
      std::ranges::count_if(layers, [&](const LayerCue& cue) { return cue.before <= request; });
  return "movements[" + std::to_string(request + static_cast<std::size_t>(before)) + "]";
}

// Returns the error for a rejected step or jump. It was rejected because no transition path leads
// to it.
Error Rejected(const AvatarEvent& event, std::span<const MovementRequest> requests,
               std::span<const LayerCue> layers) {
  const auto request = std::ranges::find(requests, event.request_id, &MovementRequest::id);
  return {event.code, event.reason, -1,
          PathOf(static_cast<std::size_t>(request - requests.begin()), layers)};
}

// Sets the layers that start before a movement. Skips layers that were already set for earlier
// movements.
Status SetLayers(std::span<const LayerCue> layers, std::size_t before, std::size_t& next,
                 AvatarSimulation& avatar) {
  for (; next < layers.size() && layers[next].before <= before; ++next) {
    const LayerCue& cue = layers[next];
    const Status status = avatar.SetLayer({.layer = avatar.library().FindLayer(cue.layer),
                                           .enabled = cue.enabled,
                                           .weight = cue.weight,
                                           .blend_s = cue.blend_s,
                                           .speed = cue.speed});
    if (status) continue;
    Error error = status.error();
    error.where = "movements[" + std::to_string(cue.before + next) + "].layer";
    error.index = -1;
    return std::unexpected(std::move(error));
  }
  return {};
}

// Measures how far the foot is from the requested footprint of a step when it has just landed.
void MeasureLanding(const MotionLibrary& library, const Clip& clip, const Footprint& requested,
                    MovementRecord& record) {
  STRIDEWIRE_CHECK(IsStep(record.kind) && !record.plants.empty());
  const Foot foot = MovingFoot(record.kind);
  const double end_s = clip.frame_count() / clip.fps;
  const int frame = Frames(clip, record.plants.back().from_s, end_s).first;
  if (frame >= clip.frame_count()) return;
  const ConstPoseSpan pose = clip.frame(frame);
  LegPose leg;
  EvaluateLeg(library.skeleton(), library.leg_rig(), pose, foot, leg);
  const BlendedFoot lands = FootOf(library.leg_rig(), foot, DVec3(pose.root_position_m), leg);
  record.landing_error_m =
      std::hypot(lands.ball_m.x - requested.position_m.x, lands.ball_m.z - requested.position_m.z);
  record.landing_error_rad = std::fabs(WrapAngle(lands.heading_rad - requested.heading_rad));
}

// Returns the weighted mean of the parameters of the examples and variants, sum w_i p_i. Without
// weight correction, stride variation and pseudoexamples, these are the parameters for which the
// weights were computed.
ParameterValues MeanParameters(const MotionGroup& group, std::span<const float> weights) {
  ParameterValues mean;
  mean.count = group.parameter_count();
  for (std::size_t row = 0; row < weights.size(); ++row) {
    const std::span<const double> parameters = group.row_parameters(static_cast<int>(row));
    for (std::size_t l = 0; l < parameters.size(); ++l) {
      mean.values[l] += static_cast<double>(weights[row]) * parameters[l];
    }
  }
  return mean;
}

// Measures the landing without planting: the difference between measured and requested end
// parameters of the group.
void MeasureUnplantedLanding(const MotionGroup& group, MovementRecord& record) {
  double squared = 0.0;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    const double miss = record.measured.values[l] - record.requested.values[l];
    switch (group.parameters[l].name) {
      case ParameterName::kEndX:
      case ParameterName::kEndY:
      case ParameterName::kEndZ: squared += miss * miss; break;
      case ParameterName::kTurn: record.landing_error_rad = std::fabs(miss); break;
      default: break;
    }
  }
  record.landing_error_m = std::sqrt(squared);
}

}  // namespace

Expected<Synthesis> Synthesize(const SynthesisInput& input) {
  const auto& [library, start, requests, fps, options, layers] = input;
  if (!(fps >= 10.0 && fps <= 1000.0)) {
    return Fail(ErrorCode::kOutOfRange, "expected 10 to 1000 frames per second");
  }
  for (std::size_t i = 0; i < requests.size(); ++i) {
    if (Status status = ValidateRequest(*library, requests[i]); !status) {
      Error error = status.error();
      error.where = PathOf(i, layers) + "." + error.where;
      error.index = -1;
      return std::unexpected(error);
    }
  }

  const int joint_count = library->skeleton().joint_count();
  AvatarSimulation avatar(library, start, options);
  Synthesis result;
  result.clip.fps = fps;
  result.clip.joint_count = joint_count;
  const auto record_pose = [&] {
    const ConstPoseSpan pose = avatar.pose();
    result.clip.root_positions_m.push_back(pose.root_position_m);
    result.clip.rotations.insert(result.clip.rotations.end(), pose.rotations.begin(),
                                 pose.rotations.end());
  };
  record_pose();

  Pose scratch(joint_count);
  GridCache cache(library->layout());
  // [movement]: requested footprint. Set only for planted steps.
  std::vector<std::optional<Footprint>> requested;
  std::set<std::uint64_t> walks;
  for (const MovementRequest& request : requests) {
    if (std::holds_alternative<WalkRequest>(request.movement)) walks.insert(request.id);
  }
  std::size_t next_cue = 0;
  if (Status status = SetLayers(layers, 0, next_cue, avatar); !status) {
    return std::unexpected(status.error());
  }
  std::size_t next = 0;
  while (next < requests.size() || !avatar.idle()) {
    while (next < requests.size() && avatar.queue_size() < AvatarSimulation::kMaxQueue) {
      if (Status status = avatar.Enqueue(requests[next]); !status) {
        Error error = status.error();
        error.where = PathOf(next, layers) + (error.where.empty() ? "" : "." + error.where);
        error.index = -1;
        return std::unexpected(std::move(error));
      }
      ++next;
    }
    if (result.clip.frame_count() >= kMaxSynthesisFrames) {
      return Fail(ErrorCode::kLimitExceeded,
                  "the choreography takes more than the limit of 2^20 frames");
    }
    avatar.Advance(1.0 / fps);
    record_pose();
    for (const AvatarEvent& event : avatar.events()) {
      const auto about = std::ranges::find(requests, event.request_id, &MovementRequest::id);
      if (next_cue < layers.size() && about != requests.end()) {
        const auto before = static_cast<std::size_t>(about - requests.begin());
        if (Status status = SetLayers(layers, before, next_cue, avatar); !status) {
          return std::unexpected(status.error());
        }
      }
      if (event.type == AvatarEventType::kIdle) result.stop_reason = event.reason;
      if (event.type == AvatarEventType::kStarted) {
        requested.emplace_back();
        MovementRecord record;
        record.kind = event.kind;
        record.request_id = event.request_id;
        record.group = event.group;
        record.start_s = event.time_s;
        record.requested = event.requested;
        record.applied = event.applied;
        record.extrapolated = event.extrapolated;
        record.clamped = event.clamped;
        if (const Movement* movement = avatar.movement(); movement != nullptr && event.group >= 0) {
          record.corrected = options.run_time_correction
                                 ? MeanParameters(library->group(event.group), movement->weights)
                                 : movement->parameters;
          record.weights = movement->weights;
          for (int i = 0; i <= movement->warp.interval_count(); ++i) {
            record.keytimes_s.push_back(event.time_s + movement->warp.keytime_s(i));
          }
          cache.Clear();
          if (movement->feet.is_active) {
            record.plants = PlantsOf(record, *movement);
            if (IsStep(record.kind))
              requested.back() = RequestedFootprint(record.kind, movement->feet);
          }
          record.measured = MeasureMovement(*library, *movement, cache, scratch);
        }
        result.movements.push_back(std::move(record));
      } else if (EndsWalk(event, walks)) {
        result.walks.push_back({event.request_id, event.type == AvatarEventType::kFinished,
                                event.reason, event.time_s, event.base, event.speed_m_s});
      } else if (event.missed) {
        result.skipped.push_back(
            {event.request_id, DescribeRejection(event), event.time_s, *event.missed});
      } else if (event.type == AvatarEventType::kRejected) {
        return std::unexpected(Rejected(event, requests, layers));
      } else if (event.type == AvatarEventType::kFinished && !result.movements.empty()) {
        STRIDEWIRE_CHECK(event.time_s >= result.movements.back().start_s);
        result.movements.back().end_s = event.time_s;
        result.movements.back().base = event.base;
      }
    }
  }
  STRIDEWIRE_CHECK(result.movements.size() == requested.size() && next == requests.size());
  for (std::size_t i = 0; i < result.movements.size(); ++i) {
    MovementRecord& record = result.movements[i];
    if (record.keytimes_s.empty()) continue;
    MeasurePlants(*library, result.clip, record);
    if (requested[i]) {
      MeasureLanding(*library, result.clip, *requested[i], record);
    } else if (IsStep(record.kind)) {
      MeasureUnplantedLanding(library->group(record.group), record);
    }
  }
  return result;
}

}  // namespace stridewire
