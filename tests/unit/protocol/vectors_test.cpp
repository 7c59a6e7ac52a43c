#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "protocol_testing.h"
#include "test_paths.h"
#include "test_vectors.h"

namespace stridewire::protocol {
namespace {

const std::filesystem::path kDirectory = SourceDir() / "protocol" / "vectors";

std::string Read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file) << path;
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::set<std::string> Names() {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(kDirectory)) {
    if (entry.path().extension() == ".bin") names.insert(entry.path().stem().string());
  }
  return names;
}

TEST(Vectors, DecodeToTheirJson) {
  const auto names = Names();
  ASSERT_FALSE(names.empty());
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    const std::string bytes = Read(kDirectory / (name + ".bin"));
    const auto json = nlohmann::ordered_json::parse(Read(kDirectory / (name + ".json")));
    std::vector<std::byte> frame(bytes.size());
    std::memcpy(frame.data(), bytes.data(), bytes.size());
    const auto message = Decode(frame, json.at("type_number").get<MessageType>());
    ASSERT_TRUE(message) << Describe(message.error());
    EXPECT_EQ(ToJson(*message), json);
    EXPECT_EQ(EncodeOrFail(*message), frame);
  }
}

TEST(Vectors, EqualTheSampleMessages) {
  std::set<std::string> samples;
  for (const auto& [name, sample] : SampleMessages()) {
    SCOPED_TRACE(name);
    samples.insert(name);
    const auto frame = EncodeOrFail(sample);
    EXPECT_EQ(Read(kDirectory / (name + ".bin")),
              std::string(reinterpret_cast<const char*>(frame.data()), frame.size()))
        << "run protocol_vectors, if the wire was meant to change";
  }
  EXPECT_EQ(samples, Names());
}

}  // namespace
}  // namespace stridewire::protocol
