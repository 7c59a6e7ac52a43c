#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>

#include "stridewire/base/error.h"

namespace stridewire {

/// Parses `rounds` versions of a JSON text with one to three bytes, words or lengths changed, and tells the seed where
/// something fails. `parse` takes a text and returns an Expected, `check` what it reads. Every error names
/// `file` and says in one line what is wrong; some versions are read, others refused.
template <typename Parse, typename Check>
void ParseMutated(const std::string& original, int rounds, const std::string& file, Parse&& parse,
                  Check&& check) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  const auto below = [&random](std::size_t n) { return random() % n; };
  constexpr std::array kPieces = {"{",     "}",    "[",        "]",        ",",          ":",
                                  "\"",    "null", "-1e308",   "1e9",      "10.0000001", "\\u0000",
                                  "false", "\xc3", "\"step\"", "\"at_m\"", "[[[[[[[[",   "0"};
  int read_count = 0;
  int refused_count = 0;
  for (int round = 0; round < rounds && !testing::Test::HasFailure(); ++round) {
    std::string text = original;
    for (std::size_t change = 0, changes = 1 + below(3); change < changes; ++change) {
      const std::size_t at = below(text.size());
      switch (below(4)) {
        case 0: text[at] = static_cast<char>(below(256)); break;
        case 1: text.erase(at, 1 + below(12)); break;
        case 2: text.insert(at, kPieces[below(kPieces.size())]); break;
        default: text.insert(at, text.substr(below(text.size()), below(40))); break;
      }
    }
    const auto read = parse(text);
    if (read) {
      ++read_count;
      check(*read);
      continue;
    }
    ++refused_count;
    EXPECT_TRUE(read.error().where.starts_with(file)) << text;
    EXPECT_NE(std::string(read.error().text), "") << text;
    EXPECT_EQ(Describe(read.error()).find_first_of("\r\n"), std::string::npos) << text;
  }
  EXPECT_GT(read_count, 0);  // White space and digits are mutated, too.
  EXPECT_GT(refused_count, 0);
}

}  // namespace stridewire
