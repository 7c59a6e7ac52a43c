#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stridewire::server {

/// Where the avatars of a tick are on the ground, sorted into the cells of a grid, so that those near a place are
/// found without looking at all. Filled by one thread, then read by any.
class SpatialGrid {
 public:
  /// Starts anew; `cell_m` above 0.
  void Begin(double cell_m, std::size_t count);
  void Add(std::uint32_t row, float x, float z);
  void Sort();

  /// Calls `function(row, x, z)` for all within `reach_m` of a place along both axes, in no order.
  template <typename Function>
  void ForEachNear(double x, double z, double reach_m, Function&& function) const {
    const std::int64_t first_x = CellOf(x - reach_m);
    const std::int64_t last_x = CellOf(x + reach_m);
    const std::int64_t first_z = CellOf(z - reach_m);
    const std::int64_t last_z = CellOf(z + reach_m);
    // Where the circle has more columns than there are avatars, all of them are looked at.
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
    std::int64_t cell = 0;  // in its column
    std::uint32_t row = 0;
    float x = 0.0f;
    float z = 0.0f;
  };

  [[nodiscard]] std::int64_t CellOf(double metres) const;
  /// The first entry not before that cell.
  [[nodiscard]] std::size_t LowerBound(std::int64_t column, std::int64_t cell) const;

  double cells_per_m_ = 1.0;
  std::vector<Entry> entries_;  // by column, then cell
};

}  // namespace stridewire::server
