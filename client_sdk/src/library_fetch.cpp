#include "library_fetch.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <system_error>
#include <utility>

#include "base/check.h"

namespace stridewire::client {

namespace fs = std::filesystem;

namespace {

// The hash comes from the server and becomes a file name, so any other text is rejected.
bool IsHash(const std::string& text) {
  constexpr std::size_t kDigits = 32;
  return text.size() == kDigits && std::ranges::all_of(text, [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

Expected<std::shared_ptr<const MotionLibrary>> CheckHash(
    Expected<std::shared_ptr<const MotionLibrary>> opened, const std::string& hash) {
  if (opened && (*opened)->hash() != hash) {
    return Fail(ErrorCode::kMalformed, "the library has another hash than requested");
  }
  return opened;
}

// Writes the file under a temporary name and renames it, so that readers find a complete file or
// none.
void Store(const LibraryTask& task) {
  std::error_code ignored;
  fs::create_directories(task.folder, ignored);
  const fs::path path = fs::path(task.folder) / (task.hash + ".swl");
  fs::path partial = path;
  partial += "." + std::to_string(std::random_device{}()) + ".part";
  std::ofstream out(partial, std::ios::binary);
  out.write(reinterpret_cast<const char*>(task.file.data()),
            static_cast<std::streamsize>(task.file.size()));
  out.close();
  if (out) fs::rename(partial, path, ignored);
  if (!out || ignored) fs::remove(partial, ignored);
}

}  // namespace

Expected<std::shared_ptr<const MotionLibrary>> RunLibraryTask(const LibraryTask& task) {
  if (task.file.empty()) {
    const fs::path path = fs::path(task.folder) / (task.hash + ".swl");
    std::error_code ignored;
    if (task.folder.empty() || !fs::is_regular_file(path, ignored)) {
      return Fail(ErrorCode::kNotFound, "the folder does not contain the library");
    }
    auto opened = CheckHash(MotionLibrary::Open(path), task.hash);
    if (!opened) return Fail(ErrorCode::kNotFound, "the library in the folder is damaged");
    return opened;
  }
  auto opened = CheckHash(MotionLibrary::FromBytes(task.file), task.hash);
  if (opened && !task.folder.empty()) Store(task);
  return opened;
}

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
