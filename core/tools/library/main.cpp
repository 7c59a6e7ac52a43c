// stridewire-library: turns motion capture into libraries, looks into them, plays them.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "command_line.h"
#include "commands.h"
#include "stridewire/base/version.h"

namespace stridewire {
namespace {

constexpr const char kExamples[] = R"(Examples:
  stridewire-library build --out walk.swl captures/16_*.bvh
  stridewire-library inspect walk.swl
  stridewire-library synthesize builtin --choreography walk.json --out walk.bvh
  stridewire-library export-capture builtin --out examples/)";

int Run(int argc, char** argv) {
  CLI::App app{"Turns motion capture into libraries, looks into them and plays them."};
  app.set_version_flag("--version", std::string("stridewire-library ") + kVersion);
  app.footer(kExamples);
  app.require_subcommand(1);

  BuildCommand build;
  CLI::App* build_app = app.add_subcommand("build", "Builds a library from captures (BVH)");
  build_app->add_option("--out", build.out, "The library to write (.swl)")->required();
  build_app->add_option("--kinds", build.kinds, "Movements to look for: step, jump")
      ->capture_default_str();
  build_app->add_flag("--mirror", build.mirror, "Add every step mirrored to the other foot");
  build_app->add_option("--unit-m", build.unit_m, "Length of one file unit in metres; else found");
  build_app->add_option("--fps", build.fps, "Frames a second, where the files are wrong");
  build_app->add_option("--up", build.up, "Up axis of the files: x, y, z, -x, -y, -z; else found");
  build_app->add_option("--left-ankle", build.left_ankle, "Joint name; else found");
  build_app->add_option("--right-ankle", build.right_ankle, "Joint name; else found");
  build_app->add_option("--left-ball", build.left_ball, "Joint name; else found");
  build_app->add_option("--right-ball", build.right_ball, "Joint name; else found");
  build_app->add_flag("--all", build.all, "Keep every usable movement: average none");
  build_app->add_flag("--json", build.json, "Report as one JSON object on stdout");
  build_app->add_option("files", build.files, "Captures, BVH")->required();
  build_app->footer("Example:\n  stridewire-library build --out walk.swl --all 16_*.bvh");

  InspectCommand inspect;
  CLI::App* inspect_app = app.add_subcommand("inspect", "Tells what a library holds");
  inspect_app->add_option("library", inspect.library, "A .swl file or builtin")->required();
  inspect_app->add_flag("--json", inspect.json, "As one JSON object on stdout");
  inspect_app->add_flag("--examples", inspect.examples, "Every example as well");
  inspect_app->footer("Example:\n  stridewire-library inspect builtin --examples");

  SynthesizeCommand synthesize;
  CLI::App* synthesize_app =
      app.add_subcommand("synthesize", "Plays a choreography into a BVH file");
  synthesize_app->add_option("library", synthesize.library, "A .swl file or builtin")->required();
  synthesize_app->add_option("--choreography", synthesize.choreography, "What to do (JSON)")
      ->required();
  synthesize_app->add_option("--out", synthesize.out, "The BVH file to write")->required();
  synthesize_app->add_option("--fps", synthesize.fps, "Frames a second")
      ->capture_default_str()
      ->check(CLI::Range(10.0, 1000.0));
  synthesize_app->add_flag("--json", synthesize.json, "Report as one JSON object on stdout");
  synthesize_app->footer(
      "Example:\n  echo '{\"movements\":[{\"step\":{\"length_m\":0.6}}]}' > c.json\n"
      "  stridewire-library synthesize builtin --choreography c.json --out walk.bvh");

  ExportCommand export_command;
  CLI::App* export_app =
      app.add_subcommand("export-capture", "Writes every example of a library as BVH");
  export_app->add_option("library", export_command.library, "A .swl file or builtin")->required();
  export_app->add_option("--out", export_command.out, "The folder to write into")->required();
  export_app->footer("Example:\n  stridewire-library export-capture builtin --out examples/");

  for (const char* name : {"refine", "report"}) {
    CLI::App* later = app.add_subcommand(name, "Not supported yet");
    later->allow_extras();
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
    return Complain(error.what());
  }
  if (*build_app) return RunBuild(build);
  if (*inspect_app) return RunInspect(inspect);
  if (*synthesize_app) return RunSynthesize(synthesize);
  if (*export_app) return RunExport(export_command);
  return Complain(app.get_subcommands().front()->get_name() + " is not supported yet");
}

}  // namespace
}  // namespace stridewire

int main(int argc, char** argv) {
  try {
    return stridewire::Run(argc, argv);
  } catch (const std::exception& error) {
    return stridewire::Complain(std::string("failed: ") + error.what(), stridewire::kExitFailure);
  }
}
