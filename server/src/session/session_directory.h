#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "base/limits.h"
#include "base/refusal.h"
#include "world/shard_messages.h"

namespace stridewire::server {

/// Lists all sessions and their shards. Owned by the main thread; not thread-safe.
class SessionDirectory {
 public:
  SessionDirectory(const Limits& limits, int shard_count);

  struct Entry {
    SessionIdentity identity;
    int shard = 0;
  };

  /// Creates a session on the shard with the fewest sessions. If there are too many sessions, in
  /// total or from this address, fails with kLimitReached and sets `reached` to that limit.
  [[nodiscard]] Outcome<Entry> Open(const std::string& address, Limit& reached);

  /// Returns null if no session has this token.
  [[nodiscard]] const Entry* Find(std::span<const std::byte> token) const;

  /// Removes a session that has ended. Unknown ids are ignored.
  void Close(SessionId id);

  /// Adds a session that replaces one that has ended (SessionRestored). Known ids are ignored.
  void Restore(int shard, const SessionIdentity& identity);

  [[nodiscard]] int CountOf(const std::string& address) const;
  [[nodiscard]] std::size_t size() const { return by_token_.size(); }

 private:
  void Insert(const Entry& entry);

  const Limits limits_;
  std::vector<int> shard_counts_;
  std::map<std::string, Entry> by_token_;  // The key is the bytes of the session's token.
  std::map<SessionId, std::string> tokens_;
  std::map<std::string, int> address_counts_;
};

}  // namespace stridewire::server
