// stridewire-load: reads the options, runs the load (load_run.h) and prints a report.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>

#include "load_options.h"
#include "load_run.h"
#include "stridewire/offline/open_library.h"

namespace {

std::atomic<bool> stop{false};

extern "C" void OnSignal(int /*signal*/) { stop = true; }

int Run(int argc, char** argv) {
  using namespace stridewire;
  using namespace stridewire::load;
  const Expected<LoadCommandLine> line = ReadLoadCommandLine(argc, argv);
  if (!line) {
    std::fprintf(stderr, "stridewire-load: %s\n", Describe(line.error()).c_str());
    return 2;
  }
  if (!line->text.empty()) {
    std::fputs(line->text.c_str(), stdout);
    return 0;
  }
  const LoadOptions& options = line->options;
  Choreography choreography;
  if (!options.choreography.empty()) {
    Expected<Choreography> read = ReadChoreography(options.choreography);
    if (!read) {
      std::fprintf(stderr, "stridewire-load: --choreography %s\n", Describe(read.error()).c_str());
      return 2;
    }
    // Avatars repeat the choreography in many places, so it must not refer to world positions.
    const bool is_fixed = std::ranges::any_of(read->movements, [](const MovementRequest& request) {
      const auto* step = std::get_if<StepRequest>(&request.movement);
      return (step != nullptr && step->at.has_value()) ||
             std::holds_alternative<WalkRequest>(request.movement);
    });
    if (!read->layers.empty()) {
      std::fprintf(stderr, "stridewire-load: --choreography %s: layers are not supported here\n",
                   options.choreography.c_str());
      return 2;
    }
    if (is_fixed || read->terrain != nullptr) {
      std::fprintf(stderr,
                   "stridewire-load: --choreography %s: at_m, walk_to and terrain are not "
                   "supported, because avatars start in many places\n",
                   options.choreography.c_str());
      return 2;
    }
    choreography = std::move(*read);
  }
  std::shared_ptr<const MotionLibrary> library;
  if (options.mode == protocol::PoseMode::kMovement) {
    auto opened = OpenLibrary(options.library);
    if (!opened) {
      std::fprintf(stderr, "stridewire-load: --library %s\n", Describe(opened.error()).c_str());
      return 2;
    }
    library = *std::move(opened);
  }
  std::signal(SIGINT, OnSignal);
  std::signal(SIGTERM, OnSignal);
  std::signal(SIGPIPE, SIG_IGN);
  const bool shows_progress = isatty(STDERR_FILENO) != 0;
  const LoadReport report = RunLoad(options, options.choreography.empty() ? nullptr : &choreography,
                                    library, stop, [shows_progress](const std::string& text) {
                                      if (shows_progress)
                                        std::fprintf(stderr, "\r\033[K%s", text.c_str());
                                    });
  if (shows_progress) std::fputs("\r\033[K", stderr);

  std::fputs((options.json ? ToJson(report) + "\n" : ToText(report)).c_str(), stdout);
  bool failed = report.failed;
  // Repeats the first error on stderr, because with --json it is inside the object.
  if (report.failed && !report.errors.empty()) {
    std::fprintf(stderr, "stridewire-load: %s\n", report.errors.front().c_str());
  }
  for (const FailIf& fail_if : options.fail_ifs) {
    if (!fail_if.Fails(report)) continue;
    failed = true;
    std::fprintf(stderr, "stridewire-load: --fail-if %s\n", fail_if.Explain(report).c_str());
  }
  return failed ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stridewire-load: %s\n", error.what());
    return 1;
  }
}
