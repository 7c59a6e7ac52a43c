#include "stridewire/offline/synthesis.h"

#include <algorithm>
#include <cmath>

#include "stridewire/runtime/measure.h"

namespace stridewire {
namespace {

DVec3 Ball(const MotionLibrary& library, const Clip& clip, double time_s, Pose& scratch,
           Foot foot) {
  SampleClip(clip, time_s, scratch);
  return DVec3(BallPosition(library.skeleton(), scratch, foot));
}

// The fixed foot of a step stands all along, the moving one before toe-off and after heel-strike;
// a jump has both feet down before toe-off and after landing.
std::vector<PlantRecord> PlantsOf(const MovementRecord& record) {
  std::vector<PlantRecord> plants;
  const std::size_t n = record.keytimes_s.size() - 1;
  const auto add = [&](Foot foot, std::size_t from, std::size_t to) {
    plants.push_back({foot, record.keytimes_s[from], record.keytimes_s[to], {}, 0.0});
  };
  if (IsStep(record.kind)) {
    const Foot moving = MovingFoot(record.kind);
    add(OtherFoot(moving), 0, n);
    if (n >= 2) add(moving, n - 1, n);
  } else if (record.kind == MovementKind::kJump) {
    const std::size_t toe_off = n == 5 ? 2 : 1;
    const std::size_t landing = n == 5 ? 3 : n - 1;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      add(foot, 0, toe_off);
      add(foot, landing, n);
    }
  }
  return plants;
}

void MeasurePlants(const MotionLibrary& library, const Clip& clip, Pose& scratch,
                   MovementRecord& record) {
  record.plants = PlantsOf(record);
  for (PlantRecord& plant : record.plants) {
    plant.anchor_m = Ball(library, clip, plant.from_s, scratch, plant.foot);
    for (double t = plant.from_s; t <= plant.to_s; t += 1.0 / clip.fps) {
      const DVec3 away = Ball(library, clip, t, scratch, plant.foot) - plant.anchor_m;
      plant.drift_m = std::max(plant.drift_m, std::hypot(away.x, away.z));
    }
  }
}

// How far the measured end of a step is from what was requested, in the parameters its group has.
void MeasureLanding(const MotionGroup& group, MovementRecord& record) {
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

Expected<Synthesis> Synthesize(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start,
                               std::span<const MovementRequest> requests, double fps,
                               const AvatarOptions& options) {
  if (!(fps >= 10.0 && fps <= 1000.0)) {
    return Fail(ErrorCode::kOutOfRange, "frames a second must be from 10 to 1000");
  }
  for (std::size_t i = 0; i < requests.size(); ++i) {
    if (Status status = ValidateRequest(*library, requests[i]); !status) {
      Error error = status.error();
      error.where = "movements[" + std::to_string(i) + "]." + error.where;
      error.index = -1;
      return std::unexpected(error);
    }
  }

  const int joint_count = library->skeleton().joint_count();
  Avatar avatar(library, start, options);
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
  std::size_t next = 0;
  while (next < requests.size() || !avatar.idle()) {
    while (next < requests.size() && avatar.queue_size() < Avatar::kMaxQueue) {
      if (Status status = avatar.Enqueue(requests[next]); !status) {
        Error error = status.error();
        error.index = static_cast<std::int64_t>(next);
        return std::unexpected(std::move(error));
      }
      ++next;
    }
    if (result.clip.frame_count() >= kMaxSynthesisFrames) {
      return Fail(ErrorCode::kLimitExceeded, "the choreography takes more than 2^20 frames");
    }
    avatar.Advance(1.0 / fps);
    record_pose();
    for (const AvatarEvent& event : avatar.events()) {
      if (event.type == AvatarEventType::kStarted) {
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
          record.corrected = movement->parameters;
          record.weights = movement->weights;
          for (int i = 0; i <= movement->interval_count; ++i) {
            record.keytimes_s.push_back(event.time_s +
                                        movement->keytimes_s[static_cast<std::size_t>(i)]);
          }
          cache.Clear();
          record.measured = MeasureMovement(*library, *movement, cache, scratch);
        }
        result.movements.push_back(std::move(record));
      } else if (event.type == AvatarEventType::kFinished && !result.movements.empty()) {
        result.movements.back().end_s = event.time_s;
        result.movements.back().base = event.base;
      }
    }
  }
  for (MovementRecord& record : result.movements) {
    if (record.keytimes_s.empty()) continue;
    MeasurePlants(*library, result.clip, scratch, record);
    if (IsStep(record.kind)) MeasureLanding(library->group(record.group), record);
  }
  return result;
}

}  // namespace stridewire
