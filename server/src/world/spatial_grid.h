#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stridewire::server {

/// Horizontal positions of all avatars in one tick, sorted into the cells of a grid. Finds the
/// avatars near a point without visiting all of them. One thread fills the grid. Any thread may
/// then read it.
class SpatialGrid {
 public:
  /// Clears the grid. `cell_m` must be positive; `count` is the expected number of avatars.
  void Begin(double cell_m, std::size_t count);
  void Add(std::uint32_t row, float x, float z);
  /// Prepares the grid for queries. Must be called after the last Add.
  void Sort();

  /// Calls `function(row, x, z)` for all avatars within `reach_m` of (x, z) along both axes, in
  /// unspecified order.
  template <typename Function>
  void ForEachNear(double x, double z, double reach_m, Function&& function) const {
    const std::int64_t first_x = CellOf(x - reach_m);
    const std::int64_t last_x = CellOf(x + reach_m);
    const std::int64_t first_z = CellOf(z - reach_m);
    const std::int64_t last_z = CellOf(z + reach_m);
    // If the area has more columns than there are avatars, it is faster to visit all avatars.
    const bool is_vast = last_x - first_x >= static_cast<std::int64_t>(entries_.size());
    for (std::int64_t column = first_x; column <= (is_vast ? first_x : last_x); ++column) {
      const std::size_t end = is_vast ? entries_.size() : LowerBound(column, last_z + 1);
      for (std::size_t i = is_vast ? 0 : LowerBound(column, first_z); i < end; ++i) {
        const Entry& entry = entries_[i];
        if (entry.x >= x - reach_m && entry.x <= x + reach_m && entry.z >= z - reach_m &&
            entry.z <= z + reach_m) {
          function(entry.row, entry.x, entry.z);
        }
      }
    }
  }

 private:
  struct Entry {
    std::int64_t column = 0;
    std::int64_t cell = 0;  // Index of the cell within the column.
    std::uint32_t row = 0;
    float x = 0.0f;
    float z = 0.0f;
  };

  [[nodiscard]] std::int64_t CellOf(double metres) const;
  // Index of the first entry that is not before the cell.
  [[nodiscard]] std::size_t LowerBound(std::int64_t column, std::int64_t cell) const;

  double cells_per_m_ = 1.0;
  std::vector<Entry> entries_;  // Entries sorted by column, then cell, then row.
};

}  // namespace stridewire::server
