#include "offline/base/json_document.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "base/check.h"

namespace stridewire {
namespace {

/// Builds the document from the events of the parser. A handler that returns false stops the parser
/// and sets `code` and `reason`.
class DocumentBuilder final : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit DocumentBuilder(int max_depth) : max_depth_(max_depth) {}

  bool null() override { return Append(nullptr) != nullptr; }
  bool boolean(bool value) override { return Append(value) != nullptr; }
  bool number_integer(number_integer_t value) override { return Append(value) != nullptr; }
  bool number_unsigned(number_unsigned_t value) override { return Append(value) != nullptr; }
  bool number_float(number_float_t value, const string_t& /*text*/) override {
    return Append(value) != nullptr;
  }
  bool string(string_t& value) override { return Append(std::move(value)) != nullptr; }
  // Binary values do not occur in JSON text.
  bool binary(binary_t& /*value*/) override { return false; }
  bool start_object(std::size_t /*size*/) override { return Open(nlohmann::json::object()); }
  bool start_array(std::size_t /*size*/) override { return Open(nlohmann::json::array()); }
  bool end_object() override { return Close(); }
  bool end_array() override { return Close(); }

  bool key(string_t& name) override {
    STRIDEWIRE_CHECK(!open_.empty() && open_.back()->is_object());
    if (open_.back()->contains(name)) {
      return Stop(ErrorCode::kMalformed, "duplicate key before this position");
    }
    key_ = std::move(name);
    return true;
  }

  bool parse_error(std::size_t /*position*/, const std::string& /*last_token*/,
                   const nlohmann::json::exception& error) override {
    constexpr int kNumberOverflow = 406;
    if (error.id == kNumberOverflow) {
      return Stop(ErrorCode::kOutOfRange,
                  "the number before this position is too large for a double");
    }
    return Stop(ErrorCode::kMalformed, "invalid JSON near this position");
  }

  nlohmann::json document;
  ErrorCode code = ErrorCode::kMalformed;
  const char* reason = "invalid JSON";

 private:
  bool Stop(ErrorCode stop_code, const char* text) {
    code = stop_code;
    reason = text;
    return false;
  }

  nlohmann::json* Append(nlohmann::json&& value) {
    if (open_.empty()) {
      document = std::move(value);
      return &document;
    }
    nlohmann::json& parent = *open_.back();
    if (parent.is_array()) {
      parent.push_back(std::move(value));
      return &parent.back();
    }
    nlohmann::json& member = parent[key_];
    member = std::move(value);
    return &member;
  }

  bool Open(nlohmann::json&& container) {
    if (static_cast<int>(open_.size()) >= max_depth_) {
      return Stop(ErrorCode::kLimitExceeded, "arrays and objects are nested too deeply");
    }
    // Only the innermost open container grows, so the pointers to the others remain valid.
    open_.push_back(Append(std::move(container)));
    return true;
  }

  bool Close() {
    STRIDEWIRE_CHECK(!open_.empty());
    open_.pop_back();
    return true;
  }

  int max_depth_;
  std::vector<nlohmann::json*> open_;
  std::string key_;
};

/// Iterates over text and counts the consumed bytes, to locate errors.
class CountingIterator {
 public:
  // NOLINTBEGIN(readability-identifier-naming): names required by the standard library.
  using difference_type = std::ptrdiff_t;
  using value_type = char;
  using pointer = const char*;
  using reference = const char&;
  using iterator_category = std::input_iterator_tag;
  // NOLINTEND(readability-identifier-naming)

  CountingIterator(std::string_view::const_iterator at, std::size_t* count)
      : at_(at), count_(count) {}
  reference operator*() const { return *at_; }
  CountingIterator& operator++() {
    ++at_;
    ++*count_;
    return *this;
  }
  CountingIterator operator++(int) {
    CountingIterator before = *this;
    ++*this;
    return before;
  }
  bool operator==(const CountingIterator& other) const { return at_ == other.at_; }
  bool operator!=(const CountingIterator& other) const { return at_ != other.at_; }

 private:
  std::string_view::const_iterator at_;
  std::size_t* count_;
};

}  // namespace

Expected<nlohmann::json> ParseJson(std::string_view text, std::string_view name, int max_depth) {
  DocumentBuilder builder(max_depth);
  std::size_t consumed = 0;
  const CountingIterator begin(text.begin(), &consumed);
  const CountingIterator end(text.end(), &consumed);
  if (nlohmann::json::sax_parse(begin, end, &builder)) return std::move(builder.document);

  const std::size_t at = std::min(consumed > 0 ? consumed - 1 : 0, text.size());
  const std::string_view before = text.substr(0, at);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t line_start = before.rfind('\n') + 1;  // npos + 1 is 0
  return Fail(
      builder.code, builder.reason,
      std::string(name) + ":" + std::to_string(line) + ":" + std::to_string(at - line_start + 1));
}

}  // namespace stridewire
