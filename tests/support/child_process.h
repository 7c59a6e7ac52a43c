#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace stridewire::test {

/// A program that runs while the test continues. Its stdout is read line by line; its stderr is
/// that of the test. The destructor kills the program if it still runs.
class ChildProcess {
 public:
  ChildProcess(const std::string& program, const std::vector<std::string>& arguments) {
    std::array<int, 2> out{};
    if (pipe2(out.data(), O_CLOEXEC) != 0) return;
    std::vector<char*> argv = {const_cast<char*>(program.c_str())};
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    child_ = fork();
    if (child_ == 0) {
      dup2(open("/dev/null", O_RDONLY), STDIN_FILENO);
      dup2(out[1], STDOUT_FILENO);
      execv(program.c_str(), argv.data());
      _exit(127);
    }
    close(out[1]);
    out_ = out[0];
  }
  ~ChildProcess() {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      (void)Wait();
    }
    if (out_ >= 0) close(out_);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  [[nodiscard]] pid_t pid() const { return child_; }

  void Signal(int signal) const {
    if (child_ > 0) kill(child_, signal);
  }

  /// Waits for the end of the program. Returns the exit code, or -1 if a signal ended it.
  int Wait() {
    int status = 0;
    while (child_ > 0 && waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
    child_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  /// Returns the next line of stdout without its line end, or nullopt after `timeout_s` or at the
  /// end of the output.
  std::optional<std::string> ReadLine(double timeout_s = 60.0) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
    for (;;) {
      if (const std::size_t end = text_.find('\n'); end != std::string::npos) {
        std::string line = text_.substr(0, end);
        text_.erase(0, end + 1);
        return line;
      }
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
          until - std::chrono::steady_clock::now());
      pollfd waiting{out_, POLLIN, 0};
      if (left.count() <= 0 || poll(&waiting, 1, static_cast<int>(left.count())) <= 0) return {};
      std::array<char, 4096> buffer{};
      const ssize_t count = read(out_, buffer.data(), buffer.size());
      if (count <= 0) return {};
      text_.append(buffer.data(), static_cast<std::size_t>(count));
    }
  }

  /// Returns the next line that begins with this text, and drops the lines before it.
  std::optional<std::string> ReadLineThatBegins(const std::string& start, double timeout_s = 60.0) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
    while (std::chrono::steady_clock::now() < until) {
      auto line = ReadLine(timeout_s);
      if (!line || line->starts_with(start)) return line;
    }
    return {};
  }

 private:
  pid_t child_ = -1;
  int out_ = -1;
  std::string text_;
};

}  // namespace stridewire::test
