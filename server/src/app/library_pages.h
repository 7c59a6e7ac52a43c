#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "app/http_server.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::server {

/// JSON pages about the libraries of the server, for the viewer's library page. Each response is
/// computed from the library when it is requested. Responses for one hash never change.
///
///   /libraries.json                             name, hash and groups of each library
///   /libraries/HASH/skeleton.json               joints, end sites, legs
///   /libraries/HASH/summary.json                what avatars can do with the library, and whether
///                                               it passes its self-check
///   /libraries/HASH/GROUP/sites.json            parameters, examples and pseudoexamples
///   /libraries/HASH/GROUP/step.json?p=A,B,...   the movement with these parameters, which are
///                                               clamped as in requests. With &correction=0 its
///                                               weights are not corrected.
///   /libraries/HASH/GROUP/example.json?index=I  the movement of one example
///   /libraries/HASH/GROUP/errors.json?x=L&y=L&p=A,B,...&cells=N&correction=0|1
///                                               the parameter errors on a grid: parameters x and y
///                                               cover their ranges and 10 % more at each end,
///                                               others have the values of p
///
/// Invalid queries get status 400 with an explanation; unknown libraries and groups get 404.
/// Thread-safe.
class LibraryPages {
 public:
  /// Maximum number of cells along one side of the grid of errors.json.
  static constexpr int kMaxCells = 64;
  static constexpr double kFramesPerS = 30.0;

  /// Adds a library, unless one with the same hash was added before. `name` is shown to users.
  void Add(std::string name, std::shared_ptr<const MotionLibrary> library);

  /// Returns nullopt if the path is not below /libraries.
  [[nodiscard]] std::optional<HttpAnswer> Answer(const HttpQuery& query) const;

 private:
  struct Library {
    std::string name;
    std::shared_ptr<const MotionLibrary> library;
  };
  [[nodiscard]] HttpAnswer List() const;

  std::map<std::string, Library, std::less<>> libraries_;  // by hash
};

}  // namespace stridewire::server
