#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>

#include "stridewire/client.h"
#include "stridewire/protocol/status_code.h"

namespace stridewire {
namespace {

TEST(Status, ProtocolCodesHaveTheSameNamesInC) {
  int known = 0;
  for (int code = 0; code < 1000; ++code) {
    const auto name = protocol::StatusCodeName(static_cast<protocol::StatusCode>(code));
    if (name == "unknown") continue;
    ++known;
    EXPECT_EQ(name, stridewire_status_name(static_cast<stridewire_status>(code))) << code;
  }
  EXPECT_GE(known, 26);
}

TEST(Status, CodesHaveUniqueNamesAndTexts) {
  std::set<std::string> names;
  std::set<std::string> texts;
  int known = 0;
  for (int code = 0; code < 1000; ++code) {
    const auto status = static_cast<stridewire_status>(code);
    const std::string name = stridewire_status_name(status);
    if (name == "unknown") continue;
    ++known;
    const std::string text = stridewire_status_text(status);
    EXPECT_TRUE(names.insert(name).second) << name;
    EXPECT_TRUE(texts.insert(text).second) << text;
    EXPECT_EQ(text.back(), '.') << name;
    EXPECT_EQ(name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_"), std::string::npos) << name;
    // Codes x50 to x99 belong to this library only.
    const bool from_protocol =
        protocol::StatusCodeName(static_cast<protocol::StatusCode>(code)) != "unknown";
    EXPECT_EQ(from_protocol, code % 100 < 50) << name;
  }
  EXPECT_EQ(known, 39);
}

TEST(Status, UnknownCodesAreDescribedByTheirHundreds) {
  for (const int code : {149, 249, 349, 449}) {
    const auto status = static_cast<stridewire_status>(code);
    EXPECT_STREQ(stridewire_status_name(status), "unknown");
    EXPECT_GT(std::strlen(stridewire_status_text(status)), 10u);
  }
  EXPECT_NE(std::string(stridewire_status_text(static_cast<stridewire_status>(349))),
            stridewire_status_text(static_cast<stridewire_status>(449)));
  EXPECT_NE(stridewire_status_text(STRIDEWIRE_STATUS_MAX), nullptr);
}

}  // namespace
}  // namespace stridewire
