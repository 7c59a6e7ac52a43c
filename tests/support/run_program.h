#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <string>
#include <vector>

namespace stridewire::test {

/// Exit code and output of a program.
struct ProgramResult {
  /// Exit code; -1 if the program did not start, was killed by a signal or exceeded the timeout.
  int exit_code = -1;
  int signal = 0;  ///< Signal that killed the program; 0 if there was none.
  bool timed_out = false;
  std::string out;  ///< Output on stdout, at most 64 MiB.
  std::string err;  ///< Output on stderr, at most 64 MiB.
};

/// Runs the program at a path, without a shell and with an empty stdin, and waits for its end.
/// Kills it after `timeout_s`. `arguments` do not include the name of the program.
inline ProgramResult RunProgram(const std::string& program,
                                const std::vector<std::string>& arguments, double timeout_s = 120) {
  constexpr std::size_t kMaxOutput = std::size_t{64} << 20;
  ProgramResult result;
  std::array<int, 2> out_pipe{};
  std::array<int, 2> err_pipe{};
  if (pipe2(out_pipe.data(), O_CLOEXEC) != 0) return result;
  if (pipe2(err_pipe.data(), O_CLOEXEC) != 0) {
    close(out_pipe[0]);
    close(out_pipe[1]);
    return result;
  }
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    const int nothing = open("/dev/null", O_RDONLY);
    dup2(nothing, STDIN_FILENO);
    dup2(out_pipe[1], STDOUT_FILENO);
    dup2(err_pipe[1], STDERR_FILENO);
    execv(program.c_str(), argv.data());
    _exit(127);
  }
  close(out_pipe[1]);
  close(err_pipe[1]);

  struct Stream {
    int file;
    std::string* text;
  };
  std::array<Stream, 2> streams = {{{out_pipe[0], &result.out}, {err_pipe[0], &result.err}}};
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  int open_count = child < 0 ? 0 : 2;
  while (open_count > 0) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        end - std::chrono::steady_clock::now());
    if (left.count() <= 0) {
      result.timed_out = true;
      break;
    }
    std::array<pollfd, 2> waiting = {{{streams[0].file, POLLIN, 0}, {streams[1].file, POLLIN, 0}}};
    if (poll(waiting.data(), 2, static_cast<int>(left.count())) < 0 && errno != EINTR) break;
    for (std::size_t i = 0; i < 2; ++i) {
      if (streams[i].file < 0 || waiting[i].revents == 0) continue;
      std::array<char, 65536> buffer{};
      const ssize_t count = read(streams[i].file, buffer.data(), buffer.size());
      if (count > 0) {
        if (streams[i].text->size() < kMaxOutput) {
          streams[i].text->append(buffer.data(), static_cast<std::size_t>(count));
        }
      } else if (count == 0 || errno != EINTR) {
        close(streams[i].file);
        streams[i].file = -1;
        --open_count;
      }
    }
  }
  for (const Stream& stream : streams) {
    if (stream.file >= 0) close(stream.file);
  }
  if (child < 0) return result;
  if (result.timed_out) kill(child, SIGKILL);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  return result;
}

}  // namespace stridewire::test
