#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// A message for a test vector. Most fields differ from their defaults.
struct SampleMessage {
  std::string name;  ///< File name of the vector, for example "request_crowd".
  Message message;   ///< A PoseBatch borrows arrays with static lifetime.
};

/// Rotation codes of the vector `world_info_compact`. The vector `pose_batch_compact` uses them.
[[nodiscard]] const CompactCodecs& SampleCodecs();

/// Returns the messages of all test vectors. The result is always the same.
[[nodiscard]] std::vector<SampleMessage> SampleMessages();

}  // namespace stridewire::protocol
