#include "backoff.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace stridewire::client {
namespace {

TEST(Backoff, DoublesUpToItsLimit) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Backoff backoff(seed);
    double longest_s = Backoff::kFirstS;
    for (int attempt = 0; attempt < 20; ++attempt) {
      const double wait_s = backoff.Next();
      ASSERT_LE(wait_s, longest_s) << "seed " << seed << " attempt " << attempt;
      ASSERT_GE(wait_s, (1.0 - Backoff::kJitter) * longest_s) << "seed " << seed;
      longest_s = std::min(2.0 * longest_s, Backoff::kLongestS);
    }
    EXPECT_EQ(longest_s, Backoff::kLongestS);
  }
}

TEST(Backoff, StartsAgainAfterReset) {
  Backoff backoff(3);
  for (int attempt = 0; attempt < 10; ++attempt) (void)backoff.Next();
  backoff.Reset();
  EXPECT_LE(backoff.Next(), Backoff::kFirstS);
}

TEST(Backoff, SpreadsClientsWithDifferentSeeds) {
  std::set<double> waits_s;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) waits_s.insert(Backoff(seed).Next());
  EXPECT_GT(*waits_s.rbegin() - *waits_s.begin(), 0.3 * Backoff::kFirstS);
  EXPECT_EQ(waits_s.size(), 50u);
}

}  // namespace
}  // namespace stridewire::client
