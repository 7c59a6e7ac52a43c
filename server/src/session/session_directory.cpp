#include "session/session_directory.h"

#include <sys/random.h>

#include <algorithm>
#include <cstring>

#include "base/check.h"

namespace stridewire::server {
namespace {

constexpr std::size_t kTokenBytes = 32;

// Tokens and session ids must be unpredictable and unique.
std::vector<std::byte> RandomBytes(std::size_t count) {
  std::vector<std::byte> bytes(count);
  const ssize_t got = getrandom(bytes.data(), bytes.size(), 0);
  // For up to 256 bytes, getrandom always returns all of them.
  STRIDEWIRE_CHECK(got == static_cast<ssize_t>(count));
  return bytes;
}

std::string KeyOf(std::span<const std::byte> token) {
  return {reinterpret_cast<const char*>(token.data()), token.size()};
}

}  // namespace

SessionDirectory::SessionDirectory(const Limits& limits, int shard_count)
    : limits_(limits), shard_counts_(static_cast<std::size_t>(shard_count)) {}

Outcome<SessionDirectory::Entry> SessionDirectory::Open(const std::string& address,
                                                        Limit& reached) {
  if (by_token_.size() >= static_cast<std::size_t>(limits_.max_sessions)) {
    reached = Limit::kSessions;
    return Refuse(protocol::StatusCode::kLimitReached,
                  "too many sessions on this server (max_sessions)");
  }
  if (CountOf(address) >= limits_.max_sessions_per_address) {
    reached = Limit::kSessionsPerAddress;
    return Refuse(protocol::StatusCode::kLimitReached,
                  "too many sessions from this address (max_sessions_per_address)");
  }
  Entry entry;
  entry.identity.address = address;
  entry.identity.token = RandomBytes(kTokenBytes);
  do {
    std::memcpy(&entry.identity.id, RandomBytes(sizeof(SessionId)).data(), sizeof(SessionId));
  } while (entry.identity.id == 0 || tokens_.contains(entry.identity.id));
  entry.shard = static_cast<int>(std::ranges::min_element(shard_counts_) - shard_counts_.begin());
  Insert(entry);
  return entry;
}

void SessionDirectory::Insert(const Entry& entry) {
  const std::string key = KeyOf(entry.identity.token);
  STRIDEWIRE_CHECK(entry.identity.id != 0 && !by_token_.contains(key));
  tokens_[entry.identity.id] = key;
  by_token_[key] = entry;
  ++shard_counts_[static_cast<std::size_t>(entry.shard)];
  ++address_counts_[entry.identity.address];
  STRIDEWIRE_CHECK(tokens_.size() == by_token_.size());
}

const SessionDirectory::Entry* SessionDirectory::Find(std::span<const std::byte> token) const {
  const auto it = by_token_.find(KeyOf(token));
  return it == by_token_.end() ? nullptr : &it->second;
}

void SessionDirectory::Close(SessionId id) {
  const auto token = tokens_.find(id);
  if (token == tokens_.end()) return;
  const auto it = by_token_.find(token->second);
  STRIDEWIRE_CHECK(it != by_token_.end());
  STRIDEWIRE_CHECK(shard_counts_[static_cast<std::size_t>(it->second.shard)] > 0);
  --shard_counts_[static_cast<std::size_t>(it->second.shard)];
  const auto address = address_counts_.find(it->second.identity.address);
  STRIDEWIRE_CHECK(address != address_counts_.end() && address->second > 0);
  if (--address->second == 0) address_counts_.erase(address);
  by_token_.erase(it);
  tokens_.erase(token);
  STRIDEWIRE_CHECK(tokens_.size() == by_token_.size());
}

void SessionDirectory::Restore(int shard, const SessionIdentity& identity) {
  if (!tokens_.contains(identity.id)) Insert({identity, shard});
}

int SessionDirectory::CountOf(const std::string& address) const {
  const auto it = address_counts_.find(address);
  return it == address_counts_.end() ? 0 : it->second;
}

}  // namespace stridewire::server
