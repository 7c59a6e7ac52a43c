#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scratch_folder.h"

namespace stridewire::test {

/// Result of `stridewire-library build --json` for one BVH file.
struct ToolBuild {
  int exit_code = -1;
  std::string err;        ///< Output on stderr.
  nlohmann::json report;  ///< The JSON on stdout; null if there was none.
  std::string library;    ///< Path of the library; the file exists if exit_code is 0.

  /// The entry of the BVH file in the report; empty if there is none.
  [[nodiscard]] nlohmann::json File() const;
  /// Steps of the left and the right foot, or {-1, -1} without a report.
  [[nodiscard]] std::vector<int> Steps() const;
  /// Number of jumps, or -1 without a report.
  [[nodiscard]] int Jumps() const;
  /// Error, reason, notes and reasons of rejected times of the file, one per line.
  [[nodiscard]] std::string Sentences() const;
};

/// Builds a library from a file with the program.
[[nodiscard]] ToolBuild BuildWithTool(const ScratchFolder& folder, const std::string& bvh_path,
                                      const std::vector<std::string>& options = {});

/// A choreography played with a library: the BVH text and the report.
struct ToolSynthesis {
  int exit_code = -1;
  std::string err;
  std::string bvh;
  nlohmann::json report;
};

[[nodiscard]] ToolSynthesis SynthesizeWithTool(const ScratchFolder& folder,
                                               const std::string& library,
                                               const std::string& choreography_path);

/// Motions are the same if no joint is farther apart than this.
inline constexpr double kSameMotionM = 0.005;

/// Largest distance between joints of the same name in two BVH files, over all frames and over the
/// joints of the first file. Infinite if the second lacks a joint or has another number of frames.
[[nodiscard]] double LargestJointDistance(const std::string& bvh, const std::string& other_bvh);

/// How far the knees are behind the line from hip to ankle in the direction -Z, over all frames.
/// At most 0 if they always bend forward. Joints are named LeftUpLeg, LeftLeg, LeftFoot and so on.
[[nodiscard]] double LargestBackwardKnee(const std::string& bvh);

}  // namespace stridewire::test
