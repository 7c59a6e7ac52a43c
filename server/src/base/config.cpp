#include "base/config.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <charconv>
#include <cmath>
#include <limits>
#include <span>
#include <thread>

#include "base/trusted_proxies.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/protocol/check.h"
#include "stridewire/protocol/limits.h"

namespace stridewire::server {
namespace {

constexpr int kMaxShards = 64;

template <typename T>
bool ParseWhole(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

std::string NumberText(double value) {
  char buffer[32];
  const auto result = std::to_chars(buffer, buffer + sizeof(buffer), value);
  std::string text(buffer, result.ptr);
  // Formats a float so that it contains a point or an exponent. TOML distinguishes floats from
  // integers, although the reader accepts both.
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

ConfigKey Text(const char* name, const char* help, std::string Config::* member,
               Status (*check)(std::string_view) = nullptr) {
  return {.name = name,
          .section = "",
          .help = help,
          .is_text = true,
          .set = [member, check](Config& config, std::string_view text) -> Status {
            if (check != nullptr) {
              if (Status status = check(text); !status) return status;
            }
            config.*member = std::string(text);
            return {};
          },
          .get = [member](const Config& config) { return config.*member; }};
}

ConfigKey Address(const char* name, const char* help, Endpoint Config::* member) {
  return {.name = name,
          .section = "",
          .help = help,
          .is_text = true,
          .set = [member](Config& config, std::string_view text) -> Status {
            auto endpoint = ParseEndpoint(text);
            if (!endpoint) return std::unexpected(endpoint.error());
            config.*member = *std::move(endpoint);
            return {};
          },
          .get = [member](const Config& config) { return ToText(config.*member); }};
}

// A key for a list of strings. In text, commas separate them. `check` rejects items that contain a
// comma.
ConfigKey List(const char* name, const char* help, std::vector<std::string> Config::* member,
               Status (*check)(std::string_view)) {
  return {.name = name,
          .section = "",
          .help = help,
          .is_list = true,
          .set = [member, check](Config& config, std::string_view text) -> Status {
            std::vector<std::string> items;
            while (!text.empty()) {
              const auto comma = std::min(text.find(','), text.size());
              std::string_view item = text.substr(0, comma);
              while (item.starts_with(' ')) item.remove_prefix(1);
              while (item.ends_with(' ')) item.remove_suffix(1);
              if (Status status = check(item); !status) return status;
              items.emplace_back(item);
              text.remove_prefix(std::min(comma + 1, text.size()));
            }
            config.*member = std::move(items);
            return {};
          },
          .get =
              [member](const Config& config) {
                return fmt::format("{}", fmt::join(config.*member, ","));
              }};
}

ConfigKey Flag(const char* name, const char* help, bool Config::* member) {
  return {.name = name,
          .section = "",
          .help = help,
          .is_flag = true,
          .set = [member](Config& config, std::string_view text) -> Status {
            if (text == "true" || text == "1") {
              config.*member = true;
            } else if (text == "false" || text == "0") {
              config.*member = false;
            } else {
              return Fail(ErrorCode::kInvalidArgument, "expected true or false");
            }
            return {};
          },
          .get = [member](const Config& config) { return config.*member ? "true" : "false"; }};
}

// A key for a number that is a member of `Owner`, which is Config or Limits.
template <typename Owner, typename T>
ConfigKey Number(const char* name, const char* help, T Owner::* member, T min, T max) {
  constexpr bool kIsLimit = std::is_same_v<Owner, Limits>;
  const auto owner = []<typename C>(C& config) -> auto& {
    if constexpr (kIsLimit) {
      return config.limits;
    } else {
      return config;
    }
  };
  return {.name = name,
          .section = kIsLimit ? "limits" : "",
          .help = fmt::format("{} ({} to {})", help, min, max),
          .range = fmt::format("{} to {}", min, max),
          .set = [=](Config& config, std::string_view text) -> Status {
            T value{};
            if (!ParseWhole(text, value)) {
              return Fail(ErrorCode::kInvalidArgument,
                          std::is_same_v<T, double> ? "expected a number" : "expected an integer");
            }
            // Written this way so that NaN is rejected.
            if (!(value >= min && value <= max)) {
              return Fail(ErrorCode::kOutOfRange, "number is out of range");
            }
            owner(config).*member = value;
            return {};
          },
          .get =
              [=](const Config& config) {
                if constexpr (std::is_same_v<T, double>) {
                  return NumberText(owner(config).*member);
                } else {
                  return std::to_string(owner(config).*member);
                }
              }};
}

// Checks the origin of a page: scheme://host or scheme://host:port, without a path.
Status CheckOrigin(std::string_view origin) {
  constexpr std::string_view kSchemeEnd = "://";
  const auto at = origin.find(kSchemeEnd);
  const bool is_valid =
      at != std::string_view::npos && at > 0 && at + kSchemeEnd.size() < origin.size() &&
      origin.find_first_of("/?#*, \t\"\\", at + kSchemeEnd.size()) == std::string_view::npos &&
      std::ranges::all_of(origin, [](char c) { return c > ' ' && c < 0x7f; });
  if (is_valid) return {};
  return Fail(ErrorCode::kInvalidArgument,
              "expected the origin of a page without a path, such as https://example.org or "
              "http://localhost:8080");
}

Status CheckNetwork(std::string_view text) {
  const std::string network(text);
  const auto parsed = TrustedProxies::Parse(std::span(&network, 1));
  if (parsed) return {};
  return Fail(parsed.error().code, parsed.error().text);
}

Status CheckLogLevel(std::string_view text) {
  constexpr std::array kLevels = {"trace", "debug", "info", "warning", "error", "off"};
  if (std::ranges::find(kLevels, text) != kLevels.end()) return {};
  return Fail(ErrorCode::kInvalidArgument, "expected trace, debug, info, warning, error or off");
}

Status CheckNotEmpty(std::string_view text) {
  if (!text.empty()) return {};
  return Fail(ErrorCode::kInvalidArgument, "expected a file name or 'builtin'");
}

std::vector<ConfigKey> MakeKeys() {
  constexpr std::size_t kMiB = std::size_t{1} << 20;
  std::vector<ConfigKey> keys = {
      Address("listen", "Address for TCP clients, HOST:PORT; port 0: the system chooses",
              &Config::listen),
      Address("http", "Address for the viewer, /stream, /metrics and health checks, HOST:PORT",
              &Config::http),
      Flag("http_enabled", "Enable the HTTP server", &Config::http_enabled),
      List("allowed_origins",
           "Other web pages that may open /stream: https://HOST[:PORT],...; no wildcards",
           &Config::allowed_origins, CheckOrigin),
      List("trusted_proxies",
           "Addresses or networks of proxies whose X-Forwarded-For names the client of /stream",
           &Config::trusted_proxies, CheckNetwork),
      Text("viewer_dir", "Folder with the viewer; empty: the viewer installed with the server",
           &Config::viewer_dir),
      Text("library", "Default library of worlds: a .swl file, or builtin", &Config::library,
           CheckNotEmpty),
      Text("data_dir", "Reserved; the server does not store worlds yet", &Config::data_dir),
      Number("tick_hz", "Ticks per second", &Config::tick_hz, 1.0, 1000.0),
      Number("shards", "Threads that advance avatars; 0: one per processor", &Config::shards, 0,
             kMaxShards),
      Number("max_catch_up_ticks",
             "Maximum number of missed ticks that avatars catch up on; further ones are lost",
             &Config::max_catch_up_ticks, 0, 1000),
      Flag("run_time_correction",
           "Correct blend weights so that movements meet the requested parameters",
           &Config::run_time_correction),
      Flag("foot_planting", "Keep feet fixed on the ground between landing and lifting",
           &Config::foot_planting),
      Flag("idle_motion", "Let standing avatars breathe, sway and shift their weight",
           &Config::idle_motion),
      Flag("stride_variation", "Let the duration and the pose of steps vary slightly",
           &Config::stride_variation),
      Number("interest_cell_m", "Cell size in m of the grid that finds the avatars of a region",
             &Config::interest_cell_m, 1.0, 1000.0),
      Flag("allow_insecure",
           "Allow non-loopback addresses, although there are no tokens and no TLS",
           &Config::allow_insecure),
      Flag("open_worlds", "Create a world when a client joins a name that the file does not list",
           &Config::open_worlds),
      Flag("persistent",
           "Keep the avatars of a session that has ended, in worlds that the file does not list",
           &Config::persistent),
      Text("log_level", "trace, debug, info, warning, error or off", &Config::log_level,
           CheckLogLevel),
      Number("drain_timeout_s", "Seconds for clients to receive pending messages after SIGTERM",
             &Config::drain_timeout_s, 0.0, 600.0),
  };
  const auto limit = [&]<typename T>(const char* name, const char* help, T Limits::* member, T min,
                                     T max) {
    keys.push_back(Number(name, help, member, min, max));
  };
  limit("max_control_bytes", "Payload of a control message, in bytes", &Limits::max_control_bytes,
        std::size_t{1024}, protocol::kMaxControlBytes);
  limit("max_bulk_bytes",
        "Payload of a message about many avatars, a terrain or a library, in bytes",
        &Limits::max_bulk_bytes, std::size_t{64 * 1024}, protocol::kMaxBulkBytes);
  limit("max_handshakes", "Connections that have not sent Hello yet", &Limits::max_handshakes, 1,
        65'536);
  limit("max_sessions", "Sessions, connected or waiting for their client", &Limits::max_sessions, 1,
        65'536);
  limit("max_sessions_per_address", "Sessions and handshakes per client address",
        &Limits::max_sessions_per_address, 1, 65'536);
  limit("handshake_timeout_s", "Seconds from accept to a complete Hello",
        &Limits::handshake_timeout_s, 0.05, 600.0);
  limit("idle_timeout_s", "Seconds without received bytes before disconnecting; 0: never",
        &Limits::idle_timeout_s, 0.0, 86'400.0);
  limit("write_timeout_s", "Seconds without sent bytes before disconnecting a slow client",
        &Limits::write_timeout_s, 0.05, 86'400.0);
  limit("resume_window_s", "Seconds that a session waits for its client to reconnect; 0: none",
        &Limits::resume_window_s, 0.0, 86'400.0);
  limit("max_worlds", "Worlds", &Limits::max_worlds, 1, 65'536);
  limit("max_worlds_per_session", "Worlds that one session may join",
        &Limits::max_worlds_per_session, 1, 65'536);
  limit("max_subscriptions", "Subscriptions per session", &Limits::max_subscriptions, 1, 65'536);
  limit("max_named_avatars", "Avatar ids in all subscriptions of one session",
        &Limits::max_named_avatars, 0, 10'000'000);
  limit("max_avatars", "Avatars in all worlds", &Limits::max_avatars, 1, 10'000'000);
  limit("max_avatars_per_world", "Avatars in one world", &Limits::max_avatars_per_world, 1,
        10'000'000);
  limit("max_queue", "Waiting requests per avatar", &Limits::max_queue, 1,
        AvatarSimulation::kMaxQueue);
  limit("requests_per_s", "Command items per second and session", &Limits::requests_per_s, 1,
        100'000'000);
  limit("request_burst", "Command items that a session may send at once", &Limits::request_burst, 1,
        100'000'000);
  limit("starts_per_tick", "Avatars that one command starts per tick; later ones wait",
        &Limits::starts_per_tick, 16, 1'000'000);
  limit("spawns_per_tick", "Avatars that one shard spawns per tick; later ones wait",
        &Limits::spawns_per_tick, 1, 1'000'000);
  limit("messages_per_s", "Messages per second and session; reading pauses beyond them",
        &Limits::messages_per_s, 1, 100'000'000);
  limit("max_pending_commands", "Unanswered commands per session; reading pauses at this number",
        &Limits::max_pending_commands, 1, static_cast<int>(protocol::kReplyCache));
  limit("control_buffer_bytes",
        "Waiting outgoing messages per session, without poses and movements, in bytes",
        &Limits::control_buffer_bytes, std::size_t{64 * 1024}, 1024 * kMiB);
  limit("observer_backlog_ticks",
        "Waiting pose batches of a slow observer, per world, mode and shard",
        &Limits::observer_backlog_ticks, 1, 1000);
  limit("reply_cache_bytes", "Stored replies per session, in bytes", &Limits::reply_cache_bytes,
        std::size_t{4096}, 1024 * kMiB);
  limit("event_replay_bytes", "Stored events per session, for a reconnect, in bytes",
        &Limits::event_replay_bytes, std::size_t{0}, 1024 * kMiB);
  limit("socket_send_buffer_bytes", "SO_SNDBUF of a connection; 0: the default of the system",
        &Limits::socket_send_buffer_bytes, std::size_t{0}, 64 * kMiB);
  limit("websocket_gather_s",
        "Seconds for which batches of shards wait to share a WebSocket message; 0: never",
        &Limits::websocket_gather_s, 0.0, 1.0);
  limit("max_http_connections", "HTTP connections, without /stream", &Limits::max_http_connections,
        1, 65'536);
  return keys;
}

std::string Quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      quoted += fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

// Converts a comma-separated list, as in an option, to a TOML array.
std::string QuotedList(std::string_view list) {
  std::vector<std::string> items;
  while (!list.empty()) {
    const auto comma = std::min(list.find(','), list.size());
    items.push_back(Quoted(list.substr(0, comma)));
    list.remove_prefix(std::min(comma + 1, list.size()));
  }
  return fmt::format("[{}]", fmt::join(items, ", "));
}

}  // namespace

int Config::shard_count() const {
  if (shards > 0) return shards;
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, kMaxShards);
}

Status ConfigKey::Set(Config& config, std::string_view value, std::string where) const {
  Status status = set(config, value);
  if (status) return {};
  const bool is_out_of_range = status.error().code == ErrorCode::kOutOfRange && !range.empty();
  if (is_out_of_range) where += fmt::format(" (expected {})", range);
  status.error().where = std::move(where);
  return status;
}

std::string ConfigKey::option() const {
  std::string text = "--" + name;
  std::ranges::replace(text, '_', '-');
  return text;
}

std::string ConfigKey::environment() const {
  std::string text = "STRIDEWIRE_" + name;
  std::ranges::transform(text, text.begin(), [](char c) {
    return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c;
  });
  return text;
}

const std::vector<ConfigKey>& ConfigKeys() {
  static const std::vector<ConfigKey> keys = MakeKeys();
  return keys;
}

Expected<Endpoint> ParseEndpoint(std::string_view text) {
  const auto colon = text.rfind(':');
  if (colon == std::string_view::npos || colon == 0) {
    return Fail(ErrorCode::kInvalidArgument, "expected HOST:PORT, such as 127.0.0.1:7420");
  }
  std::string_view host = text.substr(0, colon);
  if (host.front() == '[' && host.back() == ']' && host.size() > 2) {
    host = host.substr(1, host.size() - 2);
  } else if (host.find_first_of(":[]") != std::string_view::npos) {
    return Fail(ErrorCode::kInvalidArgument,
                "expected an IPv6 address in brackets, such as [::1]:7420");
  }
  int port = 0;
  if (!ParseWhole(text.substr(colon + 1), port) || port < 0 || port > 65'535) {
    return Fail(ErrorCode::kOutOfRange, "expected a port from 0 to 65535 after the last colon");
  }
  return Endpoint{std::string(host), static_cast<std::uint16_t>(port)};
}

std::string ToText(const Endpoint& endpoint) {
  const bool is_v6 = endpoint.host.find(':') != std::string::npos;
  return fmt::format("{}{}{}:{}", is_v6 ? "[" : "", endpoint.host, is_v6 ? "]" : "", endpoint.port);
}

bool IsLoopback(const Endpoint& endpoint) {
  boost::system::error_code error;
  const auto address = boost::asio::ip::make_address(endpoint.host, error);
  return error ? endpoint.host == "localhost" : address.is_loopback();
}

bool IsWorldName(std::string_view name) {
  return protocol::Check(protocol::JoinWorld{.seq = 1, .name = std::string(name)}).has_value();
}

Status CheckConfig(const Config& config) {
  if (!IsLoopback(config.listen) && !config.allow_insecure) {
    return Fail(ErrorCode::kInvalidArgument,
                "not a loopback address: without tokens and TLS, anyone could command avatars; set "
                "allow_insecure to allow it",
                "listen: " + ToText(config.listen));
  }
  if (config.http_enabled && !IsLoopback(config.http) && !config.allow_insecure) {
    return Fail(ErrorCode::kInvalidArgument,
                "not a loopback address: without tokens and TLS, anyone could command avatars over "
                "/stream; set allow_insecure to allow it",
                "http: " + ToText(config.http));
  }
  return {};
}

std::string PrintConfig(const Config& config) {
  std::string text;
  std::string section;
  for (const ConfigKey& key : ConfigKeys()) {
    if (key.section != section) {
      section = key.section;
      text += fmt::format("\n[{}]\n", section);
    }
    std::string value = key.get(config);
    if (key.is_text) value = Quoted(value);
    if (key.is_list) value = QuotedList(value);
    text += fmt::format("{} = {}\n", key.name, value);
  }
  for (const auto& [name, world] : config.worlds) {
    text += fmt::format("\n[worlds.{}]\n", Quoted(name));
    if (!world.library.empty()) text += fmt::format("library = {}\n", Quoted(world.library));
    if (!world.terrain.empty()) text += fmt::format("terrain = {}\n", Quoted(world.terrain));
    text += fmt::format("persistent = {}\n", world.persistent);
    if (world.idle_motion) text += fmt::format("idle_motion = {}\n", *world.idle_motion);
    if (world.stride_variation) {
      text += fmt::format("stride_variation = {}\n", *world.stride_variation);
    }
  }
  return text;
}

}  // namespace stridewire::server
