#include "findings.h"

namespace stridewire::protocol {

void Findings::Wrong(ErrorCode code, const char* text, const FieldPath& at, std::int64_t value) {
  if (error_) return;
  error_ = Error{code, text, value, {}};
  for (const FieldPath* path = &at; path != nullptr; path = path->parent) {
    error_->where = std::string(path->name) + (error_->where.empty() ? "" : "." + error_->where);
    if (path->index >= 0) error_->index = path->index;
  }
}

}  // namespace stridewire::protocol
