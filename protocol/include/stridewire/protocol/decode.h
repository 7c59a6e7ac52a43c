#pragma once

#include "stridewire/base/error.h"
#include "stridewire/protocol/frame.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Reads a frame's payload: verifies the FlatBuffers structure (depth, number of tables, every
/// offset), then counts and lengths before anything is copied, then the meaning (check.h). Bytes
/// from anyone are safe to give. A PoseBatch borrows the payload; every other message owns what it
/// holds. kMalformed, kLimitExceeded, kOutOfRange, kShapeMismatch, kUnsupported (unknown type),
/// kInvalidArgument (payload not on a multiple of 8 bytes). After an error the connection closes.
[[nodiscard]] Expected<Message> DecodeMessage(const FrameView& frame);

}  // namespace stridewire::protocol
