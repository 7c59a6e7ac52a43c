#include "stridewire/protocol/status_code.h"

#include <gtest/gtest.h>

#include <set>

namespace stridewire::protocol {
namespace {

TEST(StatusCode, HasUniqueNames) {
  std::set<std::string_view> names;
  int known = 0;
  for (int number = 0; number < 1000; ++number) {
    const auto name = StatusCodeName(static_cast<StatusCode>(number));
    if (name == "unknown") continue;
    ++known;
    EXPECT_TRUE(names.insert(name).second) << name;
    EXPECT_TRUE(number == 0 || (number >= 100 && number < 500)) << number;
  }
  EXPECT_EQ(known, 27);
  EXPECT_EQ(StatusCodeName(StatusCode::kNoSuchAvatar), "no_such_avatar");
}

}  // namespace
}  // namespace stridewire::protocol
