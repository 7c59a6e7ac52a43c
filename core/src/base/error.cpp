#include "stridewire/base/error.h"

namespace stridewire {

std::string Describe(const Error& error) {
  std::string text;
  if (!error.where.empty()) text = error.where + ": ";
  text += error.text;
  if (error.index >= 0) text += " (" + std::to_string(error.index) + ")";
  return text;
}

std::string_view ErrorCodeName(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument: return "invalid_argument";
    case ErrorCode::kOutOfRange: return "out_of_range";
    case ErrorCode::kShapeMismatch: return "shape_mismatch";
    case ErrorCode::kNotFound: return "not_found";
    case ErrorCode::kMalformed: return "malformed";
    case ErrorCode::kUnsupported: return "unsupported";
    case ErrorCode::kVersionMismatch: return "version_mismatch";
    case ErrorCode::kLimitExceeded: return "limit_exceeded";
    case ErrorCode::kIllConditioned: return "ill_conditioned";
    case ErrorCode::kIo: return "io";
  }
  return "unknown";
}

}  // namespace stridewire
