#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "stridewire/base/error.h"
#include "stridewire/protocol/status_code.h"

namespace stridewire::server {

/// Why something a client asked for is not done, as it is told.
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
