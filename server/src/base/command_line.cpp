#include "base/command_line.h"

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <vector>

#include "stridewire/base/version.h"

namespace stridewire::server {
namespace {

constexpr std::size_t kMaxConfigBytes = std::size_t{1} << 20;

constexpr const char* kFooter = R"(
Every option can also be set in the configuration file (--tick-hz 30 is tick_hz = 30; limits are in
section [limits]) or in the environment (STRIDEWIRE_TICK_HZ=30). An option overrides an environment
variable, which overrides the file. Settings of individual worlds are possible in the file only:

  [worlds.captured]
  library = "captured.swl"

Examples:
  stridewired                                       # generated library, loopback only
  stridewired --library walk.swl --shards 2
  stridewired --config stridewired.toml --check-config
  stridewired --max-sessions 64 --print-config > stridewired.toml
)";

Expected<std::string> ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return Fail(ErrorCode::kIo, "cannot open the configuration file", path);
  std::string text;
  char buffer[4096];
  while (file.read(buffer, sizeof(buffer)) || file.gcount() > 0) {
    text.append(buffer, static_cast<std::size_t>(file.gcount()));
    if (text.size() > kMaxConfigBytes) {
      return Fail(ErrorCode::kLimitExceeded, "the configuration file is longer than 1 MiB", path);
    }
  }
  if (file.bad() || !file.eof())
    return Fail(ErrorCode::kIo, "cannot read the configuration file", path);
  return text;
}

}  // namespace

std::optional<std::string> SystemEnvironment(const std::string& name) {
  const char* value = std::getenv(name.c_str());
  return value != nullptr ? std::optional<std::string>(value) : std::nullopt;
}

Expected<CommandLine> ReadCommandLine(int argc, const char* const* argv,
                                      const Environment& environment) {
  CLI::App app(
      "The Stridewire server: synthesizes the movements of avatars and streams their poses.",
      "stridewired");
  app.footer(kFooter);
  app.set_help_flag("-h,--help", "Print this help text and exit");
  app.set_version_flag("--version", std::string("stridewired ") + kVersion);
  std::string config_path;
  bool print_config = false;
  bool check_config = false;
  app.add_option("--config", config_path, "Configuration file (TOML); also STRIDEWIRE_CONFIG")
      ->type_name("FILE");
  app.add_flag("--print-config", print_config, "Print the resulting configuration and exit");
  app.add_flag("--check-config", check_config,
               "Check the configuration and its files, then exit with 0 or 2");

  const std::vector<ConfigKey>& keys = ConfigKeys();
  const Config defaults;
  std::vector<std::string> values(keys.size());
  std::vector<CLI::Option*> options(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const ConfigKey& key = keys[i];
    std::string help = key.help + " [" + key.get(defaults) + "]";
    options[i] = key.is_flag ? app.add_flag(key.option() + "{true}", values[i], help)
                             : app.add_option(key.option(), values[i], help);
    if (!key.is_flag) options[i]->type_name("");
    if (key.section == "limits") options[i]->group("Limits");
  }

  CommandLine result;
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    result.action = CommandLine::Action::kPrintText;
    result.text = app.help();
    return result;
  } catch (const CLI::CallForVersion&) {
    result.action = CommandLine::Action::kPrintText;
    result.text = std::string("stridewired ") + kVersion + "\n";
    return result;
  } catch (const CLI::ExtrasError&) {
    // The text of the exception is not used, because it lists the arguments in reverse order.
    return Fail(ErrorCode::kInvalidArgument, "unknown option or surplus argument; see --help",
                app.remaining().front());
  } catch (const CLI::ArgumentMismatch& error) {
    const std::string text = error.what();  // "--tick-hz: 1 required  missing"
    return Fail(ErrorCode::kInvalidArgument, "expected a value; see --help",
                text.substr(0, text.find(':')));
  } catch (const CLI::ParseError& error) {
    return Fail(ErrorCode::kInvalidArgument, "see --help", std::string(error.what()));
  }

  if (config_path.empty()) config_path = environment("STRIDEWIRE_CONFIG").value_or("");
  if (!config_path.empty()) {
    const auto text = ReadFile(config_path);
    if (!text) return std::unexpected(text.error());
    if (Status status = ReadConfigText(*text, config_path, result.config); !status) {
      return std::unexpected(status.error());
    }
  }
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const bool is_option = options[i]->count() > 0;
    std::optional<std::string> value;
    std::string where = keys[i].option();
    if (is_option) {
      value = values[i];
    } else {
      where = keys[i].environment();
      value = environment(where);
    }
    if (!value) continue;
    if (Status status = keys[i].Set(result.config, *value, where + " " + *value); !status) {
      return std::unexpected(status.error());
    }
  }
  if (Status status = CheckConfig(result.config); !status) {
    return std::unexpected(status.error());
  }
  if (print_config) result.action = CommandLine::Action::kPrintConfig;
  if (check_config) result.action = CommandLine::Action::kCheckConfig;
  return result;
}

}  // namespace stridewire::server
