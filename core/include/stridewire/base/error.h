#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <utility>

namespace stridewire {

/// What kind of thing went wrong, for code that reacts to it. People read `Describe()`.
enum class ErrorCode : std::uint8_t {
  kInvalidArgument,  ///< A value that makes no sense here, whatever the state.
  kOutOfRange,       ///< A number outside its stated range, or not finite.
  kShapeMismatch,    ///< Two things that must have the same size do not.
  kNotFound,         ///< A name, id or file that is not there.
  kMalformed,        ///< Bytes or text that do not follow their format.
  kUnsupported,      ///< Understood, but this build cannot do it.
  kVersionMismatch,  ///< Made by another version of the format.
  kLimitExceeded,    ///< A stated limit was reached.
  kIllConditioned,   ///< A system of equations that has no trustworthy solution.
  kIo,               ///< The operating system said no.
};

/// A failure: a code, a fixed sentence, and where. Runtime code leaves `where` empty, so that
/// failing allocates nothing; code that reads files fills it with `file:line` or a field's name.
struct Error {
  ErrorCode code = ErrorCode::kInvalidArgument;
  const char* text = "";    ///< Static storage; a sentence without the closing full stop.
  std::int64_t index = -1;  ///< The offending index or value, -1 if there is none.
  std::string where;        ///< File and line, option or field; may be empty.
};

template <typename T>
using Expected = std::expected<T, Error>;
using Status = std::expected<void, Error>;

/// `return Fail(ErrorCode::kOutOfRange, "time is not finite");`
[[nodiscard]] inline std::unexpected<Error> Fail(ErrorCode code, const char* text,
                                                 std::int64_t index = -1) {
  return std::unexpected(Error{code, text, index, {}});
}

/// As above, naming a file and line, an option or a field.
[[nodiscard]] inline std::unexpected<Error> Fail(ErrorCode code, const char* text,
                                                 std::string where, std::int64_t index = -1) {
  return std::unexpected(Error{code, text, index, std::move(where)});
}

/// One sentence for a person: "walk.bvh:12: expected a joint name (3)".
[[nodiscard]] std::string Describe(const Error& error);

/// Stable lower-case name of a code, e.g. "out_of_range".
[[nodiscard]] std::string_view ErrorCodeName(ErrorCode code);

}  // namespace stridewire
