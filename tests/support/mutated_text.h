#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>

#include "stridewire/base/error.h"

namespace stridewire {

/// Fuzzes a JSON parser with `rounds` versions of a text that have one to three random changes each,
/// and prints the seed on failure. `parse` takes a text and returns an Expected; `check` receives the
/// parsed value. Expects every error to name `file` and to have a message of one line. At least one
/// version must parse and one must fail.
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
  int parsed_count = 0;
  int rejected_count = 0;
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
      ++parsed_count;
      check(*read);
      continue;
    }
    ++rejected_count;
    EXPECT_TRUE(read.error().where.starts_with(file)) << text;
    EXPECT_NE(std::string(read.error().text), "") << text;
    EXPECT_EQ(Describe(read.error()).find_first_of("\r\n"), std::string::npos) << text;
  }
  EXPECT_GT(parsed_count, 0);  // Some mutations only change white space or digits.
  EXPECT_GT(rejected_count, 0);
}

}  // namespace stridewire
