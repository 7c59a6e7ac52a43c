#pragma once

#include <functional>
#include <optional>
#include <string>

#include "ops/config.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// What to do, as the command line has it.
struct CommandLine {
  enum class Action { kRun, kPrintConfig, kCheckConfig, kPrintText };
  Action action = Action::kRun;
  std::string text;  ///< kPrintText: help or version.
  Config config;
};

/// Value of an environment variable, nothing if it is not set.
using Environment = std::function<std::optional<std::string>(const std::string&)>;

/// The system's.
[[nodiscard]] std::optional<std::string> SystemEnvironment(const std::string& name);

/// Reads options, environment and file, in this order of precedence. Errors name the option, the
/// variable or the file and line.
[[nodiscard]] Expected<CommandLine> ReadCommandLine(int argc, const char* const* argv,
                                                    const Environment& environment);

}  // namespace stridewire::server
