#include "library_fetch.h"

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace stridewire::client {

namespace {

// The hash comes from the server and becomes a file name, so any other text is rejected.
bool IsHash(const std::string& text) {
  constexpr std::size_t kDigits = 32;
  return text.size() == kDigits && std::ranges::all_of(text, [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

}  // namespace

Expected<std::shared_ptr<const MotionLibrary>> LibraryFetch::Get(const std::string& hash) {
  if (!IsHash(hash)) return Fail(ErrorCode::kUnsupported, "the world's library has no valid hash");
  Entry& entry = entries_[hash];
  if (entry.error) {
    Error error = *std::move(entry.error);
    entries_.erase(hash);
    return std::unexpected(std::move(error));
  }
  return entry.library;
}

std::optional<LibraryTask> LibraryFetch::TakeTask() {
  for (auto& [hash, entry] : entries_) {
    if (entry.error) continue;
    if (entry.state == Entry::State::kToOpen) {
      entry.state = Entry::State::kOpening;
      return LibraryTask{hash, folder_, {}};
    }
    if (entry.state == Entry::State::kToVerify) {
      entry.state = Entry::State::kVerifying;
      return LibraryTask{hash, folder_, std::exchange(entry.file, {})};
    }
  }
  return std::nullopt;
}

void LibraryFetch::OnTask(const std::string& hash,
                          Expected<std::shared_ptr<const MotionLibrary>> result) {
  const auto it = entries_.find(hash);
  if (it == entries_.end()) return;
  Entry& entry = it->second;
  STRIDEWIRE_CHECK(entry.state == Entry::State::kOpening ||
                   entry.state == Entry::State::kVerifying);
  if (result) {
    entry.state = Entry::State::kReady;
    entry.library = *std::move(result);
  } else if (entry.state == Entry::State::kOpening) {
    entry.state = Entry::State::kFetching;
  } else {
    entry.error = std::move(result.error());
  }
}

std::optional<protocol::FetchLibrary> LibraryFetch::TakeRequest(
    const std::function<bool(const std::string& hash)>& may_request) {
  if (!requested_.empty()) return std::nullopt;
  for (auto& [hash, entry] : entries_) {
    if (entry.error || entry.state != Entry::State::kFetching || !may_request(hash)) continue;
    requested_ = hash;
    return protocol::FetchLibrary{++nonce_, hash, entry.file.size(), kPieceBytes};
  }
  return std::nullopt;
}

void LibraryFetch::OnPiece(const protocol::LibraryPiece& piece) {
  if (requested_.empty() || piece.nonce != nonce_) return;
  const std::string hash = std::exchange(requested_, {});
  const auto it = entries_.find(hash);
  if (it == entries_.end()) return;
  Entry& entry = it->second;
  STRIDEWIRE_CHECK(entry.state == Entry::State::kFetching);
  if (piece.code != protocol::StatusCode::kOk) {
    entry.error = Error{ErrorCode::kNotFound, "the server does not provide the library", -1, {}};
  } else if (piece.offset != entry.file.size() || piece.bytes.empty()) {
    entry.error = Error{ErrorCode::kMalformed,
                        "the server sent another piece of the library than requested",
                        -1,
                        {}};
  } else {
    entry.file.insert(entry.file.end(), piece.bytes.begin(), piece.bytes.end());
    if (entry.file.size() >= piece.total_bytes) entry.state = Entry::State::kToVerify;
  }
}

void LibraryFetch::OnConnectionLost() { requested_.clear(); }

}  // namespace stridewire::client
