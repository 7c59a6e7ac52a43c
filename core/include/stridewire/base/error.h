#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <utility>

namespace stridewire {

/// Kind of an error. Code can react to the kind; Describe() returns a text for users.
enum class ErrorCode : std::uint8_t {
  kInvalidArgument,  ///< A value is invalid regardless of the state of the object.
  kOutOfRange,       ///< A number is outside its documented range or not finite.
  kShapeMismatch,    ///< Two arrays or objects that must have the same size differ in size.
  kNotFound,         ///< A name, id or file does not exist.
  kMalformed,        ///< Bytes or text do not follow their format.
  kUnsupported,      ///< The request is valid, but this build or library does not support it.
  kVersionMismatch,  ///< The data has another version of the format.
  kLimitExceeded,    ///< A documented limit was exceeded.
  kIllConditioned,   ///< A system of equations has no numerically reliable solution.
  kIo,               ///< An operating system call failed.
};

/// An error: a code, a fixed sentence and a location. Code that reads files or checks input
/// sets `where`. Other code leaves it empty, so that reporting an error does not allocate.
struct Error {
  ErrorCode code = ErrorCode::kInvalidArgument;
  const char* text = "";    ///< A sentence without its full stop, in static storage.
  std::int64_t index = -1;  ///< The offending index or value; -1 if there is none.
  std::string where;        ///< File and line ("walk.bvh:12"), option or field; may be empty.
};

template <typename T>
using Expected = std::expected<T, Error>;
using Status = std::expected<void, Error>;

/// Creates an error to return: `return Fail(ErrorCode::kOutOfRange, "time is not finite");`
[[nodiscard]] inline std::unexpected<Error> Fail(ErrorCode code, const char* text,
                                                 std::int64_t index = -1) {
  return std::unexpected(Error{code, text, index, {}});
}

/// Creates an error that also contains its location: a file and line, an option or a field.
[[nodiscard]] inline std::unexpected<Error> Fail(ErrorCode code, const char* text,
                                                 std::string where, std::int64_t index = -1) {
  return std::unexpected(Error{code, text, index, std::move(where)});
}

/// Formats an error as one sentence, for example "walk.bvh:12: expected a joint name (3)".
[[nodiscard]] std::string Describe(const Error& error);

/// Returns the stable lower-case name of a code, for example "out_of_range".
[[nodiscard]] std::string_view ErrorCodeName(ErrorCode code);

}  // namespace stridewire
