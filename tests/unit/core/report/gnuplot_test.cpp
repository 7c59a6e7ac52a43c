#include "gnuplot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>

namespace stridewire {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(DrawSvg, IsDeterministic) {
  const std::string script = "$d << EOD\n0 1\n1 2\nEOD\nplot $d w l\n";
  const auto once = DrawSvg(script, 200, 100);
  ASSERT_TRUE(once.has_value()) << once.error().text << once.error().where;
  EXPECT_THAT(*once, HasSubstr("<svg"));
  EXPECT_EQ(*once, *DrawSvg(script, 200, 100));
}

TEST(DrawSvg, ReturnsTheErrorOfGnuplot) {
  const auto drawn = DrawSvg("plot nothing_of_that_name\n", 200, 100);
  ASSERT_FALSE(drawn.has_value());
  EXPECT_EQ(drawn.error().code, ErrorCode::kIo);
  EXPECT_THAT(drawn.error().where, HasSubstr("nothing_of_that_name"));
}

TEST(DrawSvg, NeverInterpretsQuotedTextAsACommand) {
  const std::string hostile = "\"\\n`echo x` @a $b\n'; set output 'y'; system(\"false\") <&>";
  const auto drawn =
      DrawSvg("set title " + Quoted(hostile) + " noenhanced\nplot 0 notitle\n", 400, 200);
  ASSERT_TRUE(drawn.has_value()) << drawn.error().where;
  EXPECT_THAT(*drawn, HasSubstr("\"\\n`echo x` @a"));
  EXPECT_THAT(*drawn, HasSubstr("&lt;&amp;>"));
}

TEST(Number, FormatsForGnuplot) {
  EXPECT_EQ(Number(0.5), "0.5");
  EXPECT_EQ(Number(-1234.5678), "-1234.57");
  EXPECT_EQ(Number(std::nan("")), "NaN");
  EXPECT_EQ(Number(HUGE_VAL), "NaN");
}

}  // namespace
}  // namespace stridewire
