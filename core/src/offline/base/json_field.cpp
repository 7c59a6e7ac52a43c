#include "offline/base/json_field.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <system_error>
#include <utility>

namespace stridewire {
namespace {

/// Shortens a key for an error message to one line of at most 64 printable characters.
std::string Printable(const std::string& key) {
  constexpr std::size_t kMaxShown = 64;
  std::string shown = key.substr(0, kMaxShown);
  for (char& c : shown) {
    if (c < ' ' || c > '~') c = '?';
  }
  return key.size() > kMaxShown ? shown + "..." : shown;
}

}  // namespace

Status CheckKeys(const JsonField& field, std::initializer_list<const char*> known) {
  if (!field.value.is_object()) {
    std::string where = field.where;
    // An empty path stands for the whole document.
    if (where.ends_with(": ")) where.resize(where.size() - 2);
    return Fail(ErrorCode::kMalformed, "expected an object", std::move(where));
  }
  for (const auto& item : field.value.items()) {
    if (std::find(known.begin(), known.end(), item.key()) == known.end()) {
      return Fail(ErrorCode::kMalformed, "unknown key", field.WhereOf(Printable(item.key())));
    }
  }
  return {};
}

Status ReadNumberAt(const nlohmann::json& value, std::string where, const JsonLimit& limit,
                    double& out) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!(number >= limit.min && number <= limit.max)) {
    return Fail(value.is_number() ? ErrorCode::kOutOfRange : ErrorCode::kMalformed, limit.text,
                std::move(where));
  }
  out = number;
  return {};
}

Status ReadNumber(const JsonField& field, const char* key, const JsonLimit& limit, double& out) {
  const nlohmann::json* value = field.Find(key);
  if (value == nullptr) return {};
  return ReadNumberAt(*value, field.WhereOf(key), limit, out);
}

Status ReadRequiredNumber(const JsonField& field, const char* key, const JsonLimit& limit,
                          double& out) {
  if (field.Find(key) == nullptr) {
    return Fail(ErrorCode::kMalformed, "required key is missing", field.WhereOf(key));
  }
  return ReadNumber(field, key, limit, out);
}

Expected<std::string> ReadTextFile(const std::filesystem::path& path, std::size_t max_bytes) {
  const std::string name = path.string();
  std::error_code code;
  const std::filesystem::file_status status = std::filesystem::status(path, code);
  if (status.type() == std::filesystem::file_type::not_found) {
    return Fail(ErrorCode::kNotFound, "there is no such file", name);
  }
  if (code) return Fail(ErrorCode::kIo, "cannot open the file", name);
  if (std::filesystem::is_directory(status)) {
    return Fail(ErrorCode::kIo, "expected a file, got a directory", name);
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return Fail(ErrorCode::kIo, "cannot open the file", name);
  // Reads up to the limit instead of asking for the file size, because a pipe has no size.
  std::string text(max_bytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) return Fail(ErrorCode::kIo, "cannot read the file", name);
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

}  // namespace stridewire
