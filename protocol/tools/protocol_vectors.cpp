// Writes the test vectors: for each sample message a frame (NAME.bin) and its fields (NAME.json).

#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include "stridewire/protocol/encoder.h"
#include "test_vectors.h"

namespace stridewire::protocol {
namespace {

constexpr std::string_view kHelp =
    "Usage: protocol_vectors DIR | --skeleton MESSAGE\n"
    "Writes the test vectors of the wire protocol to the existing folder DIR. Their source are "
    "the\n"
    "JSON files in protocol/vectors. --skeleton prints such a file for a message with default\n"
    "values, for example SetPlanting.\n"
    "Example: build/release/bin/protocol_vectors protocol/vectors\n";

void Write(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

int Run(int argc, char** argv) {
  const std::string argument = argc > 1 ? argv[1] : "--help";
  if (argument == "--help") {
    std::cout << kHelp;
    return argc == 2 ? 0 : 2;
  }
  if (argument == "--skeleton" && argc == 3) {
    std::cout << ToJson(FromJson({{"type", argv[2]}, {"fields", nlohmann::json::object()}})).dump(1)
              << "\n";
    return 0;
  }
  const std::filesystem::path folder = argument;
  for (const auto& [name, message] : SampleMessages()) {
    std::vector<std::byte> frame;
    if (const Status status = Encoder().Encode(message, frame); !status) {
      throw std::runtime_error(name + ": " + Describe(status.error()));
    }
    Write(folder / (name + ".bin"), {reinterpret_cast<const char*>(frame.data()), frame.size()});
    Write(folder / (name + ".json"), ToJson(message).dump(1) + "\n");
  }
  return 0;
}

}  // namespace
}  // namespace stridewire::protocol

int main(int argc, char** argv) {
  try {
    return stridewire::protocol::Run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "protocol_vectors: " << error.what() << "\n";
    return dynamic_cast<const std::invalid_argument*>(&error) != nullptr ? 2 : 1;
  }
}
