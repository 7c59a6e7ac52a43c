// The program stridewired: options, exit codes, signals and HTTP.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "raw_client.h"
#include "ready_line.h"

extern char** environ;

namespace stridewire {
namespace {

using test::PortIn;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

class Program {
 public:
  explicit Program(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), STRIDEWIRE_STRIDEWIRED);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    EXPECT_EQ(pipe2(output_.data(), O_CLOEXEC), 0);
    EXPECT_EQ(pipe2(errors_.data(), O_CLOEXEC), 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, output_[1], STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, errors_[1], STDERR_FILENO);
    EXPECT_EQ(posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    close(output_[1]);
    close(errors_[1]);
  }
  ~Program() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    close(output_[0]);
    close(errors_[0]);
  }

  /// Returns the next line of the output, without the line break.
  std::string ReadLine() {
    std::string line;
    char c = 0;
    pollfd waiting{output_[0], POLLIN, 0};
    while (poll(&waiting, 1, 60'000) > 0 && read(output_[0], &c, 1) == 1 && c != '\n') line += c;
    return line;
  }
  void Signal(int signal) const { kill(pid_, signal); }

  /// Waits for the end of the program. Returns the exit code, or the negative number of the signal
  /// that killed it.
  int Wait() {
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    output = ReadAll(output_[0]);
    errors = ReadAll(errors_[0]);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  std::string output;
  std::string errors;

 private:
  static std::string ReadAll(int file) {
    std::string text;
    std::array<char, 4096> buffer;
    ssize_t got = 0;
    while ((got = read(file, buffer.data(), buffer.size())) > 0) {
      text.append(buffer.data(), static_cast<std::size_t>(got));
    }
    return text;
  }

  std::array<int, 2> output_{};
  std::array<int, 2> errors_{};
  pid_t pid_ = -1;
};

// Sends one request and returns the complete response.
std::string Http(std::uint16_t port, const std::string& request) {
  const int file = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(file, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_EQ(send(file, request.data(), request.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(request.size()));
  std::string answer;
  std::array<char, 4096> buffer;
  ssize_t got = 0;
  while ((got = recv(file, buffer.data(), buffer.size(), 0)) > 0) {
    answer.append(buffer.data(), static_cast<std::size_t>(got));
  }
  close(file);
  return answer;
}

std::string Get(std::uint16_t port, const std::string& path) {
  return Http(port, "GET " + path + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
}

const std::vector<std::string> kAnyPorts = {"--listen",    "127.0.0.1:0", "--http",
                                            "127.0.0.1:0", "--shards",    "2"};

TEST(Stridewired, PrintsReadyLineAndDrainsOnSignal) {
  for (const int signal : {SIGTERM, SIGINT}) {
    Program program(kAnyPorts);
    const std::string ready = program.ReadLine();
    EXPECT_THAT(ready, testing::MatchesRegex("ready listen=127.0.0.1:[0-9]+ "
                                             "http=127.0.0.1:[0-9]+ library=builtin shards=2"));
    RawClient client("127.0.0.1", PortIn(ready, "listen"));
    ASSERT_TRUE(client.SayHello());
    const auto world = client.Join("w");
    ASSERT_TRUE(world);
    EXPECT_GT(world->skeleton.joints.size(), 10u);
    program.Signal(signal);
    const auto notice = client.Await<protocol::ErrorNotice>();
    ASSERT_TRUE(notice);
    EXPECT_EQ(notice->code, protocol::StatusCode::kShuttingDown);
    EXPECT_TRUE(client.AwaitClose());
    client = RawClient();
    EXPECT_EQ(program.Wait(), 0) << program.errors;
    EXPECT_THAT(program.output, IsEmpty());
  }
}

TEST(Stridewired, StopsAtOnceOnTheSecondSignal) {
  std::vector<std::string> arguments = kAnyPorts;
  arguments.insert(arguments.end(), {"--drain-timeout-s", "600", "--write-timeout-s", "600"});
  Program program(arguments);
  const std::string ready = program.ReadLine();
  // A client that does not close its connection delays the end after the first signal.
  RawClient client("127.0.0.1", PortIn(ready, "listen"));
  ASSERT_TRUE(client.SayHello());
  program.Signal(SIGTERM);
  ASSERT_TRUE(client.Await<protocol::ErrorNotice>());
  program.Signal(SIGTERM);
  EXPECT_EQ(program.Wait(), 1) << program.errors;
  EXPECT_THAT(program.errors, HasSubstr("stopping at once"));
}

TEST(Stridewired, ServesHealthAndMetrics) {
  Program program(kAnyPorts);
  const std::uint16_t port = PortIn(program.ReadLine(), "http");
  EXPECT_THAT(Get(port, "/healthz"), AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("ok\n")));
  EXPECT_THAT(Get(port, "/readyz"), AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("ready\n")));
  EXPECT_THAT(Get(port, "/metrics?x=1"),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("text/plain; version=0.0.4"),
                    HasSubstr("# TYPE stridewire_tick_seconds histogram"),
                    HasSubstr("stridewire_avatars 0"), HasSubstr("stridewire_build_info{")));
  EXPECT_THAT(Get(port, "/"),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("text/html"), HasSubstr("Stridewire")));
  EXPECT_THAT(Get(port, "/nothing"), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(Http(port,
                   "POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n"
                   "Connection: close\r\n\r\n"),
              AllOf(StartsWith("HTTP/1.1 405"), HasSubstr("Allow: GET, HEAD")));
  EXPECT_THAT(Http(port, "nonsense\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  const std::string huge = "GET / HTTP/1.1\r\nX: " + std::string(64 << 10, 'x');
  EXPECT_THAT(Http(port, huge), testing::Not(StartsWith("HTTP/1.1 200")));
  EXPECT_THAT(Get(port, "/healthz"), StartsWith("HTTP/1.1 200"));
  // Ticks take CPU time even without clients.
  const auto cpu_of_first = [&] {
    const std::string text = Get(port, "/metrics");
    const std::string name = "stridewire_shard_cpu_seconds_total{shard=\"0\"} ";
    const std::size_t at = text.find(name);
    return at == std::string::npos ? -1.0 : std::stod(text.substr(at + name.size()));
  };
  const double before_s = cpu_of_first();
  EXPECT_GE(before_s, 0.0);
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (cpu_of_first() <= before_s) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

TEST(Stridewired, ReportsInvalidInputAndExitsWith2) {
  struct Case {
    std::vector<std::string> arguments;
    const char* message;
  };
  const Case cases[] = {
      {{"--no-such"}, "--no-such"},
      {{"--tick-hz", "fast"}, "--tick-hz fast: expected a number"},
      {{"--listen", "0.0.0.0:7420"}, "allow_insecure"},
      {{"--config", "/no/such.toml"}, "/no/such.toml: cannot open the configuration file"},
      {{"--library", "/no/such.swl"}, "/no/such.swl"},
      {{"--library", "/no/such.swl", "--check-config"}, "/no/such.swl"},
      {{"--library", "/etc/passwd"}, "/etc/passwd"},
  };
  for (const Case& bad : cases) {
    SCOPED_TRACE(bad.message);
    Program program(bad.arguments);
    EXPECT_EQ(program.Wait(), 2);
    EXPECT_THAT(program.errors, AllOf(StartsWith("stridewired: "), HasSubstr(bad.message)));
    EXPECT_EQ(std::ranges::count(program.errors, '\n'), 1) << program.errors;
    EXPECT_THAT(program.output, IsEmpty());
  }
}

TEST(Stridewired, FailsIfAnAddressIsInUse) {
  Program first(kAnyPorts);
  const std::uint16_t port = PortIn(first.ReadLine(), "listen");
  Program second({"--listen", "127.0.0.1:" + std::to_string(port), "--http", "127.0.0.1:0"});
  EXPECT_EQ(second.Wait(), 1);
  EXPECT_THAT(second.errors, HasSubstr("listen: 127.0.0.1:" + std::to_string(port)));
}

TEST(Stridewired, PrintsAndChecksItsConfiguration) {
  Program print({"--print-config", "--tick-hz", "30"});
  EXPECT_EQ(print.Wait(), 0);
  EXPECT_THAT(print.output, AllOf(HasSubstr("tick_hz = 30.0\n"), HasSubstr("[limits]\n")));
  Program check({"--check-config"});
  EXPECT_EQ(check.Wait(), 0);
  Program version({"--version"});
  EXPECT_EQ(version.Wait(), 0);
  EXPECT_THAT(version.output, StartsWith("stridewired "));
}

}  // namespace
}  // namespace stridewire
