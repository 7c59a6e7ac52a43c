// Writes the test vectors: for each sample message a frame (NAME.bin) and its fields (NAME.json).

#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include "message_json.h"
#include "sample_messages.h"
#include "stridewire/base/version.h"
#include "stridewire/protocol/encoder.h"

namespace {

bool Write(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) std::cerr << "protocol_vectors: cannot write " << path.string() << "\n";
  return static_cast<bool>(file);
}

int Run(int argc, char** argv) {
  const std::string_view argument = argc > 1 ? argv[1] : "--help";
  if (argument == "--version") {
    std::cout << "protocol_vectors " << stridewire::kVersion << "\n";
    return 0;
  }
  if (argc == 3 && argument == "--skeleton") {
    try {
      const auto json = nlohmann::ordered_json{{"type", argv[2]}, {"fields", nlohmann::json{}}};
      std::cout << stridewire::protocol::ToJson(stridewire::protocol::FromJson(json)).dump(1)
                << "\n";
      return 0;
    } catch (const std::invalid_argument& error) {
      std::cerr << "protocol_vectors: --skeleton: " << error.what() << "\n";
      return 2;
    }
  }
  if (argument == "--help") {
    std::cout
        << "Usage: protocol_vectors DIR | --skeleton MESSAGE\n"
           "Writes the test vectors of the wire protocol to the existing folder DIR. Their\n"
           "source are the JSON files in protocol/vectors. --skeleton prints such a file for a\n"
           "message with default values, for example SetPlanting.\n"
           "Example: build/release/bin/protocol_vectors protocol/vectors\n";
    return argc == 2 ? 0 : 2;
  }
  const std::filesystem::path directory(argument);
  if (!std::filesystem::is_directory(directory)) {
    std::cerr << "protocol_vectors: " << directory.string() << " is not a directory\n";
    return 2;
  }
  stridewire::protocol::Encoder encoder;
  for (const auto& sample : stridewire::protocol::SampleMessages()) {
    std::vector<std::byte> frame;
    if (const auto status = encoder.Encode(sample.message, frame); !status) {
      std::cerr << "protocol_vectors: " << sample.name << ": "
                << stridewire::Describe(status.error()) << "\n";
      return 1;
    }
    const std::string_view bytes(reinterpret_cast<const char*>(frame.data()), frame.size());
    const std::string json = stridewire::protocol::ToJson(sample.message).dump(1) + "\n";
    if (!Write(directory / (sample.name + ".bin"), bytes) ||
        !Write(directory / (sample.name + ".json"), json)) {
      return 1;
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "protocol_vectors: " << error.what() << "\n";
    return 1;
  }
}
