#pragma once

#include "stridewire/base/error.h"
#include "stridewire/protocol/frame.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Decodes the payload of a frame. Safe for untrusted bytes: it verifies the FlatBuffers structure
/// (depth, number of tables, every offset), then counts and lengths before it copies anything, and
/// then the rules of check.h. A PoseBatch borrows the payload; all other messages own their data.
///
/// Fails with the errors of Check, with kUnsupported for an unknown type, and with kInvalidArgument
/// if the payload is not aligned to 8 bytes. The caller must close the connection after an error.
[[nodiscard]] Expected<Message> DecodeMessage(const FrameView& frame);

}  // namespace stridewire::protocol
