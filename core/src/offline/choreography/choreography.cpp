#include "stridewire/offline/choreography.h"

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "base/check.h"
#include "offline/base/json_document.h"
#include "offline/base/json_field.h"
#include "offline/choreography/terrain_json.h"

namespace stridewire {
namespace {

using nlohmann::json;

static_assert(kMaxRequestLengthM == 10.0 && kMaxRequestTurnRad == 3.2 && kMaxStandS == 3600.0 &&
              kMaxWaypoints == 64 && kMaxChoreographyPositionM == 1e5 &&
              kMaxChoreographyHeadingRad == 1e4);
constexpr JsonLimit kLength = {-kMaxRequestLengthM, kMaxRequestLengthM,
                               "expected a number from -10 to 10 m"};
constexpr JsonLimit kTurn = {-kMaxRequestTurnRad, kMaxRequestTurnRad,
                             "expected a number from -3.2 to 3.2 rad"};
constexpr JsonLimit kSeconds = {0.0, kMaxStandS, "expected a number from 0 to 3600 s"};
constexpr JsonLimit kSpeed = {kMinWalkSpeedMPerS, kMaxWalkSpeedMPerS,
                              "expected a number from 0.05 to 5 m/s"};
constexpr JsonLimit kWeight = {0.0, 1.0, "expected a number from 0 to 1"};
constexpr JsonLimit kBlend = {0.0, kMaxLayerBlendS, "expected a number from 0 to 10 s"};
constexpr JsonLimit kLayerSpeed = {kMinLayerSpeed, kMaxLayerSpeed,
                                   "expected a number from 0.1 to 4"};
constexpr JsonLimit kPosition = {-kMaxChoreographyPositionM, kMaxChoreographyPositionM,
                                 "expected a number from -100000 to 100000 m"};
constexpr JsonLimit kHeading = {-kMaxChoreographyHeadingRad, kMaxChoreographyHeadingRad,
                                "expected a number from -10000 to 10000 rad"};

/// Reads [x, y, z].
Status ReadPosition(const json& position, const std::string& where, DVec3& out) {
  if (!position.is_array() || position.size() != 3) {
    return Fail(ErrorCode::kMalformed, "expected an array of three numbers", where);
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (auto ok = ReadNumberAt(position[static_cast<std::size_t>(axis)],
                               where + "[" + std::to_string(axis) + "]", kPosition, out[axis]);
        !ok) {
      return ok;
    }
  }
  return {};
}

Status ReadPosition(const JsonField& field, const char* key, DVec3& out) {
  return ReadPosition(*field.Find(key), field.WhereOf(key), out);
}

/// Reads a step with `at_m`. Such a step must not have a length, side, height or turn.
Status ReadFootprint(const JsonField& field, FootprintRequest& at) {
  for (const char* key : {"length_m", "side_m", "height_m", "turn_rad"}) {
    if (field.Find(key) != nullptr) {
      return Fail(ErrorCode::kMalformed, "cannot be combined with at_m", field.WhereOf(key));
    }
  }
  if (auto ok = ReadPosition(field, "at_m", at.position_m); !ok) return ok;
  if (field.Find("heading_rad") == nullptr) return {};
  return ReadNumber(field, "heading_rad", kHeading, at.heading_rad.emplace());
}

Status ReadFlag(const JsonField& field, const char* key, bool& out) {
  const json* value = field.Find(key);
  if (value == nullptr) return {};
  if (!value->is_boolean()) {
    return Fail(ErrorCode::kMalformed, "expected true or false", field.WhereOf(key));
  }
  out = value->get<bool>();
  return {};
}

Status ReadStep(const JsonField& field, StepRequest& step) {
  if (auto ok = CheckKeys(field, {"foot", "length_m", "side_m", "height_m", "turn_rad", "at_m",
                                  "heading_rad", "exact_only", "allow_nearest"});
      !ok) {
    return ok;
  }
  if (const json* foot = field.Find("foot")) {
    if (*foot == "left") {
      step.foot = Foot::kLeft;
    } else if (*foot == "right") {
      step.foot = Foot::kRight;
    } else {
      return Fail(ErrorCode::kMalformed, "expected \"left\" or \"right\"", field.WhereOf("foot"));
    }
  }
  if (auto ok = ReadFlag(field, "exact_only", step.exact_only); !ok) return ok;
  if (auto ok = ReadFlag(field, "allow_nearest", step.allow_nearest); !ok) return ok;
  if (step.exact_only && step.allow_nearest) {
    return Fail(ErrorCode::kMalformed, "cannot be combined with allow_nearest",
                field.WhereOf("exact_only"));
  }
  if (field.Find("at_m") != nullptr) return ReadFootprint(field, step.at.emplace());
  if (field.Find("heading_rad") != nullptr) {
    return Fail(ErrorCode::kMalformed, "requires at_m", field.WhereOf("heading_rad"));
  }
  if (auto ok = ReadRequiredNumber(field, "length_m", kLength, step.length_m); !ok) return ok;
  if (field.Find("side_m") != nullptr) {
    double side_m = 0.0;
    if (auto ok = ReadNumber(field, "side_m", kLength, side_m); !ok) return ok;
    step.side_m = side_m;
  }
  if (auto ok = ReadNumber(field, "height_m", kLength, step.height_m); !ok) return ok;
  return ReadNumber(field, "turn_rad", kTurn, step.turn_rad);
}

Status ReadJump(const JsonField& field, JumpRequest& jump) {
  if (auto ok = CheckKeys(field, {"length_m", "height_m", "turn_rad", "allow_nearest"}); !ok) {
    return ok;
  }
  if (auto ok = ReadFlag(field, "allow_nearest", jump.allow_nearest); !ok) return ok;
  if (auto ok = ReadRequiredNumber(field, "length_m", kLength, jump.length_m); !ok) return ok;
  if (auto ok = ReadNumber(field, "height_m", kLength, jump.height_m); !ok) return ok;
  return ReadNumber(field, "turn_rad", kTurn, jump.turn_rad);
}

Status ReadWalk(const JsonField& field, WalkRequest& walk) {
  if (auto ok = CheckKeys(field, {"position_m", "heading_rad", "waypoints_m", "speed_m_s"}); !ok) {
    return ok;
  }
  if (field.Find("position_m") == nullptr) {
    return Fail(ErrorCode::kMalformed, "required key is missing", field.WhereOf("position_m"));
  }
  if (auto ok = ReadPosition(field, "position_m", walk.position_m); !ok) return ok;
  if (auto ok = ReadRequiredNumber(field, "heading_rad", kHeading, walk.heading_rad); !ok)
    return ok;
  if (const json* waypoints = field.Find("waypoints_m")) {
    const std::string where = field.WhereOf("waypoints_m");
    if (!waypoints->is_array()) return Fail(ErrorCode::kMalformed, "expected an array", where);
    if (waypoints->size() > kMaxWaypoints) {
      return Fail(ErrorCode::kLimitExceeded, "expected at most 64 positions", where);
    }
    for (std::size_t i = 0; i < waypoints->size(); ++i) {
      if (auto ok = ReadPosition((*waypoints)[i], where + "[" + std::to_string(i) + "]",
                                 walk.waypoints_m.emplace_back());
          !ok) {
        return ok;
      }
    }
  }
  if (field.Find("speed_m_s") == nullptr) return {};
  return ReadNumber(field, "speed_m_s", kSpeed, walk.speed_m_s.emplace());
}

Status ReadStand(const JsonField& field, StandRequest& stand) {
  if (auto ok = CheckKeys(field, {"seconds"}); !ok) return ok;
  return ReadRequiredNumber(field, "seconds", kSeconds, stand.seconds);
}

Status ReadLayer(const JsonField& field, LayerCue& cue) {
  if (auto ok = CheckKeys(field, {"name", "enabled", "weight", "blend_s", "speed"}); !ok) return ok;
  const json* name = field.Find("name");
  if (name == nullptr)
    return Fail(ErrorCode::kMalformed, "required key is missing", field.WhereOf("name"));
  if (!name->is_string() || name->get<std::string>().empty()) {
    return Fail(ErrorCode::kMalformed, "expected a non-empty string", field.WhereOf("name"));
  }
  cue.layer = name->get<std::string>();
  if (auto ok = ReadFlag(field, "enabled", cue.enabled); !ok) return ok;
  if (auto ok = ReadNumber(field, "weight", kWeight, cue.weight); !ok) return ok;
  if (auto ok = ReadNumber(field, "blend_s", kBlend, cue.blend_s); !ok) return ok;
  return ReadNumber(field, "speed", kLayerSpeed, cue.speed);
}

Status ReadMovement(const JsonField& field, MovementRequest& request) {
  const auto item = field.value.begin();
  const JsonField inner{item.value(), field.WhereOf(item.key())};
  if (item.key() == "step") return ReadStep(inner, request.movement.emplace<StepRequest>());
  if (item.key() == "jump") return ReadJump(inner, request.movement.emplace<JumpRequest>());
  if (item.key() == "stand") return ReadStand(inner, request.movement.emplace<StandRequest>());
  return ReadWalk(inner, request.movement.emplace<WalkRequest>());
}

Status ReadStart(const JsonField& field, BaseFrame& start) {
  if (auto ok = CheckKeys(field, {"position_m", "heading_rad"}); !ok) return ok;
  if (field.Find("position_m") != nullptr) {
    if (auto ok = ReadPosition(field, "position_m", start.position_m); !ok) return ok;
  }
  return ReadNumber(field, "heading_rad", kHeading, start.heading_rad);
}

}  // namespace

Expected<Choreography> ParseChoreography(std::string_view text, std::string_view name) {
  if (text.size() > kMaxChoreographyBytes) {
    return Fail(ErrorCode::kLimitExceeded, "the file is larger than the limit of 4 MiB",
                std::string(name));
  }
  const Expected<json> document = ParseJson(text, name, kMaxChoreographyDepth);
  if (!document) return std::unexpected(document.error());

  const JsonField root{*document, std::string(name) + ": "};
  if (auto ok = CheckKeys(root, {"start", "terrain", "movements"}); !ok) {
    return std::unexpected(ok.error());
  }
  Choreography choreography;
  if (const json* terrain = root.Find("terrain")) {
    auto read = ReadTerrainField({*terrain, root.WhereOf("terrain")});
    if (!read) return std::unexpected(std::move(read.error()));
    choreography.terrain = *std::move(read);
  }
  if (const json* start = root.Find("start")) {
    if (auto ok = ReadStart({*start, root.WhereOf("start")}, choreography.start); !ok) {
      return std::unexpected(ok.error());
    }
  }
  const std::string where = root.WhereOf("movements");
  const json* movements = root.Find("movements");
  if (movements == nullptr) return Fail(ErrorCode::kMalformed, "required key is missing", where);
  if (!movements->is_array()) return Fail(ErrorCode::kMalformed, "expected an array", where);
  if (movements->empty())
    return Fail(ErrorCode::kOutOfRange, "expected at least one movement", where);
  if (movements->size() > kMaxChoreographyMovements) {
    return Fail(ErrorCode::kLimitExceeded, "expected at most 65536 movements", where);
  }
  choreography.movements.reserve(movements->size());
  for (std::size_t i = 0; i < movements->size(); ++i) {
    const JsonField field{(*movements)[i], where + "[" + std::to_string(i) + "]"};
    if (auto ok = CheckKeys(field, {"step", "walk_to", "jump", "stand", "layer"}); !ok) {
      return std::unexpected(ok.error());
    }
    if (field.value.size() != 1) {
      return Fail(ErrorCode::kMalformed,
                  "expected exactly one of step, walk_to, jump, stand and layer", field.where);
    }
    if (const json* layer = field.Find("layer")) {
      LayerCue& cue = choreography.layers.emplace_back();
      cue.before = choreography.movements.size();
      if (auto ok = ReadLayer({*layer, field.WhereOf("layer")}, cue); !ok) {
        return std::unexpected(ok.error());
      }
      continue;
    }
    MovementRequest& request = choreography.movements.emplace_back();
    request.id = i + 1;
    if (auto ok = ReadMovement(field, request); !ok) return std::unexpected(ok.error());
  }
  if (choreography.movements.empty()) {
    return Fail(ErrorCode::kOutOfRange, "expected at least one movement", where);
  }
  STRIDEWIRE_CHECK(choreography.movements.size() + choreography.layers.size() == movements->size());
  return choreography;
}

Expected<Choreography> ReadChoreography(const std::filesystem::path& path) {
  const Expected<std::string> text = ReadTextFile(path, kMaxChoreographyBytes);
  if (!text) return std::unexpected(text.error());
  return ParseChoreography(*text, path.string());
}

}  // namespace stridewire
