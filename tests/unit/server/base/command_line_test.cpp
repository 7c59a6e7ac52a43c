#include "base/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <map>

#include "stridewire/base/version.h"

namespace stridewire::server {
namespace {

using testing::HasSubstr;
using Action = CommandLine::Action;
using Variables = std::map<std::string, std::string>;

Expected<CommandLine> Read(std::vector<const char*> arguments, const Variables& variables = {}) {
  arguments.insert(arguments.begin(), "stridewired");
  return ReadCommandLine(static_cast<int>(arguments.size()), arguments.data(),
                         [&](const std::string& name) -> std::optional<std::string> {
                           const auto it = variables.find(name);
                           if (it == variables.end()) return std::nullopt;
                           return it->second;
                         });
}

class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text) {
    const int file = mkstemp(path_);
    EXPECT_GE(file, 0);
    EXPECT_EQ(write(file, text.data(), text.size()), static_cast<ssize_t>(text.size()));
    close(file);
  }
  ~TemporaryFile() { unlink(path_); }
  [[nodiscard]] const char* path() const { return path_; }

 private:
  char path_[32] = "/tmp/stridewire_XXXXXX";
};

TEST(CommandLine, OptionOverridesEnvironmentFileAndDefault) {
  const TemporaryFile file("tick_hz = 10\nshards = 3\n[limits]\nmax_queue = 7\nmax_worlds = 5");
  const Variables variables = {{"STRIDEWIRE_TICK_HZ", "20"}, {"STRIDEWIRE_MAX_QUEUE", "8"}};
  const auto read =
      Read({"--config", file.path(), "--tick-hz", "30", "--max-sessions", "9"}, variables);
  ASSERT_TRUE(read) << Describe(read.error());
  EXPECT_EQ(read->action, Action::kRun);
  EXPECT_EQ(read->config.tick_hz, 30.0);
  EXPECT_EQ(read->config.limits.max_queue, 8);
  EXPECT_EQ(read->config.shards, 3);
  EXPECT_EQ(read->config.limits.max_worlds, 5);
  EXPECT_EQ(read->config.limits.max_sessions, 9);
  EXPECT_EQ(read->config.limits.max_avatars, Limits().max_avatars);
}

TEST(CommandLine, EveryKeyIsAnOptionAndAVariable) {
  const Config defaults;
  for (const ConfigKey& key : ConfigKeys()) {
    SCOPED_TRACE(key.name);
    const std::string value = key.get(defaults);
    if (key.name == "data_dir" || key.name == "viewer_dir") continue;  // the default is empty
    const std::string option = key.option() + "=" + value;
    EXPECT_TRUE(value.empty() || Read({option.c_str()}));
    EXPECT_TRUE(Read({}, {{key.environment(), value}}));
    if (key.is_text && key.name == "library") continue;
    const std::string bad = key.option() + "=\x01";
    const auto option_error = Read({bad.c_str()});
    ASSERT_FALSE(option_error);
    EXPECT_THAT(Describe(option_error.error()), HasSubstr(key.option()));
    const auto variable_error = Read({}, {{key.environment(), "\x01"}});
    ASSERT_FALSE(variable_error);
    EXPECT_THAT(Describe(variable_error.error()), HasSubstr(key.environment()));
  }
}

TEST(CommandLine, FlagsNeedNoValue) {
  const auto read = Read({"--allow-insecure", "--listen", "0.0.0.0:1"});
  ASSERT_TRUE(read) << Describe(read.error());
  EXPECT_TRUE(read->config.allow_insecure);
  const auto off = Read({"--open-worlds=false"});
  ASSERT_TRUE(off) << Describe(off.error());
  EXPECT_FALSE(off->config.open_worlds);
}

TEST(CommandLine, PrintsHelpAndVersion) {
  const auto help = Read({"--help"});
  ASSERT_TRUE(help);
  EXPECT_EQ(help->action, Action::kPrintText);
  for (const ConfigKey& key : ConfigKeys()) EXPECT_THAT(help->text, HasSubstr(key.option()));
  EXPECT_THAT(help->text, HasSubstr("Examples:"));
  const auto version = Read({"--version"});
  ASSERT_TRUE(version);
  EXPECT_EQ(version->text, std::string("stridewired ") + kVersion + "\n");
  EXPECT_EQ(Read({"--print-config"})->action, Action::kPrintConfig);
  EXPECT_EQ(Read({"--check-config"})->action, Action::kCheckConfig);
}

TEST(CommandLine, RejectsUnknownArguments) {
  for (const std::vector<const char*>& arguments : std::vector<std::vector<const char*>>{
           {"--no-such-option"}, {"surplus"}, {"--tick-hz"}, {"--config"}}) {
    const auto read = Read(arguments);
    ASSERT_FALSE(read) << arguments[0];
    EXPECT_THAT(Describe(read.error()), HasSubstr(arguments[0]));
  }
  EXPECT_EQ(Describe(Read({"--tick-hz", "30", "--bar", "7"}).error()),
            "--bar: unknown option or surplus argument; see --help");
  EXPECT_EQ(Describe(Read({"--tick-hz"}).error()), "--tick-hz: expected a value; see --help");
}

TEST(CommandLine, FileErrorsContainTheFileName) {
  const auto missing = Read({"--config", "/no/such/file.toml"});
  ASSERT_FALSE(missing);
  EXPECT_THAT(Describe(missing.error()),
              HasSubstr("/no/such/file.toml: cannot open the configuration file"));
  const auto directory = Read({"--config", "/tmp"});
  ASSERT_FALSE(directory);
  EXPECT_THAT(Describe(directory.error()), HasSubstr("/tmp"));
  const TemporaryFile huge(std::string((std::size_t{1} << 20) + 1, '\n'));
  const auto too_long = Read({}, {{"STRIDEWIRE_CONFIG", huge.path()}});
  ASSERT_FALSE(too_long);
  EXPECT_EQ(too_long.error().code, ErrorCode::kLimitExceeded);
}

}  // namespace
}  // namespace stridewire::server
