// Runs `stridewire-library report` as a program and checks its figures, files and errors.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "child_process.h"
#include "run_program.h"
#include "scratch_folder.h"

namespace stridewire {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::ReadWhole;
using test::ScratchFolder;
using testing::HasSubstr;
using testing::Not;

ProgramResult Report(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "report");
  return test::RunProgram(STRIDEWIRE_LIBRARY_TOOL, arguments, 280);
}

std::set<std::string> FilesIn(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  return names;
}

// Checks that tags are closed in order.
testing::AssertionResult IsWellFormed(const std::string& xml,
                                      std::set<std::string> void_tags = {}) {
  std::vector<std::string> open;
  for (std::size_t at = 0; (at = xml.find('<', at)) != std::string::npos;) {
    const bool is_comment = xml.compare(at, 4, "<!--") == 0;
    const std::size_t end = is_comment ? xml.find("-->", at) : xml.find('>', at);
    if (end == std::string::npos) return testing::AssertionFailure() << "unclosed tag at " << at;
    const std::string tag = xml.substr(at + 1, end - at - 1);
    at = end + 1;
    if (tag.empty() || tag[0] == '!' || tag[0] == '?' || tag.back() == '/') continue;
    const std::string name = tag.substr(0, tag.find_first_of(" \t\n"));
    if (name[0] != '/') {
      if (!void_tags.contains(name)) open.push_back(name);
      continue;
    }
    if (open.empty() || "/" + open.back() != name) {
      return testing::AssertionFailure()
             << "<" << name << "> closes a tag that is not open, at " << at;
    }
    open.pop_back();
  }
  if (!open.empty())
    return testing::AssertionFailure() << "<" << open.back() << "> is never closed";
  return testing::AssertionSuccess();
}

// Uses the steps of one capture, whose figures take only seconds to draw.
class LibraryReport : public testing::Test {
 protected:
  void SetUp() override {
    const char* steps = "/usr/share/assimp/models/BVH/01_03.bvh";
    const ProgramResult built =
        test::RunProgram(STRIDEWIRE_LIBRARY_TOOL, {"build", "--out", library_, steps});
    ASSERT_EQ(built.exit_code, 0) << built.err;
  }

  const ScratchFolder folder_;
  const std::string library_ = folder_.File("a & b.swl");
};

TEST_F(LibraryReport, IsDeterministic) {
  const std::string out = folder_.File("report");
  const ProgramResult result =
      Report({library_, "--out", out, "--max-pseudoexamples", "3", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  const json output = json::parse(result.out);
  std::set<std::string> files;
  for (const json& file : output["files"]) files.insert(file.get<std::string>());
  EXPECT_EQ(FilesIn(out), files);
  for (std::size_t g = 0; g < output["groups"].size(); ++g) {
    const json& group = output["groups"][g];
    EXPECT_LE(group["after"]["error_m"]["max"], group["before"]["error_m"]["max"]);
    EXPECT_LE(group["corrected_error_m"]["mean"], group["before"]["error_m"]["mean"]);
    const std::string prefix = std::to_string(g) + "_" + group["kind"].get<std::string>() + "_";
    for (const char* kind : {"error", "pseudoexamples", "examples", "sites", "joints", "timing"}) {
      EXPECT_TRUE(files.contains(prefix + kind + ".svg")) << prefix << kind;
    }
  }

  const std::string page = ReadWhole(std::filesystem::path(out) / "index.html");
  EXPECT_TRUE(IsWellFormed(page, {"meta", "img"}));
  EXPECT_THAT(page, HasSubstr("a &amp; b.swl"));
  // The page opens with the verdict and a table of contents whose links all exist.
  const std::size_t verdict = page.find(output["self_check"]["verdict"].get<std::string>());
  const std::size_t contents = page.find("<nav");
  ASSERT_NE(contents, std::string::npos);
  EXPECT_LT(verdict, contents);
  EXPECT_LT(contents, page.find("<h2 id="));
  int links = 0;
  for (std::size_t at = contents; (at = page.find("href=\"#", at)) != std::string::npos; ++at) {
    const std::string id = page.substr(at + 7, page.find('"', at + 7) - at - 7);
    EXPECT_THAT(page, HasSubstr("<h2 id=\"" + id + "\">"));
    ++links;
  }
  EXPECT_GE(links, 6);
  for (const json& sentence : output["summary"]["sentences"]) {
    EXPECT_THAT(page, HasSubstr(sentence.get<std::string>()));
  }
  for (const json& check : output["self_check"]["checks"]) {
    EXPECT_THAT(page, HasSubstr(check["title"].get<std::string>()));
  }
  for (const char* term : {"Pseudoexample", "Condition", "Generic time", "Hull"}) {
    EXPECT_THAT(page, HasSubstr(std::string("<dt>") + term + "</dt>"));
  }
  EXPECT_THAT(page, Not(HasSubstr("http")));  // The page is self-contained.
  std::size_t pictures = 0;
  for (std::size_t at = 0; (at = page.find("<img ", at)) != std::string::npos; ++at) ++pictures;
  EXPECT_EQ(pictures + 1, files.size());
  for (const std::string& file : files) {
    if (!file.ends_with(".svg")) continue;
    SCOPED_TRACE(file);
    const std::string svg = ReadWhole(std::filesystem::path(out) / file);
    EXPECT_THAT(svg, testing::StartsWith("<?xml"));
    EXPECT_TRUE(IsWellFormed(svg));
  }

  const std::string again = folder_.File("again");
  ASSERT_EQ(Report({library_, "--out", again, "--max-pseudoexamples", "3"}).exit_code, 0);
  ASSERT_EQ(FilesIn(again), files);
  for (const std::string& file : files) {
    EXPECT_EQ(ReadWhole(std::filesystem::path(out) / file),
              ReadWhole(std::filesystem::path(again) / file))
        << file;
  }
}

TEST_F(LibraryReport, MeasuresRealismOnCaptures) {
  const ProgramResult result =
      Report({library_, "--out", folder_.File("report"), "--max-pseudoexamples", "0", "--captures",
              "/usr/share/assimp/models/BVH/01_01.bvh", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json output = json::parse(result.out);
  bool has_jumps = false;
  for (const json& group : output["realism"]) {
    if (group["kind"] != "jump") continue;
    has_jumps = true;
    EXPECT_GT(group["movements"], 5);
    EXPECT_LT(group["cardinal"]["parameter_m"], group["nearest"]["parameter_m"]);
    for (const char* method : {"cardinal", "nearest", "inverse_distance"}) {
      EXPECT_GT(group[method]["pose_m"], 0.0);
      EXPECT_EQ(group[method]["parts_m"].size(), 4u);
    }
    EXPECT_EQ(group["cardinal"]["won_by_cardinal"], 0.0);
  }
  EXPECT_TRUE(has_jumps);
  EXPECT_THAT(ReadWhole(folder_.path() / "report" / "index.html"), HasSubstr("Realism"));
}

TEST_F(LibraryReport, ReportsMissingGnuplot) {
  const std::string path = std::getenv("PATH");
  ASSERT_EQ(setenv("PATH", folder_.path().c_str(), 1), 0);
  const ProgramResult result = Report({library_, "--out", folder_.File("report")});
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err, HasSubstr("gnuplot"));
  EXPECT_THAT(result.err, HasSubstr("not installed"));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1);
  EXPECT_FALSE(std::filesystem::exists(folder_.File("report")));
}

TEST_F(LibraryReport, RejectsInvalidOptionsAndWritesNothing) {
  const auto fails = [&](const std::vector<std::string>& arguments, int exit_code,
                         const std::string& named) {
    const ProgramResult result = Report(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_EQ(result.out, "");
    EXPECT_THAT(result.err, HasSubstr(named));
  };
  const std::string out = folder_.File("report");
  fails({library_}, 2, "--out");
  fails({"missing.swl", "--out", out}, 2, "missing.swl");
  fails({library_, "--out", out, "--axes", "no_such_m"}, 2, "no_such_m");
  fails({library_, "--out", out, "--max-error-m", "-1"}, 2, "--max-error-m");
  fails({library_, "--out", out, "--max-pseudoexamples", "1025"}, 2, "--max-pseudoexamples");
  fails({library_, "--out", out, "--captures", "missing.bvh"}, 2, "missing.bvh");
  fails({library_, "--out", library_}, 1, "not a folder");
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(LibraryReport, WritesNothingWhenInterrupted) {
  const std::string out = folder_.File("report");
  test::ChildProcess drawing(
      STRIDEWIRE_LIBRARY_TOOL,
      {"report", "builtin", "--out", out, "--max-error-m", "0", "--max-pseudoexamples", "1024"});
  // Waits until the program catches SIGINT, which happens long before it can finish.
  const std::string status = "/proc/" + std::to_string(drawing.pid()) + "/status";
  const auto catches = [&] {
    std::ifstream file(status);
    for (std::string line; std::getline(file, line);) {
      if (line.starts_with("SigCgt:")) {
        return (std::stoull(line.substr(7), nullptr, 16) >> (SIGINT - 1) & 1) != 0;
      }
    }
    return false;
  };
  for (int i = 0; i < 3000 && !catches(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_TRUE(catches());
  drawing.Signal(SIGINT);
  EXPECT_EQ(drawing.Wait(), 1);
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace stridewire
