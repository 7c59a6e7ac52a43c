#pragma once

#include <chrono>
#include <string>

namespace stridewire {

// Catches SIGINT and SIGTERM during its lifetime, so that a command can stop without leaving a
// partial file. A second signal ends the program at once. At most one instance may exist.
class InterruptSignal {
 public:
  InterruptSignal();
  ~InterruptSignal();
  InterruptSignal(const InterruptSignal&) = delete;
  InterruptSignal& operator=(const InterruptSignal&) = delete;

  [[nodiscard]] static bool IsRaised();
};

// A progress line on stderr with the estimated time left: "refining: 45 %, 3 s left". Prints only
// if stderr is a terminal. The destructor removes the line.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `done` is in [0, 1].
  void Update(double done);

  // Removes the line, so that the program can print something else.
  void Clear();

 private:
  using Clock = std::chrono::steady_clock;

  std::string what_;
  bool is_terminal_ = false;
  bool is_visible_ = false;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace stridewire
