#pragma once

#include <expected>
#include <string>
#include <utility>

#include "stridewire/protocol/status_code.h"

namespace stridewire::server {

/// Reason why the server refuses a command of a client. Both members are sent to the client.
struct Refusal {
  protocol::StatusCode code = protocol::StatusCode::kInternal;
  std::string text;
};

template <typename T>
using Outcome = std::expected<T, Refusal>;

[[nodiscard]] inline std::unexpected<Refusal> Refuse(protocol::StatusCode code, std::string text) {
  return std::unexpected(Refusal{code, std::move(text)});
}

}  // namespace stridewire::server
