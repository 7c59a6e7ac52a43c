#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "ops/http_server.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::server {

/// What the animator's page asks of the server's libraries, as JSON. Everything is worked out when it
/// is asked for; nothing is kept. Answers never change while a library has the same hash:
///
///   /libraries.json                          which there are: name, hash, groups
///   /libraries/HASH/skeleton.json            joints, end sites, legs
///   /libraries/HASH/GROUP/sites.json         parameters, examples and pseudoexamples
///   /libraries/HASH/GROUP/step.json?p=A,B,…  the movement of these parameters; &correction=0 leaves
///                                            it uncorrected. Clamped as requests are.
///   /libraries/HASH/GROUP/example.json?index=I
///   /libraries/HASH/GROUP/errors.json?x=L&y=L&p=A,B,…&cells=N&correction=0|1
///                                            e(p) over a slice: parameters x and y from edge to edge,
///                                            the others as p has them
///
/// Bad numbers are answered with 400 and a sentence, unknown libraries and groups with 404.
/// Safe to call from any thread.
class LibraryPages {
 public:
  static constexpr int kMostCells = 64;  ///< A side of a map of errors.
  static constexpr double kFramesPerS = 30.0;

  /// A library by what people know it as.
  void Add(std::string name, std::shared_ptr<const MotionLibrary> library);

  /// Nothing for paths that are none of these.
  [[nodiscard]] std::optional<HttpAnswer> Answer(const HttpQuery& query) const;

 private:
  struct Shown {
    std::string name;
    std::shared_ptr<const MotionLibrary> library;
  };
  [[nodiscard]] HttpAnswer List() const;

  std::map<std::string, Shown, std::less<>> libraries_;  ///< By hash.
};

}  // namespace stridewire::server
