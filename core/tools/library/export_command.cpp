#include <cstdio>
#include <filesystem>
#include <vector>

#include "command_line.h"
#include "commands.h"
#include "offline/base/text.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "stridewire/offline/bvh_writer.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

constexpr double kExportFps = 120.0;

// Samples a stored example from its first to its last keytime, as the movement in which it has the
// weight 1.
Clip ExampleClip(const MotionLibrary& library, int group_index, int example) {
  const MotionGroup& group = library.group(group_index);
  const int joint_count = library.skeleton().joint_count();
  std::vector<double> scratch(static_cast<std::size_t>(group.example_count));
  Movement movement;
  StartMovement(group, group_index, group.site(example), {}, scratch, movement);
  GridCache cache(library.layout());
  Clip clip;
  clip.fps = kExportFps;
  const int frames = static_cast<int>(movement.duration_s() * kExportFps) + 1;
  clip.Resize(frames, joint_count);
  for (int f = 0; f < frames; ++f) {
    EvaluateBlend(group, library.layout(), movement, f / kExportFps, cache, clip.frame(f));
  }
  return clip;
}

}  // namespace

int RunExport(const ExportCommand& command) {
  const auto library = OpenLibrary(command.library);
  if (!library) return PrintInputError(library.error());
  std::error_code failed;
  std::filesystem::create_directories(command.out, failed);
  if (failed) return PrintError(command.out + ": cannot create the folder", kExitFailure);
  int count = 0;
  for (std::size_t g = 0; g < (*library)->groups().size(); ++g) {
    const MotionGroup& group = (*library)->groups()[g];
    for (int e = 0; e < group.example_count; ++e) {
      const std::string name =
          Text("%02zu_%s_%03d.bvh", g, std::string(MovementKindName(group.kind)).c_str(), e);
      const std::filesystem::path path = std::filesystem::path(command.out) / name;
      const Clip clip = ExampleClip(**library, static_cast<int>(g), e);
      if (Status status = WriteBvh((*library)->skeleton(), clip, path); !status) {
        return PrintOutputError(status.error());
      }
      ++count;
    }
  }
  std::printf("%s: %d examples\n", command.out.c_str(), count);
  return kExitSuccess;
}

}  // namespace stridewire
