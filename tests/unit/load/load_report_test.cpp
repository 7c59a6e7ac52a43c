#include "load_report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace stridewire::load {
namespace {

TEST(LoadReport, HasTheDocumentedKeys) {
  LoadReport report;
  report.avatars = 3;
  report.observers = 2;
  report.mode = protocol::PoseMode::kFull;
  report.seconds = 1.5;
  report.poses_received = 4;
  report.poses_expected = 5;
  report.bytes_received = 8;
  report.tick_ms = Quantiles{1.0, 2.0, 3.0};
  report.ticks_missed = 6;
  report.step_latency_ms = Quantiles{4.0, 5.0, 6.0};
  report.requests_sent = 9;
  report.requests_accepted = 7;
  report.requests_rejected = 2;
  report.reconnects = 1;
  report.errors = {"one"};
  const auto json = nlohmann::json::parse(ToJson(report));
  EXPECT_EQ(json["avatars"], 3);
  EXPECT_EQ(json["observers"], 2);
  EXPECT_EQ(json["mode"], "full");
  EXPECT_EQ(json["seconds"], 1.5);
  EXPECT_EQ(json["poses_received"], 4);
  EXPECT_EQ(json["poses_expected"], 5);
  EXPECT_EQ(json["bytes_received"], 8);
  EXPECT_EQ(json["bytes_per_pose"], 2.0);
  EXPECT_EQ(json["tick_ms"], (nlohmann::json{{"p50", 1.0}, {"p99", 2.0}, {"max", 3.0}}));
  EXPECT_EQ(json["ticks_missed"], 6);
  EXPECT_EQ(json["step_latency_ms"], (nlohmann::json{{"p50", 4.0}, {"p99", 5.0}, {"max", 6.0}}));
  EXPECT_EQ(json["requests"], (nlohmann::json{{"sent", 9}, {"accepted", 7}, {"rejected", 2}}));
  EXPECT_EQ(json["reconnects"], 1);
  EXPECT_EQ(json["errors"], nlohmann::json::array({"one"}));
}

TEST(LoadReport, IsNullForMissingMeasurements) {
  const auto json = nlohmann::json::parse(ToJson(LoadReport{}));
  EXPECT_TRUE(json["tick_ms"]["p99"].is_null());
  EXPECT_TRUE(json["ticks_missed"].is_null());
  EXPECT_TRUE(json["step_latency_ms"]["max"].is_null());
  EXPECT_TRUE(json["bytes_per_pose"].is_null());
  EXPECT_EQ(ReportNumber(LoadReport{}, "ticks_missed"), std::nullopt);
}

TEST(LoadReport, IsOneLineOfValidJsonForAnyErrorText) {
  LoadReport report;
  report.errors = {"a\nb \xff"};
  const std::string text = ToJson(report);
  EXPECT_EQ(text.find('\n'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(text)["errors"].size(), 1u);
}

}  // namespace
}  // namespace stridewire::load
