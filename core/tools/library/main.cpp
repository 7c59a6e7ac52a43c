// stridewire-library: builds motion libraries from captures, inspects them and synthesizes motion.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <system_error>

#include "command_line.h"
#include "commands.h"
#include "offline/base/text.h"
#include "offline/build/refine.h"
#include "stridewire/base/version.h"

namespace stridewire {
namespace {

constexpr const char kExamples[] = R"(Examples:
  stridewire-library build --out walk.swl captures/16_*.bvh
  stridewire-library inspect walk.swl
  stridewire-library refine walk.swl --out better.swl
  stridewire-library synthesize builtin --choreography walk.json --out walk.bvh
  stridewire-library export-capture builtin --out examples/
)";

// Accepts numbers in [min, max], or in (min, max] if `is_open`. Rejects NaN.
CLI::Validator Number(double min, double max, bool is_open) {
  const auto check = [=](const std::string& text) -> std::string {
    double value = 0.0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool is_number = failed == std::errc() && end == text.data() + text.size();
    if (is_number && (is_open ? value > min : value >= min) && value <= max) return {};
    return Text("expected a number %s %g and at most %g, got ", is_open ? "above" : "of at least",
                min, max) +
           "\"" + text + "\"";
  };
  return CLI::Validator(check, "");
}

CLI::Validator NotEmpty() {
  return CLI::Validator(
      [](const std::string& text) {
        return text.empty() ? "expected a value, got an empty string" : std::string();
      },
      "");
}

template <typename Text>
CLI::Option* AddText(CLI::App* command, const char* name, Text& value, const char* help) {
  return command->add_option(name, value, help)->check(NotEmpty());
}

void AddLibrary(CLI::App* command, std::string& library) {
  AddText(command, "library", library, "A .swl file, or builtin for the generated library")
      ->required();
}

void AddOut(CLI::App* command, std::string& out, const char* help) {
  AddText(command, "--out", out, help)->required();
}

void AddJson(CLI::App* command, bool& json) {
  command->add_flag("--json", json, "Print one JSON object on stdout");
}

void AddRefinement(CLI::App* command, double& max_error_m, int& max_pseudoexamples) {
  command
      ->add_option("--max-error-m", max_error_m,
                   "Stop refining a group below this error; metres, a radian counts as 0.5 m")
      ->capture_default_str()
      ->check(Number(0.0, 1000.0, false));
  command
      ->add_option("--max-pseudoexamples", max_pseudoexamples,
                   "Largest number of pseudoexamples per group")
      ->capture_default_str()
      ->check(CLI::Range(0, RefineOptions::kMaxPseudoexamples));
}

// Returns what is wrong with the first argument; empty if it is a command or a global option. CLI11
// would report a missing command even if the user typed an unknown one.
std::string FirstWordError(const CLI::App& app, const std::string& word) {
  if (word.starts_with('-')) {
    if (word == "-h" || word == "--help" || word == "--version") return {};
    return "expected a command before " + word;
  }
  const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
  const bool is_known = std::any_of(commands.begin(), commands.end(), [&](const CLI::App* command) {
    return command->get_name() == word;
  });
  return is_known ? "" : "\"" + word + "\" is not a command";
}

int Run(int argc, char** argv) {
  CLI::App app{"Builds motion libraries from captures, inspects them and synthesizes motion."};
  app.name("stridewire-library");
  app.set_version_flag("--version", std::string("stridewire-library ") + kVersion);
  app.footer(kExamples);
  app.require_subcommand(1);

  BuildCommand build;
  CLI::App* build_app = app.add_subcommand("build", "Build a library from BVH captures");
  AddOut(build_app, build.out, "The library file to write (.swl)");
  build_app
      ->add_option("--kinds", build.kinds, "Movements to extract, separated by commas: step, jump")
      ->capture_default_str();
  build_app->add_flag("--mirror", build.mirror,
                      "Also add the mirror image of every step, for the other foot");
  build_app->add_flag("--root-motion", build.root_motion,
                      "Derive the root motion of figures that walk on the spot from the foot that "
                      "stands");
  build_app
      ->add_option("--unit-m", build.unit_m,
                   "Length of one file unit in metres (default: detected)")
      ->check(Number(0.0, 1000.0, true));
  build_app
      ->add_option("--fps", build.fps, "Frames per second (default: the Frame Time of each file)")
      ->check(Number(0.0, 10000.0, true));
  build_app->add_option("--up", build.up,
                        "Up axis of the files: x, y, z, -x, -y or -z (default: detected)");
  AddText(build_app, "--left-ankle", build.left_ankle,
          "Name of the left ankle joint (default: detected)");
  AddText(build_app, "--right-ankle", build.right_ankle,
          "Name of the right ankle joint (default: detected)");
  AddText(build_app, "--left-ball", build.left_ball,
          "Name of the left toe joint (default: detected)");
  AddText(build_app, "--right-ball", build.right_ball,
          "Name of the right toe joint (default: detected)");
  build_app->add_flag("--all", build.all, "Keep every usable movement, without averaging");
  build_app
      ->add_option("--max-pose-error-m", build.max_pose_error_m,
                   "Drop movements that the rest reproduces within this error in metres; 0 only "
                   "averages")
      ->check(Number(0.0, 10.0, false))
      ->capture_default_str()
      ->excludes("--all");
  build_app->add_flag(
      "--no-complete", build.no_complete,
      "Do not generate basic steps that the captures lack, such as stops and turns");
  build_app->add_flag("--no-self-check", build.no_self_check,
                      "Do not play and check a few movements with the finished library");
  AddJson(build_app, build.json);
  build_app->add_option("files", build.files, "BVH captures")->required()->check(NotEmpty());
  build_app->footer("Example:\n  stridewire-library build --out walk.swl --all 16_*.bvh\n");

  InspectCommand inspect;
  CLI::App* inspect_app = app.add_subcommand("inspect", "Print the contents of a library");
  AddLibrary(inspect_app, inspect.library);
  AddJson(inspect_app, inspect.json);
  inspect_app->add_flag("--examples", inspect.examples, "Also list every example");
  inspect_app->footer("Example:\n  stridewire-library inspect builtin --examples\n");

  SynthesizeCommand synthesize;
  CLI::App* synthesize_app =
      app.add_subcommand("synthesize", "Synthesize a choreography and write it as BVH");
  AddLibrary(synthesize_app, synthesize.library);
  AddText(synthesize_app, "--choreography", synthesize.choreography,
          "The movements to play (a JSON file)")
      ->required();
  AddOut(synthesize_app, synthesize.out, "The BVH file to write");
  synthesize_app->add_option("--fps", synthesize.fps, "Frames per second")
      ->capture_default_str()
      ->check(Number(10.0, 1000.0, false));
  synthesize_app->add_flag("--no-correction", synthesize.no_correction,
                           "Do not correct the weights when a movement starts");
  synthesize_app->add_flag("--no-planting", synthesize.no_planting,
                           "Do not plant feet; the blended feet may slide");
  synthesize_app->add_flag("--no-idle", synthesize.no_idle,
                           "Keep standing avatars still in their last pose");
  synthesize_app->add_flag("--no-variation", synthesize.no_variation, "Repeat equal steps exactly");
  synthesize_app
      ->add_option("--seed", synthesize.seed,
                   "Seed of the idle motion and of the variation of steps")
      ->capture_default_str();
  AddJson(synthesize_app, synthesize.json);
  synthesize_app->footer(
      "Example:\n  echo '{\"movements\":[{\"step\":{\"length_m\":0.6}}]}' > c.json\n"
      "  stridewire-library synthesize builtin --choreography c.json --out walk.bvh\n");

  ExportCommand export_command;
  CLI::App* export_app =
      app.add_subcommand("export-capture", "Write every example of a library as BVH");
  AddLibrary(export_app, export_command.library);
  AddOut(export_app, export_command.out, "The folder to write to; created if necessary");
  export_app->footer("Example:\n  stridewire-library export-capture builtin --out examples/\n");

  AddLayersCommand add_layers;
  CLI::App* add_layers_app =
      app.add_subcommand("add-layers", "Add upper-body clips that can play over movements");
  AddLibrary(add_layers_app, add_layers.library);
  AddOut(add_layers_app, add_layers.out, "The library file to write (.swl)");
  add_layers_app->add_option("--layer", add_layers.loops,
                             "A looping clip: NAME=FILE.bvh or NAME=FILE.bvh:FROM_S:TO_S; "
                             "repeatable");
  add_layers_app->add_option("--layer-once", add_layers.once, "Same, for a clip that plays once");
  add_layers_app
      ->add_option("--layer-joints", add_layers.joints,
                   "Joints to animate, with all joints below them (default: the upper body)")
      ->delimiter(',');
  AddJson(add_layers_app, add_layers.json);
  add_layers_app->footer(
      "Example:\n  stridewire-library add-layers walk.swl --out both.swl --layer "
      "wave=wave.bvh:1.5:3\n");

  RefineCommand refine;
  CLI::App* refine_app = app.add_subcommand(
      "refine", "Add pseudoexamples where synthesized movements miss their parameters most");
  AddLibrary(refine_app, refine.library);
  AddOut(refine_app, refine.out, "The library file to write (.swl)");
  AddRefinement(refine_app, refine.max_error_m, refine.max_pseudoexamples);
  refine_app
      ->add_option(
          "--rule", refine.rule,
          "bare: the rule of the paper; amended: adds a pseudoexample only if it reduces the error")
      ->capture_default_str()
      ->check(CLI::IsMember({"amended", "bare"}));
  AddJson(refine_app, refine.json);
  refine_app->footer("Example:\n  stridewire-library refine walk.swl --out better.swl\n");

  ReportCommand report;
  CLI::App* report_app =
      app.add_subcommand("report", "Draw the figures of the paper for a library (HTML and SVG)");
  AddLibrary(report_app, report.library);
  AddOut(report_app, report.out, "The folder to write index.html and the figures to");
  report_app
      ->add_option("--axes", report.axes,
                   "One or two parameters for the axes of the error maps, separated by a comma")
      ->delimiter(',')
      ->expected(1, 2);
  AddRefinement(report_app, report.max_error_m, report.max_pseudoexamples);
  AddText(report_app, "--captures", report.captures,
          "BVH files for a leave-one-out comparison of synthesized with captured movements");
  AddJson(report_app, report.json);
  report_app->footer(
      "Example:\n  stridewire-library report walk.swl --out pictures/\n"
      "  stridewire-library report builtin --out pictures/ --axes end_z_m,turn_rad --json\n"
      "  stridewire-library report walk.swl --out pictures/ --captures 16_*.bvh\n");

  const std::string wrong = argc < 2 ? "expected a command" : FirstWordError(app, argv[1]);
  if (!wrong.empty()) {
    return PrintError(wrong +
                      "; commands are build, inspect, refine, add-layers, report, synthesize and "
                      "export-capture");
  }

  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForAllHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForVersion& version) {
    return app.exit(version);
  } catch (const CLI::ParseError& error) {
    const auto commands = app.get_subcommands();
    const std::string command = commands.empty() ? "" : commands.front()->get_name() + ": ";
    std::string what = error.what();
    // The text of CLI::ExtrasError is not used, because it lists the arguments in reverse order.
    if (const auto surplus = app.remaining(true); !surplus.empty()) {
      what = surplus.front() + ": unknown option or surplus argument";
    }
    return PrintError(command + what);
  }
  if (*build_app) return RunBuild(build);
  if (*inspect_app) return RunInspect(inspect);
  if (*add_layers_app) return RunAddLayers(add_layers);
  if (*refine_app) return RunRefine(refine);
  if (*report_app) return RunReport(report);
  if (*synthesize_app) return RunSynthesize(synthesize);
  return RunExport(export_command);
}

}  // namespace
}  // namespace stridewire

int main(int argc, char** argv) {
  try {
    const int exit_code = stridewire::Run(argc, argv);
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
      return stridewire::PrintError("cannot write the output to stdout", stridewire::kExitFailure);
    }
    return exit_code;
  } catch (const std::exception& error) {
    return stridewire::PrintError(std::string("unexpected error: ") + error.what(),
                                  stridewire::kExitFailure);
  }
}
