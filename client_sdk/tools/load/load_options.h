#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fail_if.h"
#include "stridewire/base/error.h"
#include "stridewire/protocol/pose_codec.h"

namespace stridewire::load {

/// HOST:PORT; an IPv6 address stands in brackets.
struct Address {
  std::string host;
  std::uint16_t port = 0;
  bool operator==(const Address&) const = default;
};

[[nodiscard]] std::string ToText(const Address& address);

/// What bounds a run, whatever is asked for.
inline constexpr int kMaxAvatars = 100'000;
inline constexpr int kMaxWorlds = 1000;
inline constexpr int kMaxObservers = 10'000;
inline constexpr double kMaxSeconds = 3600.0;
inline constexpr double kMaxChurnPerS = 1000.0;
inline constexpr int kMaxThreads = 64;
inline constexpr int kMaxFailIfs = 32;

struct LoadOptions {
  Address server;
  std::optional<Address> http;  ///< Empty: the server's metrics are not read.
  int worlds = 1;
  int avatars = 0;
  int observers = 0;
  int partial_observers = 0;  ///< Beside them, such as name avatars.
  int partial_avatars = 100;  ///< How many each of those names.
  double seconds = 10.0;
  protocol::PoseMode mode = protocol::PoseMode::kQuantised;
  protocol::PoseDetail detail = protocol::PoseDetail::kAll;
  std::string library = "builtin";  ///< The server's, in mode movement.
  std::string choreography;         ///< A file; empty: the avatars wander.
  bool observe_all = true;          ///< Every observer watches every world; else one each, in turn.
  double churn_per_s = 0.0;
  int threads = 1;
  int verify_one_in = 1;  ///< Observers decode and check each n-th batch.
  std::uint64_t seed = 0;
  bool json = false;
  std::vector<FailIf> fail_ifs;
};

struct LoadCommandLine {
  std::string text;  ///< Not empty: help or version, to be printed instead of a run.
  LoadOptions options;
};

/// Reads the options. Errors name the option; the text ends up on stderr with exit code 2.
[[nodiscard]] Expected<LoadCommandLine> ReadLoadCommandLine(int argc, const char* const* argv);

}  // namespace stridewire::load
