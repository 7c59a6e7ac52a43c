#include "offline/base/json_document.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace stridewire {
namespace {

/// Builds the document from the parser's events. Returning false ends the parsing; why is in `code`
/// and `reason`.
class DocumentBuilder final : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit DocumentBuilder(int max_depth) : max_depth_(max_depth) {}

  bool null() override { return Put(nullptr) != nullptr; }
  bool boolean(bool value) override { return Put(value) != nullptr; }
  bool number_integer(number_integer_t value) override { return Put(value) != nullptr; }
  bool number_unsigned(number_unsigned_t value) override { return Put(value) != nullptr; }
  bool number_float(number_float_t value, const string_t& /*text*/) override {
    return Put(value) != nullptr;
  }
  bool string(string_t& value) override { return Put(std::move(value)) != nullptr; }
  bool binary(binary_t& /*value*/) override { return false; }  // Not in JSON text.
  bool start_object(std::size_t /*size*/) override { return Open(nlohmann::json::object()); }
  bool start_array(std::size_t /*size*/) override { return Open(nlohmann::json::array()); }
  bool end_object() override { return Close(); }
  bool end_array() override { return Close(); }

  bool key(string_t& name) override {
    if (open_.back()->contains(name)) {
      return Stop(ErrorCode::kMalformed, "the key before this stands twice in its object");
    }
    key_ = std::move(name);
    return true;
  }

  bool parse_error(std::size_t /*position*/, const std::string& /*last_token*/,
                   const nlohmann::json::exception& error) override {
    constexpr int kNumberOverflow = 406;
    if (error.id == kNumberOverflow) {
      return Stop(ErrorCode::kOutOfRange, "the number before this is too large");
    }
    return Stop(ErrorCode::kMalformed, "the text is not JSON near here");
  }

  nlohmann::json document;
  ErrorCode code = ErrorCode::kMalformed;
  const char* reason = "the text is not JSON";

 private:
  bool Stop(ErrorCode why, const char* text) {
    code = why;
    reason = text;
    return false;
  }

  nlohmann::json* Put(nlohmann::json&& value) {
    if (open_.empty()) {
      document = std::move(value);
      return &document;
    }
    nlohmann::json& parent = *open_.back();
    if (parent.is_array()) {
      parent.push_back(std::move(value));
      return &parent.back();
    }
    nlohmann::json& place = parent[key_];
    place = std::move(value);
    return &place;
  }

  bool Open(nlohmann::json&& container) {
    if (static_cast<int>(open_.size()) >= max_depth_) {
      return Stop(ErrorCode::kLimitExceeded, "arrays and objects are nested too deep");
    }
    // A container grows only while it is the innermost open one, so pointers to the others hold.
    open_.push_back(Put(std::move(container)));
    return true;
  }

  bool Close() {
    open_.pop_back();
    return true;
  }

  int max_depth_;
  std::vector<nlohmann::json*> open_;
  std::string key_;
};

/// Passes bytes on and counts them, so that every error has a place.
class CountingIterator {
 public:
  // NOLINTBEGIN(readability-identifier-naming): names the standard library asks for.
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
