#include "app/program.h"

#include <csignal>
#include <cstdio>
#include <exception>

#include "app/libraries.h"
#include "app/server.h"
#include "app/terrains.h"
#include "base/command_line.h"
#include "base/logging.h"

namespace stridewire::server {
namespace {

constexpr int kExitFailure = 1;
constexpr int kExitBadInput = 2;

int PrintError(const Error& error, int exit_code) {
  std::fprintf(stderr, "stridewired: %s\n", Describe(error).c_str());
  return exit_code;
}

int RunUnguarded(int argc, char** argv) {
  using Action = CommandLine::Action;
  const auto command = ReadCommandLine(argc, argv, SystemEnvironment);
  if (!command) return PrintError(command.error(), kExitBadInput);
  if (command->action == Action::kPrintText || command->action == Action::kPrintConfig) {
    const std::string text =
        command->action == Action::kPrintText ? command->text : PrintConfig(command->config);
    std::fputs(text.c_str(), stdout);
    return 0;
  }

  auto libraries = Libraries::Load(command->config);
  if (!libraries) return PrintError(libraries.error(), kExitBadInput);
  auto terrains = Terrains::Load(command->config);
  if (!terrains) return PrintError(terrains.error(), kExitBadInput);
  auto viewer = ViewerFiles::Find(command->config.viewer_dir);
  if (!viewer) return PrintError(viewer.error(), kExitBadInput);
  if (command->action == Action::kCheckConfig) {
    std::puts("the configuration is valid");
    return 0;
  }

  std::signal(SIGPIPE, SIG_IGN);
  const Log log(command->config.log_level);
  Server server(command->config, *std::move(libraries), *std::move(viewer), *std::move(terrains));
  server.WatchSignals();
  if (const auto status = server.Start(); !status) return PrintError(status.error(), kExitFailure);
  std::printf("%s\n", server.ReadyLine().c_str());
  std::fflush(stdout);
  return server.Run() ? 0 : kExitFailure;
}

}  // namespace

int RunProgram(int argc, char** argv) {
  try {
    return RunUnguarded(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stridewired: %s\n", error.what());
    return kExitFailure;
  }
}

}  // namespace stridewire::server
