#pragma once

#include <memory>
#include <string>
#include <vector>

#include "capture_files.h"
#include "offline/extract/assemble.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {

/// Names the two takes of subject 01 that Debian's assimp-testmodels carries, so that any machine has them.
inline constexpr const char* kDebianTakes = "assimp-testmodels";

/// The takes of one subject of CMU's ("03", "16"), or kDebianTakes.
inline std::vector<std::filesystem::path> TakesOfOne(const std::string& subject) {
  if (subject != kDebianTakes) return MocapFiles("cmu/" + subject);
  std::vector<std::filesystem::path> takes;
  for (const char* name : {"01_01.bvh", "01_03.bvh"}) {
    if (!ModelFile(name).empty()) takes.push_back(ModelFile(name));
  }
  return takes;
}

/// All takes of the subjects.
inline std::vector<std::filesystem::path> TakesOf(const std::vector<std::string>& subjects) {
  std::vector<std::filesystem::path> all;
  for (const std::string& subject : subjects) {
    const std::vector<std::filesystem::path> takes = TakesOfOne(subject);
    all.insert(all.end(), takes.begin(), takes.end());
  }
  return all;
}

/// Which of the subjects have no takes on this machine, and where they were looked for; empty if all have.
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

/// What extraction finds in takes that are there.
inline RawLibrary AssembleTakes(const std::vector<std::filesystem::path>& takes,
                                const AssembleOptions& options) {
  LibraryAssembler assembler(options);
  for (const std::filesystem::path& take : takes) assembler.Add(ReadBvh(take).value());
  return assembler.Assemble().value();
}

/// The library that `stridewire-library build --mirror` makes of takes that are there.
inline std::shared_ptr<const MotionLibrary> BuildFromTakes(
    const std::vector<std::filesystem::path>& takes,
    LibraryBuilder builder = LibraryBuilder::Selecting()) {
  return builder.Build(AssembleTakes(takes, {.mirror = true})).value();
}

/// The generated library if no subjects are named, else BuildFromTakes() of theirs.
inline std::shared_ptr<const MotionLibrary> LibraryOf(const std::vector<std::string>& subjects) {
  if (subjects.empty()) return OpenLibrary("builtin").value();
  return BuildFromTakes(TakesOf(subjects));
}

/// The same with every movement as it was captured: nothing selected, averaged or made smooth. What made movements are
/// compared with.
inline std::shared_ptr<const MotionLibrary> LibraryOfAll(const std::vector<std::string>& subjects) {
  if (subjects.empty()) return OpenLibrary("builtin").value();
  return BuildFromTakes(TakesOf(subjects), LibraryBuilder{});
}

}  // namespace stridewire

/// Skips a test of subjects of which one or more have no takes here; never one that names none.
#define STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects)                                             \
  if (const std::string missing = ::stridewire::MissingTakes(subjects); !missing.empty()) { \
    GTEST_SKIP() << missing;                                                                \
  }
