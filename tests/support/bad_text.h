#pragma once

#include <gtest/gtest.h>

#include <span>

#include "stridewire/base/error.h"

namespace stridewire {

/// A text that a parser refuses: the error's code and the whole sentence a person reads.
struct BadText {
  const char* text;
  ErrorCode code;
  const char* described;
};

/// `parse` takes a text and returns an Expected.
template <typename Parse>
void ExpectRefused(std::span<const BadText> bad_texts, Parse&& parse) {
  for (const BadText& bad : bad_texts) {
    SCOPED_TRACE(bad.text);
    const auto read = parse(bad.text);
    ASSERT_FALSE(read.has_value());
    EXPECT_EQ(Describe(read.error()), bad.described);
    EXPECT_EQ(read.error().code, bad.code);
  }
}

}  // namespace stridewire
