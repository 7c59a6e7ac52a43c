#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stridewire/protocol/messages.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::client {

/// Work on a library that waits for a disk, or takes some milliseconds: not for who holds a lock.
struct LibraryTask {
  std::string hash;
  std::string folder;  ///< Empty: none
  std::vector<std::byte>
      file;  ///< To be checked and kept in the folder; empty: it is looked for there
};

/// Does it. kNotFound: it is not in the folder, or what is there is not it; kMalformed: the file is none, or another.
/// That a file cannot be kept is no error. Files are named HASH.swl, written under another name and then renamed.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> Do(const LibraryTask& task);

/// Brings libraries from a folder or from the server, piece by piece and one question at a time. Knows no disk and no
/// socket: others do what it asks for.
///
///   Want -> a task: look in the folder -> there | a question -> a piece -> … -> a task: check and keep -> there | refused
class LibraryFetch {
 public:
  /// Small enough that poses do not wait long behind one.
  static constexpr std::uint32_t kPieceBytes = 256u << 10;

  explicit LibraryFetch(std::string folder) : folder_(std::move(folder)) {}

  /// The library once it is there; until then it is being brought. Errors: why it could not be; asked again it is tried again.
  [[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> Want(const std::string& hash);

  [[nodiscard]] std::optional<LibraryTask> TakeTask();
  void OnTask(const std::string& hash, Expected<std::shared_ptr<const MotionLibrary>> result);

  /// What to ask the server, if nothing is asked already, of libraries that it gives out now.
  [[nodiscard]] std::optional<protocol::FetchLibrary> TakeQuestion(
      const std::function<bool(const std::string& hash)>& may_ask);
  void OnPiece(const protocol::LibraryPiece& piece);
  /// What was asked is not answered any more.
  void OnConnectionLost();

 private:
  struct Entry {
    enum class State : std::uint8_t { kToLook, kLooking, kFetching, kToCheck, kChecking, kThere };
    State state = State::kToLook;
    std::vector<std::byte> file;  // as far as it has come
    std::shared_ptr<const MotionLibrary> library;
    std::optional<Error> error;
  };

  std::string folder_;
  std::map<std::string, Entry> entries_;
  std::string asked_;  // of which; empty: nothing
  std::uint64_t nonce_ = 0;
};

}  // namespace stridewire::client
