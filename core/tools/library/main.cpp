// stridewire-library: turns motion capture into libraries, looks into them, plays them.

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
#include "stridewire/base/version.h"
#include "offline/build/refine.h"

namespace stridewire {
namespace {

constexpr const char kExamples[] = R"(Examples:
  stridewire-library build --out walk.swl captures/16_*.bvh
  stridewire-library inspect walk.swl
  stridewire-library refine walk.swl --out better.swl
  stridewire-library synthesize builtin --choreography walk.json --out walk.bvh
  stridewire-library export-capture builtin --out examples/
)";

// A number that lies in [min, max], or in (min, max] if `is_open`.
CLI::Validator Number(double min, double max, bool is_open) {
  const auto check = [=](const std::string& text) -> std::string {
    double value = 0.0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool is_number = failed == std::errc() && end == text.data() + text.size();
    if (is_number && (is_open ? value > min : value >= min) && value <= max) return {};
    char sentence[128];
    std::snprintf(sentence, sizeof(sentence), "is not a number %s %g %s %g",
                  is_open ? "above" : "from", min, is_open ? "and up to" : "to", max);
    return "\"" + text + "\" " + sentence;
  };
  return CLI::Validator(check, "");
}

CLI::Validator NotEmpty() {
  return CLI::Validator(
      [](const std::string& text) { return text.empty() ? "is empty" : std::string(); }, "");
}

// What is wrong with the first word, as a sentence; empty when it is a command or an option that can
// stand there. CLI11 would complain of a missing command where an unknown one is given.
std::string FirstWordError(const CLI::App& app, const std::string& word) {
  if (word.starts_with('-')) {
    if (word == "-h" || word == "--help" || word == "--version") return {};
    return "a command comes first, not " + word;
  }
  const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
  const bool is_known = std::any_of(commands.begin(), commands.end(), [&](const CLI::App* command) {
    return command->get_name() == word;
  });
  return is_known ? "" : "\"" + word + "\" is no command";
}

int Run(int argc, char** argv) {
  CLI::App app{"Turns motion capture into libraries, looks into them and plays them."};
  app.name("stridewire-library");
  app.set_version_flag("--version", std::string("stridewire-library ") + kVersion);
  app.footer(kExamples);
  app.require_subcommand(1);

  BuildCommand build;
  CLI::App* build_app = app.add_subcommand("build", "Builds a library from captures (BVH)");
  build_app->add_option("--out", build.out, "The library to write (.swl)")
      ->required()
      ->check(NotEmpty());
  build_app->add_option("--kinds", build.kinds, "Movements to look for: step, jump")
      ->capture_default_str();
  build_app->add_flag("--mirror", build.mirror, "Add every step mirrored to the other foot");
  build_app->add_option("--unit-m", build.unit_m, "Length of one file unit in metres; else found")
      ->check(Number(0.0, 1000.0, true));
  build_app->add_option("--fps", build.fps, "Frames a second, where the files are wrong")
      ->check(Number(0.0, 10000.0, true));
  build_app->add_option("--up", build.up, "Up axis of the files: x, y, z, -x, -y, -z; else found");
  build_app->add_option("--left-ankle", build.left_ankle, "Joint name; else found")
      ->check(NotEmpty());
  build_app->add_option("--right-ankle", build.right_ankle, "Joint name; else found")
      ->check(NotEmpty());
  build_app->add_option("--left-ball", build.left_ball, "Joint name; else found")
      ->check(NotEmpty());
  build_app->add_option("--right-ball", build.right_ball, "Joint name; else found")
      ->check(NotEmpty());
  build_app->add_flag("--all", build.all, "Keep every usable movement: average none");
  build_app
      ->add_option("--max-pose-error-m", build.max_pose_error_m,
                   "Leave out movements that the others make within this; 0 averages only")
      ->check(Number(0.0, 10.0, false))
      ->capture_default_str()
      ->excludes("--all");
  build_app->add_flag("--json", build.json, "Report as one JSON object on stdout");
  build_app->add_option("files", build.files, "Captures, BVH")->required()->check(NotEmpty());
  build_app->footer("Example:\n  stridewire-library build --out walk.swl --all 16_*.bvh\n");

  InspectCommand inspect;
  CLI::App* inspect_app = app.add_subcommand("inspect", "Tells what a library holds");
  inspect_app->add_option("library", inspect.library, "A .swl file or builtin")
      ->required()
      ->check(NotEmpty());
  inspect_app->add_flag("--json", inspect.json, "As one JSON object on stdout");
  inspect_app->add_flag("--examples", inspect.examples, "Every example as well");
  inspect_app->footer("Example:\n  stridewire-library inspect builtin --examples\n");

  SynthesizeCommand synthesize;
  CLI::App* synthesize_app =
      app.add_subcommand("synthesize", "Plays a choreography into a BVH file");
  synthesize_app->add_option("library", synthesize.library, "A .swl file or builtin")
      ->required()
      ->check(NotEmpty());
  synthesize_app->add_option("--choreography", synthesize.choreography, "What to do (JSON)")
      ->required()
      ->check(NotEmpty());
  synthesize_app->add_option("--out", synthesize.out, "The BVH file to write")
      ->required()
      ->check(NotEmpty());
  synthesize_app->add_option("--fps", synthesize.fps, "Frames a second")
      ->capture_default_str()
      ->check(Number(10.0, 1000.0, false));
  synthesize_app->add_flag("--no-correction", synthesize.no_correction,
                           "Start movements with the parameters asked for, uncorrected");
  synthesize_app->add_flag("--no-planting", synthesize.no_planting,
                           "Leave the feet where the blend has them, sliding");
  synthesize_app->add_flag("--json", synthesize.json, "Report as one JSON object on stdout");
  synthesize_app->footer(
      "Example:\n  echo '{\"movements\":[{\"step\":{\"length_m\":0.6}}]}' > c.json\n"
      "  stridewire-library synthesize builtin --choreography c.json --out walk.bvh\n");

  ExportCommand export_command;
  CLI::App* export_app =
      app.add_subcommand("export-capture", "Writes every example of a library as BVH");
  export_app->add_option("library", export_command.library, "A .swl file or builtin")
      ->required()
      ->check(NotEmpty());
  export_app->add_option("--out", export_command.out, "The folder to write into")
      ->required()
      ->check(NotEmpty());
  export_app->footer("Example:\n  stridewire-library export-capture builtin --out examples/\n");

  AddLayersCommand add_layers;
  CLI::App* add_layers_app = app.add_subcommand(
      "add-layers", "Adds clips of the upper body that are played over movements");
  add_layers_app->add_option("library", add_layers.library, "A .swl file or builtin")
      ->required()
      ->check(NotEmpty());
  add_layers_app->add_option("--out", add_layers.out, "The library to write (.swl)")
      ->required()
      ->check(NotEmpty());
  add_layers_app->add_option("--layer", add_layers.loops,
                             "A loop: NAME=FILE.bvh or NAME=FILE.bvh:FROM_S:TO_S; may be repeated");
  add_layers_app->add_option("--layer-once", add_layers.once, "The same, played once");
  add_layers_app
      ->add_option("--layer-joints", add_layers.joints,
                   "Joints to move, with all that hangs on them; else the upper body")
      ->delimiter(',');
  add_layers_app->add_flag("--json", add_layers.json, "Report as one JSON object on stdout");
  add_layers_app->footer(
      "Example:\n  stridewire-library add-layers walk.swl --out both.swl --layer "
      "wave=wave.bvh:1.5:3\n");

  RefineCommand refine;
  CLI::App* refine_app =
      app.add_subcommand("refine", "Adds pseudoexamples where movements miss most what is asked");
  refine_app->add_option("library", refine.library, "A .swl file or builtin")
      ->required()
      ->check(NotEmpty());
  refine_app->add_option("--out", refine.out, "The library to write (.swl)")
      ->required()
      ->check(NotEmpty());
  refine_app->add_option("--max-error-m", refine.max_error_m, "Stop below this error")
      ->capture_default_str()
      ->check(Number(0.0, 1000.0, false));
  refine_app->add_option("--max-pseudoexamples", refine.max_pseudoexamples, "The most a group gets")
      ->capture_default_str()
      ->check(CLI::Range(0, RefineOptions::kMostPseudoexamples));
  refine_app->add_option("--rule", refine.rule, "amended, or bare: as the paper has it")
      ->capture_default_str()
      ->check(CLI::IsMember({"amended", "bare"}));
  refine_app->add_flag("--json", refine.json, "Report as one JSON object on stdout");
  refine_app->footer("Example:\n  stridewire-library refine walk.swl --out better.swl\n");

  ReportCommand report;
  CLI::App* report_app =
      app.add_subcommand("report", "Draws the paper's figures of a library, one page (HTML, SVG)");
  report_app->add_option("library", report.library, "A .swl file or builtin")
      ->required()
      ->check(NotEmpty());
  report_app->add_option("--out", report.out, "The folder to write into: index.html, pictures")
      ->required()
      ->check(NotEmpty());
  report_app->add_option("--axes", report.axes, "One or two parameters the error maps show")
      ->delimiter(',')
      ->expected(1, 2);
  report_app->add_option("--max-error-m", report.max_error_m, "Refinement stops below this error")
      ->capture_default_str()
      ->check(Number(0.0, 1000.0, false));
  report_app->add_option("--max-pseudoexamples", report.max_pseudoexamples, "The most a group gets")
      ->capture_default_str()
      ->check(CLI::Range(0, RefineOptions::kMostPseudoexamples));
  report_app
      ->add_option(
          "--captures", report.captures,
          "BVH files to measure realism on: each movement left out and made from the others")
      ->check(NotEmpty());
  report_app->add_flag("--json", report.json, "What the tables say as one JSON object on stdout");
  report_app->footer(
      "Example:\n  stridewire-library report walk.swl --out pictures/\n"
      "  stridewire-library report builtin --out pictures/ --axes end_z_m,turn_rad --json\n"
      "  stridewire-library report walk.swl --out pictures/ --captures 16_*.bvh\n");

  const std::string wrong = argc < 2 ? "a command is needed" : FirstWordError(app, argv[1]);
  if (!wrong.empty()) {
    return PrintError(wrong +
                    "; there are build, inspect, refine, add-layers, report, synthesize and "
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
    return PrintError(command + error.what());
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
      return stridewire::PrintError("the report cannot be written", stridewire::kExitFailure);
    }
    return exit_code;
  } catch (const std::exception& error) {
    return stridewire::PrintError(std::string("failed: ") + error.what(), stridewire::kExitFailure);
  }
}
