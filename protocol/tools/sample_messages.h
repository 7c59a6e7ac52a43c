#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// A message with every field set to something that is not its default, and variants worth testing.
struct SampleMessage {
  std::string name;  ///< File name of its vector, e.g. "request_crowd".
  Message message;   ///< A PoseBatch borrows arrays that live as long as the program.
};

/// How the rotations of the vectors' world are told: the codes of `world_info_compact`, for `pose_batch_compact`.
[[nodiscard]] const CompactCodecs& SampleCodecs();

/// The messages the test vectors are made of; the same every time.
[[nodiscard]] std::vector<SampleMessage> SampleMessages();

}  // namespace stridewire::protocol
