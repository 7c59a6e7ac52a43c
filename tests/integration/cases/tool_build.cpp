#include "tool_build.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "corpus/bvh_positions.h"
#include "run_program.h"

namespace stridewire::test {

using nlohmann::json;

namespace {

json ParseReport(const std::string& out) {
  json report = json::parse(out, nullptr, false);
  return report.is_object() ? report : json();
}

}  // namespace

json ToolBuild::File() const {
  if (!report.contains("files") || report["files"].empty()) return json::object();
  return report["files"][0];
}

std::vector<int> ToolBuild::Steps() const {
  const json file = File();
  return {file.value("steps_left", -1), file.value("steps_right", -1)};
}

int ToolBuild::Jumps() const { return File().value("jumps", -1); }

std::string ToolBuild::Sentences() const {
  std::string text;
  const json file = File();
  for (const char* key : {"error", "reason"}) {
    if (file.contains(key) && file[key].is_string()) text += file[key].get<std::string>() + '\n';
  }
  for (const json& note : file.value("notes", json::array()))
    text += note.get<std::string>() + '\n';
  for (const json& time : file.value("rejected", json::array())) {
    text += time.value("reason", "") + '\n';
  }
  return text;
}

ToolBuild BuildWithTool(const ScratchFolder& folder, const std::string& bvh_path,
                        const std::vector<std::string>& options) {
  ToolBuild build;
  build.library = folder.File(std::filesystem::path(bvh_path).stem().string() + ".swl");
  std::vector<std::string> arguments = {"build", "--json", "--out", build.library};
  arguments.insert(arguments.end(), options.begin(), options.end());
  arguments.push_back(bvh_path);
  const ProgramResult result = RunProgram(STRIDEWIRE_LIBRARY_TOOL, arguments);
  build.exit_code = result.exit_code;
  build.err = result.err;
  build.report = ParseReport(result.out);
  return build;
}

ToolSynthesis SynthesizeWithTool(const ScratchFolder& folder, const std::string& library,
                                 const std::string& choreography_path) {
  ToolSynthesis synthesis;
  const std::string out =
      folder.File(std::filesystem::path(library).stem().string() + "_synthesized.bvh");
  const ProgramResult result = RunProgram(
      STRIDEWIRE_LIBRARY_TOOL,
      {"synthesize", library, "--choreography", choreography_path, "--out", out, "--json"});
  synthesis.exit_code = result.exit_code;
  synthesis.err = result.err;
  synthesis.bvh = ReadWhole(out);
  synthesis.report = ParseReport(result.out);
  return synthesis;
}

double LargestJointDistance(const std::string& bvh, const std::string& other_bvh) {
  const BvhPositions a(bvh);
  const BvhPositions b(other_bvh);
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  if (a.frame_count() != b.frame_count()) return kInfinite;
  std::vector<std::size_t> in_b;
  for (int j = 0; j < a.joint_count(); ++j) {
    const int found = b.Find(a.Name(j));
    if (found < 0) return kInfinite;
    in_b.push_back(static_cast<std::size_t>(found));
  }
  double largest = 0.0;
  for (int f = 0; f < a.frame_count(); ++f) {
    const std::vector<DVec3> at_a = a.At(f);
    const std::vector<DVec3> at_b = b.At(f);
    for (std::size_t j = 0; j < at_a.size(); ++j) {
      largest = std::max(largest, glm::length(at_a[j] - at_b[in_b[j]]));
    }
  }
  return largest;
}

double LargestBackwardKnee(const std::string& bvh) {
  const BvhPositions positions(bvh);
  double largest = -std::numeric_limits<double>::infinity();
  for (int f = 0; f < positions.frame_count(); ++f) {
    for (const std::string side : {"Left", "Right"}) {
      const DVec3 hip = positions.At(f, side + "UpLeg");
      const DVec3 line = glm::normalize(positions.At(f, side + "Foot") - hip);
      const DVec3 knee = positions.At(f, side + "Leg") - hip;
      const DVec3 out = knee - glm::dot(knee, line) * line;
      largest = std::max(largest, -out.z);
    }
  }
  return largest;
}

}  // namespace stridewire::test
