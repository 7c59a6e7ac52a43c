#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/limits.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// An address HOST:PORT. In text, an IPv6 host is enclosed in brackets. If the port is 0, the
/// operating system chooses one.
struct Endpoint {
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;
  bool operator==(const Endpoint&) const = default;
};

[[nodiscard]] Expected<Endpoint> ParseEndpoint(std::string_view text);
[[nodiscard]] std::string ToText(const Endpoint& endpoint);
[[nodiscard]] bool IsLoopback(const Endpoint& endpoint);

/// The settings of section [worlds.NAME].
struct WorldConfig {
  std::string library;      ///< Motion library: "builtin" or a file. Empty: the default library.
  std::string terrain;      ///< A terrain file; empty: flat ground.
  bool persistent = false;  ///< Avatars outlive the session that spawned them.
  std::optional<bool> idle_motion;       ///< Default: Config::idle_motion.
  std::optional<bool> stride_variation;  ///< Default: Config::stride_variation.
  bool operator==(const WorldConfig&) const = default;
};

/// All settings of the server. Each key has an option (--tick-hz), an environment variable
/// (STRIDEWIRE_TICK_HZ) and a name in the file (tick_hz). The option takes precedence over the
/// variable, the variable over the file, and the file over the default.
struct Config {
  Endpoint listen = {"127.0.0.1", 7420};
  Endpoint http = {"127.0.0.1", 7421};
  bool http_enabled = true;
  /// Origins of web pages that may open a WebSocket to /stream, in addition to the origin of the
  /// server itself (OriginPolicy).
  std::vector<std::string> allowed_origins;
  /// Addresses and networks of proxies (TrustedProxies::Parse).
  std::vector<std::string> trusted_proxies;
  /// Folder of the viewer. Empty: the viewer that was built or installed with the program.
  std::string viewer_dir;
  std::string library = "builtin";
  std::string data_dir;  ///< Reserved for stored worlds; the server writes nothing yet.
  double tick_hz = 60.0;
  int shards = 0;                   ///< Number of shards. 0: one per processor.
  int max_catch_up_ticks = 10;      ///< Maximum number of missed ticks that avatars catch up on.
  bool run_time_correction = true;  ///< True: the blend weights of each movement are corrected.
  /// True: feet stay fixed on the ground between landing and lifting.
  bool foot_planting = true;
  bool idle_motion = true;       ///< True: standing avatars breathe, sway and shift their weight.
  bool stride_variation = true;  ///< True: equal steps vary slightly, like the steps of people.
  double interest_cell_m = 8.0;  ///< Cell size of the grid that finds the avatars of a region.
  bool allow_insecure = false;   ///< True: the server may listen on non-loopback addresses.
  /// True: when a client joins a world that the file does not name, the server creates it.
  bool open_worlds = true;
  bool persistent = false;  ///< WorldConfig::persistent for worlds that the file does not name.
  std::string log_level = "info";
  double drain_timeout_s = 5.0;
  Limits limits;
  std::map<std::string, WorldConfig, std::less<>> worlds;

  [[nodiscard]] int shard_count() const;
};

/// One key of the configuration.
struct ConfigKey {
  std::string name;     ///< "tick_hz"
  std::string section;  ///< "" or "limits"
  std::string help;
  std::string range;     ///< Allowed values of a number, such as "1 to 1000"; empty otherwise.
  bool is_text = false;  ///< True if the file contains the value in quotes.
  bool is_flag = false;
  /// True if the value is an array of strings in TOML, and comma-separated text elsewhere.
  bool is_list = false;
  std::function<Status(Config&, std::string_view)> set;
  std::function<std::string(const Config&)> get;

  /// Sets the value from text. The error contains `where` and, if a number is out of range, the
  /// allowed range.
  [[nodiscard]] Status Set(Config& config, std::string_view value, std::string where) const;

  [[nodiscard]] std::string option() const;  ///< "--tick-hz"
  /// Name of the environment variable, for example "STRIDEWIRE_TICK_HZ".
  [[nodiscard]] std::string environment() const;
};

/// Returns all keys except those of worlds, in the order of --print-config.
[[nodiscard]] const std::vector<ConfigKey>& ConfigKeys();

/// True for the names that the protocol allows: UTF-8 of 1 to kMaxNameBytes bytes without control
/// characters. A world name may thus contain slashes, so it must not be used as a file name.
[[nodiscard]] bool IsWorldName(std::string_view name);

/// Reads TOML text into `config`. `name` is the file name for errors. Each error contains the file
/// name, the line, and the key or, if the TOML syntax is invalid, a description of the mistake. On
/// error, `config` is unchanged.
[[nodiscard]] Status ReadConfigText(std::string_view text, const std::string& name, Config& config);

/// Checks rules that concern several keys, such as a public address without allow_insecure.
[[nodiscard]] Status CheckConfig(const Config& config);

/// Returns the configuration as TOML. ReadConfigText reads it back without loss.
[[nodiscard]] std::string PrintConfig(const Config& config);

}  // namespace stridewire::server
