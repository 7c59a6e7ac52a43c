#include <charconv>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "command_line.h"
#include "commands.h"
#include "library_json.h"
#include "offline/build/layers.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

struct LayerSource {
  LayerCut cut;
  std::string path;
};

// Removes ":number" from the end of `text` and returns the number.
std::optional<double> TakeTime(std::string_view& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return std::nullopt;
  const std::string_view digits = text.substr(colon + 1);
  double value = 0.0;
  const auto [end, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (failed != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  text = text.substr(0, colon);
  return value;
}

// Parses "wave=file.bvh:1.5:3". The two times are optional together. The file name may contain
// colons.
std::optional<LayerSource> ParseSource(std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0) return std::nullopt;
  LayerSource source;
  source.cut.name = text.substr(0, equals);
  text.remove_prefix(equals + 1);
  std::string_view without_times = text;
  const auto to_s = TakeTime(without_times);
  const auto from_s = to_s ? TakeTime(without_times) : std::nullopt;
  if (from_s) {
    source.cut.from_s = from_s;
    source.cut.to_s = to_s;
    text = without_times;
  }
  source.path = text;
  if (source.path.empty()) return std::nullopt;
  return source;
}

}  // namespace

int RunAddLayers(const AddLayersCommand& command) {
  if (command.loops.empty() && command.once.empty()) {
    return PrintError("add-layers: expected at least one --layer or --layer-once");
  }
  std::vector<LayerSource> sources;
  for (const auto* texts : {&command.loops, &command.once}) {
    for (const std::string& text : *texts) {
      auto source = ParseSource(text);
      if (!source) {
        return PrintError((texts == &command.loops ? "--layer" : "--layer-once") +
                          (": expected NAME=FILE or NAME=FILE:FROM_S:TO_S, got \"" + text + "\""));
      }
      if (IsSameFile(command.out, source->path)) {
        return PrintError("--out: " + command.out +
                          " is also an input file; choose another output path");
      }
      source->cut.is_looping = texts == &command.loops;
      sources.push_back(*std::move(source));
    }
  }
  if (IsSameFile(command.out, command.library)) {
    return PrintError("--out: " + command.out +
                      " is the input library; choose another output path");
  }
  if (Status status = CheckOutputFile(command.out); !status) {
    return PrintOutputError(status.error());
  }
  const auto library = OpenLibrary(command.library);
  if (!library) return PrintInputError(library.error());
  const Skeleton& skeleton = (*library)->skeleton();
  std::optional<std::vector<float>> mask;
  if (!command.joints.empty()) {
    auto named = MaskOfJoints(skeleton, command.joints);
    if (!named) {
      Error error = named.error();
      error.where = "--layer-joints: " + error.where;
      return PrintInputError(error);
    }
    mask = *std::move(named);
  }
  std::vector<RawLayer> layers;
  for (const LayerSource& source : sources) {
    const auto capture = ReadBvh(source.path);
    if (!capture) return PrintInputError(capture.error());
    auto layer = CutLayer(*capture, skeleton, source.cut);
    if (!layer) return PrintInputError(layer.error());
    if (mask) layer->weights = *mask;
    layers.push_back(*std::move(layer));
  }
  const auto made = AddLayers(**library, layers);
  if (!made) return PrintInputError(made.error());
  if (Status status = WriteFile(command.out, (*made)->bytes()); !status) {
    return PrintOutputError(status.error());
  }
  if (command.json) {
    std::printf("%s\n", Dump({{"layers", LayersToJson(**made)},
                              {"hash", (*made)->hash()},
                              {"bytes", (*made)->bytes().size()}})
                            .c_str());
    return kExitSuccess;
  }
  PrintLayers(**made);
  std::printf("%s: %zu bytes\n", command.out.c_str(), (*made)->bytes().size());
  return kExitSuccess;
}

}  // namespace stridewire
