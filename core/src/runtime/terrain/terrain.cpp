#include "stridewire/runtime/terrain.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <tuple>
#include <utility>

namespace stridewire {
namespace {

// The grid index starts with about one cell per box. It is refined as long as a cell contains more
// than kFewBoxes boxes and smaller cells contain fewer.
constexpr std::int32_t kMaxIndexCellsPerAxis = 1024;
constexpr std::size_t kFewBoxes = 16;
// Minimum extent of the indexed area. It prevents cells of size zero.
constexpr double kMinIndexedM = 1e-6;
constexpr std::size_t kMaxIndexEntries = std::size_t{4} << 20;

bool IsWithin(double value, double limit) { return value >= -limit && value <= limit; }

Status CheckPoint(const GroundPoint& point, const std::string& where) {
  if (IsWithin(point.x, kMaxTerrainPositionM) && IsWithin(point.z, kMaxTerrainPositionM)) return {};
  return Fail(ErrorCode::kOutOfRange, "expected a number within 1000000 m", where);
}

Status CheckField(const HeightField& field) {
  static_assert(kMaxTerrainColumns == 1024 && kMaxTerrainRows == 1024);
  static_assert(kMinTerrainCellM == 0.01 && kMaxTerrainCellM == 1e3);
  static_assert(kMaxTerrainHeightM == 1e4 && kMaxTerrainPositionM == 1e6);
  if (auto ok = CheckPoint(field.origin_m, "height_field.origin_m"); !ok) return ok;
  if (!(field.cell_m >= kMinTerrainCellM && field.cell_m <= kMaxTerrainCellM)) {
    return Fail(ErrorCode::kOutOfRange, "expected a number from 0.01 to 1000 m",
                std::string("height_field.cell_m"));
  }
  if (field.columns < 2 || field.columns > kMaxTerrainColumns) {
    return Fail(ErrorCode::kOutOfRange, "expected a number from 2 to 1024",
                std::string("height_field.columns"), field.columns);
  }
  if (field.rows < 2 || field.rows > kMaxTerrainRows) {
    return Fail(ErrorCode::kOutOfRange, "expected a number from 2 to 1024",
                std::string("height_field.rows"), field.rows);
  }
  if (field.heights_m.size() !=
      static_cast<std::size_t>(field.columns) * static_cast<std::size_t>(field.rows)) {
    return Fail(ErrorCode::kShapeMismatch, "expected columns x rows numbers",
                std::string("height_field.heights_m"),
                static_cast<std::int64_t>(field.heights_m.size()));
  }
  for (std::size_t i = 0; i < field.heights_m.size(); ++i) {
    if (!IsWithin(static_cast<double>(field.heights_m[i]), kMaxTerrainHeightM)) {
      return Fail(ErrorCode::kOutOfRange, "expected a number within 10000 m",
                  "height_field.heights_m[" + std::to_string(i) + "]");
    }
  }
  return {};
}

Status CheckBox(const TerrainBox& box, const std::string& where) {
  if (auto ok = CheckPoint(box.min_m, where + ".min_m"); !ok) return ok;
  if (auto ok = CheckPoint(box.max_m, where + ".max_m"); !ok) return ok;
  if (!(box.min_m.x < box.max_m.x && box.min_m.z < box.max_m.z)) {
    return Fail(ErrorCode::kOutOfRange, "expected values above min_m", where + ".max_m");
  }
  if (!IsWithin(box.height_m, kMaxTerrainHeightM)) {
    return Fail(ErrorCode::kOutOfRange, "expected a number within 10000 m", where + ".height_m");
  }
  return {};
}

// Returns the index of the cell that contains `offset`, clamped to [0, cells - 1]. `offset` may be
// infinite but not NaN.
std::int32_t CellOf(double offset, std::int32_t cells) {
  return static_cast<std::int32_t>(std::clamp(offset, 0.0, static_cast<double>(cells - 1)));
}

// Returns the index of a cell in a row-major array.
std::size_t CellIndex(std::int32_t column, std::int32_t row, std::int32_t columns) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
         static_cast<std::size_t>(column);
}

bool Contains(const TerrainBox& box, double x, double z) {
  return x >= box.min_m.x && x <= box.max_m.x && z >= box.min_m.z && z <= box.max_m.z;
}

// Returns the squared distance from a point to a rectangle, or 0 if the point is inside.
double DistanceSquared(const GroundPoint& min, const GroundPoint& max, double x, double z) {
  const double dx = std::max({min.x - x, 0.0, x - max.x});
  const double dz = std::max({min.z - z, 0.0, z - max.z});
  return dx * dx + dz * dz;
}

}  // namespace

Expected<std::shared_ptr<const Terrain>> Terrain::Make(TerrainData data) {
  static_assert(kMaxTerrainBoxes == 65'536);
  if (data.height_field) {
    if (auto ok = CheckField(*data.height_field); !ok) return std::unexpected(ok.error());
  }
  if (data.boxes.size() > kMaxTerrainBoxes) {
    return Fail(ErrorCode::kLimitExceeded, "expected at most 65536 boxes", std::string("boxes"));
  }
  for (std::size_t b = 0; b < data.boxes.size(); ++b) {
    if (auto ok = CheckBox(data.boxes[b], "boxes[" + std::to_string(b) + "]"); !ok) {
      return std::unexpected(ok.error());
    }
  }
  std::shared_ptr<Terrain> terrain(new Terrain(std::move(data)));
  if (const auto& field = terrain->data_.height_field) {
    terrain->field_max_m_ = {field->origin_m.x + field->cell_m * (field->columns - 1),
                             field->origin_m.z + field->cell_m * (field->rows - 1)};
  }
  if (auto ok = terrain->IndexBoxes(); !ok) return std::unexpected(ok.error());
  return terrain;
}

Status Terrain::IndexBoxes() {
  if (data_.boxes.empty()) return {};
  bounds_ = {data_.boxes.front().min_m, data_.boxes.front().max_m};
  for (const TerrainBox& box : data_.boxes) {
    bounds_.min = {std::min(bounds_.min.x, box.min_m.x), std::min(bounds_.min.z, box.min_m.z)};
    bounds_.max = {std::max(bounds_.max.x, box.max_m.x), std::max(bounds_.max.z, box.max_m.z)};
  }
  // Starts with nearly square cells, one per box on average. Halves them as long as this reduces
  // the number of boxes in the fullest cell.
  const double width = std::max(bounds_.max.x - bounds_.min.x, kMinIndexedM);
  const double depth = std::max(bounds_.max.z - bounds_.min.z, kMinIndexedM);
  double cell = std::sqrt(width * depth / static_cast<double>(data_.boxes.size()));
  std::size_t most_before = data_.boxes.size() + 1;
  for (bool is_coarser_needed = false;;) {
    const auto cells_x = 1 + CellOf(width / cell, kMaxIndexCellsPerAxis);
    const auto cells_z = 1 + CellOf(depth / cell, kMaxIndexCellsPerAxis);
    if (!TryIndex(cells_x, cells_z)) {
      if (!starts_.empty()) break;  // Keeps the previous, coarser index.
      // With a few large and many small boxes, the index would need too many entries. Coarser cells
      // need fewer, and a single cell always fits.
      is_coarser_needed = true;
      cell *= 2.0;
      continue;
    }
    std::size_t most = 0;
    for (std::size_t c = 0; c + 1 < starts_.size(); ++c) {
      most = std::max<std::size_t>(most, starts_[c + 1] - starts_[c]);
    }
    const bool is_finest = cells_x == kMaxIndexCellsPerAxis && cells_z == kMaxIndexCellsPerAxis;
    if (most <= kFewBoxes || most >= most_before || is_finest || is_coarser_needed) break;
    most_before = most;
    cell *= 0.5;
  }
  for (std::size_t c = 0; c + 1 < starts_.size(); ++c) {
    static_assert(kMaxTerrainBoxesPerCell == 256);
    if (starts_[c + 1] - starts_[c] > kMaxTerrainBoxesPerCell) {
      return Fail(ErrorCode::kLimitExceeded, "more than 256 boxes overlap or are close together",
                  std::string("boxes"), static_cast<std::int64_t>(boxes_[starts_[c]]));
    }
  }
  return {};
}

bool Terrain::TryIndex(std::int32_t cells_x, std::int32_t cells_z) {
  const auto before = std::tuple(cells_x_, cells_z_, cells_per_m_x_, cells_per_m_z_);
  cells_x_ = cells_x;
  cells_z_ = cells_z;
  cells_per_m_x_ = cells_x / std::max(bounds_.max.x - bounds_.min.x, kMinIndexedM);
  cells_per_m_z_ = cells_z / std::max(bounds_.max.z - bounds_.min.z, kMinIndexedM);

  const std::size_t cells = static_cast<std::size_t>(cells_x) * static_cast<std::size_t>(cells_z);
  std::vector<std::uint32_t> starts(cells + 1, 0);
  std::size_t entries = 0;
  for (const TerrainBox& box : data_.boxes) {
    const CellRange range = IndexCells({box.min_m, box.max_m});
    entries += static_cast<std::size_t>(range.last_x - range.first_x + 1) *
               static_cast<std::size_t>(range.last_z - range.first_z + 1);
    if (entries > kMaxIndexEntries) {
      std::tie(cells_x_, cells_z_, cells_per_m_x_, cells_per_m_z_) = before;
      return false;
    }
    for (std::int32_t j = range.first_z; j <= range.last_z; ++j) {
      for (std::int32_t i = range.first_x; i <= range.last_x; ++i) {
        ++starts[CellIndex(i, j, cells_x) + 1];
      }
    }
  }
  std::partial_sum(starts.begin(), starts.end(), starts.begin());

  // Inserts the boxes in the order of their heights, so that each cell lists its highest box first.
  std::vector<std::uint32_t> order(data_.boxes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [this](std::uint32_t a, std::uint32_t b) {
    const double height_a = data_.boxes[a].height_m;
    const double height_b = data_.boxes[b].height_m;
    return height_a != height_b ? height_a > height_b : a < b;
  });
  std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
  boxes_.assign(entries, 0);
  for (const std::uint32_t b : order) {
    const CellRange range = IndexCells({data_.boxes[b].min_m, data_.boxes[b].max_m});
    for (std::int32_t j = range.first_z; j <= range.last_z; ++j) {
      for (std::int32_t i = range.first_x; i <= range.last_x; ++i) {
        boxes_[next[CellIndex(i, j, cells_x)]++] = b;
      }
    }
  }
  starts_ = std::move(starts);
  return true;
}

Terrain::CellRange Terrain::IndexCells(const Rectangle& area) const {
  // The index of a cell never decreases as the coordinate increases. The cells of a box therefore
  // always include the cell of a point inside the box.
  return {CellOf((area.min.x - bounds_.min.x) * cells_per_m_x_, cells_x_),
          CellOf((area.max.x - bounds_.min.x) * cells_per_m_x_, cells_x_),
          CellOf((area.min.z - bounds_.min.z) * cells_per_m_z_, cells_z_),
          CellOf((area.max.z - bounds_.min.z) * cells_per_m_z_, cells_z_)};
}

template <typename Visit>
void Terrain::VisitBoxes(const Rectangle& area, Visit&& visit) const {
  if (cells_x_ == 0 || !(area.max.x >= bounds_.min.x && area.min.x <= bounds_.max.x &&
                         area.max.z >= bounds_.min.z && area.min.z <= bounds_.max.z)) {
    return;
  }
  const CellRange range = IndexCells(area);
  for (std::int32_t j = range.first_z; j <= range.last_z; ++j) {
    for (std::int32_t i = range.first_x; i <= range.last_x; ++i) {
      const auto cell = CellIndex(i, j, cells_x_);
      for (std::uint32_t e = starts_[cell]; e < starts_[cell + 1]; ++e) {
        const TerrainBox& box = data_.boxes[boxes_[e]];
        // A box that spans several cells is visited only in the first of them that is in `range`.
        const CellRange own = IndexCells({box.min_m, box.max_m});
        if (std::max(own.first_x, range.first_x) == i &&
            std::max(own.first_z, range.first_z) == j) {
          visit(box);
        }
      }
    }
  }
}

std::int64_t Terrain::HighestBoxAt(double x, double z) const {
  if (cells_x_ == 0 ||
      !(x >= bounds_.min.x && x <= bounds_.max.x && z >= bounds_.min.z && z <= bounds_.max.z)) {
    return -1;
  }
  const CellRange range = IndexCells({{x, z}, {x, z}});
  const auto cell = CellIndex(range.first_x, range.first_z, cells_x_);
  for (std::uint32_t e = starts_[cell]; e < starts_[cell + 1]; ++e) {
    if (Contains(data_.boxes[boxes_[e]], x, z)) return boxes_[e];
  }
  return -1;
}

bool Terrain::InField(double x, double z) const {
  if (!data_.height_field) return false;
  const GroundPoint& origin = data_.height_field->origin_m;
  return x >= origin.x && x <= field_max_m_.x && z >= origin.z && z <= field_max_m_.z;
}

Terrain::Patch Terrain::PatchAt(double x, double z) const {
  const HeightField& field = *data_.height_field;
  const double u = (x - field.origin_m.x) / field.cell_m;
  const double v = (z - field.origin_m.z) / field.cell_m;
  const std::int32_t i = CellOf(u, field.columns - 1);
  const std::int32_t j = CellOf(v, field.rows - 1);
  const float* h = field.heights_m.data() + static_cast<std::ptrdiff_t>(j) * field.columns + i;
  return {h[0],
          h[1],
          h[field.columns],
          h[field.columns + 1],
          std::min(u - i, 1.0),
          std::min(v - j, 1.0)};
}

double Terrain::FieldHeight(double x, double z) const {
  if (!InField(x, z)) return 0.0;
  const Patch p = PatchAt(x, z);
  const double near = p.h00 * (1.0 - p.s) + p.h10 * p.s;
  const double far = p.h01 * (1.0 - p.s) + p.h11 * p.s;
  return near * (1.0 - p.t) + far * p.t;
}

// `area` must be inside the field. A bilinear patch has its maximum over an axis-aligned rectangle
// at a corner of that rectangle. It is therefore sufficient to sample the corners of the part of
// `area` in each cell. These are the points of the grid that consists of the borders of `area` and
// the sample lines between them.
double Terrain::HighestInField(const Rectangle& area) const {
  const HeightField& field = *data_.height_field;
  const auto line = [&](double origin, std::int32_t l) { return origin + field.cell_m * l; };
  const auto first = [&](double from, double origin) {
    return static_cast<std::int32_t>((from - origin) / field.cell_m) + 1;
  };
  double highest = -kMaxTerrainHeightM;
  const auto sample = [&](double x, double z) { highest = std::max(highest, FieldHeight(x, z)); };
  const auto sample_along_x = [&](double z) {
    sample(area.min.x, z);
    for (std::int32_t i = first(area.min.x, field.origin_m.x); i < field.columns; ++i) {
      const double x = line(field.origin_m.x, i);
      if (x >= area.max.x) break;
      sample(x, z);
    }
    sample(area.max.x, z);
  };
  sample_along_x(area.min.z);
  for (std::int32_t j = first(area.min.z, field.origin_m.z); j < field.rows; ++j) {
    const double z = line(field.origin_m.z, j);
    if (z >= area.max.z) break;
    sample_along_x(z);
  }
  sample_along_x(area.max.z);
  return highest;
}

double Terrain::HeightAt(double x, double z) const {
  const double ground = FieldHeight(x, z);
  const std::int64_t box = HighestBoxAt(x, z);
  if (box < 0) return ground;
  return std::max(ground, data_.boxes[static_cast<std::size_t>(box)].height_m);
}

Vec3 Terrain::NormalAt(double x, double z) const {
  const Vec3 up(0.0f, 1.0f, 0.0f);
  if (!InField(x, z)) return up;
  const std::int64_t box = HighestBoxAt(x, z);
  if (box >= 0 && data_.boxes[static_cast<std::size_t>(box)].height_m >= FieldHeight(x, z)) {
    return up;
  }
  const Patch p = PatchAt(x, z);
  const double cell_m = data_.height_field->cell_m;
  const double slope_x = ((p.h10 - p.h00) * (1.0 - p.t) + (p.h11 - p.h01) * p.t) / cell_m;
  const double slope_z = ((p.h01 - p.h00) * (1.0 - p.s) + (p.h11 - p.h10) * p.s) / cell_m;
  const double length = std::sqrt(slope_x * slope_x + 1.0 + slope_z * slope_z);
  return Vec3(-slope_x / length, 1.0 / length, -slope_z / length);
}

double Terrain::HighestWithin(double x, double z, double radius) const {
  if (!(radius > 0.0) || !std::isfinite(x) || !std::isfinite(z)) return HeightAt(x, z);
  double highest = -kMaxTerrainHeightM;
  const Rectangle around{{x - radius, z - radius}, {x + radius, z + radius}};
  bool is_all_field = false;
  if (data_.height_field) {
    const GroundPoint& origin = data_.height_field->origin_m;
    is_all_field = around.min.x >= origin.x && around.max.x <= field_max_m_.x &&
                   around.min.z >= origin.z && around.max.z <= field_max_m_.z;
    if (DistanceSquared(origin, field_max_m_, x, z) <= radius * radius) {
      highest = HighestInField(
          {{std::max(around.min.x, origin.x), std::max(around.min.z, origin.z)},
           {std::min(around.max.x, field_max_m_.x), std::min(around.max.z, field_max_m_.z)}});
    }
  }
  if (!is_all_field) highest = std::max(highest, 0.0);
  VisitBoxes(around, [&](const TerrainBox& box) {
    if (DistanceSquared(box.min_m, box.max_m, x, z) <= radius * radius) {
      highest = std::max(highest, box.height_m);
    }
  });
  return highest;
}

}  // namespace stridewire
