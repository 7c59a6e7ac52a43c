// Runs stridewire-load against stridewired and checks its counters and error messages.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "run_program.h"
#include "scratch_folder.h"
#include "server_metrics.h"

namespace stridewire::load {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::RunProgram;
using testing::HasSubstr;

/// Runs stridewired on free ports and kills it at the end.
class RealServer {
 public:
  explicit RealServer(const std::string& shards = "2") {
    std::array<int, 2> output{};
    EXPECT_EQ(pipe2(output.data(), O_CLOEXEC), 0);
    child_ = fork();
    if (child_ == 0) {
      dup2(output[1], STDOUT_FILENO);
      execl(STRIDEWIRE_STRIDEWIRED, STRIDEWIRE_STRIDEWIRED, "--listen", "127.0.0.1:0", "--http",
            "127.0.0.1:0", "--shards", shards.c_str(), "--log-level", "warning", nullptr);
      _exit(127);
    }
    close(output[1]);
    char c = 0;
    while (read(output[0], &c, 1) == 1 && c != '\n') ready_ += c;
    close(output[0]);
  }
  ~RealServer() { Kill(); }
  RealServer(const RealServer&) = delete;
  RealServer& operator=(const RealServer&) = delete;

  void Kill() {
    if (child_ <= 0) return;
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
    child_ = -1;
  }

  /// Returns an address from the ready line, for example of "listen".
  [[nodiscard]] std::string Address(const std::string& key) const {
    const std::size_t at = ready_.find(key + "=");
    if (at == std::string::npos) return "127.0.0.1:1";
    const std::size_t from = at + key.size() + 1;
    return ready_.substr(from, ready_.find(' ', from) - from);
  }

  /// Number of avatars in the server's metrics; -1 without metrics.
  [[nodiscard]] int AvatarCount() const {
    const std::string http = Address("http");
    const auto port = static_cast<std::uint16_t>(std::stoi(http.substr(http.rfind(':') + 1)));
    const Expected<ServerMetrics> metrics = ScrapeServerMetrics({"127.0.0.1", port}, 10.0);
    return metrics ? static_cast<int>(metrics->avatars) : -1;
  }

  [[nodiscard]] ProgramResult Load(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(),
                     {"--connect", Address("listen"), "--http", Address("http"), "--json"});
    return RunProgram(STRIDEWIRE_LOAD, arguments, 120.0);
  }

 private:
  pid_t child_ = -1;
  std::string ready_;
};

/// Parses the report, which must be one JSON object and nothing else.
json ReportOf(const ProgramResult& result) {
  EXPECT_FALSE(result.timed_out);
  json report = json::parse(result.out, nullptr, false);
  EXPECT_TRUE(report.is_object()) << result.out << result.err;
  return report;
}

/// Expects all poses, except those of missed ticks and dropped batches, which occur on a busy
/// machine. Allows two further ticks, because the server does not count them at the same moment.
void ExpectAllPoses(const json& report) {
  const auto expected = report["poses_expected"].get<std::int64_t>();
  const auto received = report["poses_received"].get<std::int64_t>();
  const auto avatars = report["avatars"].get<std::int64_t>();
  const auto observers = report["observers"].get<std::int64_t>();
  const auto missed = report["ticks_missed"].get<std::int64_t>();
  const auto dropped = report["batches_dropped"].get<std::int64_t>();
  EXPECT_LE(received, expected) << report;
  const std::int64_t excused =
      missed == 0 && dropped == 0 ? 0 : (missed + 2) * avatars * observers + dropped * avatars;
  EXPECT_GE(received, expected - excused) << report;
  EXPECT_GT(received, 0) << report;
}

/// Expects no errors except those that a busy machine causes.
void ExpectNoErrorsButLateness(const json& report) {
  for (const json& error : report["errors"]) {
    const auto text = error.get<std::string>();
    EXPECT_TRUE(text.starts_with("this program was too slow") ||
                text.starts_with("the server dropped") || text.find("had not moved") != text.npos)
        << text;
  }
  EXPECT_EQ(report["poses_invalid"], 0) << report;
}

TEST(LoadProgram, CountsEveryPoseOfFiftyWanderingAvatars) {
  const RealServer server;
  const ProgramResult result =
      server.Load({"--avatars", "50", "--observers", "2", "--seconds", "3"});
  const json report = ReportOf(result);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(report["poses_expected"], 50 * 2 * 180);
  ExpectAllPoses(report);
  ExpectNoErrorsButLateness(report);
  EXPECT_EQ(report["seconds"], 3.0);
  EXPECT_EQ(report["mode"], "quantised");
  EXPECT_GT(report["requests"]["sent"], 50);
  EXPECT_EQ(report["requests"]["accepted"], report["requests"]["sent"]);
  EXPECT_EQ(report["requests"]["rejected"], 0);
  EXPECT_EQ(report["reconnects"], 0);
  // 23 joints take 98 bytes, including 12 for the root. The header of a batch adds a little.
  EXPECT_GT(report["bytes_per_pose"], 98.0);
  EXPECT_LT(report["bytes_per_pose"], 110.0);
  EXPECT_GT(report["moving_share"], 0.2);
  // Every avatar starts at least one plan in the first two seconds.
  EXPECT_GE(report["steps_measured"], 25);
  EXPECT_GT(report["step_latency_ms"]["max"], 0.0);
  EXPECT_LE(report["step_latency_ms"]["p50"], report["step_latency_ms"]["p99"]);
  EXPECT_LE(report["step_latency_ms"]["p99"], report["step_latency_ms"]["max"]);
  EXPECT_GT(report["tick_ms"]["max"], 0.0);
  EXPECT_LE(report["tick_ms"]["p50"], report["tick_ms"]["max"]);
  // The program has removed its avatars.
  EXPECT_EQ(server.AvatarCount(), 0);
}

TEST(LoadProgram, CountsThePosesOfPartialObservers) {
  const RealServer server;
  const ProgramResult result =
      server.Load({"--avatars", "50", "--observers", "1", "--partial-observers", "3",
                   "--partial-avatars", "7", "--worlds", "2", "--seconds", "2"});
  const json report = ReportOf(result);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(report["poses_expected"], (50 + 3 * 7) * 120);
  ExpectAllPoses(report);
  ExpectNoErrorsButLateness(report);
  EXPECT_EQ(report["partial_observers"], 3);
  EXPECT_EQ(report["partial_avatars"], 7);
  // With all avatars it would be twice as much.
  EXPECT_LT(report["bytes_per_pose"], 200.0);
}

TEST(LoadProgram, EvaluatesPosesInModeMovement) {
  const RealServer server;
  const ProgramResult result = server.Load(
      {"--avatars", "50", "--observers", "2", "--partial-observers", "2", "--partial-avatars", "10",
       "--seconds", "3", "--mode", "movement", "--churn", "1"});
  const json report = ReportOf(result);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(report["mode"], "movement");
  EXPECT_EQ(report["poses_invalid"], 0);
  ExpectAllPoses(report);
  ExpectNoErrorsButLateness(report);
  EXPECT_GE(report["steps_measured"], 10);
  EXPECT_LT(report["bytes_per_pose"], 50.0);
}

TEST(LoadProgram, ObservesRootsOnly) {
  const RealServer server;
  const ProgramResult result =
      server.Load({"--avatars", "20", "--observers", "2", "--seconds", "1", "--detail", "root"});
  const json report = ReportOf(result);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(report["mode"], "quantised, root only");
  ExpectAllPoses(report);
  ExpectNoErrorsButLateness(report);
  // A root takes 18 bytes, plus avatar id, flags and a share of the header.
  EXPECT_GT(report["bytes_per_pose"], 18.0);
  EXPECT_LT(report["bytes_per_pose"], 40.0);
}

TEST(LoadProgram, RunsAChoreographyInSeveralWorldsAndThreads) {
  const test::ScratchFolder scratch;
  const std::string file =
      scratch.Write("c.json", R"({"start":{"position_m":[5,0,-5],"heading_rad":1},
    "movements":[{"step":{"length_m":0.6}},{"jump":{"length_m":0.9}},{"stand":{"seconds":0.2}},
                 {"step":{"foot":"left","length_m":0.5}}]})");
  const RealServer server("1");
  const ProgramResult result =
      server.Load({"--worlds", "3", "--avatars", "10", "--observers", "3", "--seconds", "2",
                   "--mode", "full", "--choreography", file, "--threads", "2"});
  const json report = ReportOf(result);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(report["worlds"], 3);
  EXPECT_EQ(report["mode"], "full");
  EXPECT_EQ(report["poses_expected"], 10 * 3 * 120);
  ExpectAllPoses(report);
  ExpectNoErrorsButLateness(report);
  EXPECT_EQ(report["requests"]["sent"].get<int>() % 4, 0);
  EXPECT_GE(report["requests"]["accepted"], 40);
  // Avatars start at random times soon after they are spawned. On a slow machine, some complete
  // their first step before the program starts to count.
  EXPECT_GE(report["steps_measured"], 5);
}

TEST(LoadProgram, ExcusesPosesOfDroppedObservers) {
  const RealServer server;
  const ProgramResult result = server.Load({"--avatars", "20", "--observers", "4", "--seconds", "3",
                                            "--churn", "5", "--observe", "all"});
  const json report = ReportOf(result);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GE(report["reconnects"], 5);
  EXPECT_LT(report["poses_expected"], 20 * 4 * 180);
  ExpectAllPoses(report);
  ExpectNoErrorsButLateness(report);
}

TEST(LoadProgram, ExitsWithOneIfAConditionIsTrue) {
  const RealServer server;
  const ProgramResult result =
      server.Load({"--avatars", "5", "--observers", "1", "--seconds", "0.5", "--fail-if",
                   "poses_received>0", "--fail-if", "poses_invalid>0"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("--fail-if poses_received>0: the value is "));
  EXPECT_THAT(result.err, testing::Not(HasSubstr("poses_invalid")));
  EXPECT_GT(ReportOf(result)["poses_received"], 0);
}

TEST(LoadProgram, ReportsAKilledServerAndExitsInTime) {
  RealServer server;
  std::jthread killer([&server] {
    for (int i = 0; i < 600 && server.AvatarCount() < 20; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    server.Kill();
  });
  const ProgramResult result =
      server.Load({"--avatars", "20", "--observers", "2", "--seconds", "5"});
  killer.join();
  const json report = ReportOf(result);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(report["errors"].dump(), HasSubstr("connection lost"));
  EXPECT_THAT(result.err, HasSubstr("connection lost"));
  // Each session reports the loss once, although it tries to reconnect; then the metrics fail.
  EXPECT_LE(report["errors"].size(), 8u) << report;
  // On a very slow machine the server may be killed before the measurement starts.
  if (report["poses_expected"] > 0) {
    EXPECT_LT(report["poses_received"], report["poses_expected"]);
  }
  EXPECT_TRUE(report["tick_ms"]["p99"].is_null());
}

TEST(LoadProgram, ReportsAnUnreachableServer) {
  const ProgramResult result =
      RunProgram(STRIDEWIRE_LOAD, {"--connect", "127.0.0.1:1", "--avatars", "5", "--observers", "1",
                                   "--seconds", "1", "--json"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("cannot connect: Connection refused"));
  EXPECT_EQ(ReportOf(result)["errors"].size(), 1u);
}

TEST(LoadProgram, ExitsWithTwoOnInvalidOptions) {
  const ProgramResult none = RunProgram(STRIDEWIRE_LOAD, {});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_EQ(none.err, "stridewire-load: --connect is required: see --help\n");
  EXPECT_EQ(none.out, "");
  const ProgramResult file =
      RunProgram(STRIDEWIRE_LOAD, {"--connect", "127.0.0.1:1", "--avatars", "5", "--observers", "1",
                                   "--seconds", "1", "--choreography", "/nowhere/c.json"});
  EXPECT_EQ(file.exit_code, 2);
  EXPECT_EQ(file.err, "stridewire-load: --choreography /nowhere/c.json: there is no such file\n");
}

TEST(LoadProgram, RejectsChoreographiesWithWorldPositions) {
  const test::ScratchFolder scratch;
  for (const char* text : {R"({"movements":[{"step":{"at_m":[0,0,1]}}]})",
                           R"({"movements":[{"walk_to":{"position_m":[0,0,1],"heading_rad":0}}]})",
                           R"({"terrain":{},"movements":[{"stand":{"seconds":1}}]})"}) {
    const ProgramResult result = RunProgram(
        STRIDEWIRE_LOAD, {"--connect", "127.0.0.1:1", "--avatars", "5", "--observers", "1",
                          "--seconds", "1", "--choreography", scratch.Write("c.json", text)});
    EXPECT_EQ(result.exit_code, 2) << text;
    EXPECT_THAT(result.err, HasSubstr("c.json: at_m, walk_to and terrain are not supported"));
  }
}

TEST(LoadProgram, PrintsHelpAndVersion) {
  EXPECT_EQ(RunProgram(STRIDEWIRE_LOAD, {"--help"}).exit_code, 0);
  const ProgramResult version = RunProgram(STRIDEWIRE_LOAD, {"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out, testing::StartsWith("stridewire-load "));
}

}  // namespace
}  // namespace stridewire::load
