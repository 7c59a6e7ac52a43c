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

/// Limits on a terrain. Terrain::Make fails if one of them is exceeded.
inline constexpr std::int32_t kMaxTerrainColumns = 1024;
inline constexpr std::int32_t kMaxTerrainRows = 1024;
inline constexpr std::size_t kMaxTerrainBoxes = 65'536;
inline constexpr double kMaxTerrainHeightM = 1e4;  ///< Maximum magnitude of a ground height.
/// Minimum distance between samples of a height field.
inline constexpr double kMinTerrainCellM = 0.01;
inline constexpr double kMaxTerrainCellM = 1e3;
inline constexpr double kMaxTerrainPositionM = 1e6;  ///< Maximum magnitude of each coordinate.
/// Maximum number of boxes that intersect one cell of the terrain's spatial index. The limit bounds
/// the time of a query. A terrain exceeds it if too many boxes overlap, or if many boxes are close
/// together and others are large or far away.
inline constexpr std::size_t kMaxTerrainBoxesPerCell = 256;

/// Horizontal position, in metres.
struct GroundPoint {
  double x = 0.0;
  double z = 0.0;
  bool operator==(const GroundPoint&) const = default;
};

/// Heights at the corners of grid cells. Sample (column, row) is at origin + cell * (column, row),
/// so the field covers (columns - 1) x (rows - 1) cells, including its border. Heights between
/// samples are interpolated bilinearly.
struct HeightField {
  GroundPoint origin_m;          ///< Position of sample (0, 0), which has the smallest x and z.
  double cell_m = 0.0;           ///< Sample spacing, kMinTerrainCellM to kMaxTerrainCellM.
  std::int32_t columns = 0;      ///< Samples along x, 2 to kMaxTerrainColumns.
  std::int32_t rows = 0;         ///< Samples along z, 2 to kMaxTerrainRows.
  std::vector<float> heights_m;  ///< [row][column]: heights of the samples, in metres.
  bool operator==(const HeightField&) const = default;
};

/// A block with vertical sides and a flat top, for example a stair tread. Points on its border are
/// inside.
struct TerrainBox {
  GroundPoint min_m;
  GroundPoint max_m;      ///< Both coordinates must exceed those of `min_m`.
  double height_m = 0.0;  ///< World height of the top.
  bool operator==(const TerrainBox&) const = default;
};

/// Describes the ground of a world, for files, messages and rendering. If empty, the ground is flat
/// at y = 0.
struct TerrainData {
  std::optional<HeightField> height_field;
  std::vector<TerrainBox> boxes;
  bool operator==(const TerrainData&) const = default;
};

/// The ground on which feet land: a height field, y = 0 outside of it, and boxes.
///
///   height(x, z) = max(field(x, z) or 0, tops of all boxes that contain (x, z))
///
/// Immutable, so avatars and threads may share it. Queries never allocate, and their results have
/// the same bits on every machine. They find nearby boxes in a uniform grid. A position that is not
/// finite is outside the field and all boxes.
class Terrain {
 public:
  /// Validates `data` and builds the spatial index.
  ///
  /// Errors, with the field in Error::where, for example "boxes[3].max_m": kOutOfRange if a number
  /// is not finite or out of range, or if max_m does not exceed min_m. kShapeMismatch if the
  /// size of heights_m is not columns x rows. kLimitExceeded if there are too many boxes, in total
  /// or in one cell of the index.
  [[nodiscard]] static Expected<std::shared_ptr<const Terrain>> Make(TerrainData data);

  [[nodiscard]] const TerrainData& data() const { return data_; }

  /// Returns the height of the ground in metres.
  [[nodiscard]] double HeightAt(double x_m, double z_m) const;

  /// Returns the unit normal of the ground. It is vertical outside the field and on a box, even if
  /// the box is level with the field. In the field, it is the normal of the bilinear cell that
  /// contains the point, so it is not continuous between cells. A point on the border of two cells
  /// belongs to the cell with larger coordinates, and at the end of the field to the last cell.
  [[nodiscard]] Vec3 NormalAt(double x_m, double z_m) const;

  /// Returns an upper bound for the height of the ground in a closed disc. It is exact for boxes
  /// and for y = 0 outside the field. For the field, it is the maximum over the square that
  /// encloses the disc. A radius <= 0 is treated as 0. The time grows with the square of the
  /// radius.
  [[nodiscard]] double HighestWithin(double x_m, double z_m, double radius_m) const;

 private:
  /// Cells [first, last] of a grid along both axes. Empty if `first` > `last`.
  struct CellRange {
    std::int32_t first_x = 0;
    std::int32_t last_x = -1;
    std::int32_t first_z = 0;
    std::int32_t last_z = -1;
  };
  /// Horizontal rectangle from `min` to `max`.
  struct Rectangle {
    GroundPoint min;
    GroundPoint max;
  };
  /// Heights at the corners of a field cell, h[x][z], and the position (s, t) of a point in the
  /// cell, 0 to 1 along each axis.
  struct Patch {
    double h00, h10, h01, h11;
    double s, t;
  };

  explicit Terrain(TerrainData data) : data_(std::move(data)) {}

  [[nodiscard]] Status IndexBoxes();
  [[nodiscard]] bool TryIndex(std::int32_t cells_x, std::int32_t cells_z);
  [[nodiscard]] CellRange IndexCells(const Rectangle& area) const;
  [[nodiscard]] bool InField(double x_m, double z_m) const;
  [[nodiscard]] Patch PatchAt(double x_m, double z_m) const;  ///< The point must be in the field.
  [[nodiscard]] double FieldHeight(double x_m, double z_m) const;
  [[nodiscard]] double HighestInField(const Rectangle& area) const;
  /// Returns the index of the highest box that contains the point, or -1.
  [[nodiscard]] std::int64_t HighestBoxAt(double x_m, double z_m) const;
  /// Calls `visit(box)` once for each box that may intersect `area`.
  template <typename Visit>
  void VisitBoxes(const Rectangle& area, Visit&& visit) const;

  TerrainData data_;
  GroundPoint field_max_m_;  ///< Position of the last sample of the field.

  // Grid over the boxes. Cell (i, j) has the index c = j * cells_x_ + i and contains the boxes
  // boxes_[starts_[c]] to boxes_[starts_[c + 1] - 1], the highest first.
  Rectangle bounds_;
  std::int32_t cells_x_ = 0;
  std::int32_t cells_z_ = 0;
  double cells_per_m_x_ = 0.0;
  double cells_per_m_z_ = 0.0;
  std::vector<std::uint32_t> starts_;
  std::vector<std::uint32_t> boxes_;
};

}  // namespace stridewire
