#include "load_run.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cmath>
#include <future>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "controller.h"
#include "latency_histogram.h"
#include "latency_probes.h"
#include "observer.h"
#include "run_state.h"
#include "server_metrics.h"
#include "session.h"

namespace stridewire::load {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

/// Time between the end of the setup and the first measured tick.
constexpr double kWindowLeadS = 0.1;
/// Maximum number of observers that connect at the same time.
constexpr std::size_t kMaxOpening = 64;
/// Delay before a dropped observer (--churn) reconnects.
constexpr double kChurnPauseS = 0.2;
/// Longer delays of this program itself affect the results, so the report then contains a warning.
constexpr double kOwnLateP99Ms = 5.0;

/// A thread that polls its sessions and measures its own delays.
class Worker {
 public:
  static constexpr std::int64_t kPollIntervalNs = 10'000'000;
  /// Each poll handles one of this many groups of sessions.
  static constexpr std::size_t kPollGroups = 10;

  ~Worker() { Stop(); }

  ThreadContext& context() { return context_; }

  /// Call it before Start, or on the worker's thread.
  void Add(Session& session) { sessions_.push_back(&session); }

  void Start() {
    next_poll_ns_ = NowNs();
    SchedulePoll();
    thread_ = std::thread([this] { context_.io.run(); });
  }

  template <typename F>
  void Post(F&& task) {
    asio::post(context_.io, std::forward<F>(task));
  }

  /// Runs a task on the thread and waits until it is done.
  template <typename F>
  void Run(F&& task) {
    std::promise<void> done;
    Post([&] {
      task();
      done.set_value();
    });
    done.get_future().wait();
  }

  void Stop() {
    if (!thread_.joinable()) return;
    context_.io.stop();
    thread_.join();
  }

  void StartCounting() { late_ = LatencyHistogram(); }
  const LatencyHistogram& late() const { return late_; }

 private:
  void SchedulePoll() {
    next_poll_ns_ += kPollIntervalNs;
    timer_.expires_at(
        std::chrono::steady_clock::time_point(std::chrono::nanoseconds(next_poll_ns_)));
    timer_.async_wait([this](const boost::system::error_code& code) {
      if (code) return;
      const std::int64_t now_ns = NowNs();
      late_.RecordNs(now_ns - next_poll_ns_);
      // Prevents a burst of polls after a stall.
      next_poll_ns_ = std::max(next_poll_ns_, now_ns - kPollIntervalNs);
      for (std::size_t i = poll_count_ % kPollGroups; i < sessions_.size(); i += kPollGroups) {
        sessions_[i]->Poll(now_ns);
      }
      ++poll_count_;
      SchedulePoll();
    });
  }

  ThreadContext context_;
  asio::steady_timer timer_{context_.io};
  std::vector<Session*> sessions_;
  std::int64_t next_poll_ns_ = 0;
  std::size_t poll_count_ = 0;
  LatencyHistogram late_;
  std::thread thread_;
};

Quantiles ToQuantiles(const LatencyHistogram& times) {
  return {times.QuantileMs(0.5), times.QuantileMs(0.99), times.max_ms()};
}

double OwnCpuS() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Raises the soft limit on open files if necessary. Returns true if `count` files can be opened.
bool AllowOpenFiles(std::size_t count) {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return true;
  if (limit.rlim_cur >= count) return true;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, count);
  return setrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur >= count;
}

class LoadRun {
 public:
  LoadRun(const LoadOptions& options, const Choreography* choreography,
          std::shared_ptr<const MotionLibrary> library, const std::atomic<bool>& stop,
          const std::function<void(const std::string&)>& progress)
      : options_(options),
        run_(options, choreography, std::move(library)),
        stop_(stop),
        progress_(progress) {}

  LoadReport Run() {
    if (SetUp()) Measure();
    TearDown();
    return Report();
  }

 private:
  bool SetUp();
  bool Resolve();
  void MakeSessions();
  bool OpenObservers();
  void Measure();
  void TearDown();
  [[nodiscard]] LoadReport Report();

  [[nodiscard]] std::optional<ServerMetrics> Scrape();
  [[nodiscard]] std::uint64_t OpenWindow();
  void Churn(std::int64_t now_ns);
  void ReportProgress(std::int64_t now_ns, const char* what);
  /// Polls `done` until it returns true. Returns false after the deadline, or if the run is
  /// stopped.
  template <typename F>
  bool WaitUntil(std::int64_t deadline_ns, const char* what, F&& done);

  const LoadOptions& options_;
  RunState run_;
  const std::atomic<bool>& stop_;
  const std::function<void(const std::string&)>& progress_;
  tcp::endpoint server_;
  std::optional<LatencyProbes> probes_;
  // Sessions use the contexts of the workers, so workers are destroyed after them.
  std::vector<std::unique_ptr<Worker>> workers_;
  std::vector<std::unique_ptr<Controller>> controllers_;
  std::vector<std::unique_ptr<Observer>> observers_;
  std::vector<Worker*> observer_workers_;  ///< [observer]

  std::int64_t opened_ns_ = 0;
  std::int64_t next_progress_ns_ = 0;
  std::int64_t churned_ns_ = 0;
  std::uint64_t churn_count_ = 0;
  double seconds_ = 0.0;
  double own_cpu_s_ = 0.0;
  std::optional<ServerMetrics> before_;
  std::optional<ServerMetrics> after_;
  std::size_t unfinished_count_ = 0;
};

template <typename F>
bool LoadRun::WaitUntil(std::int64_t deadline_ns, const char* what, F&& done) {
  for (;;) {
    if (done()) return true;
    const std::int64_t now_ns = NowNs();
    if (stop_ || now_ns >= deadline_ns) return false;
    ReportProgress(now_ns, what);
    std::this_thread::sleep_for(
        std::chrono::nanoseconds(std::min<std::int64_t>(5'000'000, deadline_ns - now_ns)));
  }
}

void LoadRun::ReportProgress(std::int64_t now_ns, const char* what) {
  if (now_ns < next_progress_ns_) return;
  next_progress_ns_ = now_ns + kSecondNs;
  const auto count =
      std::ranges::count_if(observers_, [](const auto& observer) { return observer->sees_all(); });
  progress_(std::string(what) + ": " + std::to_string(count) + " of " +
            std::to_string(observers_.size()) + " observers receive all avatars" +
            (opened_ns_ == 0 ? std::string()
                             : ", " + std::to_string((now_ns - opened_ns_) / kSecondNs) + " s of " +
                                   std::to_string(static_cast<int>(options_.seconds))));
}

bool LoadRun::Resolve() {
  asio::io_context io;
  tcp::resolver resolver(io);
  boost::system::error_code code;
  const auto found =
      resolver.resolve(options_.server.host, std::to_string(options_.server.port), code);
  if (code || found.empty()) {
    run_.Problem("--connect " + ToText(options_.server) + ": " +
                 (code ? code.message() : std::string("no address")));
    return false;
  }
  server_ = found.begin()->endpoint();
  return true;
}

void LoadRun::MakeSessions() {
  for (int i = 0; i < options_.threads; ++i) workers_.push_back(std::make_unique<Worker>());
  // The first observer measures latency if it observes all worlds. Otherwise, up to one observer
  // per world does. These observers run on the thread of the controllers.
  const bool measures = options_.observers > 0;
  if (measures) probes_.emplace(static_cast<std::size_t>(options_.avatars));
  const int measuring_count = options_.observe_all ? 1 : options_.worlds;
  for (int world = 0; world < options_.worlds; ++world) {
    const bool is_watched = measures && (options_.observe_all || world < options_.observers);
    controllers_.push_back(std::make_unique<Controller>(workers_[0]->context(), server_, run_,
                                                        world, is_watched ? &*probes_ : nullptr));
    workers_[0]->Add(*controllers_.back());
  }
  for (int i = 0; i < options_.observers + options_.partial_observers; ++i) {
    const bool is_measuring = i < std::min(measuring_count, options_.observers);
    Worker& worker =
        is_measuring ? *workers_[0] : *workers_[static_cast<std::size_t>(i % options_.threads)];
    observers_.push_back(std::make_unique<Observer>(worker.context(), server_, run_, i,
                                                    is_measuring ? &*probes_ : nullptr));
    observer_workers_.push_back(&worker);
    worker.Add(*observers_.back());
  }
}

bool LoadRun::OpenObservers() {
  const std::int64_t deadline_ns = NowNs() + static_cast<std::int64_t>(1e9 * kSetUpTimeoutS) +
                                   static_cast<std::int64_t>(observers_.size()) * kSecondNs / 100;
  std::size_t opened = 0;
  const bool all_see = WaitUntil(deadline_ns, "connecting", [&] {
    if (run_.failed) return true;
    const auto seeing = static_cast<std::size_t>(std::ranges::count_if(
        observers_, [](const auto& observer) { return observer->sees_all(); }));
    for (; opened < observers_.size() && opened < seeing + kMaxOpening; ++opened) {
      observer_workers_[opened]->Post([observer = observers_[opened].get()] { observer->Open(); });
    }
    return seeing == observers_.size();
  });
  if (!all_see && !stop_) {
    run_.Problem("some observers did not receive all avatars within " +
                 std::to_string(static_cast<int>(kSetUpTimeoutS)) + " s");
  }
  return all_see && !run_.failed;
}

bool LoadRun::SetUp() {
  constexpr std::size_t kOtherFiles = 64;
  if (!AllowOpenFiles(static_cast<std::size_t>(options_.worlds + options_.observers +
                                               options_.partial_observers) +
                      kOtherFiles)) {
    run_.Problem("too many connections for the limit on open files (ulimit -n)");
    return false;
  }
  if (!Resolve()) return false;
  MakeSessions();
  for (const auto& worker : workers_) worker->Start();
  for (const auto& controller : controllers_) {
    workers_[0]->Post([controller = controller.get()] { controller->Open(); });
  }
  const auto deadline_ns = NowNs() + static_cast<std::int64_t>(1e9 * kSetUpTimeoutS);
  const bool all_there = WaitUntil(deadline_ns, "spawning avatars", [&] {
    return run_.failed || std::ranges::all_of(controllers_, [](const auto& controller) {
             return controller->has_spawned();
           });
  });
  if (!all_there && !stop_) {
    run_.Problem("the server did not spawn all avatars within " +
                 std::to_string(static_cast<int>(kSetUpTimeoutS)) + " s");
  }
  return all_there && !run_.failed && OpenObservers();
}

std::optional<ServerMetrics> LoadRun::Scrape() {
  if (!options_.http) return std::nullopt;
  Expected<ServerMetrics> metrics = ScrapeServerMetrics(*options_.http, kScrapeTimeoutS);
  if (metrics) return std::move(*metrics);
  run_.errors.Add(Describe(metrics.error()) +
                  "; tick_ms and ticks_missed are unknown (see --http)");
  return std::nullopt;
}

/// Sets the measurement window, which starts kWindowLeadS from now. Returns its number of ticks.
std::uint64_t LoadRun::OpenWindow() {
  const double tick_hz = run_.tick_hz;
  const auto ticks =
      static_cast<std::uint64_t>(std::max(1.0, std::round(options_.seconds * tick_hz)));
  std::uint64_t newest = 0;
  for (const auto& observer : observers_) newest = std::max(newest, observer->latest_tick());
  const std::uint64_t first = newest + static_cast<std::uint64_t>(kWindowLeadS * tick_hz) + 1;
  run_.window.Set(first, first + ticks - 1);
  seconds_ = static_cast<double>(ticks) / tick_hz;
  return ticks;
}

void LoadRun::Churn(std::int64_t now_ns) {
  if (options_.churn_per_s <= 0.0) return;
  const auto planned = static_cast<std::uint64_t>(1e-9 * static_cast<double>(now_ns - churned_ns_) *
                                                  options_.churn_per_s);
  for (; churn_count_ < planned; ++churn_count_) {
    const std::size_t i = churn_count_ % observers_.size();
    observer_workers_[i]->Post([observer = observers_[i].get()] { observer->Drop(kChurnPauseS); });
  }
}

void LoadRun::Measure() {
  // Discards everything that was counted during the setup.
  for (const auto& worker : workers_) {
    worker->Run([&] { worker->StartCounting(); });
  }
  if (probes_) workers_[0]->Run([&] { probes_->StartCounting(); });
  before_ = Scrape();
  const double cpu_s = OwnCpuS();
  opened_ns_ = NowNs();
  (void)OpenWindow();
  churned_ns_ = opened_ns_;
  const std::int64_t closes_ns =
      opened_ns_ + static_cast<std::int64_t>(1e9 * (kWindowLeadS + seconds_));
  (void)WaitUntil(closes_ns, "measuring", [&] {
    Churn(NowNs());
    return false;
  });
  if (stop_) {
    run_.Problem("stopped before the end");
    seconds_ = 1e-9 * static_cast<double>(NowNs() - opened_ns_);
  }
  for (const auto& controller : controllers_) {
    workers_[0]->Post([controller = controller.get()] { controller->StopMoving(); });
  }
  // Waits for steps in progress and for the last poses.
  const std::int64_t grace_ns = NowNs() + static_cast<std::int64_t>(1e9 * kGraceS);
  (void)WaitUntil(grace_ns, "finishing", [&] {
    std::size_t open_probes = 0;
    if (probes_) workers_[0]->Run([&] { open_probes = probes_->open_count(); });
    return open_probes == 0 && std::ranges::all_of(observers_, [](const auto& observer) {
             return observer->saw_last_tick();
           });
  });
  own_cpu_s_ = OwnCpuS() - cpu_s;
  after_ = before_ ? Scrape() : std::nullopt;
  if (probes_) workers_[0]->Run([&] { unfinished_count_ = probes_->Finish(NowNs()); });
}

void LoadRun::TearDown() {
  run_.is_ending = true;
  for (std::size_t i = 0; i < observers_.size(); ++i) {
    observer_workers_[i]->Post([observer = observers_[i].get()] { observer->Finish(); });
  }
  for (const auto& controller : controllers_) {
    workers_[0]->Post([controller = controller.get()] { controller->CleanUp(); });
  }
  const std::int64_t deadline_ns = NowNs() + kSecondNs;
  while (NowNs() < deadline_ns && !std::ranges::all_of(controllers_, [](const auto& controller) {
           return controller->has_cleaned_up();
         })) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  for (const auto& worker : workers_) worker->Stop();
}

LoadReport LoadRun::Report() {
  LoadReport report;
  report.avatars = options_.avatars;
  report.worlds = options_.worlds;
  report.observers = options_.observers;
  report.partial_observers = options_.partial_observers;
  report.partial_avatars = options_.partial_observers > 0 ? options_.partial_avatars : 0;
  report.mode = options_.detail == protocol::PoseDetail::kAll
                    ? options_.mode
                    : protocol::CompactMode(options_.detail);
  report.seed = options_.seed;
  report.seconds = seconds_;
  report.threads = options_.threads;
  report.own_cpu_s = own_cpu_s_;
  const std::uint64_t ticks = run_.window.CountBetween(0, run_.window.last());
  std::uint64_t moving = 0;
  for (const auto& observer : observers_) {
    const ObserverCounts counts = observer->Counts();
    report.poses_received += counts.poses_received;
    report.poses_expected += observer->avatar_count() * ticks - counts.poses_excused;
    report.poses_invalid += counts.poses_invalid;
    report.bytes_received += counts.bytes_received;
    report.batches_dropped += counts.batches_dropped;
    report.reconnects += observer->reconnect_count();
    moving += counts.poses_moving;
  }
  if (report.poses_received > 0) {
    report.moving_share = static_cast<double>(moving) / static_cast<double>(report.poses_received);
  }
  LatencyHistogram send_late;
  std::map<protocol::StatusCode, std::uint64_t> rejected;
  for (const auto& controller : controllers_) {
    const ControllerCounts& counts = controller->counts();
    report.requests_sent += counts.requests_sent;
    report.requests_accepted += counts.requests_accepted;
    report.requests_rejected += counts.requests_rejected;
    report.reconnects += controller->reconnect_count();
    send_late.Merge(counts.send_late);
    for (const auto& [code, count] : counts.rejected_by_code) rejected[code] += count;
  }
  for (const auto& [code, count] : rejected) {
    run_.errors.Add(std::to_string(count) +
                    " requests rejected: " + std::string(protocol::StatusCodeName(code)));
  }
  if (before_ && after_) {
    report.tick_ms = TicksBetween(*before_, *after_);
    report.ticks_missed =
        static_cast<std::uint64_t>(std::max(0.0, after_->ticks_missed - before_->ticks_missed));
  }
  if (probes_ && probes_->times().count() > 0) {
    report.step_latency_ms = ToQuantiles(probes_->times());
    report.steps_measured = probes_->times().count();
  }
  if (unfinished_count_ > 0) {
    run_.errors.Add(std::to_string(unfinished_count_) +
                    " steps had no visible pose at the end; they count with the time until then");
  }
  if (report.batches_dropped > 0) {
    run_.errors.Add("the server dropped " + std::to_string(report.batches_dropped) +
                    " batches because this program or the network was too slow");
  }
  LatencyHistogram late;
  for (const auto& worker : workers_) late.Merge(worker->late());
  report.own_loop_late_ms = ToQuantiles(late);
  report.own_send_late_ms = ToQuantiles(send_late);
  const bool was_late =
      report.own_loop_late_ms.p99 > kOwnLateP99Ms || report.own_send_late_ms.p99 > kOwnLateP99Ms;
  if (opened_ns_ != 0 && was_late) {
    const auto text = [](double ms) {
      return std::to_string(ms).substr(0, std::to_string(ms).size() - 3);
    };
    run_.errors.Add(
        "this program was too slow: its loop was late by p99 " + text(report.own_loop_late_ms.p99) +
        " ms, max " + text(report.own_loop_late_ms.max) + " ms, its requests by p99 " +
        text(report.own_send_late_ms.p99) + " ms; this affects latencies and missing poses");
  }
  report.errors = run_.errors.Texts();
  report.failed = run_.failed;
  return report;
}

}  // namespace

LoadReport RunLoad(const LoadOptions& options, const Choreography* choreography,
                   std::shared_ptr<const MotionLibrary> library, const std::atomic<bool>& stop,
                   const std::function<void(const std::string&)>& progress) {
  return LoadRun(options, choreography, std::move(library), stop, progress).Run();
}

}  // namespace stridewire::load
