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

/// Work on a library that accesses the disk or takes milliseconds. It must run without a lock.
struct LibraryTask {
  std::string hash;
  std::string folder;  ///< Folder of the cache. Empty: no cache.
  /// File to verify and to store in the folder. Empty: open the file in the folder instead.
  std::vector<std::byte> file;
};

/// Runs a task and returns the library. Fails with kNotFound if the folder has no intact file of
/// that hash, with the errors of MotionLibrary::FromBytes if `file` is not a library, and with
/// kMalformed if its hash differs. Ignores errors of storing the file. Files are named HASH.swl.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> RunLibraryTask(
    const LibraryTask& task);

/// Gets libraries from a folder or from the server, one piece at a time. It accesses neither disk
/// nor socket itself. Instead, its owner runs its tasks and sends its requests.
///
///   Get -> kToOpen -> kOpening -> kReady                        the folder has the library
///                            `--> kFetching -> kToVerify -> kVerifying -> kReady
///                                                                    `--> error
class LibraryFetch {
 public:
  /// Size of a piece. Pieces are small, so that they do not delay poses for long.
  static constexpr std::uint32_t kPieceBytes = 256u << 10;

  explicit LibraryFetch(std::string folder) : folder_(std::move(folder)) {}

  /// Returns the library, or null while it is being fetched. If the last attempt has failed,
  /// returns its error, and the next call starts a new attempt.
  [[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> Get(const std::string& hash);

  /// Returns the next task, if any. Report its result with OnTask.
  [[nodiscard]] std::optional<LibraryTask> TakeTask();
  void OnTask(const std::string& hash, Expected<std::shared_ptr<const MotionLibrary>> result);

  /// Returns the next request to the server, unless a request is pending or nothing is left to
  /// request. Requests only libraries for which `may_request` returns true. Report the answer with
  /// OnPiece.
  [[nodiscard]] std::optional<protocol::FetchLibrary> TakeRequest(
      const std::function<bool(const std::string& hash)>& may_request);
  void OnPiece(const protocol::LibraryPiece& piece);
  /// Must be called when the connection is lost, because the pending request will not be answered.
  void OnConnectionLost();

 private:
  struct Entry {
    enum class State : std::uint8_t { kToOpen, kOpening, kFetching, kToVerify, kVerifying, kReady };
    State state = State::kToOpen;
    std::vector<std::byte> file;  // Bytes that have been received so far.
    std::shared_ptr<const MotionLibrary> library;
    std::optional<Error> error;
  };

  std::string folder_;
  std::map<std::string, Entry> entries_;
  std::string requested_;  // Hash of the pending request; empty: none.
  std::uint64_t nonce_ = 0;
};

}  // namespace stridewire::client
