#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"

namespace stridewire {

/// Limits on a terrain; beyond one of them Terrain::Make fails.
inline constexpr std::int32_t kMaxTerrainColumns = 1024;
inline constexpr std::int32_t kMaxTerrainRows = 1024;
inline constexpr std::size_t kMaxTerrainBoxes = 65'536;
inline constexpr double kMaxTerrainHeightM = 1e4;  ///< Of the ground, either sign.
inline constexpr double kMinTerrainCellM = 0.01;   ///< Between two samples of a height field.
inline constexpr double kMaxTerrainCellM = 1e3;
inline constexpr double kMaxTerrainPositionM = 1e6;  ///< Each coordinate, either sign.
/// How many boxes may meet one cell of the index that a terrain makes for itself: what bounds the
/// time of a query. Reached only where hundreds of boxes lie over one another.
inline constexpr std::size_t kMaxTerrainBoxesPerCell = 256;

/// A place on the ground, seen from above.
struct GroundPoint {
  double x = 0.0;
  double z = 0.0;
  bool operator==(const GroundPoint&) const = default;
};

/// Heights at the corners of a grid: sample (column, row) lies at origin + cell (column, row), so
/// the field covers (columns - 1) x (rows - 1) cells, its border included. Between the samples the
/// ground is bilinear.
struct HeightField {
  GroundPoint origin_m;      ///< Sample (0, 0), where x and z are least.
  double cell_m = 0.0;       ///< From one sample to the next; kMinTerrainCellM to kMaxTerrainCellM.
  std::int32_t columns = 0;  ///< Samples along x, 2 to kMaxTerrainColumns.
  std::int32_t rows = 0;     ///< Samples along z, 2 to kMaxTerrainRows.
  std::vector<float> heights_m;  ///< [row][column]: row by row, x fastest.
  bool operator==(const HeightField&) const = default;
};

/// A block with upright sides and a flat top; its borders belong to it.
struct TerrainBox {
  GroundPoint min_m;
  GroundPoint max_m;      ///< Above `min_m` in both.
  double height_m = 0.0;  ///< Of its top, in the world.
  bool operator==(const TerrainBox&) const = default;
};

/// The ground of a world as it is written down, sent and drawn. Nothing at all: flat at y = 0.
struct TerrainData {
  std::optional<HeightField> height_field;
  std::vector<TerrainBox> boxes;
  bool operator==(const TerrainData&) const = default;
};

/// The ground that feet land on: a height field where there is one, y = 0 elsewhere, and boxes
/// standing in it.
///
///   height(x, z) = max(field(x, z) or 0, tops of all boxes that contain (x, z))
///
/// Immutable; share it between avatars and threads. Queries never allocate, use no trigonometry of
/// the C library (same bytes on every machine), and look only at what lies near, through a uniform
/// grid over the boxes. A coordinate that is not finite is outside of everything.
class Terrain {
 public:
  /// Checks and indexes. `where` of an error names the field, e.g. "boxes[3].max_m".
  /// kOutOfRange: a number not finite or beyond its limit, or max_m not above min_m;
  /// kShapeMismatch: heights_m has not columns x rows numbers; kLimitExceeded: too many boxes, all
  /// together or over one another.
  [[nodiscard]] static Expected<std::shared_ptr<const Terrain>> Make(TerrainData data);

  [[nodiscard]] const TerrainData& data() const { return data_; }

  /// Height of the ground in metres.
  [[nodiscard]] double HeightAt(double x_m, double z_m) const;

  /// Unit normal of the ground: up on a box's top (also where it is level with the field) and
  /// outside of the field, else that of the bilinear patch of the cell (x, z) is in. It is not
  /// continuous from cell to cell; a point on the border of two belongs to the one with larger
  /// coordinates, at the field's end to the last.
  [[nodiscard]] Vec3 NormalAt(double x_m, double z_m) const;

  /// Highest ground in the closed disc. Exact for boxes and the field's outline; a field's highest
  /// is taken over the square around the disc, so it may be told too high but never too low.
  /// A radius <= 0 is a point. Time grows with the square of the radius.
  [[nodiscard]] double HighestWithin(double x_m, double z_m, double radius_m) const;

  /// Lowest ground in the disc (its greatest lower bound): what boxes cover together does not
  /// count, so the seam of two slabs is no gap. Exact for boxes and the field's outline as long as
  /// at most 32 boxes meet the disc; else it may be told too low but never too high, as with a
  /// field, whose lowest is taken over squares.
  [[nodiscard]] double LowestWithin(double x_m, double z_m, double radius_m) const;

 private:
  /// Cells [first, last] of a grid along both axes; `first` > `last` where there are none.
  struct CellRange {
    std::int32_t first_x = 0;
    std::int32_t last_x = -1;
    std::int32_t first_z = 0;
    std::int32_t last_z = -1;
  };
  /// x and z from `min` to `max`.
  struct Rectangle {
    GroundPoint min;
    GroundPoint max;
  };
  /// A cell of the field: its corners' heights, [x][z], and where in it a point is, 0 to 1 each way.
  struct Patch {
    double h00, h10, h01, h11;
    double s, t;
  };
  struct Extremes {
    double lowest;
    double highest;
  };

  explicit Terrain(TerrainData data) : data_(std::move(data)) {}

  [[nodiscard]] Status IndexBoxes();
  [[nodiscard]] bool TryIndex(std::int32_t cells_x, std::int32_t cells_z);
  [[nodiscard]] CellRange IndexCells(const Rectangle& area) const;
  [[nodiscard]] bool InField(double x_m, double z_m) const;
  [[nodiscard]] Patch PatchAt(double x_m, double z_m) const;  ///< Of a point in the field.
  [[nodiscard]] double FieldHeight(double x_m, double z_m) const;
  [[nodiscard]] Extremes FieldExtremes(const Rectangle& area) const;
  /// Index of the highest box that contains the point, -1 if there is none.
  [[nodiscard]] std::int64_t HighestBoxAt(double x_m, double z_m) const;
  /// Calls `visit(box)` once for each box that may meet `area`.
  template <typename Visit>
  void VisitBoxes(const Rectangle& area, Visit&& visit) const;

  TerrainData data_;
  GroundPoint field_max_m_;  ///< Last sample of the field.

  // The grid over the boxes: cell (i, j) holds boxes_[starts_[c]] to boxes_[starts_[c + 1] - 1],
  // c = j cells_x_ + i, highest first.
  Rectangle bounds_;
  std::int32_t cells_x_ = 0;
  std::int32_t cells_z_ = 0;
  double cells_per_m_x_ = 0.0;
  double cells_per_m_z_ = 0.0;
  std::vector<std::uint32_t> starts_;
  std::vector<std::uint32_t> boxes_;
};

}  // namespace stridewire
