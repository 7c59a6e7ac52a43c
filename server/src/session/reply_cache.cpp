#include "session/reply_cache.h"

#include <utility>

#include "base/check.h"

namespace stridewire::server {

ReplyCache::Verdict ReplyCache::Classify(protocol::Seq seq) const {
  if (seq > last_seq()) return seq == last_seq() + 1 ? Verdict::kNew : Verdict::kGap;
  if (seq < first_seq_) return Verdict::kForgotten;
  return answers_[seq - first_seq_].reply == nullptr ? Verdict::kPending : Verdict::kAnswered;
}

void ReplyCache::Begin(protocol::Seq seq) {
  STRIDEWIRE_CHECK(Classify(seq) == Verdict::kNew);
  answers_.emplace_back();
  STRIDEWIRE_CHECK(Classify(seq) == Verdict::kPending);
}

std::size_t ReplyCache::Store(protocol::Seq seq, SharedFrame reply, WorldId joined) {
  STRIDEWIRE_CHECK(reply != nullptr && Classify(seq) == Verdict::kPending);
  bytes_ += reply->size();
  answers_[seq - first_seq_] = {std::move(reply), joined};
  std::size_t forgotten = 0;
  while (answers_.size() > 1 && (answers_.size() > max_count_ || bytes_ > max_bytes_) &&
         answers_.front().reply != nullptr) {
    STRIDEWIRE_CHECK(answers_.front().reply->size() <= bytes_);
    bytes_ -= answers_.front().reply->size();
    answers_.pop_front();
    ++first_seq_;
    ++forgotten;
  }
  STRIDEWIRE_CHECK(!answers_.empty());
  return forgotten;
}

const ReplyCache::Answer& ReplyCache::Find(protocol::Seq seq) const {
  STRIDEWIRE_CHECK(Classify(seq) == Verdict::kAnswered);
  return answers_[seq - first_seq_];
}

}  // namespace stridewire::server
