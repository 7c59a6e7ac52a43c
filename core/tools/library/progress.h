#pragma once

#include <chrono>
#include <string>

namespace stridewire {

// While it lives, Ctrl-C and SIGTERM only ask the work to stop, so that it can leave no half file; a
// second one ends the program at once. One at a time.
class InterruptSignal {
 public:
  InterruptSignal();
  ~InterruptSignal();
  InterruptSignal(const InterruptSignal&) = delete;
  InterruptSignal& operator=(const InterruptSignal&) = delete;

  [[nodiscard]] static bool IsAsked();
};

// A line on stderr that says how far some work is and how long it may still take: "refining: 45 %, 3 s
// left". Only if stderr is a terminal; gone when this goes.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `done` from 0 to 1.
  void Show(double done);

  // Takes the line away, so that something else can be printed.
  void Hide();

 private:
  using Clock = std::chrono::steady_clock;

  std::string what_;
  bool is_terminal_ = false;
  bool is_shown_ = false;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace stridewire
