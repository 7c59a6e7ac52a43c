// stridewire-load: options in, one report out. All else is in load_run.h.
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
    // Its avatars stand in many places: what is fixed to one place is not for them.
    const bool is_fixed = std::ranges::any_of(read->movements, [](const MovementRequest& request) {
      const auto* step = std::get_if<StepRequest>(&request.movement);
      return (step != nullptr && step->at.has_value()) ||
             std::holds_alternative<WalkRequest>(request.movement);
    });
    if (!read->layers.empty()) {
      std::fprintf(stderr, "stridewire-load: --choreography %s: layers are not played by a load\n",
                   options.choreography.c_str());
      return 2;
    }
    if (is_fixed || read->terrain != nullptr) {
      std::fprintf(stderr,
                   "stridewire-load: --choreography %s: at_m, walk_to and terrain belong to one "
                   "place, and avatars stand in many\n",
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
  const bool tells_progress = isatty(STDERR_FILENO) != 0;
  const LoadReport report = RunLoad(options, options.choreography.empty() ? nullptr : &choreography,
                                    library, stop, [tells_progress](const std::string& text) {
                                      if (tells_progress)
                                        std::fprintf(stderr, "\r\033[K%s", text.c_str());
                                    });
  if (tells_progress) std::fputs("\r\033[K", stderr);

  std::fputs((options.json ? ToJson(report) + "\n" : ToText(report)).c_str(), stdout);
  bool failed = report.failed;
  // With --json the errors are inside the object, and someone may only look at stderr.
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
