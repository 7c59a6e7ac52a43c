#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "error_log.h"
#include "load_options.h"
#include "stridewire/offline/choreography.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::load {

/// Distributes N avatars over W worlds. Avatar k, 1 to N, is in world (k - 1) mod W and has the id
/// k.
struct Layout {
  int avatars = 1;
  int worlds = 1;

  [[nodiscard]] std::size_t CountIn(int world) const {
    return static_cast<std::size_t>((avatars - world + worlds - 1) / worlds);
  }
  /// Returns the id of the i-th avatar of a world.
  [[nodiscard]] std::uint32_t Number(int world, std::size_t i) const {
    return static_cast<std::uint32_t>(world) + 1 +
           static_cast<std::uint32_t>(i) * static_cast<std::uint32_t>(worlds);
  }
  /// Returns true if this id belongs to an avatar of this run in that world.
  [[nodiscard]] bool IsOurs(int world, std::uint32_t number) const {
    return number >= 1 && number <= static_cast<std::uint32_t>(avatars) &&
           (number - 1) % static_cast<std::uint32_t>(worlds) == static_cast<std::uint32_t>(world);
  }
  /// Returns the index of an avatar in its world; the inverse of Number.
  [[nodiscard]] std::size_t IndexIn(std::uint32_t number) const {
    return (number - 1) / static_cast<std::uint32_t>(worlds);
  }
};

/// The measured ticks, from the first to the last inclusive. Set once, read by any thread.
class TickWindow {
 public:
  void Set(std::uint64_t first, std::uint64_t last) {
    last_.store(last);
    first_.store(first);
  }
  [[nodiscard]] bool is_set() const { return first_.load() != 0; }
  [[nodiscard]] std::uint64_t last() const { return last_.load(); }
  [[nodiscard]] bool Contains(std::uint64_t tick) const {
    const std::uint64_t first = first_.load();
    return first != 0 && tick >= first && tick <= last_.load();
  }
  /// Returns the number of ticks from `from` to `to`, both inclusive, that are in the window.
  [[nodiscard]] std::uint64_t CountBetween(std::uint64_t from, std::uint64_t to) const {
    const std::uint64_t first = first_.load();
    if (first == 0) return 0;
    from = std::max(from, first);
    to = std::min(to, last_.load());
    return to < from ? 0 : to - from + 1;
  }

 private:
  std::atomic<std::uint64_t> first_{0};
  std::atomic<std::uint64_t> last_{0};
};

/// State that all sessions of a run share.
struct RunState {
  RunState(const LoadOptions& load_options, const Choreography* movements,
           std::shared_ptr<const MotionLibrary> motion_library)
      : options(load_options),
        choreography(movements),
        library(std::move(motion_library)),
        layout{load_options.avatars, load_options.worlds} {}

  /// Logs an error that makes the run fail with exit code 1.
  void Problem(std::string text) {
    failed = true;
    errors.Add(std::move(text));
  }

  const LoadOptions& options;
  /// Choreography of the avatars. Null: the avatars wander.
  const Choreography* choreography;
  /// Library for evaluating poses. Set in movement mode.
  const std::shared_ptr<const MotionLibrary> library;
  const Layout layout;
  TickWindow window;
  ErrorLog errors;
  std::atomic<bool> failed{false};
  /// True once the run is ending. Lost connections are then not errors.
  std::atomic<bool> is_ending{false};
  std::atomic<double> tick_hz{60.0};
};

[[nodiscard]] inline std::string WorldName(int world) { return "load-" + std::to_string(world); }

}  // namespace stridewire::load
