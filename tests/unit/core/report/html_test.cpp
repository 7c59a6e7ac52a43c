#include "html.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stridewire {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(EscapeHtml, EscapesMarkup) {
  EXPECT_EQ(EscapeHtml("<b a=\"1\" c='2'>&amp;"),
            "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;amp;");
  EXPECT_EQ(EscapeHtml("Schritt ä 𝄞"), "Schritt ä 𝄞");
}

TEST(EscapeHtml, ReplacesInvalidUtf8AndControlCharacters) {
  const std::string bad = "\xef\xbf\xbd";
  EXPECT_EQ(EscapeHtml(std::string("a\0b\x1b", 4)), "a" + bad + "b" + bad);
  EXPECT_EQ(EscapeHtml("\xff"), bad);
  EXPECT_EQ(EscapeHtml("\xc3"), bad);                      // truncated
  EXPECT_EQ(EscapeHtml("\xc0\xbc"), bad + bad);            // an overlong '<'
  EXPECT_EQ(EscapeHtml("\xed\xa0\x80"), bad + bad + bad);  // a lone surrogate
}

TEST(EncodeBase64, MatchesTheVectorsOfRfc4648) {
  EXPECT_EQ(EncodeBase64(""), "");
  EXPECT_EQ(EncodeBase64("f"), "Zg==");
  EXPECT_EQ(EncodeBase64("fo"), "Zm8=");
  EXPECT_EQ(EncodeBase64("foo"), "Zm9v");
  EXPECT_EQ(EncodeBase64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(EncodeBase64("\xff\xfe\xfd"), "//79");
}

TEST(TableHtml, AlignsNumbersRightAndEscapesText) {
  const std::string html = TableHtml({{"name", "mm"}, {"<walk>", "1.5"}});
  EXPECT_THAT(html, HasSubstr("<th>name</th><th>mm</th>"));
  EXPECT_THAT(html, HasSubstr("<td>&lt;walk&gt;</td><td class=\"n\">1.5</td>"));
}

TEST(PageHtml, EscapesItsTitleAndEmbedsFigures) {
  const std::string page =
      PageHtml("a<script>", PictureHtml("<svg/>", "a \"quoted\" caption", "x.svg"));
  EXPECT_THAT(page, Not(HasSubstr("<script>")));
  EXPECT_THAT(page, HasSubstr("data:image/svg+xml;base64,PHN2Zy8+"));
  EXPECT_THAT(page, HasSubstr("alt=\"a &quot;quoted&quot; caption\""));
}

}  // namespace
}  // namespace stridewire
