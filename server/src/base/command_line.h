#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/config.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// The parsed command line of stridewired.
struct CommandLine {
  enum class Action { kRun, kPrintConfig, kCheckConfig, kPrintText };
  Action action = Action::kRun;
  std::string text;  ///< The help text or the version, for kPrintText.
  Config config;
};

/// Returns the value of an environment variable, or nullopt if it is not set.
using Environment = std::function<std::optional<std::string>(const std::string&)>;

/// Reads the environment of this process.
[[nodiscard]] std::optional<std::string> SystemEnvironment(const std::string& name);

/// Combines options, environment variables and the configuration file, in this order of
/// precedence. Errors name the option, the variable, or the file and line.
[[nodiscard]] Expected<CommandLine> ReadCommandLine(int argc, const char* const* argv,
                                                    const Environment& environment);

}  // namespace stridewire::server
