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

/// Returns the codecs for the compact poses of the vector `pose_batch_compact`. Their parameters
/// are those in the vector `world_info_compact`.
[[nodiscard]] const CompactCodecs& SampleCodecs();

/// Returns the messages of all test vectors. The result is always the same.
[[nodiscard]] std::vector<SampleMessage> SampleMessages();

}  // namespace stridewire::protocol
