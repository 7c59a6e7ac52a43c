#include "load_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <random>

#include "stridewire/base/version.h"

namespace stridewire::load {
namespace {

constexpr const char* kFooter = R"(
What is measured
  poses_expected   avatars x observers x ticks of the measured window, however many of these ticks
                   the server did or sent; of partial observers what they watch. The window opens when all observers see all avatars.
  tick_ms          how long the server's ticks took, from its own histogram: p50 and p99 are
                   interpolated within its bins. ticks_missed is the server's count, over all shards.
  step_latency_ms  from when a step was to be sent by the plan (not from when it was) to the arrival
                   of the first pose that moves by it: at a tick not before its `started` event and
                   different from the pose before. Only steps that start from a stand are measured.
                   A step that has not moved at the end counts with the time it has waited.
  errors           what went wrong, and what this program itself could not keep up with.

Exit code: 0 done, 2 bad options, 1 anything else: a server that is not there or goes away, a pose
that fails its checks, a --fail-if that holds.

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

constexpr const char* kOutOfRange = "is out of its range (see --help)";

Expected<Address> ParseAddress(const std::string& text, const char* option) {
  const std::string where = std::string(option) + " " + text.substr(0, 300);
  const auto fail = [&where] {
    return Fail(ErrorCode::kMalformed, "is not HOST:PORT, such as 127.0.0.1:7420 or [::1]:7420",
                where);
  };
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return fail();
  Address address;
  address.host = text.substr(0, colon);
  if (address.host.starts_with('[') && address.host.ends_with(']')) {
    address.host = address.host.substr(1, address.host.size() - 2);
  } else if (address.host.find(':') != std::string::npos) {
    return fail();  // An IPv6 address without brackets: which colon is the port's?
  }
  const char* const end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data() + colon + 1, end, address.port);
  if (code != std::errc() || stop != end || address.port == 0 || address.host.empty() ||
      address.host.size() > 255) {
    return fail();
  }
  return address;
}

/// "--avatars 0", for errors.
template <typename T>
std::string Given(const char* option, T value) {
  std::string text = std::to_string(value);
  if constexpr (std::is_floating_point_v<T>) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
  }
  return std::string(option) + " " + text;
}

template <typename T>
Status CheckRange(const char* option, T value, T min, T max) {
  if (value >= min && value <= max) return {};  // NaN fails, too.
  return Fail(ErrorCode::kOutOfRange, kOutOfRange, Given(option, value));
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
    return Fail(ErrorCode::kInvalidArgument, "leaves worlds without an avatar",
                Given("--worlds", options.worlds));
  }
  if (options.partial_observers > 0 && options.partial_avatars > options.avatars) {
    return Fail(ErrorCode::kInvalidArgument, "is more than there are",
                Given("--partial-avatars", options.partial_avatars));
  }
  if (options.churn_per_s > 0.0 && options.observers + options.partial_observers == 0) {
    return Fail(ErrorCode::kInvalidArgument, "has no observers to drop and bring back",
                Given("--churn", options.churn_per_s));
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
      "Loads a Stridewire server: game servers that make avatars walk, and observers that count "
      "and "
      "check the poses.",
      "stridewire-load");
  app.footer(kFooter);
  app.set_help_flag("-h,--help", "Print this and end");
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
  app.add_option("--connect", connect, "The server, HOST:PORT")->required();
  app.add_option(
      "--http", http,
      "Its HTTP address, for /metrics; 'none': do not ask [host of --connect, port + 1]");
  app.add_option("--worlds", options.worlds, "Worlds load-0, load-1, ... (1 to 1000) [1]");
  app.add_option("--avatars", options.avatars,
                 "Avatars 1 to N, spread over the worlds in turn (1 to 100000)")
      ->required();
  app.add_option("--observers", options.observers, "Sessions that watch (0 to 10000)")->required();
  app.add_option("--partial-observers", options.partial_observers,
                 "Beside those, sessions that watch some avatars only (0 to 10000) [0]");
  app.add_option("--partial-avatars", options.partial_avatars,
                 "How many each of these watches, spread over the crowd, not the same ones [100]");
  app.add_option("--seconds", options.seconds, "Length of the measured window (0.1 to 3600)")
      ->required();
  app.add_option("--mode", mode,
                 "How poses are sent: full or quantised; movement: evaluated here [quantised]");
  app.add_option("--detail", detail,
                 "Joints that are sent: all, fewer or root; others than all quantised [all]");
  app.add_option("--library", options.library,
                 "What the server's worlds have, for --mode movement [builtin]")
      ->type_name("FILE");
  app.add_option("--choreography", options.choreography,
                 "What each avatar does, over and over; repeated from where it stands then")
      ->type_name("C.json");
  app.add_flag("--wander", wander, "Random steps, stands and jumps; so without --choreography");
  app.add_option("--churn", options.churn_per_s,
                 "This many times a second one observer drops its connection and comes back");
  app.add_option("--observe", observe,
                 "all: every observer watches every world; one: world i mod worlds [all]");
  app.add_option("--threads", options.threads,
                 "Threads; the first has the game servers, the others only observers [1]");
  app.add_option(
      "--verify-one-in", options.verify_one_in,
      "Decode and check each n-th batch only, when this program is what is too slow [1]");
  CLI::Option* seed = app.add_option("--seed", options.seed, "Seed of the wandering [random]");
  app.add_flag("--json", options.json, "Print the result as one JSON object");
  app.add_option("--fail-if", fail_ifs,
                 "End with 1 if this holds, e.g. 'ticks_missed>0'; may be given several times")
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
    return Fail(ErrorCode::kInvalidArgument, "is not full, quantised or movement",
                "--mode " + mode);
  }
  if (detail == "fewer") {
    options.detail = protocol::PoseDetail::kReduced;
  } else if (detail == "root") {
    options.detail = protocol::PoseDetail::kRoot;
  } else if (detail != "all") {
    return Fail(ErrorCode::kInvalidArgument, "is not all, fewer or root", "--detail " + detail);
  }
  if (options.detail != protocol::PoseDetail::kAll &&
      options.mode != protocol::PoseMode::kQuantised) {
    return Fail(ErrorCode::kInvalidArgument, "goes with --mode quantised", "--detail " + detail);
  }
  if (observe != "all" && observe != "one") {
    return Fail(ErrorCode::kInvalidArgument, "is neither all nor one", "--observe " + observe);
  }
  options.observe_all = observe == "all";
  if (wander && !options.choreography.empty()) {
    return Fail(ErrorCode::kInvalidArgument, "excludes --choreography", "--wander");
  }
  if (seed->count() == 0) options.seed = std::random_device{}();
  if (fail_ifs.size() > static_cast<std::size_t>(kMaxFailIfs)) {
    return Fail(ErrorCode::kLimitExceeded, "may be given 32 times", "--fail-if");
  }
  for (const std::string& text : fail_ifs) {
    Expected<FailIf> fail_if = FailIf::Parse(text);
    if (!fail_if) return std::unexpected(fail_if.error());
    options.fail_ifs.push_back(std::move(*fail_if));
  }
  return line;
}

}  // namespace stridewire::load
