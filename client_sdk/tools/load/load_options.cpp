#include "load_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <random>

#include "stridewire/base/version.h"

namespace stridewire::load {
namespace {

constexpr const char* kFooter = R"(
Results:
  poses_expected   observed avatars x ticks of the measurement, summed over all observers. The
                   measurement starts when all observers have received poses of all avatars.
  tick_ms          duration of the server's ticks, from its own histogram. p50 and p99 are
                   interpolated within a bin.
  ticks_missed     ticks that the server has skipped, over all shards.
  step_latency_ms  time from the planned sending of a step to the arrival of the first pose that
                   shows it: the first changed pose whose tick is not before the `started` event.
                   Only steps from standing are measured. A step without such a pose at the end
                   counts with the time until then.
  errors           failures, and delays of stridewire-load itself that affect the results.

Exit code: 0 success; 2 invalid options; 1 if the server is not reachable or the connection is lost,
if a pose fails a check, or if a --fail-if condition is true.

Examples:
  stridewire-load --connect 127.0.0.1:7420 --avatars 1000 --observers 4 --seconds 30
  stridewire-load --connect 127.0.0.1:7420 --avatars 200 --observers 50 --seconds 60 --churn 5
  stridewire-load --connect 127.0.0.1:7420 --avatars 10000 --observers 1 --partial-observers 100 \
                  --partial-avatars 100 --seconds 60
  stridewire-load --connect 127.0.0.1:7420 --worlds 4 --avatars 100 --observers 1 --seconds 20 \
                  --choreography walk.json --mode full
  stridewire-load --connect 127.0.0.1:7420 --avatars 1000 --observers 4 --seconds 30 --json \
                  --fail-if 'ticks_missed>0' --fail-if 'step_latency_ms.p99>50'
)";

constexpr const char* kOutOfRange = "is out of range (see --help)";

Expected<Address> ParseAddress(const std::string& text, const char* option) {
  const std::string where = std::string(option) + " " + text.substr(0, 300);
  const auto fail = [&where] {
    return Fail(ErrorCode::kMalformed,
                "expected HOST:PORT, for example 127.0.0.1:7420 or [::1]:7420", where);
  };
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return fail();
  Address address;
  address.host = text.substr(0, colon);
  if (address.host.starts_with('[') && address.host.ends_with(']')) {
    address.host = address.host.substr(1, address.host.size() - 2);
  } else if (address.host.find(':') != std::string::npos) {
    return fail();  // An IPv6 address without brackets is ambiguous.
  }
  const char* const end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data() + colon + 1, end, address.port);
  if (code != std::errc() || stop != end || address.port == 0 || address.host.empty() ||
      address.host.size() > 255) {
    return fail();
  }
  return address;
}

/// Formats an option and its value for an error message.
template <typename T>
std::string OptionText(const char* option, T value) {
  std::string text = std::to_string(value);
  if constexpr (std::is_floating_point_v<T>) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
  }
  return std::string(option) + " " + text;
}

template <typename T>
Status CheckRange(const char* option, T value, T min, T max) {
  if (value >= min && value <= max) return {};  // Written this way so that NaN is rejected.
  return Fail(ErrorCode::kOutOfRange, kOutOfRange, OptionText(option, value));
}

Status CheckRanges(const LoadOptions& options) {
  const Status checks[] = {
      CheckRange("--avatars", options.avatars, 1, kMaxAvatars),
      CheckRange("--worlds", options.worlds, 1, kMaxWorlds),
      CheckRange("--observers", options.observers, 0, kMaxObservers),
      CheckRange("--partial-observers", options.partial_observers, 0, kMaxObservers),
      CheckRange("--partial-avatars", options.partial_avatars, 1, kMaxAvatars),
      CheckRange("--seconds", options.seconds, 0.1, kMaxSeconds),
      CheckRange("--churn", options.churn_per_s, 0.0, kMaxChurnPerS),
      CheckRange("--threads", options.threads, 1, kMaxThreads),
      CheckRange("--verify-one-in", options.verify_one_in, 1, 1'000'000),
  };
  for (const Status& check : checks) {
    if (!check) return check;
  }
  if (options.worlds > options.avatars) {
    return Fail(ErrorCode::kInvalidArgument, "exceeds the number of avatars",
                OptionText("--worlds", options.worlds));
  }
  if (options.partial_observers > 0 && options.partial_avatars > options.avatars) {
    return Fail(ErrorCode::kInvalidArgument, "exceeds the number of avatars",
                OptionText("--partial-avatars", options.partial_avatars));
  }
  if (options.churn_per_s > 0.0 && options.observers + options.partial_observers == 0) {
    return Fail(ErrorCode::kInvalidArgument, "needs at least one observer",
                OptionText("--churn", options.churn_per_s));
  }
  return {};
}

}  // namespace

std::string ToText(const Address& address) {
  const bool is_ipv6 = address.host.find(':') != std::string::npos;
  return (is_ipv6 ? "[" + address.host + "]" : address.host) + ":" + std::to_string(address.port);
}

Expected<LoadCommandLine> ReadLoadCommandLine(int argc, const char* const* argv) {
  CLI::App app(
      "Loads a Stridewire server with simulated game servers, which move avatars, and with "
      "observers, which count and check the poses they receive.",
      "stridewire-load");
  app.footer(kFooter);
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_version_flag("--version", std::string("stridewire-load ") + kVersion);

  LoadCommandLine line;
  LoadOptions& options = line.options;
  std::string connect;
  std::string http;
  std::string mode = "quantised";
  std::string detail = "all";
  std::string observe = "all";
  bool wander = false;
  std::vector<std::string> fail_ifs;
  app.add_option("--connect", connect, "Address of the server, HOST:PORT")->required();
  app.add_option(
      "--http", http,
      "HTTP address of the server's metrics, HOST:PORT, or none [host and port + 1 of --connect]");
  app.add_option("--worlds", options.worlds,
                 "Number of worlds, named load-0, load-1, ... (1 to 1000) [1]");
  app.add_option("--avatars", options.avatars,
                 "Number of avatars, distributed over the worlds (1 to 100000)")
      ->required();
  app.add_option("--observers", options.observers,
                 "Number of sessions that observe all avatars (0 to 10000)")
      ->required();
  app.add_option("--partial-observers", options.partial_observers,
                 "Number of further sessions that observe some avatars only (0 to 10000) [0]");
  app.add_option("--partial-avatars", options.partial_avatars,
                 "Avatars per partial observer, distributed over the crowd [100]");
  app.add_option("--seconds", options.seconds, "Duration of the measurement (0.1 to 3600)")
      ->required();
  app.add_option("--mode", mode,
                 "How the server sends poses: full, quantised or movement [quantised]");
  app.add_option("--detail", detail, "Joints of quantised poses: all, reduced or root [all]");
  app.add_option("--library", options.library,
                 "Library of the server's worlds, for --mode movement [builtin]")
      ->type_name("FILE");
  app.add_option("--choreography", options.choreography,
                 "Movements that each avatar repeats, from wherever it stands")
      ->type_name("C.json");
  app.add_flag("--wander", wander,
               "Random steps, stands and jumps (the default without --choreography)");
  app.add_option(
      "--churn", options.churn_per_s,
      "Reconnects per second: each drops the connection of one observer (0 to 1000) [0]");
  app.add_option("--observe", observe,
                 "Worlds per observer: all, or one, which is observer index modulo worlds [all]");
  app.add_option(
      "--threads", options.threads,
      "Number of threads. The first runs the game servers, the others only observers [1]");
  app.add_option(
      "--verify-one-in", options.verify_one_in,
      "Decode and check only every n-th batch, if this program is too slow otherwise [1]");
  CLI::Option* seed = app.add_option("--seed", options.seed, "Seed for --wander [random]");
  app.add_flag("--json", options.json, "Print the result as one JSON object");
  app.add_option("--fail-if", fail_ifs,
                 "Exit with 1 if this condition is true, e.g. 'ticks_missed>0'. Can be repeated")
      ->allow_extra_args(false);

  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    line.text = app.help();
    return line;
  } catch (const CLI::CallForVersion&) {
    line.text = app.version() + "\n";
    return line;
  } catch (const CLI::ParseError& error) {
    // Reports an unknown option in preference to a missing one. Does not use the text of
    // CLI::ExtrasError, which lists the arguments in reverse order.
    if (const auto surplus = app.remaining(); !surplus.empty()) {
      return Fail(ErrorCode::kInvalidArgument, "unknown option or surplus argument; see --help",
                  surplus.front());
    }
    std::string what = error.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    return Fail(ErrorCode::kInvalidArgument, "see --help", what);
  }

  if (Status status = CheckRanges(options); !status) return std::unexpected(status.error());
  Expected<Address> server = ParseAddress(connect, "--connect");
  if (!server) return std::unexpected(server.error());
  options.server = *server;
  if (http.empty()) {
    options.http = Address{server->host, static_cast<std::uint16_t>(server->port + 1)};
    if (options.http->port == 0) options.http.reset();
  } else if (http != "none") {
    Expected<Address> address = ParseAddress(http, "--http");
    if (!address) return std::unexpected(address.error());
    options.http = *address;
  }
  if (mode == "full") {
    options.mode = protocol::PoseMode::kFull;
  } else if (mode == "movement") {
    options.mode = protocol::PoseMode::kMovement;
  } else if (mode != "quantised") {
    return Fail(ErrorCode::kInvalidArgument, "expected full, quantised or movement",
                "--mode " + mode);
  }
  if (detail == "reduced") {
    options.detail = protocol::PoseDetail::kReduced;
  } else if (detail == "root") {
    options.detail = protocol::PoseDetail::kRoot;
  } else if (detail != "all") {
    return Fail(ErrorCode::kInvalidArgument, "expected all, reduced or root", "--detail " + detail);
  }
  if (options.detail != protocol::PoseDetail::kAll &&
      options.mode != protocol::PoseMode::kQuantised) {
    return Fail(ErrorCode::kInvalidArgument, "needs --mode quantised", "--detail " + detail);
  }
  if (observe != "all" && observe != "one") {
    return Fail(ErrorCode::kInvalidArgument, "expected all or one", "--observe " + observe);
  }
  options.observe_all = observe == "all";
  if (wander && !options.choreography.empty()) {
    return Fail(ErrorCode::kInvalidArgument, "cannot be used with --choreography", "--wander");
  }
  if (seed->count() == 0) options.seed = std::random_device{}();
  if (fail_ifs.size() > static_cast<std::size_t>(kMaxFailIfs)) {
    return Fail(ErrorCode::kLimitExceeded, "can be used at most 32 times", "--fail-if");
  }
  for (const std::string& text : fail_ifs) {
    Expected<FailIf> fail_if = FailIf::Parse(text);
    if (!fail_if) return std::unexpected(fail_if.error());
    options.fail_ifs.push_back(std::move(*fail_if));
  }
  return line;
}

}  // namespace stridewire::load
