#include "load_options.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace stridewire::load {
namespace {

using Arguments = std::vector<std::string>;

Expected<LoadCommandLine> Read(const Arguments& arguments) {
  std::vector<const char*> argv = {"stridewire-load"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  return ReadLoadCommandLine(static_cast<int>(argv.size()), argv.data());
}

const Arguments kEnough = {"--connect", "127.0.0.1:7420", "--avatars", "10", "--observers",
                           "2",         "--seconds",      "1.5"};

/// Returns the required options followed by `more`.
Arguments With(const Arguments& more) {
  Arguments all = kEnough;
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

/// The required options with one value changed.
Arguments Changed(const std::string& option, const std::string& value) {
  Arguments all = kEnough;
  *(std::find(all.begin(), all.end(), option) + 1) = value;
  return all;
}

std::string ErrorOf(const Arguments& arguments) {
  const Expected<LoadCommandLine> line = Read(arguments);
  return line ? "no error" : Describe(line.error());
}

TEST(LoadOptions, HaveDefaults) {
  const Expected<LoadCommandLine> line = Read(kEnough);
  ASSERT_TRUE(line.has_value()) << Describe(line.error());
  const LoadOptions& options = line->options;
  EXPECT_EQ(line->text, "");
  EXPECT_EQ(options.server, (Address{"127.0.0.1", 7420}));
  EXPECT_EQ(options.http, (Address{"127.0.0.1", 7421}));
  EXPECT_EQ(options.worlds, 1);
  EXPECT_EQ(options.avatars, 10);
  EXPECT_EQ(options.observers, 2);
  EXPECT_EQ(options.seconds, 1.5);
  EXPECT_EQ(options.mode, protocol::PoseMode::kQuantised);
  EXPECT_TRUE(options.observe_all);
  EXPECT_FALSE(options.json);
}

TEST(LoadOptions, ParseAllOptions) {
  const Expected<LoadCommandLine> line = Read(With({"--http",
                                                    "[::1]:80",
                                                    "--worlds",
                                                    "3",
                                                    "--mode",
                                                    "full",
                                                    "--choreography",
                                                    "c.json",
                                                    "--observe",
                                                    "one",
                                                    "--churn",
                                                    "2.5",
                                                    "--threads",
                                                    "2",
                                                    "--verify-one-in",
                                                    "7",
                                                    "--seed",
                                                    "42",
                                                    "--json",
                                                    "--fail-if",
                                                    "ticks_missed>0",
                                                    "--fail-if",
                                                    "errors>1",
                                                    "--partial-observers",
                                                    "5",
                                                    "--partial-avatars",
                                                    "9"}));
  ASSERT_TRUE(line.has_value()) << Describe(line.error());
  const LoadOptions& options = line->options;
  EXPECT_EQ(options.http, (Address{"::1", 80}));
  EXPECT_EQ(ToText(*options.http), "[::1]:80");
  EXPECT_EQ(options.worlds, 3);
  EXPECT_EQ(options.mode, protocol::PoseMode::kFull);
  EXPECT_EQ(options.choreography, "c.json");
  EXPECT_FALSE(options.observe_all);
  EXPECT_EQ(options.churn_per_s, 2.5);
  EXPECT_EQ(options.threads, 2);
  EXPECT_EQ(options.verify_one_in, 7);
  EXPECT_EQ(options.seed, 42u);
  EXPECT_EQ(options.partial_observers, 5);
  EXPECT_EQ(options.partial_avatars, 9);
  EXPECT_TRUE(options.json);
  ASSERT_EQ(options.fail_ifs.size(), 2u);
  EXPECT_EQ(options.fail_ifs[1].name(), "errors");
}

TEST(LoadOptions, CanDisableTheMetrics) {
  const Expected<LoadCommandLine> line = Read(With({"--http", "none", "--wander"}));
  ASSERT_TRUE(line.has_value()) << Describe(line.error());
  EXPECT_FALSE(line->options.http.has_value());
}

TEST(LoadOptions, PrintHelpAndVersion) {
  const Expected<LoadCommandLine> help = Read({"--help"});
  ASSERT_TRUE(help.has_value());
  EXPECT_NE(help->text.find("stridewire-load --connect 127.0.0.1:7420"), std::string::npos);
  const Expected<LoadCommandLine> version = Read({"--version"});
  ASSERT_TRUE(version.has_value());
  EXPECT_TRUE(version->text.starts_with("stridewire-load ")) << version->text;
}

TEST(LoadOptions, NameTheInvalidOption) {
  EXPECT_EQ(ErrorOf({}), "--connect is required: see --help");
  const std::string unknown = "--speed: unknown option or surplus argument; see --help";
  EXPECT_EQ(ErrorOf(With({"--speed", "3"})), unknown);
  EXPECT_EQ(ErrorOf({"--speed", "3"}), unknown);
  EXPECT_NE(ErrorOf(Changed("--avatars", "many")).find("--avatars"), std::string::npos);
  const std::string range = ": is out of range (see --help)";
  EXPECT_EQ(ErrorOf(Changed("--avatars", "0")), "--avatars 0" + range);
  EXPECT_EQ(ErrorOf(Changed("--avatars", "100001")), "--avatars 100001" + range);
  EXPECT_EQ(ErrorOf(Changed("--observers", "-1")), "--observers -1" + range);
  EXPECT_EQ(ErrorOf(Changed("--observers", "10001")), "--observers 10001" + range);
  EXPECT_EQ(ErrorOf(Changed("--seconds", "0")), "--seconds 0" + range);
  EXPECT_EQ(ErrorOf(Changed("--seconds", "3601")), "--seconds 3601" + range);
  EXPECT_EQ(ErrorOf(Changed("--seconds", "nan")), "--seconds nan" + range);
  EXPECT_EQ(ErrorOf(With({"--worlds", "0"})), "--worlds 0" + range);
  EXPECT_EQ(ErrorOf(With({"--worlds", "1001"})), "--worlds 1001" + range);
  EXPECT_EQ(ErrorOf(With({"--worlds", "11"})), "--worlds 11: exceeds the number of avatars");
  EXPECT_EQ(ErrorOf(With({"--churn", "-0.5"})), "--churn -0.5" + range);
  EXPECT_EQ(ErrorOf(With({"--churn", "1001"})), "--churn 1001" + range);
  EXPECT_EQ(ErrorOf(With({"--threads", "0"})), "--threads 0" + range);
  EXPECT_EQ(ErrorOf(With({"--threads", "65"})), "--threads 65" + range);
  EXPECT_EQ(ErrorOf(With({"--verify-one-in", "0"})), "--verify-one-in 0" + range);
  EXPECT_EQ(ErrorOf(With({"--mode", "raw"})), "--mode raw: expected full, quantised or movement");
  EXPECT_EQ(ErrorOf(With({"--detail", "1"})), "--detail 1: expected all, reduced or root");
  EXPECT_EQ(ErrorOf(With({"--detail", "root", "--mode", "full"})),
            "--detail root: needs --mode quantised");
  EXPECT_EQ(ErrorOf(With({"--observe", "none"})), "--observe none: expected all or one");
  EXPECT_EQ(ErrorOf(With({"--wander", "--choreography", "c.json"})),
            "--wander: cannot be used with --choreography");
  EXPECT_NE(ErrorOf(With({"--seed", "x"})).find("--seed"), std::string::npos);
  EXPECT_TRUE(ErrorOf(With({"--fail-if", "tick>0"})).starts_with("--fail-if 'tick>0': "));

  EXPECT_EQ(ErrorOf(With({"--partial-observers", "-1"})), "--partial-observers -1" + range);
  EXPECT_EQ(ErrorOf(With({"--partial-avatars", "0"})), "--partial-avatars 0" + range);
  EXPECT_EQ(ErrorOf(With({"--partial-observers", "1", "--partial-avatars", "11"})),
            "--partial-avatars 11: exceeds the number of avatars");

  Arguments alone = Changed("--observers", "0");
  alone.insert(alone.end(), {"--churn", "1"});
  EXPECT_EQ(ErrorOf(alone), "--churn 1: needs at least one observer");
}

TEST(LoadOptions, RejectInvalidAddresses) {
  for (const char* address : {"localhost", ":7420", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:65536",
                              "127.0.0.1:-1", "127.0.0.1:80x", "::1:7420", "[]:7420"}) {
    EXPECT_EQ(ErrorOf(Changed("--connect", address)),
              "--connect " + std::string(address) +
                  ": expected HOST:PORT, for example 127.0.0.1:7420 or [::1]:7420");
  }
  EXPECT_TRUE(ErrorOf(With({"--http", "x"})).starts_with("--http x: expected HOST:PORT"));
}

TEST(LoadOptions, LimitTheNumberOfConditions) {
  Arguments many = kEnough;
  for (int i = 0; i < kMaxFailIfs; ++i) many.insert(many.end(), {"--fail-if", "errors>0"});
  EXPECT_EQ(ErrorOf(many), "no error");
  many.insert(many.end(), {"--fail-if", "errors>0"});
  EXPECT_EQ(ErrorOf(many), "--fail-if: can be used at most 32 times");
}

}  // namespace
}  // namespace stridewire::load
