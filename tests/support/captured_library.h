#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "capture_files.h"
#include "offline/extract/assemble.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {

/// Name for the two takes of subject 01 in Debian's package assimp-testmodels.
inline constexpr const char* kDebianTakes = "assimp-testmodels";

/// Returns the takes of one subject of the CMU captures ("03", "16"), of a folder below MocapDir()
/// ("gaits/07"), or those of kDebianTakes.
inline std::vector<std::filesystem::path> TakesOfOne(const std::string& subject) {
  if (subject.contains('/')) return MocapFiles(subject);
  if (subject != kDebianTakes) return MocapFiles("cmu/" + subject);
  std::vector<std::filesystem::path> takes;
  for (const char* name : {"01_01.bvh", "01_03.bvh"}) {
    if (!ModelFile(name).empty()) takes.push_back(ModelFile(name));
  }
  return takes;
}

/// Returns all takes of some subjects.
inline std::vector<std::filesystem::path> TakesOf(const std::vector<std::string>& subjects) {
  std::vector<std::filesystem::path> all;
  for (const std::string& subject : subjects) {
    const std::vector<std::filesystem::path> takes = TakesOfOne(subject);
    all.insert(all.end(), takes.begin(), takes.end());
  }
  return all;
}

/// Describes which subjects have no takes on this machine; empty if all have takes.
inline std::string MissingTakes(const std::vector<std::string>& subjects) {
  std::string text;
  for (const std::string& subject : subjects) {
    if (!TakesOfOne(subject).empty()) continue;
    if (!text.empty()) text += ", ";
    text += subject == kDebianTakes
                ? std::string("no captures of Debian's package assimp-testmodels")
                : "no captures in " + (MocapDir() / "cmu" / subject).string();
  }
  return text;
}

/// Extracts and combines the movements of existing takes.
inline RawLibrary AssembleTakes(const std::vector<std::filesystem::path>& takes,
                                const AssembleOptions& options) {
  LibraryAssembler assembler(options);
  for (const std::filesystem::path& take : takes) assembler.Add(ReadBvh(take).value());
  return assembler.Assemble().value();
}

/// Builds a library from existing takes like `stridewire-library build --mirror`.
inline std::shared_ptr<const MotionLibrary> BuildFromTakes(
    const std::vector<std::filesystem::path>& takes,
    LibraryBuilder builder = LibraryBuilder::Selecting()) {
  return builder.Build(AssembleTakes(takes, {.mirror = true})).value();
}

/// Returns the library of some subjects, or the generated library if there are none. A process
/// builds each library only once.
inline std::shared_ptr<const MotionLibrary> LibraryOf(const std::vector<std::string>& subjects) {
  if (subjects.empty()) return OpenLibrary("builtin").value();
  static std::map<std::vector<std::string>, std::shared_ptr<const MotionLibrary>> built;
  std::shared_ptr<const MotionLibrary>& library = built[subjects];
  if (!library) library = BuildFromTakes(TakesOf(subjects));
  return library;
}

/// Same as LibraryOf, but without selection, averaging and smoothing, so that every movement is as
/// captured. A reference for synthesized movements.
inline std::shared_ptr<const MotionLibrary> LibraryOfAll(const std::vector<std::string>& subjects) {
  if (subjects.empty()) return OpenLibrary("builtin").value();
  return BuildFromTakes(TakesOf(subjects), LibraryBuilder::KeepingAll());
}

}  // namespace stridewire

/// Skips a test if takes of one of its subjects are missing. Never skips tests without subjects.
#define STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects)                                             \
  if (const std::string missing = ::stridewire::MissingTakes(subjects); !missing.empty()) { \
    GTEST_SKIP() << missing;                                                                \
  }
