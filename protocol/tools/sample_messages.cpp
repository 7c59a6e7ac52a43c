#include "sample_messages.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "base/check.h"
#include "message_json.h"

namespace stridewire::protocol {
namespace {

Message ReadSample(const std::filesystem::path& path) {
  std::ifstream file(path);
  STRIDEWIRE_CHECK(file.good());
  return FromJson(nlohmann::ordered_json::parse(file));
}

const std::filesystem::path kFolder =
    std::filesystem::path(STRIDEWIRE_SOURCE_DIR) / "protocol" / "vectors";

/// The world whose poses the batches contain.
const WorldInfo& SampleWorld() {
  static const WorldInfo world =
      std::get<WorldInfo>(ReadSample(kFolder / "world_info_detail.json"));
  return world;
}

}  // namespace

const CompactCodecs& SampleCodecs() {
  static const CompactCodecs codecs = [] {
    const WorldInfo& world = SampleWorld();
    std::vector<std::int16_t> parents;
    for (const JointInfo& joint : world.skeleton.joints) parents.push_back(joint.parent);
    return CompactCodecs::Make(world.rotation_quantizations, parents, world.reduced_joints).value();
  }();
  return codecs;
}

std::vector<SampleMessage> SampleMessages() {
  std::vector<SampleMessage> samples;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() == ".json") samples.push_back({name, ReadSample(entry.path())});
  }
  std::ranges::sort(samples, {}, &SampleMessage::name);
  return samples;
}

}  // namespace stridewire::protocol
