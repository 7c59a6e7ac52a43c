#include "offline/choreography/terrain_file.h"

#include <cmath>
#include <string>
#include <utility>

#include "offline/base/json_document.h"
#include "offline/choreography/terrain_json.h"

namespace stridewire {
namespace {

using nlohmann::json;

constexpr int kMaxTerrainDepth = 8;

static_assert(kMaxTerrainPositionM == 1e6 && kMaxTerrainHeightM == 1e4);
static_assert(kMinTerrainCellM == 0.01 && kMaxTerrainCellM == 1e3);
constexpr JsonLimit kGroundPosition = {-kMaxTerrainPositionM, kMaxTerrainPositionM,
                                       "expected a number from -1000000 to 1000000 m"};
constexpr JsonLimit kHeight = {-kMaxTerrainHeightM, kMaxTerrainHeightM,
                               "expected a number from -10000 to 10000 m"};
constexpr JsonLimit kCell = {kMinTerrainCellM, kMaxTerrainCellM,
                             "expected a number from 0.01 to 1000 m"};

Status FailMissing(std::string where) {
  return Fail(ErrorCode::kMalformed, "required key is missing", std::move(where));
}

/// Reads [x, z].
Status ReadPoint(const JsonField& field, const char* key, GroundPoint& out) {
  const json* point = field.Find(key);
  const std::string where = field.WhereOf(key);
  if (point == nullptr) return FailMissing(where);
  if (!point->is_array() || point->size() != 2) {
    return Fail(ErrorCode::kMalformed, "expected an array of two numbers", where);
  }
  if (auto ok = ReadNumberAt((*point)[0], where + "[0]", kGroundPosition, out.x); !ok) return ok;
  return ReadNumberAt((*point)[1], where + "[1]", kGroundPosition, out.z);
}

Status ReadCount(const JsonField& field, const char* key, std::int32_t max, const char* text,
                 std::int32_t& out) {
  const json* count = field.Find(key);
  if (count == nullptr) return FailMissing(field.WhereOf(key));
  if (!count->is_number()) return Fail(ErrorCode::kMalformed, text, field.WhereOf(key));
  const double number = count->get<double>();
  if (!(number >= 2 && number <= max && number == std::floor(number))) {
    return Fail(ErrorCode::kOutOfRange, text, field.WhereOf(key));
  }
  out = static_cast<std::int32_t>(number);
  return {};
}

Status ReadHeightField(const JsonField& field, HeightField& out) {
  if (auto ok = CheckKeys(field, {"origin_m", "cell_m", "columns", "rows", "heights_m"}); !ok) {
    return ok;
  }
  static_assert(kMaxTerrainColumns == 1024 && kMaxTerrainRows == 1024);
  constexpr const char* kCountText = "expected an integer from 2 to 1024";
  if (auto ok = ReadPoint(field, "origin_m", out.origin_m); !ok) return ok;
  if (auto ok = ReadRequiredNumber(field, "cell_m", kCell, out.cell_m); !ok) return ok;
  if (auto ok = ReadCount(field, "columns", kMaxTerrainColumns, kCountText, out.columns); !ok) {
    return ok;
  }
  if (auto ok = ReadCount(field, "rows", kMaxTerrainRows, kCountText, out.rows); !ok) return ok;

  const json* heights = field.Find("heights_m");
  const std::string where = field.WhereOf("heights_m");
  if (heights == nullptr) return FailMissing(where);
  if (!heights->is_array()) return Fail(ErrorCode::kMalformed, "expected an array", where);
  if (heights->size() !=
      static_cast<std::size_t>(out.columns) * static_cast<std::size_t>(out.rows)) {
    return Fail(ErrorCode::kShapeMismatch, "expected columns * rows numbers", where,
                static_cast<std::int64_t>(heights->size()));
  }
  out.heights_m.reserve(heights->size());
  for (std::size_t i = 0; i < heights->size(); ++i) {
    const json& value = (*heights)[i];
    const double height = value.is_number() ? value.get<double>() : std::nan("");
    if (!(height >= kHeight.min && height <= kHeight.max)) {
      return Fail(value.is_number() ? ErrorCode::kOutOfRange : ErrorCode::kMalformed, kHeight.text,
                  where + "[" + std::to_string(i) + "]");
    }
    out.heights_m.push_back(static_cast<float>(height));
  }
  return {};
}

Status ReadBox(const JsonField& field, TerrainBox& out) {
  if (auto ok = CheckKeys(field, {"min_m", "max_m", "height_m"}); !ok) return ok;
  if (auto ok = ReadPoint(field, "min_m", out.min_m); !ok) return ok;
  if (auto ok = ReadPoint(field, "max_m", out.max_m); !ok) return ok;
  return ReadRequiredNumber(field, "height_m", kHeight, out.height_m);
}

Status ReadBoxes(const JsonField& field, std::vector<TerrainBox>& out) {
  if (!field.value.is_array()) {
    return Fail(ErrorCode::kMalformed, "expected an array", field.where);
  }
  if (field.value.size() > kMaxTerrainBoxes) {
    static_assert(kMaxTerrainBoxes == 65'536);
    return Fail(ErrorCode::kLimitExceeded, "expected at most 65536 boxes", field.where);
  }
  out.resize(field.value.size());
  for (std::size_t b = 0; b < out.size(); ++b) {
    if (auto ok = ReadBox({field.value[b], field.where + "[" + std::to_string(b) + "]"}, out[b]);
        !ok) {
      return ok;
    }
  }
  return {};
}

}  // namespace

Expected<std::shared_ptr<const Terrain>> ReadTerrainField(const JsonField& field) {
  if (auto ok = CheckKeys(field, {"height_field", "boxes"}); !ok) {
    return std::unexpected(ok.error());
  }
  TerrainData data;
  if (const json* height_field = field.Find("height_field")) {
    if (auto ok = ReadHeightField({*height_field, field.WhereOf("height_field")},
                                  data.height_field.emplace());
        !ok) {
      return std::unexpected(ok.error());
    }
  }
  if (const json* boxes = field.Find("boxes")) {
    if (auto ok = ReadBoxes({*boxes, field.WhereOf("boxes")}, data.boxes); !ok) {
      return std::unexpected(ok.error());
    }
  }
  auto terrain = Terrain::Make(std::move(data));
  if (!terrain) {
    Error error = std::move(terrain.error());
    error.where = field.WhereOf(error.where);
    return std::unexpected(std::move(error));
  }
  return *std::move(terrain);
}

Expected<std::shared_ptr<const Terrain>> ParseTerrain(std::string_view text,
                                                      std::string_view name) {
  if (text.size() > kMaxTerrainFileBytes) {
    static_assert(kMaxTerrainFileBytes == std::size_t{16} << 20);
    return Fail(ErrorCode::kLimitExceeded, "the file is larger than the limit of 16 MiB",
                std::string(name));
  }
  const Expected<json> document = ParseJson(text, name, kMaxTerrainDepth);
  if (!document) return std::unexpected(document.error());
  return ReadTerrainField({*document, std::string(name) + ": "});
}

Expected<std::shared_ptr<const Terrain>> ReadTerrain(const std::filesystem::path& path) {
  const Expected<std::string> text = ReadTextFile(path, kMaxTerrainFileBytes);
  if (!text) return std::unexpected(text.error());
  return ParseTerrain(*text, path.string());
}

}  // namespace stridewire
