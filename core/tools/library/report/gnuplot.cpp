#include "gnuplot.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <memory>

extern "C" char** environ;

namespace stridewire {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

std::string ReadAll(std::FILE* file) {
  std::rewind(file);
  std::string text;
  std::array<char, 65536> buffer{};
  for (std::size_t count; (count = std::fread(buffer.data(), 1, buffer.size(), file)) > 0;) {
    text.append(buffer.data(), count);
  }
  return text;
}

}  // namespace

Expected<std::string> DrawSvg(const std::string& script, int width, int height) {
  // Uses unnamed files instead of pipes: gnuplot may write output before it has read all input,
  // which could block both processes.
  const File in(std::tmpfile());
  const File out(std::tmpfile());
  const File err(std::tmpfile());
  if (!in || !out || !err) {
    return Fail(ErrorCode::kIo, "cannot create a temporary file", "gnuplot");
  }
  const std::string whole = "set encoding utf8\nset terminal svg size " + std::to_string(width) +
                            "," + std::to_string(height) +
                            " font 'sans-serif,13' background '#ffffff'\n" + script;
  if (std::fwrite(whole.data(), 1, whole.size(), in.get()) != whole.size() ||
      std::fflush(in.get()) != 0) {
    return Fail(ErrorCode::kIo, "cannot write a temporary file", "gnuplot");
  }
  std::rewind(in.get());

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fileno(in.get()), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(out.get()), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(err.get()), STDERR_FILENO);
  std::string name = "gnuplot";
  std::string defaults = "--default-settings";
  std::array<char*, 3> arguments = {name.data(), defaults.data(), nullptr};
  pid_t child = -1;
  const int failed =
      posix_spawnp(&child, name.c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    return Fail(ErrorCode::kUnsupported,
                "not installed; the report needs it to draw figures (Debian: gnuplot-nox)",
                "gnuplot");
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  std::string svg = ReadAll(out.get());
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || !svg.ends_with("</svg>\n\n")) {
    std::string reason = ReadAll(err.get());
    for (char& c : reason) {
      if (c == '\n') c = ' ';
    }
    return Fail(ErrorCode::kIo, "gnuplot failed to draw a figure", reason.substr(0, 200));
  }
  return svg;
}

std::string Number(double value) {
  if (!std::isfinite(value)) return "NaN";
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

std::string Quoted(const std::string& text) {
  // Inside single quotes gnuplot interprets nothing, not even backquotes; '' stands for one quote.
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') quoted += '\'';
    if (static_cast<unsigned char>(c) >= 0x20) quoted += c;
  }
  quoted += '\'';
  return quoted;
}

}  // namespace stridewire
