#include "fail_if.h"

#include <gtest/gtest.h>

namespace stridewire::load {
namespace {

LoadReport SomeReport() {
  LoadReport report;
  report.poses_received = 100;
  report.ticks_missed = 3;
  report.tick_ms = Quantiles{0.5, 2.0, 8.0};
  report.requests_rejected = 1;
  report.errors = {"one", "two"};
  return report;
}

bool Fails(const char* text) {
  const Expected<FailIf> fail_if = FailIf::Parse(text);
  EXPECT_TRUE(fail_if.has_value()) << Describe(fail_if.error());
  return fail_if->Fails(SomeReport());
}

TEST(FailIf, ComparesWithEveryOperator) {
  EXPECT_TRUE(Fails("ticks_missed>2"));
  EXPECT_FALSE(Fails("ticks_missed>3"));
  EXPECT_TRUE(Fails("ticks_missed>=3"));
  EXPECT_FALSE(Fails("ticks_missed>=4"));
  EXPECT_TRUE(Fails("ticks_missed<4"));
  EXPECT_FALSE(Fails("ticks_missed<3"));
  EXPECT_TRUE(Fails("ticks_missed<=3"));
  EXPECT_FALSE(Fails("ticks_missed<=2"));
  EXPECT_TRUE(Fails("ticks_missed==3"));
  EXPECT_FALSE(Fails("ticks_missed==2"));
  EXPECT_TRUE(Fails("ticks_missed!=2"));
  EXPECT_FALSE(Fails("ticks_missed!=3"));
}

TEST(FailIf, FindsNumbersInsideObjects) {
  EXPECT_TRUE(Fails("tick_ms.p99 > 1.5"));
  EXPECT_FALSE(Fails(" tick_ms.p99>2.5e0 "));
  EXPECT_TRUE(Fails("requests.rejected>0"));
}

TEST(FailIf, CountsErrors) {
  EXPECT_TRUE(Fails("errors==2"));
  EXPECT_FALSE(Fails("errors>2"));
}

TEST(FailIf, FailsIfTheNumberWasNotMeasured) {
  EXPECT_TRUE(Fails("step_latency_ms.p99>1000000"));
  const Expected<FailIf> fail_if = FailIf::Parse("step_latency_ms.p99>1000000");
  EXPECT_EQ(fail_if->Explain(SomeReport()),
            "step_latency_ms.p99>1000000: the value was not measured");
}

TEST(FailIf, ExplainsTheFailure) {
  const Expected<FailIf> fail_if = FailIf::Parse(" tick_ms.p99 > 1 ");
  ASSERT_TRUE(fail_if.has_value());
  EXPECT_EQ(fail_if->Explain(SomeReport()), "tick_ms.p99 > 1: the value is 2");
}

TEST(FailIf, AcceptsEveryNumberOfTheReport) {
  for (const std::string& name : ReportNumberNames()) {
    EXPECT_TRUE(FailIf::Parse(name + ">0").has_value()) << name;
  }
}

TEST(FailIf, ReportsSyntaxErrors) {
  const auto error = [](const std::string& text) {
    const Expected<FailIf> fail_if = FailIf::Parse(text);
    return fail_if ? std::string("no error") : Describe(fail_if.error());
  };
  const std::string comparison = ": expected a comparison, for example ticks_missed>0";
  EXPECT_EQ(error(""), "--fail-if ''" + comparison);
  EXPECT_EQ(error("ticks_missed"), "--fail-if 'ticks_missed'" + comparison);
  EXPECT_EQ(error("ticks_missed=3"),
            "--fail-if 'ticks_missed=3': unknown comparison; expected > >= < <= == or !=");
  EXPECT_EQ(error("ticks_missed!3"),
            "--fail-if 'ticks_missed!3': unknown comparison; expected > >= < <= == or !=");
  for (const char* number : {"", " ", "x", "1x", "1 2", "nan", "inf", "1e999", ">1"}) {
    const std::string text = std::string("ticks_missed>") + number;
    EXPECT_EQ(error(text), "--fail-if '" + text + "': expected a number after the comparison");
  }
  for (const char* name : {"", "tick", "tick_ms", "mode", "requests", "tick_ms.p98", "."}) {
    EXPECT_TRUE(error(std::string(name) + ">0")
                    .starts_with("--fail-if '" + std::string(name) + ">0': unknown name"))
        << error(std::string(name) + ">0");
  }
  EXPECT_EQ(error(std::string(129, 'a')),
            "--fail-if '" + std::string(128, 'a') + "': is longer than 128 characters");
}

}  // namespace
}  // namespace stridewire::load
