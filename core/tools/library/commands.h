#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace stridewire {

// Command line options, with one struct per command. The Run functions return the exit code.

struct BuildCommand {
  std::vector<std::string> files;
  std::string out;
  std::string kinds = "step,jump";
  bool mirror = false;
  bool root_motion = false;
  bool all = false;
  double max_pose_error_m = 0.025;
  bool no_complete = false;
  bool no_self_check = false;
  bool json = false;
  std::optional<double> unit_m;  // Empty: detected.
  std::string left_ankle, right_ankle, left_ball, right_ball;
  std::string up;
  std::optional<double> fps;  // Frames per second. Empty: the Frame Time of each file.
};
int RunBuild(const BuildCommand& command);

struct InspectCommand {
  std::string library;
  bool json = false;
  bool examples = false;
};
int RunInspect(const InspectCommand& command);

struct SynthesizeCommand {
  std::string library;
  std::string choreography;
  std::string out;
  double fps = 60.0;
  bool no_correction = false;
  bool no_planting = false;
  bool no_idle = false;
  bool no_variation = false;
  std::uint64_t seed = 0;
  bool json = false;
};
int RunSynthesize(const SynthesizeCommand& command);

struct RefineCommand {
  std::string library;
  std::string out;
  double max_error_m = 0.01;
  int max_pseudoexamples = 32;
  std::string rule = "amended";
  bool json = false;
};
int RunRefine(const RefineCommand& command);

struct ReportCommand {
  std::string library;
  std::vector<std::string> captures;
  std::string out;
  std::vector<std::string> axes;
  double max_error_m = 0.001;
  int max_pseudoexamples = 16;
  bool json = false;
};
int RunReport(const ReportCommand& command);

struct AddLayersCommand {
  std::string library;
  std::string out;
  std::vector<std::string> loops;  // NAME=FILE[:FROM_S:TO_S]
  std::vector<std::string> once;   // Same format.
  // Names of the joints that the layer animates. Empty: the upper body.
  std::vector<std::string> joints;
  bool json = false;
};
int RunAddLayers(const AddLayersCommand& command);

struct ExportCommand {
  std::string library;
  std::string out;
};
int RunExport(const ExportCommand& command);

}  // namespace stridewire
