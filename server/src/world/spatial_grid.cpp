#include "world/spatial_grid.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "base/check.h"

namespace stridewire::server {

void SpatialGrid::Begin(double cell_m, std::size_t count) {
  STRIDEWIRE_CHECK(cell_m > 0.0);
  cells_per_m_ = 1.0 / cell_m;
  entries_.clear();
  entries_.reserve(count);
}

void SpatialGrid::Add(std::uint32_t row, float x, float z) {
  entries_.push_back({CellOf(x), CellOf(z), row, x, z});
}

void SpatialGrid::Sort() {
  std::ranges::sort(entries_, {}, [](const Entry& entry) {
    return std::tuple(entry.column, entry.cell, entry.row);
  });
}

std::int64_t SpatialGrid::CellOf(double metres) const {
  // The centre of a region can be anywhere. The limit prevents overflow in the conversion. It does
  // not affect avatars, whose coordinates are at most protocol::kMaxRootM.
  constexpr double kMaxCell = 1e9;
  return static_cast<std::int64_t>(
      std::floor(std::clamp(metres * cells_per_m_, -kMaxCell, kMaxCell)));
}

std::size_t SpatialGrid::LowerBound(std::int64_t column, std::int64_t cell) const {
  const auto found = std::ranges::lower_bound(
      entries_, std::pair(column, cell), {},
      [](const Entry& entry) { return std::pair(entry.column, entry.cell); });
  return static_cast<std::size_t>(found - entries_.begin());
}

}  // namespace stridewire::server
