// Runs stridewire-library as a program and checks output, files and exit codes of every option.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bvh_text.h"
#include "child_process.h"
#include "run_program.h"
#include "scratch_folder.h"
#include "stridewire/base/version.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::ReadWhole;
using test::ScratchFolder;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

using Arguments = std::vector<std::string>;

// From Debian's package assimp-testmodels: ten standing jumps; and steps, a ladder and turns.
constexpr const char* kJumps = "/usr/share/assimp/models/BVH/01_01.bvh";
constexpr const char* kSteps = "/usr/share/assimp/models/BVH/01_03.bvh";

ProgramResult Tool(const Arguments& arguments) {
  return test::RunProgram(STRIDEWIRE_LIBRARY_TOOL, arguments);
}

Arguments Join(Arguments a, const Arguments& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::string Text(const Arguments& arguments) {
  std::string text = "stridewire-library";
  for (const std::string& argument : arguments) text += " \"" + argument + "\"";
  return text;
}

// Expects one line of the program that contains `named`.
void ExpectSentence(const std::string& err, const std::string& named) {
  EXPECT_THAT(err, StartsWith("stridewire-library: "));
  EXPECT_THAT(err, HasSubstr(named));
  EXPECT_EQ(std::count(err.begin(), err.end(), '\n'), 1) << err;
  EXPECT_LT(err.size(), 400u) << err;
}

void ExpectFailure(const Arguments& arguments, int exit_code, const std::string& named) {
  SCOPED_TRACE(Text(arguments));
  const ProgramResult result = Tool(arguments);
  EXPECT_EQ(result.exit_code, exit_code) << result.err;
  EXPECT_THAT(result.out, IsEmpty());
  ExpectSentence(result.err, named);
}

json ParseOutput(const std::string& out) {
  // Throws, which fails the test, if there is anything before or after the object.
  json parsed = json::parse(out);
  EXPECT_TRUE(parsed.is_object());
  return parsed;
}

// Returns the output of `inspect --json` without the summary and the self-check.
json Groups(const std::string& out) {
  json library = ParseOutput(out);
  library.erase("summary");
  library.erase("self_check");
  return library;
}

std::vector<std::string> Keys(const json& object) {
  std::vector<std::string> keys;
  for (const auto& item : object.items()) keys.push_back(item.key());
  return keys;
}

class LibraryTool : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(std::filesystem::exists(kJumps) && std::filesystem::exists(kSteps))
        << "Debian's assimp-testmodels is not installed";
  }
  std::string Out(const std::string& name = "out.swl") const { return folder_.File(name); }

  const ScratchFolder folder_;
};

TEST_F(LibraryTool, PrintsItsVersion) {
  const ProgramResult result = Tool({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.out, std::string("stridewire-library ") + kVersion + "\n");
  EXPECT_THAT(result.err, IsEmpty());
}

TEST_F(LibraryTool, HelpOfEveryCommandHasAnExample) {
  const ProgramResult all = Tool({"--help"});
  EXPECT_EQ(all.exit_code, 0);
  for (const char* command : {"build", "inspect", "refine", "synthesize", "export-capture"}) {
    EXPECT_THAT(all.out, HasSubstr(std::string("\n  stridewire-library ") + command));
  }
  for (const char* command :
       {"build", "inspect", "add-layers", "synthesize", "export-capture", "refine", "report"}) {
    SCOPED_TRACE(command);
    const ProgramResult result = Tool({command, "--help"});
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out, HasSubstr(std::string("Example:\n")));
    EXPECT_THAT(result.out, HasSubstr(std::string("stridewire-library ") + command));
    EXPECT_THAT(result.out, testing::EndsWith("\n"));
    EXPECT_THAT(result.err, IsEmpty());
  }
}

TEST_F(LibraryTool, RejectsUnknownOrMissingCommands) {
  ExpectFailure({}, 2, "expected a command");
  ExpectFailure({"frobnicate"}, 2, "\"frobnicate\"");
  ExpectFailure({""}, 2, "\"\" is not a command");
  ExpectFailure({"inspect", "builtin", "--bar", "7"}, 2,
                "inspect: --bar: unknown option or surplus argument");
  ExpectFailure({"--frobnicate"}, 2, "--frobnicate");
}

TEST_F(LibraryTool, ReportsMissingOptionsAndArguments) {
  ExpectFailure({"build", kJumps}, 2, "--out is required");
  ExpectFailure({"build", "--out"}, 2, "--out");
  ExpectFailure({"build", "--out", Out()}, 2, "files is required");
  ExpectFailure({"inspect"}, 2, "library is required");
  ExpectFailure({"synthesize"}, 2, "is required");
  ExpectFailure({"synthesize", "builtin", "--out", Out()}, 2, "--choreography is required");
  ExpectFailure({"synthesize", "builtin", "--choreography", Out("c.json")}, 2, "--out is required");
  ExpectFailure({"export-capture", "builtin"}, 2, "--out is required");
}

TEST_F(LibraryTool, ReportsUnknownOptions) {
  ExpectFailure({"build", "--out", Out(), "--frobnicate", kJumps}, 2, "--frobnicate");
  ExpectFailure({"inspect", "builtin", "--frobnicate"}, 2, "--frobnicate");
  ExpectFailure({"inspect", "builtin", "more"}, 2, "more");
  ExpectFailure({"synthesize", "builtin", "--frobnicate"}, 2, "synthesize: ");
  ExpectFailure({"export-capture", "builtin", "--out", Out(), "--frobnicate"}, 2, "--frobnicate");
  ExpectFailure({"build", "--out", Out(), "--out", Out("b.swl"), kJumps}, 2, "--out");
  EXPECT_EQ(folder_.Count(), 0);
}

TEST_F(LibraryTool, RejectsInvalidOptionValues) {
  const Arguments build = {"build", "--out", Out(), kJumps};
  for (const char* value : {"nan", "inf", "-inf", "-1", "0", "-0.01", "1e9", "abc", "", "1 m"}) {
    ExpectFailure(Join(build, {"--unit-m", value}), 2, "--unit-m");
    ExpectFailure(Join(build, {"--fps", value}), 2, "--fps");
  }
  for (const char* value : {"w", "+", "xy", "", "--x", "up"}) {
    if (*value != '\0') ExpectFailure(Join(build, {std::string("--up=") + value}), 2, "--up");
  }
  ExpectFailure(Join(build, {"--kinds", "walk"}), 2, "got \"walk\"");
  ExpectFailure(Join(build, {"--kinds", "step,walk"}), 2, "got \"walk\"");
  ExpectFailure(Join(build, {"--kinds", "step,,jump"}), 2, "--kinds: expected step, jump or both");
  ExpectFailure(Join(build, {"--kinds", ""}), 2, "--kinds");
  ExpectFailure(Join(build, {"--left-ankle", "LeftFoot"}), 2, "--right-ankle");
  ExpectFailure(Join(build, {"--right-ankle", "RightFoot"}), 2, "--left-ankle");
  for (const char* option : {"--left-ankle", "--right-ankle", "--left-ball", "--right-ball"}) {
    ExpectFailure(Join(build, {option, ""}), 2, option);
  }
  ExpectFailure({"build", "--out", "", kJumps}, 2, "--out");
  ExpectFailure({"build", "--out", Out(), ""}, 2, "files");
  ExpectFailure({"inspect", ""}, 2, "library");
  ExpectFailure({"export-capture", "builtin", "--out", ""}, 2, "--out");
  EXPECT_EQ(folder_.Count(), 0);
}

TEST_F(LibraryTool, RejectsFrameRatesOutOfRange) {
  const std::string choreography =
      folder_.Write("c.json", R"({"movements":[{"step":{"length_m":0.5}}]})");
  for (const char* fps : {"9.9", "1001", "0", "-60", "nan", "inf", "fast", ""}) {
    ExpectFailure(
        {"synthesize", "builtin", "--choreography", choreography, "--out", Out(), "--fps", fps}, 2,
        "--fps");
  }
  EXPECT_EQ(folder_.Count(), 1);
}

TEST_F(LibraryTool, ReportsMissingJoints) {
  for (const char* option : {"--left-ball", "--right-ball"}) {
    const ProgramResult result = Tool({"build", "--out", Out(), option, "Tail", kJumps});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, AllOf(HasSubstr(kJumps), HasSubstr(option), HasSubstr("no joint")));
  }
  const ProgramResult result =
      Tool({"build", "--out", Out(), "--left-ankle", "Tail", "--right-ankle", "Fin", kJumps});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr(kJumps), HasSubstr("--left-ankle")));
  EXPECT_EQ(folder_.Count(), 0);
}

TEST_F(LibraryTool, RejectsFilesThatAreNotLibraries) {
  const std::string none = folder_.File("none.swl");
  const std::string empty = folder_.Write("empty.swl", "");
  const std::string foreign = folder_.Write("foreign.swl", std::string(5000, 'x'));
  const std::string choreography =
      folder_.Write("c.json", R"({"movements":[{"step":{"length_m":0.5}}]})");
  struct Case {
    std::string file;
    const char* text;
  };
  const std::vector<Case> cases = {{none, "no such file"},
                                   {folder_.path().string(), "not a regular file"},
                                   {"/dev/null", "not a regular file"},
                                   {empty, "shorter than its header"},
                                   {foreign, "not a Stridewire library"},
                                   {kJumps, "not a Stridewire library"}};
  for (const Case& c : cases) {
    for (const Arguments& arguments :
         {Arguments{"inspect", c.file}, Arguments{"inspect", c.file, "--json"},
          Arguments{"synthesize", c.file, "--choreography", choreography, "--out", Out("o.bvh")},
          Arguments{"export-capture", c.file, "--out", Out("examples")}}) {
      ExpectFailure(arguments, 2, c.file + ": ");
      ExpectFailure(arguments, 2, c.text);
    }
  }
  EXPECT_EQ(folder_.Count(), 3) << "a failed command must not leave files behind";
}

TEST_F(LibraryTool, RejectsDamagedLibraries) {
  ASSERT_EQ(Tool({"build", "--out", Out(), kJumps}).exit_code, 0);
  const std::string whole = ReadWhole(Out());
  std::string damaged = whole;
  damaged[whole.size() / 2] ^= 0x10;
  std::string other_version = whole;
  other_version[8] = 77;
  ExpectFailure({"inspect", folder_.Write("damaged.swl", damaged)}, 2,
                "damaged.swl: the file is damaged");
  ExpectFailure({"inspect", folder_.Write("version.swl", other_version)}, 2, "version");
  ExpectFailure({"inspect", folder_.Write("short.swl", whole.substr(0, whole.size() - 1))}, 2,
                "truncated");
  ExpectFailure({"inspect", folder_.Write("long.swl", whole + "x")}, 2, "longer than its header");
}

TEST_F(LibraryTool, ReportsUnusableCapturesAndWritesNothing) {
  const std::string none = folder_.File("none.bvh");
  const std::string foreign = folder_.Write("foreign.bvh", "this is\nno capture\n");
  const std::string malformed =
      folder_.Write("bad.bvh", "HIERARCHY\nROOT Hips\n{\nOFFSET 0 zero 0\n");
  struct Case {
    std::string file;
    std::string named;
  };
  const std::vector<Case> cases = {{none, none + ": there is no such file"},
                                   {folder_.path().string(), folder_.path().string() + ": "},
                                   {foreign, foreign + ":1: "},
                                   {malformed, malformed + ":4: "}};
  const int before = folder_.Count();
  for (const Case& c : cases) {
    for (const bool as_json : {false, true}) {
      Arguments arguments = {"build", "--out", Out(), c.file};
      if (as_json) arguments.push_back("--json");
      SCOPED_TRACE(Text(arguments));
      const ProgramResult result = Tool(arguments);
      EXPECT_EQ(result.exit_code, 2);
      EXPECT_THAT(result.err, HasSubstr("stridewire-library: " + c.named));
      EXPECT_THAT(result.err, HasSubstr("no usable step or jump"));
      if (as_json) {
        const json report = ParseOutput(result.out);
        EXPECT_THAT(report["error"].get<std::string>(), HasSubstr("no usable step or jump"));
        ASSERT_EQ(report["files"].size(), 1u);
        EXPECT_THAT(report["files"][0]["reason"].get<std::string>(), HasSubstr(c.named));
        EXPECT_EQ(report["library"], nullptr);
      }
    }
  }
  EXPECT_EQ(folder_.Count(), before);
}

TEST_F(LibraryTool, FailedBuildKeepsTheOldLibrary) {
  folder_.Write("out.swl", "the old library");
  EXPECT_EQ(Tool({"build", "--out", Out(), folder_.File("none.bvh")}).exit_code, 2);
  EXPECT_EQ(ReadWhole(Out()), "the old library");
  EXPECT_EQ(folder_.Count(), 1);
}

// A symbolic link to itself cannot be opened, and /proc/self/mem cannot be read at its start. Both
// fail even for root, who may open files without permissions.
TEST_F(LibraryTool, ReportsUnreadableFiles) {
  const auto self_link = [](const std::string& file) {
    std::filesystem::create_symlink(std::filesystem::path(file).filename(), file);
  };
  const auto unreadable = [](const std::string& file) {
    std::filesystem::create_symlink("/proc/self/mem", file);
  };
  const auto forbidden = [](const std::string& file) {
    std::ofstream(file) << "x";
    std::filesystem::permissions(file, std::filesystem::perms::none);
  };
  std::vector<std::function<void(const std::string&)>> makers = {self_link, unreadable};
  if (geteuid() != 0) makers.push_back(forbidden);
  for (std::size_t i = 0; i < makers.size(); ++i) {
    SCOPED_TRACE(i);
    const auto make = [&](const std::string& name) {
      const std::string file = folder_.File(std::to_string(i) + name);
      makers[i](file);
      return file;
    };
    const std::string capture = make(".bvh");
    const ProgramResult built = Tool({"build", "--out", Out(), capture});
    EXPECT_EQ(built.exit_code, 2);
    EXPECT_THAT(built.err, HasSubstr(capture));
    const std::string library = make(".swl");
    ExpectFailure({"inspect", library}, 2, library);
    const std::string choreography = make(".json");
    ExpectFailure({"synthesize", "builtin", "--choreography", choreography, "--out", Out()}, 2,
                  choreography);
  }
}

TEST_F(LibraryTool, ReportsUnwritableOutputPaths) {
  const std::string choreography =
      folder_.Write("c.json", R"({"movements":[{"step":{"length_m":0.5}}]})");
  const std::string missing = folder_.File("no/such/folder/out");
  for (const std::string& out : {missing, folder_.path().string(), std::string("/dev/null")}) {
    ExpectFailure({"build", "--out", out, kJumps}, 1, out);
    ExpectFailure({"synthesize", "builtin", "--choreography", choreography, "--out", out}, 1, out);
  }
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  ExpectFailure({"export-capture", "builtin", "--out", choreography}, 1, choreography);
  ExpectFailure({"export-capture", "builtin", "--out", choreography + "/examples"}, 1,
                choreography);
  EXPECT_EQ(folder_.Count(), 1);
}

TEST_F(LibraryTool, NeverOverwritesItsInput) {
  const std::string capture = folder_.Write("a.bvh", ReadWhole(kJumps));
  ExpectFailure({"build", "--out", capture, kSteps, capture}, 2, "--out");
  EXPECT_EQ(ReadWhole(capture), ReadWhole(kJumps));
  const std::string text = R"({"movements":[{"step":{"length_m":0.5}}]})";
  const std::string choreography = folder_.Write("c.json", text);
  ExpectFailure({"synthesize", "builtin", "--choreography", choreography, "--out", choreography}, 2,
                "--out");
  EXPECT_EQ(ReadWhole(choreography), text);
}

TEST_F(LibraryTool, ReportsTheFieldOfAMalformedChoreography) {
  struct Case {
    const char* text;
    const char* named;
  };
  const std::vector<Case> cases = {
      {"", "c.json"},
      {"[]", "c.json"},
      {"{", "c.json"},
      {R"({"movements":[]})", "movements"},
      {R"({"start":{}})", "movements"},
      {R"({"movements":[{"step":{}}]})", "movements[0].step.length_m"},
      {R"({"movements":[{"step":{"length_m":"far"}}]})", "movements[0].step.length_m"},
      {R"({"movements":[{"step":{"length_m":11}}]})", "movements[0].step.length_m"},
      {R"({"movements":[{"step":{"length_m":0.5,"turn_rad":9}}]})", "step.turn_rad"},
      {R"({"movements":[{"step":{"length_m":0.5,"side_m":1e9}}]})", "step.side_m"},
      {R"({"movements":[{"step":{"length_m":0.5,"height_m":null}}]})", "step.height_m"},
      {R"({"movements":[{"step":{"length_m":0.5,"foot":"both"}}]})", "step.foot"},
      {R"({"movements":[{"step":{"length_m":0.5,"knee":1}}]})", "step.knee"},
      {R"({"movements":[{"jump":{"length_m":0.5}},{"jump":{}}]})", "movements[1].jump.length_m"},
      {R"({"movements":[{"stand":{"seconds":-1}}]})", "movements[0].stand.seconds"},
      {R"({"movements":[{"stand":{"seconds":1},"step":{"length_m":0}}]})", "movements[0]"},
      {R"({"movements":[{"dance":{}}]})", "movements[0].dance"},
      {R"({"movements":[7]})", "movements[0]"},
      {R"({"movements":[{"stand":{"seconds":1}}],"start":{"position_m":[0,0]}})",
       "start.position_m"},
      {R"({"movements":[{"stand":{"seconds":1}}],"start":{"heading_rad":"north"}})",
       "start.heading_rad"},
      {R"({"movements":[{"stand":{"seconds":1}}],"tempo":1})", "tempo"}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.text);
    const std::string choreography = folder_.Write("c.json", c.text);
    ExpectFailure({"synthesize", "builtin", "--choreography", choreography, "--out", Out()}, 2,
                  c.named);
  }
  ExpectFailure({"synthesize", "builtin", "--choreography", Out("none.json"), "--out", Out()}, 2,
                "none.json: there is no such file");
  ExpectFailure(
      {"synthesize", "builtin", "--choreography", folder_.path().string(), "--out", Out()}, 2,
      folder_.path().string());
  EXPECT_EQ(folder_.Count(), 1);
}

TEST_F(LibraryTool, ReportsWhetherWalksArrive) {
  const std::string choreography =
      folder_.Write("c.json",
                    R"({"terrain":{"boxes":[{"min_m":[-9,2],"max_m":[9,3],"height_m":2}]},
          "movements":[{"walk_to":{"position_m":[0.5,0,1],"heading_rad":1}},
                       {"walk_to":{"position_m":[0,0,5],"heading_rad":0}}]})");
  const ProgramResult result =
      Tool({"synthesize", "builtin", "--choreography", choreography, "--out", Out(), "--json"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const json output = ParseOutput(result.out);
  ASSERT_EQ(output["walks"].size(), 2u);
  EXPECT_EQ(output["walks"][0]["arrived"], true);
  EXPECT_NEAR(output["walks"][0]["base"]["position_m"][0].get<double>(), 0.5, 0.01);
  EXPECT_NEAR(output["walks"][0]["base"]["heading_rad"].get<double>(), 1.0, 0.01);
  EXPECT_EQ(output["walks"][1]["arrived"], false);
  EXPECT_EQ(output["walks"][1]["request"], 1);
  EXPECT_FALSE(output["walks"][1]["reason"].get<std::string>().empty());
}

TEST_F(LibraryTool, ReportsSpeedsThatTheLibraryCannotWalk) {
  const std::string choreography = folder_.Write("c.json", R"({"movements":[
          {"walk_to":{"position_m":[0,0,4],"heading_rad":0}},
          {"walk_to":{"position_m":[0,0,10],"heading_rad":0,"speed_m_s":1}},
          {"walk_to":{"position_m":[0,0,16],"heading_rad":0,"speed_m_s":3}},
          {"walk_to":{"position_m":[0,0,18],"heading_rad":0,"speed_m_s":0.06}}]})");
  const std::vector<std::string> arguments = {"synthesize", "builtin", "--choreography",
                                              choreography, "--out",   Out()};
  const ProgramResult text = Tool(arguments);
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out,
              AllOf(HasSubstr("; movements[2] walks at "),
                    HasSubstr(" m/s instead of 3 m/s: the library walks at "),
                    HasSubstr("; movements[3] walks at "), testing::Not(HasSubstr("movements[0]")),
                    testing::Not(HasSubstr("movements[1]"))));
  std::vector<std::string> json_arguments = arguments;
  json_arguments.push_back("--json");
  const json walks = ParseOutput(Tool(json_arguments).out)["walks"];
  ASSERT_EQ(walks.size(), 4u);
  EXPECT_TRUE(walks[0]["requested_m_s"].is_null());
  EXPECT_GT(walks[0]["speed_m_s"], 0.5);
  EXPECT_EQ(walks[0]["speed_note"], "");
  EXPECT_NEAR(walks[1]["speed_m_s"].get<double>(), 1.0, 0.12);
  EXPECT_EQ(walks[1]["speed_note"], "");
  EXPECT_EQ(walks[2]["requested_m_s"], 3.0);
  EXPECT_LT(walks[2]["speed_m_s"], 2.5);
  EXPECT_THAT(walks[2]["speed_note"].get<std::string>(), HasSubstr("the library walks at "));
  EXPECT_GT(walks[3]["speed_m_s"], 0.1);
  EXPECT_NE(walks[3]["speed_note"], "");
}

TEST_F(LibraryTool, SkipsExactStepsOutOfReach) {
  const std::string choreography =
      folder_.Write("c.json", R"({"movements":[{"step":{"length_m":0.5}},
                                 {"step":{"at_m":[0,0,7],"heading_rad":0,"exact_only":true}}]})");
  const std::vector<std::string> arguments = {"synthesize", "builtin", "--choreography",
                                              choreography, "--out",   Out()};
  const ProgramResult text = Tool(arguments);
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out, testing::HasSubstr(
                            "; movements[1] was skipped: the footprint is out of reach: the "));
  std::vector<std::string> json_arguments = arguments;
  json_arguments.push_back("--json");
  const json output = ParseOutput(Tool(json_arguments).out);
  ASSERT_EQ(output["skipped"].size(), 1u);
  const json& unreachable = output["skipped"][0];
  EXPECT_THAT(Keys(unreachable),
              testing::UnorderedElementsAre("request", "reason", "time_s", "nearest", "missed_m",
                                            "missed_rad", "requested", "reached"));
  EXPECT_EQ(unreachable["request"], 1);
  EXPECT_NEAR(
      unreachable["nearest"]["at_m"][2].get<double>() + unreachable["missed_m"].get<double>(), 7.0,
      0.1);
  EXPECT_TRUE(output["walks"].empty());
}

TEST_F(LibraryTool, ReportsMovementsTheLibraryDoesNotHave) {
  ASSERT_EQ(Tool({"build", "--out", Out(), "--kinds", "jump", kJumps}).exit_code, 0);
  const std::string choreography = folder_.Write(
      "c.json", R"({"movements":[{"jump":{"length_m":0.9}},{"step":{"length_m":0.5}}]})");
  ExpectFailure({"synthesize", Out(), "--choreography", choreography, "--out", Out("o.bvh")}, 2,
                "c.json: movements[1].step: ");
  const json report = ParseOutput(
      Tool({"synthesize", Out(), "--choreography", choreography, "--out", Out("o.bvh"), "--json"})
          .out);
  EXPECT_THAT(report["error"].get<std::string>(), HasSubstr("movements[1].step: "));
  ASSERT_EQ(report["refusals"].size(), 1u);
  EXPECT_EQ(report["refusals"][0]["request"], 1);
  EXPECT_THAT(report["refusals"][0]["reason"].get<std::string>(), HasSubstr("no such step"));
  EXPECT_FALSE(std::filesystem::exists(Out("o.bvh")));
}

TEST_F(LibraryTool, BuildsFromTheOtherFilesIfOneIsBad) {
  const std::string bad = folder_.Write("bad.bvh", "HIERARCHY\nROOT Hips\n{\nOFFSET 0 zero 0\n");
  const std::string none = folder_.File("none.bvh");
  const ProgramResult result = Tool({"build", "--out", Out(), "--json", none, kJumps, bad, kSteps});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, AllOf(HasSubstr(none + ": "), HasSubstr(bad + ":4: ")));
  const json report = ParseOutput(result.out);
  ASSERT_EQ(report["files"].size(), 4u);
  for (const std::size_t i : {0u, 2u}) EXPECT_TRUE(report["files"][i]["error"].is_string());
  for (const std::size_t i : {1u, 3u}) EXPECT_TRUE(report["files"][i]["error"].is_null());
  EXPECT_EQ(report["files"][0]["path"], none);
  EXPECT_EQ(report["files"][1]["jumps"], 10);
  EXPECT_GT(report["files"][3]["steps_left"], 5);
  EXPECT_TRUE(MotionLibrary::Open(Out()).has_value());

  const ProgramResult text = Tool({"build", "--out", Out(), none, kJumps, bad});
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, AllOf(HasSubstr(none + ": left out"), HasSubstr(bad + ": left out"),
                              HasSubstr("10 jumps")));
}

TEST_F(LibraryTool, BuildsTheSameBytesTwice) {
  const Arguments files = {kJumps, kSteps};
  for (const Arguments& options : {Arguments{}, Arguments{"--all"}, Arguments{"--mirror"}}) {
    ASSERT_EQ(Tool(Join(Join({"build", "--out", Out("a.swl")}, options), files)).exit_code, 0);
    ASSERT_EQ(Tool(Join(Join({"build", "--out", Out("b.swl")}, options), files)).exit_code, 0);
    EXPECT_FALSE(ReadWhole(Out("a.swl")).empty());
    EXPECT_EQ(ReadWhole(Out("a.swl")), ReadWhole(Out("b.swl")));
  }
  EXPECT_EQ(folder_.Count(), 2);
}

TEST_F(LibraryTool, BuildOptionsHaveTheirEffect) {
  const auto build = [&](const Arguments& options) {
    const ProgramResult result =
        Tool(Join(Join({"build", "--out", Out(), "--json"}, options), {kJumps, kSteps}));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return ParseOutput(result.out);
  };
  const auto examples = [](const json& report, const std::string& kind) {
    int count = 0;
    for (const json& group : report["library"]["groups"]) {
      if (group["kind"] == kind) count += group["examples"].get<int>();
    }
    return count;
  };
  const json plain = build({});
  const json all = build({"--all"});
  EXPECT_GT(examples(all, "step_left"), examples(plain, "step_left"));
  EXPECT_GT(examples(build({"--all", "--mirror"}), "step_left"), examples(all, "step_left"));
  EXPECT_EQ(examples(build({"--kinds", "step"}), "jump"), 0);
  EXPECT_EQ(examples(build({"--kinds", "jump"}), "step_left"), 0);
  EXPECT_EQ(examples(build({"--kinds", "jump"}), "jump"), examples(plain, "jump"));
  EXPECT_DOUBLE_EQ(build({"--unit-m", "0.05"})["files"][0]["unit_m"], 0.05);
  EXPECT_DOUBLE_EQ(build({"--fps", "100"})["files"][0]["fps"], 100.0);
  EXPECT_EQ(build({"--up", "y"}), plain) << "y is the up axis of these captures";
  EXPECT_EQ(build({"--left-ankle", "LeftFoot", "--right-ankle", "RightFoot", "--left-ball",
                   "LeftToeBase", "--right-ball", "RightToeBase"})["library"],
            plain["library"]);
  // With a wrong up axis the figure lies on the floor: the build fails or gives another library.
  const ProgramResult lying = Tool({"build", "--out", Out(), "--json", "--up", "x", kJumps});
  if (lying.exit_code == 0) {
    EXPECT_NE(ParseOutput(lying.out)["library"]["hash"], plain["library"]["hash"]);
  } else {
    EXPECT_EQ(lying.exit_code, 2);
  }
}

TEST_F(LibraryTool, BuildReportsAsOneJsonObject) {
  const ProgramResult result = Tool({"build", "--out", Out(), "--json", kJumps});
  ASSERT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, IsEmpty());
  const json report = ParseOutput(result.out);
  EXPECT_THAT(Keys(report),
              testing::UnorderedElementsAre("error", "files", "completion", "summary", "self_check",
                                            "notes", "selection", "library"));
  EXPECT_EQ(report["error"], nullptr);
  EXPECT_EQ(report["files"][0]["reason"], nullptr);
  for (const char* key : {"path", "frames", "fps", "unit_m", "steps_left", "steps_right", "jumps",
                          "rejected", "error"}) {
    EXPECT_THAT(Keys(report["files"][0]), Contains(key));
  }
  ASSERT_FALSE(report["files"][0]["rejected"].empty());
  for (const json& rejected : report["files"][0]["rejected"]) {
    EXPECT_THAT(Keys(rejected), testing::UnorderedElementsAre("from_s", "to_s", "reason"));
  }
  const ProgramResult inspected = Tool({"inspect", Out(), "--json"});
  EXPECT_EQ(report["summary"], ParseOutput(inspected.out)["summary"]);
  EXPECT_EQ(report["self_check"], ParseOutput(inspected.out)["self_check"]);
  EXPECT_EQ(report["library"], Groups(inspected.out));
}

TEST_F(LibraryTool, BuildReportsItsErrorsAsJsonToo) {
  const ProgramResult kinds = Tool({"build", "--out", Out(), "--json", "--kinds", "hop", kJumps});
  EXPECT_EQ(kinds.exit_code, 2);
  EXPECT_THAT(ParseOutput(kinds.out)["error"].get<std::string>(), HasSubstr("--kinds"));
  const std::string missing = folder_.File("no/such/folder/out");
  const ProgramResult out = Tool({"build", "--out", missing, "--json", kJumps});
  EXPECT_EQ(out.exit_code, 1);
  EXPECT_THAT(ParseOutput(out.out)["error"].get<std::string>(), HasSubstr(missing));
}

TEST_F(LibraryTool, BuildSaysWhyAFileYieldsNothing) {
  const ProgramResult result =
      Tool({"build", "--out", Out(), "--json", "--kinds", "jump", kJumps, kSteps});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = ParseOutput(result.out);
  EXPECT_EQ(report["files"][0]["reason"], nullptr);
  EXPECT_THAT(report["files"][1]["reason"].get<std::string>(), HasSubstr("--kinds"));
}

TEST_F(LibraryTool, BuildPrintsInTextWhatItReportsAsJson) {
  const Arguments arguments = {"build", "--out", Out(), kSteps};
  const ProgramResult text = Tool(arguments);
  ASSERT_EQ(text.exit_code, 0) << text.err;
  const json report = ParseOutput(Tool(Join(arguments, {"--json"})).out);
  for (const json& sentence : report["summary"]["sentences"]) {
    EXPECT_THAT(text.out, HasSubstr(sentence.get<std::string>()));
  }
  for (const json& missing : report["summary"]["missing"]) {
    EXPECT_THAT(text.out, HasSubstr(missing["what"].get<std::string>()));
  }
  EXPECT_THAT(text.out, HasSubstr(report["self_check"]["verdict"].get<std::string>()));
  ASSERT_FALSE(report["self_check"]["checks"].empty());
  for (const json& check : report["self_check"]["checks"]) {
    EXPECT_THAT(text.out, HasSubstr(check["text"].get<std::string>()));
  }
  ASSERT_FALSE(report["notes"].empty());
  for (const json& note : report["notes"]) {
    EXPECT_THAT(text.out, HasSubstr(note["text"].get<std::string>()));
  }
  for (const json& note : report["files"][0]["notes"]) {
    EXPECT_THAT(text.out, HasSubstr(note.get<std::string>()));
  }
}

TEST_F(LibraryTool, BuildCompletesLibrariesUnlessToldNotTo) {
  const Arguments arguments = {"build", "--out", Out(), kSteps};
  const json completed = ParseOutput(Tool(Join(arguments, {"--json"})).out);
  const json plain = ParseOutput(Tool(Join(arguments, {"--json", "--no-complete"})).out);
  const json& completion = completed["completion"];
  EXPECT_GT(completion["examples"].get<int>(), 0);
  EXPECT_THAT(completion["lacking"], Contains("steps backward"));
  EXPECT_GT(completed["summary"]["back_steps"]["left"]["completed"].get<int>(), 0);
  EXPECT_EQ(plain["completion"], nullptr);
  EXPECT_EQ(plain["summary"]["steps"]["completed"], 0);
  // Captured groups keep their examples. Figures differ in the last digits, because the root is
  // stored relative to the stand pose, which may be a composed one.
  const std::size_t captured = plain["library"]["groups"].size();
  ASSERT_GT(completed["library"]["groups"].size(), captured);
  for (std::size_t g = 0; g < captured; ++g) {
    for (const char* key : {"kind", "examples", "duration_s"}) {
      EXPECT_EQ(completed["library"]["groups"][g][key], plain["library"]["groups"][g][key]) << key;
    }
  }
  const ProgramResult text = Tool(arguments);
  for (const json& sentence : completion["sentences"]) {
    EXPECT_THAT(text.out, HasSubstr(sentence.get<std::string>()));
  }
  ASSERT_EQ(Tool(arguments).exit_code, 0);
  EXPECT_THAT(Tool({"inspect", Out(), "--examples"}).out, HasSubstr("completed step"));
}

TEST_F(LibraryTool, BuildCanSkipTheSelfCheck) {
  const Arguments arguments = {"build", "--out", Out(), "--no-self-check", kJumps};
  EXPECT_THAT(Tool(arguments).out, Not(HasSubstr("elf-check")));
  const json report = ParseOutput(Tool(Join(arguments, {"--json"})).out);
  EXPECT_EQ(report["self_check"], nullptr);
  EXPECT_TRUE(report["summary"].is_object());
}

// A captured library does not have steps of every length. Whatever the planner chooses instead, a
// step that lands far from its request is listed.
TEST_F(LibraryTool, ShortStepsWithLongStridesAreListed) {
  const std::string choreography =
      folder_.Write("c.json",
                    R"({"movements":[{"step":{"length_m":0.28}},{"step":{"length_m":0.28}},
                       {"step":{"length_m":0.28}},
                       {"step":{"length_m":1.2,"allow_nearest":true}}]})");
  ASSERT_EQ(Tool({"build", "--out", Out(), kJumps}).exit_code, 0);
  const ProgramResult result =
      Tool({"synthesize", Out(), "--choreography", choreography, "--out", Out("o.bvh"), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json output = ParseOutput(result.out);
  std::vector<json> listed;
  for (const json& refusal : output["refusals"]) listed.push_back(refusal["request"]);
  int checked = 0;
  for (const json& movement : output["movements"]) {
    if (movement["request"].is_null() || !movement.contains("landing_error_m")) continue;
    if (movement["landing_error_m"].get<double>() < 0.25) continue;
    EXPECT_THAT(listed, Contains(movement["request"]));
    ++checked;
  }
  EXPECT_GE(checked, 1);
}

TEST_F(LibraryTool, SynthesisListsRequestsThatWereNotMet) {
  const std::string choreography = folder_.Write(
      "c.json",
      R"({"movements":[{"step":{"length_m":0.5}},{"step":{"length_m":1.5,"allow_nearest":true}},
                       {"step":{"length_m":1.5}}]})");
  const Arguments arguments = {"synthesize", "builtin", "--choreography",
                               choreography, "--out",   Out("o.bvh")};
  const ProgramResult text = Tool(arguments);
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, HasSubstr("movements[1] missed its request"));
  EXPECT_THAT(text.out, Not(HasSubstr("movements[0]")));
  const json refusals = ParseOutput(Tool(Join(arguments, {"--json"})).out)["refusals"];
  ASSERT_EQ(refusals.size(), 2u);
  EXPECT_EQ(refusals[0]["request"], 1);
  EXPECT_EQ(refusals[0]["asked"]["length_m"], 1.5);
  EXPECT_LT(refusals[0]["got"]["length_m"], 1.0);
  EXPECT_THAT(text.out, HasSubstr(refusals[0]["reason"].get<std::string>()));
  EXPECT_EQ(refusals[1]["request"], 2);
  EXPECT_EQ(refusals[1]["asked"]["length_m"], 1.5);
  EXPECT_NEAR(refusals[1]["got"]["length_m"], refusals[0]["got"]["length_m"], 0.1);
  EXPECT_THAT(text.out,
              HasSubstr("movements[2] was skipped: the step is out of reach: requested length"));
}

TEST_F(LibraryTool, BuildReportsTheFateOfEveryExample) {
  const auto build = [&](const Arguments& options) {
    const ProgramResult result =
        Tool(Join(Join({"build", "--out", Out(), "--json"}, options), {kJumps, kSteps}));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return ParseOutput(result.out);
  };
  const auto stored = [](const json& report) {
    int count = 0;
    for (const json& group : report["library"]["groups"]) count += group["examples"].get<int>();
    return count;
  };
  const json report = build({});
  ASSERT_EQ(report["selection"].size(), report["library"]["groups"].size());
  for (std::size_t g = 0; g < report["selection"].size(); ++g) {
    const json& selection = report["selection"][g];
    EXPECT_EQ(selection["kind"], report["library"]["groups"][g]["kind"]);
    EXPECT_EQ(selection["found"].get<std::size_t>(), selection["examples"].size());
    std::map<std::string, int> fates;
    std::set<int> examples;
    for (const json& example : selection["examples"]) {
      const std::string fate = example["fate"];
      ++fates[fate];
      EXPECT_FALSE(example["source"].get<std::string>().empty());
      EXPECT_FALSE(example["reason"].get<std::string>().empty());
      EXPECT_EQ(example["example"].is_null(), fate == "redundant" || fate == "outlier");
      EXPECT_NE(example["example"].is_null(), example["error_m"].is_null());
      if (!example["example"].is_null()) examples.insert(example["example"].get<int>());
    }
    for (const char* fate : {"kept", "averaged", "redundant", "outlier"}) {
      EXPECT_EQ(selection[fate], fates[fate]);
    }
    EXPECT_EQ(report["library"]["groups"][g]["examples"].get<std::size_t>(), examples.size());
  }
  EXPECT_LT(stored(build({"--max-pose-error-m", "0.1"})), stored(report));
  EXPECT_GT(stored(build({"--max-pose-error-m", "0"})),
            stored(build({"--max-pose-error-m", "0.1"})));
  ExpectFailure({"build", "--out", Out(), "--max-pose-error-m", "-1", kSteps}, 2,
                "--max-pose-error-m");
  ExpectFailure({"build", "--out", Out(), "--max-pose-error-m", "0.02", "--all", kSteps}, 2,
                "--all");
}

TEST_F(LibraryTool, InspectsAsOneJsonObject) {
  for (const bool examples : {false, true}) {
    Arguments arguments = {"inspect", "builtin", "--json"};
    if (examples) arguments.push_back("--examples");
    const ProgramResult result = Tool(arguments);
    ASSERT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.err, IsEmpty());
    const json report = ParseOutput(result.out);
    EXPECT_EQ(report["format_version"], MotionLibrary::kFormatVersion);
    EXPECT_EQ(report["hash"].get<std::string>().size(), 32u);
    EXPECT_GT(report["bytes"], 1000);
    EXPECT_EQ(report["skeleton"]["joints"].get<std::size_t>(), report["skeleton"]["names"].size());
    for (const char* foot : {"left_foot", "right_foot"}) {
      EXPECT_THAT(report["skeleton"]["names"].get<std::vector<std::string>>(),
                  Contains(report["skeleton"][foot].get<std::string>()));
    }
    ASSERT_EQ(report["groups"].size(), 13u);
    for (const json& group : report["groups"]) {
      for (const char* key : {"kind", "examples", "pseudoexamples", "parameters", "duration_s",
                              "error_m", "corrected_error_m"}) {
        EXPECT_THAT(Keys(group), Contains(key));
      }
      EXPECT_THAT(Keys(group["parameters"][0]),
                  testing::UnorderedElementsAre("name", "min", "max", "scale"));
      EXPECT_THAT(Keys(group["error_m"]),
                  testing::UnorderedElementsAre("max", "mean", "min", "samples"));
      EXPECT_THAT(Keys(group["corrected_error_m"]),
                  testing::UnorderedElementsAre("max", "mean", "iterations"));
      EXPECT_THAT(Keys(group["weights"]), testing::UnorderedElementsAre("sum_max", "condition"));
      EXPECT_FALSE(group.contains("unrefined_error_m"));
      EXPECT_EQ(group.contains("sites"), examples);
      if (!examples) continue;
      EXPECT_EQ(group["sites"].size(), group["examples"].get<std::size_t>());
      EXPECT_EQ(group["dilations"].size(), group["sites"].size());
      EXPECT_EQ(group["centre"].size(), group["parameters"].size());
      EXPECT_THAT(Keys(group["sites"][0]),
                  testing::UnorderedElementsAre("parameters", "source", "mirrored", "keytimes_s",
                                                "pseudoexample", "weights"));
    }
  }
}

TEST_F(LibraryTool, InspectsAsText) {
  const ProgramResult result = Tool({"inspect", "builtin", "--examples"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, AllOf(HasSubstr("step_left, 15 examples"), HasSubstr("start_z_m"),
                                HasSubstr("jump, 4 examples")));
  EXPECT_THAT(Tool({"inspect", "builtin"}).out, Not(HasSubstr("(mirrored)")));
}

TEST_F(LibraryTool, InspectPrintsTransitions) {
  const json shown = ParseOutput(Tool({"inspect", "builtin", "--json"}).out);
  const std::size_t nodes = shown["groups"].size() + 1;
  ASSERT_EQ(shown["transitions"].size(), nodes * nodes);
  const json& first = shown["transitions"][0];
  EXPECT_EQ(first["from"], "step_left");
  EXPECT_EQ(first["from_group"], 0);
  EXPECT_EQ(first["to_group"], 0);
  const json& last = shown["transitions"][nodes * nodes - 1];
  EXPECT_EQ(last["from"], "stand");
  EXPECT_TRUE(last["to_group"].is_null());
  EXPECT_EQ(last["distance_m"], 0.0);
  EXPECT_THAT(Tool({"inspect", "builtin"}).out,
              AllOf(HasSubstr("step_left  to jump"), HasSubstr("jump       to stand"),
                    HasSubstr("stand      to step_right"), Not(HasSubstr("stand      to stand"))));
}

constexpr const char* kStepsOnly =
    R"({"movements":[{"step":{"length_m":0.5}},{"step":{"length_m":0.4}}]})";

constexpr const char* kWalk =
    R"({"start":{"position_m":[1,0,2],"heading_rad":0.5},
        "movements":[{"step":{"length_m":0.6}},{"step":{"length_m":0.6,"foot":"right"}},
                     {"stand":{"seconds":0.3}},{"jump":{"length_m":0.9}}]})";

TEST_F(LibraryTool, SynthesizesTheSameBytesTwice) {
  const std::string choreography = folder_.Write("c.json", kWalk);
  Arguments arguments = {"synthesize", "builtin", "--choreography",
                         choreography, "--json",  "--out"};
  const ProgramResult first = Tool(Join(arguments, {Out("a.bvh")}));
  const ProgramResult second = Tool(Join(arguments, {Out("b.bvh")}));
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_EQ(first.out, second.out);
  EXPECT_FALSE(ReadWhole(Out("a.bvh")).empty());
  EXPECT_EQ(ReadWhole(Out("a.bvh")), ReadWhole(Out("b.bvh")));
  EXPECT_EQ(folder_.Count(), 3);
}

TEST_F(LibraryTool, TheSeedSelectsHowEqualStepsVary) {
  const std::string choreography = folder_.Write("c.json", kStepsOnly);
  const auto motion = [&](const Arguments& options) {
    const ProgramResult result = Tool(
        Join({"synthesize", "builtin", "--choreography", choreography, "--out", Out()}, options));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return ReadWhole(Out());
  };
  EXPECT_EQ(motion({"--seed", "1"}), motion({"--seed", "1"}));
  EXPECT_NE(motion({"--seed", "1"}), motion({"--seed", "2"}));
  EXPECT_EQ(motion({"--seed", "1", "--no-variation", "--no-idle"}),
            motion({"--seed", "2", "--no-variation", "--no-idle"}));
}

TEST_F(LibraryTool, SynthesisReportMatchesTheBvhFile) {
  const std::string choreography = folder_.Write("c.json", kWalk);
  const ProgramResult result = Tool({"synthesize", "builtin", "--choreography", choreography,
                                     "--out", Out("o.bvh"), "--fps", "50", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, IsEmpty());
  const json report = ParseOutput(result.out);
  EXPECT_EQ(report["fps"], 50.0);
  const Expected<Capture> capture = ReadBvh(Out("o.bvh"));
  ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
  EXPECT_EQ(report["frames"], capture->clip.frame_count());
  EXPECT_EQ(capture->clip.fps, 50.0);
  double before_s = 0.0;
  for (const json& movement : report["movements"]) {
    for (const char* key : {"kind", "start_s", "end_s", "base"}) {
      EXPECT_THAT(Keys(movement), Contains(key));
    }
    EXPECT_GE(movement["start_s"], before_s - 1e-9);
    EXPECT_GT(movement["end_s"], movement["start_s"]);
    before_s = movement["end_s"];
    if (movement["kind"] == "stand") continue;
    for (const char* key : {"keytimes_s", "requested", "applied", "corrected", "measured",
                            "extrapolated", "group", "weights", "plants"}) {
      EXPECT_THAT(Keys(movement), Contains(key));
    }
    EXPECT_DOUBLE_EQ(movement["keytimes_s"].front(), movement["start_s"]);
    double sum = 0.0;
    for (const json& weight : movement["weights"]) sum += weight.get<double>();
    EXPECT_NEAR(sum, 1.0, 1e-5);
  }
  std::vector<std::string> kinds;
  for (const json& movement : report["movements"]) {
    if (!movement["request"].is_null()) kinds.push_back(movement["kind"]);
  }
  ASSERT_EQ(kinds.size(), 4u);
  EXPECT_THAT(kinds[0], StartsWith("step_"));
  EXPECT_EQ(kinds[1], "step_right");
  EXPECT_EQ(kinds[2], "stand");
  EXPECT_EQ(kinds[3], "jump");

  const ProgramResult text =
      Tool({"synthesize", "builtin", "--choreography", choreography, "--out", Out("o.bvh")});
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, HasSubstr("movements"));
}

// A request uses the group that covers it best. The report contains this group, whether the request
// extrapolates and, outside the hull grown by 10 %, the parameters that were applied instead.
TEST_F(LibraryTool, ReportsTheGroupOfEachStepAndExtrapolation) {
  const json groups =
      ParseOutput(Tool({"inspect", "builtin", "--json", "--examples"}).out)["groups"];
  const auto play = [&](const std::string& step) {
    const std::string choreography =
        folder_.Write("c.json", "{\"movements\":[{\"step\":" + step + "}]}");
    const ProgramResult result = Tool(
        {"synthesize", "builtin", "--choreography", choreography, "--out", Out("o.bvh"), "--json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const json report = ParseOutput(result.out);
    for (const json& movement : report["movements"]) {
      if (!movement["request"].is_null()) return movement;
    }
    return json();
  };
  const auto has = [&](const json& movement, const char* name) {
    return std::ranges::any_of(groups[movement["group"].get<std::size_t>()]["parameters"],
                               [&](const json& parameter) { return parameter["name"] == name; });
  };

  const json inside = play(R"({"foot":"left","length_m":0.5})");
  EXPECT_FALSE(inside["extrapolated"]);
  EXPECT_FALSE(inside["clamped"]);
  EXPECT_FALSE(has(inside, "turn_rad"));
  EXPECT_EQ(inside["requested"], inside["applied"]);

  const json turned = play(R"({"foot":"left","length_m":0.4,"turn_rad":0.4})");
  EXPECT_TRUE(has(turned, "turn_rad"));
  EXPECT_FALSE(turned["clamped"]);
  EXPECT_NEAR(turned["applied"]["turn_rad"], 0.4, 1e-9);

  const json up = play(R"({"foot":"left","length_m":0.4,"height_m":0.2})");
  EXPECT_TRUE(has(up, "end_y_m"));
  EXPECT_NEAR(up["applied"]["end_y_m"], 0.2, 1e-6);

  const json aside = play(R"({"foot":"left","length_m":0,"side_m":0.3})");
  EXPECT_TRUE(has(aside, "end_x_m"));
  EXPECT_FALSE(has(aside, "end_y_m"));

  EXPECT_TRUE(play(R"({"foot":"left","length_m":3})").is_null());
  const json far = play(R"({"foot":"left","length_m":3,"allow_nearest":true})");
  EXPECT_TRUE(far["extrapolated"]);
  EXPECT_TRUE(far["clamped"]);
  EXPECT_NEAR(far["requested"]["end_z_m"], 3.0, 1e-9);
  double longest = 0.0;
  double mean = 0.0;
  const json& sites = groups[far["group"].get<std::size_t>()]["sites"];
  const json& names = groups[far["group"].get<std::size_t>()]["parameters"];
  std::size_t end_z = 0;
  while (names[end_z]["name"] != "end_z_m") ++end_z;
  for (const json& site : sites) {
    const double value = site["parameters"][end_z];
    longest = std::max(longest, value);
    mean += value / static_cast<double>(sites.size());
  }
  EXPECT_GT(far["applied"]["end_z_m"], 0.8 * longest);
  EXPECT_LE(far["applied"]["end_z_m"], longest + 0.1 * (longest - mean) + 1e-6);
}

TEST_F(LibraryTool, RefinesAndReportsAsOneJsonObject) {
  ASSERT_EQ(Tool({"build", "--out", Out("in.swl"), kSteps}).exit_code, 0);
  const Arguments arguments = {"refine", Out("in.swl"), "--json", "--max-pseudoexamples",
                               "2",      "--out"};
  const ProgramResult result = Tool(Join(arguments, {Out()}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, IsEmpty());
  const json report = ParseOutput(result.out);
  EXPECT_THAT(Keys(report),
              testing::UnorderedElementsAre("rule", "max_error_m", "groups", "library"));
  int pseudoexamples = 0;
  for (std::size_t g = 0; g < report["groups"].size(); ++g) {
    const json& group = report["groups"][g];
    for (const char* when : {"before", "after"}) {
      EXPECT_THAT(Keys(group[when]),
                  testing::UnorderedElementsAre("error_m", "weight_sum_max", "condition"));
      EXPECT_THAT(Keys(group[when]["error_m"]),
                  testing::UnorderedElementsAre("min", "mean", "max"));
    }
    EXPECT_LE(group["max_error_curve_m"].back(), group["max_error_curve_m"].front());
    EXPECT_EQ(group["max_error_curve_m"].size(), group["pseudoexamples"].get<std::size_t>() + 1);
    EXPECT_LE(group["pseudoexamples"], 2);
    pseudoexamples += group["pseudoexamples"].get<int>();
  }
  EXPECT_GT(pseudoexamples, 0);

  // Repeating the command gives the same bytes.
  EXPECT_EQ(Tool(Join(arguments, {Out("again.swl")})).out, result.out);
  EXPECT_EQ(ReadWhole(Out("again.swl")), ReadWhole(Out()));
  EXPECT_EQ(folder_.Count(), 3);

  // inspect prints the pseudoexamples.
  const ProgramResult inspected = Tool({"inspect", Out(), "--json"});
  EXPECT_EQ(report["library"], Groups(inspected.out));
  const json shown = ParseOutput(Tool({"inspect", Out(), "--json", "--examples"}).out);
  int sites = 0;
  for (const json& group : shown["groups"]) {
    EXPECT_EQ(group.contains("unrefined_error_m"), group["pseudoexamples"] > 0);
    for (const json& site : group["sites"]) {
      if (!site["pseudoexample"]) continue;
      ++sites;
      double sum = 0.0;
      for (const json& weight : site["weights"]) sum += weight.get<double>();
      EXPECT_NEAR(sum, 1.0, 1e-9);
      EXPECT_TRUE(site["source"].is_null());
    }
  }
  EXPECT_EQ(sites, pseudoexamples);
  EXPECT_THAT(
      Tool({"inspect", Out(), "--examples"}).out,
      AllOf(HasSubstr("pseudoexamples; without them error"), HasSubstr("  pseudoexample\n")));
  const std::string choreography = folder_.Write("c.json", kStepsOnly);
  EXPECT_EQ(
      Tool({"synthesize", Out(), "--choreography", choreography, "--out", Out("o.bvh")}).exit_code,
      0);
}

TEST_F(LibraryTool, AddsLayersAndReportsThem) {
  const std::string base = Out("base.swl");
  const std::string out = Out("layers.swl");
  ASSERT_EQ(Tool({"build", "--out", base, "--kinds", "jump", kJumps}).exit_code, 0);
  const ProgramResult made =
      Tool({"add-layers", base, "--out", out, "--json", "--layer", std::string("sway=") + kSteps,
            "--layer-once", std::string("reach=") + kSteps + ":2:3.5"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const json layers = ParseOutput(made.out)["layers"];
  ASSERT_EQ(layers.size(), 2u);
  EXPECT_EQ(layers[0]["name"], "sway");
  EXPECT_EQ(layers[0]["loop"], true);
  EXPECT_EQ(layers[1]["name"], "reach");
  EXPECT_EQ(layers[1]["loop"], false);
  EXPECT_NEAR(layers[1]["duration_s"].get<double>(), 1.5, 1e-6);
  EXPECT_EQ(layers[1]["source"], "01_03.bvh 2.00-3.50 s");
  EXPECT_FALSE(layers[0]["mask"].contains("Hips"));
  EXPECT_FALSE(layers[0]["mask"].contains("LeftLeg"));
  EXPECT_EQ(layers[0]["mask"]["LeftHand"], 1.0);
  EXPECT_EQ(ParseOutput(Tool({"inspect", out, "--json"}).out)["layers"], layers);

  // A layer with the same name replaces the old one, here with other joints.
  const std::string again = Out("again.swl");
  ASSERT_EQ(Tool({"add-layers", out, "--out", again, "--layer", std::string("sway=") + kSteps,
                  "--layer-joints", "LeftArm,RightArm"})
                .exit_code,
            0);
  const json replaced = ParseOutput(Tool({"inspect", again, "--json"}).out)["layers"];
  ASSERT_EQ(replaced.size(), 2u);
  EXPECT_EQ(replaced[0]["name"], "reach");
  EXPECT_TRUE(replaced[1]["mask"].contains("LeftHand"));
  EXPECT_FALSE(replaced[1]["mask"].contains("Spine"));

  const Arguments add = {"add-layers", base, "--out", Out("no.swl")};
  ExpectFailure(add, 2, "at least one --layer");
  ExpectFailure(Join(add, {"--layer", "sway"}), 2, "sway");
  ExpectFailure(Join(add, {"--layer", "sway=missing.bvh"}), 2, "missing.bvh");
  ExpectFailure(Join(add, {"--layer", std::string("two words=") + kSteps}), 2, "two words");
  ExpectFailure(Join(add, {"--layer", std::string("sway=") + kSteps + ":5:5000"}), 2,
                "outside the capture");
  ExpectFailure(Join(add, {"--layer", std::string("sway=") + kSteps, "--layer-joints", "LeftLeg"}),
                2, "LeftLeg");
  ExpectFailure(Join(add, {"--layer", std::string("sway=") + kSteps, "--layer-joints", "Tail"}), 2,
                "Tail");
  ExpectFailure(
      {"add-layers", "builtin", "--out", Out("no.swl"), "--layer", std::string("sway=") + kSteps},
      2, "another skeleton");
  EXPECT_FALSE(std::filesystem::exists(Out("no.swl")));
}

TEST_F(LibraryTool, RefinesWithTheRequestedRule) {
  ASSERT_EQ(Tool({"build", "--out", Out("in.swl"), kSteps}).exit_code, 0);
  for (const char* rule : {"amended", "bare"}) {
    const ProgramResult result = Tool({"refine", Out("in.swl"), "--out", Out(rule), "--rule", rule,
                                       "--max-error-m", "0.02", "--max-pseudoexamples", "4"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.out, AllOf(HasSubstr("before  error"), HasSubstr("after   error")));
  }
  EXPECT_NE(ReadWhole(Out("amended")), ReadWhole(Out("bare")));
}

TEST_F(LibraryTool, RefineRejectsInvalidArguments) {
  const std::string damaged = folder_.Write("damaged.swl", "STRDWSWL without a payload");
  ExpectFailure({"refine", damaged, "--out", Out()}, 2, "damaged.swl");
  ExpectFailure({"refine", "missing.swl", "--out", Out()}, 2, "missing.swl");
  ExpectFailure({"refine", damaged, "--out", damaged}, 2, "--out");
  ExpectFailure({"refine", "builtin"}, 2, "--out");
  ExpectFailure({"refine", "builtin", "--out", Out(), "--rule", "other"}, 2, "--rule");
  ExpectFailure({"refine", "builtin", "--out", Out(), "--max-error-m", "-1"}, 2, "--max-error-m");
  ExpectFailure({"refine", "builtin", "--out", Out(), "--max-pseudoexamples", "1025"}, 2,
                "--max-pseudoexamples");
  ExpectFailure({"refine", "builtin", "--out", folder_.File("no/where.swl")}, 1, "folder");
  EXPECT_EQ(folder_.Count(), 1);
}

TEST_F(LibraryTool, LeavesNoPartialFileWhenInterrupted) {
  test::ChildProcess refining(
      STRIDEWIRE_LIBRARY_TOOL,
      {"refine", "builtin", "--out", Out(), "--max-error-m", "0", "--max-pseudoexamples", "1024"});
  // Waits until the program catches SIGINT, which happens long before it can finish.
  const std::string status = "/proc/" + std::to_string(refining.pid()) + "/status";
  const auto catches = [&] {
    std::ifstream file(status);
    for (std::string line; std::getline(file, line);) {
      if (!line.starts_with("SigCgt:")) continue;
      return (std::stoull(line.substr(7), nullptr, 16) >> (SIGINT - 1) & 1) != 0;
    }
    return false;
  };
  for (int i = 0; i < 3000 && !catches(); ++i) usleep(10'000);
  ASSERT_TRUE(catches());
  refining.Signal(SIGINT);
  EXPECT_EQ(refining.Wait(), 1);
  EXPECT_EQ(folder_.Count(), 0);
}

TEST_F(LibraryTool, CorrectsParametersUnlessDisabled) {
  const std::string choreography = folder_.Write("c.json", kWalk);
  const Arguments arguments = {"synthesize", "builtin", "--choreography", choreography,
                               "--json",     "--out",   Out("o.bvh")};
  for (const bool corrected : {true, false}) {
    const ProgramResult result = Tool(corrected ? arguments : Join(arguments, {"--no-correction"}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json report = ParseOutput(result.out);
    double largest_miss = 0.0;
    bool all_as_applied = true;
    for (const json& movement : report["movements"]) {
      if (movement["kind"] == "stand") continue;
      all_as_applied = all_as_applied && movement["corrected"] == movement["applied"];
      for (const auto& [name, value] : movement["applied"].items()) {
        largest_miss = std::max(largest_miss, std::fabs(value.get<double>() -
                                                        movement["measured"][name].get<double>()));
      }
    }
    EXPECT_EQ(all_as_applied, !corrected);
    if (corrected) {
      EXPECT_LT(largest_miss, 1e-4);
    } else {
      EXPECT_GT(largest_miss, 1e-4);
    }
  }
}

TEST_F(LibraryTool, ExportsExamplesThatTheReaderAccepts) {
  ASSERT_EQ(Tool({"build", "--out", Out(), kJumps}).exit_code, 0);
  for (const std::string& name : {std::string("builtin"), Out()}) {
    SCOPED_TRACE(name);
    const std::string out = folder_.File("examples of " + name.substr(name.size() - 3));
    const ProgramResult result = Tool({"export-capture", name, "--out", out});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const auto library = OpenLibrary(name);
    ASSERT_TRUE(library.has_value());
    std::size_t examples = 0;
    for (const MotionGroup& group : (*library)->groups()) {
      examples += static_cast<std::size_t>(group.example_count);
    }
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(out)) {
      SCOPED_TRACE(entry.path().string());
      ++files;
      const Expected<Capture> capture = ReadBvh(entry.path());
      ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
      const Skeleton& skeleton = (*library)->skeleton();
      ASSERT_EQ(capture->skeleton.joint_count(), skeleton.joint_count());
      for (std::size_t j = 0; j < skeleton.joints.size(); ++j) {
        EXPECT_EQ(capture->skeleton.joints[j].name, skeleton.joints[j].name);
        EXPECT_EQ(capture->skeleton.joints[j].parent, skeleton.joints[j].parent);
      }
      EXPECT_GT(capture->clip.frame_count(), 10);
    }
    EXPECT_EQ(files, examples);
  }
}

TEST_F(LibraryTool, FailsIfStdoutCannotBeWritten) {
  // Redirects stdout to a device that is always full.
  const ProgramResult result = test::RunProgram(
      "/bin/sh", {"-c", "exec \"$0\" inspect builtin --json >/dev/full", STRIDEWIRE_LIBRARY_TOOL});
  EXPECT_EQ(result.exit_code, 1);
  ExpectSentence(result.err, "cannot write");
}

// In the rest pose of these files, the figure does not stand, so the reader derives the up axis
// from each motion. One figure lies on a table all the time, which suggests a wrong axis.
TEST_F(LibraryTool, FilesOfABuildAgreeOnTheirUpAxis) {
  test::BvhText figure;
  figure.folded = true;
  const std::string standing = figure.Text();
  std::string lying = standing;
  std::size_t row = lying.find('\n', lying.find("Frame Time")) + 1;
  for (; row < lying.size(); row = lying.find('\n', row) + 1) {
    std::size_t end = row;  // The first six numbers of the row are those of the root.
    for (int number = 0; number < 6; ++number) end = lying.find(' ', end + 1);
    lying.replace(row, end - row, "0 1 1.5 0 -90 0");
  }
  std::ofstream(folder_.File("lying.bvh")) << lying;
  std::ofstream(folder_.File("a.bvh")) << standing;
  std::ofstream(folder_.File("b.bvh")) << standing;
  const auto notes_of_lying = [&](const Arguments& others) {
    const ProgramResult result =
        Tool(Join({"build", "--json", "--out", Out(), folder_.File("lying.bvh")}, others));
    const json files = ParseOutput(result.out)["files"];
    EXPECT_EQ(files.size(), 1 + others.size());
    EXPECT_EQ(files[0]["path"], folder_.File("lying.bvh"));
    return files[0]["notes"].dump();
  };
  EXPECT_THAT(notes_of_lying({}), HasSubstr("the up axis of the file is -z"));
  const std::string agreed = notes_of_lying({folder_.File("a.bvh"), folder_.File("b.bvh")});
  EXPECT_THAT(agreed, HasSubstr("up is taken as +y like in other files with these joints"));
  EXPECT_THAT(agreed, Not(HasSubstr("the up axis of the file is")));
}

}  // namespace
}  // namespace stridewire
