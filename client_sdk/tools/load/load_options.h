#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fail_if.h"
#include "stridewire/base/error.h"
#include "stridewire/protocol/pose_codec.h"

namespace stridewire::load {

/// Host name or IP address, and port.
struct Address {
  std::string host;
  std::uint16_t port = 0;
  bool operator==(const Address&) const = default;
};

/// Formats as HOST:PORT, with brackets around an IPv6 address.
[[nodiscard]] std::string ToText(const Address& address);

// Upper limits of the options.
inline constexpr int kMaxAvatars = 100'000;
inline constexpr int kMaxWorlds = 1000;
inline constexpr int kMaxObservers = 10'000;
inline constexpr double kMaxSeconds = 3600.0;
inline constexpr double kMaxChurnPerS = 1000.0;
inline constexpr int kMaxThreads = 64;
inline constexpr int kMaxFailIfs = 32;

/// Options of a run. The fields correspond to the command line options.
struct LoadOptions {
  Address server;
  std::optional<Address> http;  ///< HTTP address of the server. Empty: do not read metrics.
  int worlds = 1;
  int avatars = 0;
  int observers = 0;
  int partial_observers = 0;  ///< Observers that subscribe only to some avatars.
  int partial_avatars = 100;  ///< Avatars per partial observer.
  double seconds = 10.0;
  protocol::PoseMode mode = protocol::PoseMode::kQuantised;
  protocol::PoseDetail detail = protocol::PoseDetail::kAll;
  std::string library = "builtin";  ///< Library of the server's worlds, for mode movement.
  std::string choreography;         ///< File of the choreography. Empty: the avatars wander.
  /// True if each observer observes all worlds, false if it observes one world.
  bool observe_all = true;
  double churn_per_s = 0.0;
  int threads = 1;
  int verify_one_in = 1;  ///< Observers decode and check every n-th batch.
  std::uint64_t seed = 0;
  bool json = false;
  std::vector<FailIf> fail_ifs;
};

/// A parsed command line.
struct LoadCommandLine {
  std::string text;  ///< Help text or version to print instead of a run; empty: start a run.
  LoadOptions options;
};

/// Parses and checks the command line. An error names the option.
[[nodiscard]] Expected<LoadCommandLine> ReadLoadCommandLine(int argc, const char* const* argv);

}  // namespace stridewire::load
