#pragma once

#include <gtest/gtest.h>

#include <span>

#include "stridewire/base/error.h"

namespace stridewire {

/// A text that a parser must reject, with the expected error code and message.
struct BadText {
  const char* text;
  ErrorCode code;
  const char* described;
};

/// Expects `parse`, which takes a text and returns an Expected, to reject every text.
template <typename Parse>
void ExpectErrors(std::span<const BadText> bad_texts, Parse&& parse) {
  for (const BadText& bad : bad_texts) {
    SCOPED_TRACE(bad.text);
    const auto read = parse(bad.text);
    ASSERT_FALSE(read.has_value());
    EXPECT_EQ(Describe(read.error()), bad.described);
    EXPECT_EQ(read.error().code, bad.code);
  }
}

}  // namespace stridewire
