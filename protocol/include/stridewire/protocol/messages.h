#pragma once

#include "stridewire/protocol/message_parts.h"
#include "stridewire/protocol/message_structs.h"

/// The messages of the protocol as plain structs. STANDARD.md defines their fields. The build
/// generates most of them from schema/stridewire.fbs (message_structs.h).
///
/// Encoder and decoder run the same checks (check.h): numbers are finite, ids are not 0, counts
/// match and are within limits.h, and texts are short UTF-8. The server alone checks whether an
/// avatar exists or a step is possible, and it replies item by item.
namespace stridewire::protocol {}
