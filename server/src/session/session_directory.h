#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "ops/limits.h"
#include "session/refusal.h"
#include "session/session.h"

namespace stridewire::server {

/// Which sessions there are and where they live. One thread's.
class SessionDirectory {
 public:
  SessionDirectory(const Limits& limits, int shard_count);

  struct Entry {
    SessionIdentity identity;
    int shard = 0;
  };

  /// A new session on the shard with the fewest. kLimitReached: too many, of all or of that
  /// address; `reached` says which.
  [[nodiscard]] Outcome<Entry> Open(const std::string& address, Limit& reached);

  /// Null when no session has that token.
  [[nodiscard]] const Entry* Find(std::span<const std::byte> token) const;

  /// It has ended. Unknown ones are ignored.
  void Close(SessionId id);

  /// It is there after all; known ones are ignored.
  void Restore(int shard, const SessionIdentity& identity);

  [[nodiscard]] int CountOf(const std::string& address) const;
  [[nodiscard]] std::size_t size() const { return by_token_.size(); }

 private:
  void Insert(const Entry& entry);

  const Limits limits_;
  std::vector<int> shard_counts_;
  std::map<std::string, Entry> by_token_;  // a token's bytes as a string
  std::map<SessionId, std::string> tokens_;
  std::map<std::string, int> address_counts_;
};

}  // namespace stridewire::server
