#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "ops/limits.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// HOST:PORT; an IPv6 address stands in brackets. Port 0: the system chooses.
struct Endpoint {
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;
  bool operator==(const Endpoint&) const = default;
};

[[nodiscard]] Expected<Endpoint> ParseEndpoint(std::string_view text);
[[nodiscard]] std::string ToText(const Endpoint& endpoint);
[[nodiscard]] bool IsLoopback(const Endpoint& endpoint);

/// What [worlds.NAME] says.
struct WorldConfig {
  std::string library;      ///< "builtin" or a file; empty: the default library.
  std::string terrain;      ///< A file of its ground; empty: flat.
  bool persistent = false;  ///< Avatars outlive the session that spawned them.
  bool operator==(const WorldConfig&) const = default;
};

/// Everything that can be set. Each key has an option (--tick-hz), an environment variable
/// (STRIDEWIRE_TICK_HZ) and a place in the file (tick_hz); the first of these that is there counts,
/// else the default.
struct Config {
  Endpoint listen = {"127.0.0.1", 7420};
  Endpoint http = {"127.0.0.1", 7421};
  bool http_enabled = true;
  std::vector<std::string> allowed_origins;  ///< Pages of elsewhere that may open a stream.
  std::string viewer_dir;  ///< Empty: the one built or installed with the program.
  std::string library = "builtin";
  std::string data_dir;  ///< Reserved for the world store; nothing is written yet.
  double tick_hz = 60.0;
  int shards = 0;  ///< 0: one a processor.
  int max_catch_up_ticks = 10;
  bool run_time_correction = true;  ///< Movements start with corrected parameters.
  bool foot_planting = true;        ///< Feet stand still where they land.
  double interest_cell_m = 8.0;     ///< Of the grid that regions observed are looked up in.
  bool allow_insecure = false;
  bool open_worlds = true;  ///< Worlds the file does not name come into being when joined.
  bool persistent = false;  ///< Of worlds the file does not name.
  std::string log_level = "info";
  double drain_timeout_s = 5.0;
  Limits limits;
  std::map<std::string, WorldConfig, std::less<>> worlds;

  [[nodiscard]] int shard_count() const;
};

/// One thing that can be set.
struct ConfigKey {
  std::string name;     ///< "tick_hz"
  std::string section;  ///< "" or "limits"
  std::string help;
  bool is_text = false;  ///< The file has it in quotes.
  bool is_flag = false;
  bool is_list = false;  ///< The file has texts in brackets, options have commas between them.
  std::function<Status(Config&, std::string_view)> set;
  std::function<std::string(const Config&)> get;

  [[nodiscard]] std::string option() const;       ///< "--tick-hz"
  [[nodiscard]] std::string environment() const;  ///< "STRIDEWIRE_TICK_HZ"
};

/// All keys but the worlds, in the order --print-config shows them.
[[nodiscard]] const std::vector<ConfigKey>& ConfigKeys();

/// A world's name: 1 to 64 of A-Z a-z 0-9 _ - . and not a dot first, for it will name files and
/// metrics as well.
[[nodiscard]] bool IsWorldName(std::string_view name);

/// Reads a TOML text over `config`. `name` is the file's, for errors, which name its line and key.
/// On error `config` is as it was.
[[nodiscard]] Status ReadConfigText(std::string_view text, const std::string& name, Config& config);

/// Checks what concerns more than one key, e.g. listening to the world without tokens.
[[nodiscard]] Status CheckConfig(const Config& config);

/// The configuration as a TOML file that gives it back.
[[nodiscard]] std::string PrintConfig(const Config& config);

}  // namespace stridewire::server
