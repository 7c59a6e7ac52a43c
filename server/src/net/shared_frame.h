#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace stridewire::server {

/// An encoded frame. It is immutable and shared by all connections that send it.
using SharedFrame = std::shared_ptr<const std::vector<std::byte>>;

}  // namespace stridewire::server
