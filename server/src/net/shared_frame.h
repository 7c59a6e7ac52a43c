#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace stridewire::server {

/// One encoded frame: immutable, shared by every connection that sends it.
using SharedFrame = std::shared_ptr<const std::vector<std::byte>>;

}  // namespace stridewire::server
