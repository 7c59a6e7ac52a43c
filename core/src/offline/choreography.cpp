#include "stridewire/offline/choreography.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <utility>

#include "json_document.h"

namespace stridewire {
namespace {

using nlohmann::json;

/// A value of the document and the way to it, for errors: "c.json: movements[3].step".
struct Field {
  const json& value;
  std::string where;

  [[nodiscard]] const json* Find(const char* key) const {
    const auto found = value.find(key);
    return found == value.end() ? nullptr : &*found;
  }
  [[nodiscard]] std::string WhereOf(const std::string& key) const {
    return where + (where.ends_with(": ") ? "" : ".") + key;
  }
};

/// A number's limit and the sentence that tells it.
struct Limit {
  double min;
  double max;
  const char* text;
};

static_assert(kMaxRequestLengthM == 10.0 && kMaxRequestTurnRad == 3.2 && kMaxStandS == 3600.0 &&
              kMaxChoreographyPositionM == 1e5 && kMaxChoreographyHeadingRad == 1e4);
constexpr Limit kLength = {-kMaxRequestLengthM, kMaxRequestLengthM, "is not a number within 10 m"};
constexpr Limit kTurn = {-kMaxRequestTurnRad, kMaxRequestTurnRad, "is not a number within 3.2 rad"};
constexpr Limit kSeconds = {0.0, kMaxStandS, "is not a number from 0 to 3600 s"};
constexpr Limit kPosition = {-kMaxChoreographyPositionM, kMaxChoreographyPositionM,
                             "is not a number within 100000 m"};
constexpr Limit kHeading = {-kMaxChoreographyHeadingRad, kMaxChoreographyHeadingRad,
                            "is not a number within 10000 rad"};

/// A key as it stands in an error: one line of at most 64 printable characters.
std::string Printable(const std::string& key) {
  constexpr std::size_t kMaxShown = 64;
  std::string shown = key.substr(0, kMaxShown);
  for (char& c : shown) {
    if (c < ' ' || c > '~') c = '?';
  }
  return key.size() > kMaxShown ? shown + "..." : shown;
}

/// The field is an object and has no other keys than these.
Status CheckKeys(const Field& field, std::initializer_list<const char*> known) {
  if (!field.value.is_object()) {
    std::string where = field.where;
    if (where.ends_with(": ")) where.resize(where.size() - 2);  // The whole document.
    return Fail(ErrorCode::kMalformed, "is not an object", std::move(where));
  }
  for (const auto& item : field.value.items()) {
    if (std::find(known.begin(), known.end(), item.key()) == known.end()) {
      return Fail(ErrorCode::kMalformed, "is not a key known here",
                  field.WhereOf(Printable(item.key())));
    }
  }
  return {};
}

Status ReadNumberAt(const json& value, std::string where, const Limit& limit, double& out) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!(number >= limit.min && number <= limit.max)) {
    return Fail(value.is_number() ? ErrorCode::kOutOfRange : ErrorCode::kMalformed, limit.text,
                std::move(where));
  }
  out = number;
  return {};
}

/// Leaves `out` alone when the key is not there.
Status ReadNumber(const Field& field, const char* key, const Limit& limit, double& out) {
  const json* value = field.Find(key);
  if (value == nullptr) return {};
  return ReadNumberAt(*value, field.WhereOf(key), limit, out);
}

Status ReadRequiredNumber(const Field& field, const char* key, const Limit& limit, double& out) {
  if (field.Find(key) == nullptr) {
    return Fail(ErrorCode::kMalformed, "is missing", field.WhereOf(key));
  }
  return ReadNumber(field, key, limit, out);
}

Status FailUnsupported(std::string where) {
  return Fail(ErrorCode::kUnsupported, "is not supported yet", std::move(where));
}

Status ReadStep(const Field& field, StepRequest& step) {
  if (auto ok = CheckKeys(
          field, {"foot", "length_m", "side_m", "height_m", "turn_rad", "at_m", "heading_rad"});
      !ok) {
    return ok;
  }
  if (field.Find("at_m") != nullptr) return FailUnsupported(field.WhereOf("at_m"));
  if (field.Find("heading_rad") != nullptr) {
    return Fail(ErrorCode::kMalformed, "has a meaning only beside at_m",
                field.WhereOf("heading_rad"));
  }
  if (const json* foot = field.Find("foot")) {
    if (*foot == "left") {
      step.foot = Foot::kLeft;
    } else if (*foot == "right") {
      step.foot = Foot::kRight;
    } else {
      return Fail(ErrorCode::kMalformed, "is neither \"left\" nor \"right\"",
                  field.WhereOf("foot"));
    }
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

Status ReadJump(const Field& field, JumpRequest& jump) {
  if (auto ok = CheckKeys(field, {"length_m", "height_m", "turn_rad"}); !ok) return ok;
  if (auto ok = ReadRequiredNumber(field, "length_m", kLength, jump.length_m); !ok) return ok;
  if (auto ok = ReadNumber(field, "height_m", kLength, jump.height_m); !ok) return ok;
  return ReadNumber(field, "turn_rad", kTurn, jump.turn_rad);
}

Status ReadStand(const Field& field, StandRequest& stand) {
  if (auto ok = CheckKeys(field, {"seconds"}); !ok) return ok;
  return ReadRequiredNumber(field, "seconds", kSeconds, stand.seconds);
}

Status ReadMovement(const Field& field, MovementRequest& request) {
  if (auto ok = CheckKeys(field, {"step", "walk_to", "jump", "stand"}); !ok) return ok;
  if (field.value.size() != 1) {
    return Fail(ErrorCode::kMalformed, "needs exactly one of step, walk_to, jump and stand",
                field.where);
  }
  const auto item = field.value.begin();
  const Field inner{item.value(), field.WhereOf(item.key())};
  if (item.key() == "step") return ReadStep(inner, request.movement.emplace<StepRequest>());
  if (item.key() == "jump") return ReadJump(inner, request.movement.emplace<JumpRequest>());
  if (item.key() == "stand") return ReadStand(inner, request.movement.emplace<StandRequest>());
  return FailUnsupported(inner.where);
}

Status ReadStart(const Field& field, BaseFrame& start) {
  if (auto ok = CheckKeys(field, {"position_m", "heading_rad"}); !ok) return ok;
  if (const json* position = field.Find("position_m")) {
    const std::string where = field.WhereOf("position_m");
    if (!position->is_array() || position->size() != 3) {
      return Fail(ErrorCode::kMalformed, "is not an array of three numbers", where);
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (auto ok = ReadNumberAt((*position)[static_cast<std::size_t>(axis)],
                                 where + "[" + std::to_string(axis) + "]", kPosition,
                                 start.position_m[axis]);
          !ok) {
        return ok;
      }
    }
  }
  return ReadNumber(field, "heading_rad", kHeading, start.heading_rad);
}

}  // namespace

Expected<Choreography> ParseChoreography(std::string_view text, std::string_view name) {
  if (text.size() > kMaxChoreographyBytes) {
    return Fail(ErrorCode::kLimitExceeded, "the file is larger than 4 MiB", std::string(name));
  }
  const Expected<json> document = ParseJson(text, name, kMaxChoreographyDepth);
  if (!document) return std::unexpected(document.error());

  const Field root{*document, std::string(name) + ": "};
  if (auto ok = CheckKeys(root, {"start", "terrain", "movements"}); !ok) {
    return std::unexpected(ok.error());
  }
  if (root.Find("terrain") != nullptr) {
    return std::unexpected(FailUnsupported(root.WhereOf("terrain")).error());
  }
  Choreography choreography;
  if (const json* start = root.Find("start")) {
    if (auto ok = ReadStart({*start, root.WhereOf("start")}, choreography.start); !ok) {
      return std::unexpected(ok.error());
    }
  }
  const std::string where = root.WhereOf("movements");
  const json* movements = root.Find("movements");
  if (movements == nullptr) return Fail(ErrorCode::kMalformed, "is missing", where);
  if (!movements->is_array()) return Fail(ErrorCode::kMalformed, "is not an array", where);
  if (movements->empty()) return Fail(ErrorCode::kOutOfRange, "holds no movement", where);
  if (movements->size() > kMaxChoreographyMovements) {
    return Fail(ErrorCode::kLimitExceeded, "holds more than 65536 movements", where);
  }
  choreography.movements.resize(movements->size());
  for (std::size_t i = 0; i < movements->size(); ++i) {
    MovementRequest& request = choreography.movements[i];
    request.id = i + 1;
    if (auto ok = ReadMovement({(*movements)[i], where + "[" + std::to_string(i) + "]"}, request);
        !ok) {
      return std::unexpected(ok.error());
    }
  }
  return choreography;
}

Expected<Choreography> ReadChoreography(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code code;
  const std::filesystem::file_status status = std::filesystem::status(path, code);
  if (status.type() == std::filesystem::file_type::not_found) {
    return Fail(ErrorCode::kNotFound, "there is no such file", name);
  }
  if (code) return Fail(ErrorCode::kIo, "the file cannot be opened", name);
  if (std::filesystem::is_directory(status)) {
    return Fail(ErrorCode::kIo, "this is a directory", name);
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return Fail(ErrorCode::kIo, "the file cannot be opened", name);
  // One byte more than allowed tells that there is more; a pipe has no size to ask for.
  std::string text(kMaxChoreographyBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) return Fail(ErrorCode::kIo, "the file cannot be read", name);
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return ParseChoreography(text, name);
}

}  // namespace stridewire
