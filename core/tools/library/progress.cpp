#include "progress.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <utility>

namespace stridewire {
namespace {

volatile std::sig_atomic_t g_is_raised = 0;

void Raise(int) { g_is_raised = 1; }

constexpr auto kUpdateInterval = std::chrono::milliseconds(200);
// Before this time, the estimate of the remaining time is too uncertain to print.
constexpr auto kFirstUpdate = std::chrono::milliseconds(500);

}  // namespace

InterruptSignal::InterruptSignal() {
  g_is_raised = 0;
  struct sigaction action{};
  action.sa_handler = Raise;
  // Restores the default handler, so that a second signal ends the program.
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

InterruptSignal::~InterruptSignal() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

bool InterruptSignal::IsRaised() { return g_is_raised != 0; }

Progress::Progress(std::string what)
    : what_(std::move(what)),
      is_terminal_(::isatty(STDERR_FILENO) != 0),
      start_(Clock::now()),
      last_(start_) {}

Progress::~Progress() { Clear(); }

void Progress::Update(double done) {
  const Clock::time_point now = Clock::now();
  if (!is_terminal_ || now - last_ < kUpdateInterval || now - start_ < kFirstUpdate) return;
  last_ = now;
  is_visible_ = true;
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  done = std::clamp(done, 0.0, 1.0);
  std::fprintf(stderr, "\r\033[K%s: %.0f %%", what_.c_str(), 100.0 * done);
  if (done > 0.02) std::fprintf(stderr, ", %.0f s left", elapsed_s * (1.0 - done) / done);
  std::fflush(stderr);
}

void Progress::Clear() {
  if (!std::exchange(is_visible_, false)) return;
  std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
}

}  // namespace stridewire
