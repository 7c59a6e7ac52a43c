#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ops/http_server.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// The viewer's files, held in memory: what was not found at the start is never served, whatever a
/// request's path says.
///
/// Files in assets/ have their content's hash in their names and may be kept for ever; others are
/// asked for again, by entity tag. Empty when there is no bundle.
class ViewerFiles {
 public:
  static constexpr std::size_t kMaxFiles = 256;
  static constexpr std::size_t kMaxBytes = std::size_t{64} << 20;  ///< Of all files together.

  ViewerFiles() = default;

  /// Reads a folder with all below it but hidden files and symbolic links. kNotFound: there is no
  /// index.html in it; kLimitExceeded: too many files or bytes; kInvalidArgument: a name that is
  /// not made of A-Z a-z 0-9 . _ -; kIo. Errors name the path.
  [[nodiscard]] static Expected<ViewerFiles> Read(const std::string& folder);

  /// That of `viewer_dir`, which has to be there; if it is empty the one that was built or
  /// installed with this program, if there is one.
  [[nodiscard]] static Expected<ViewerFiles> Find(const std::string& viewer_dir);

  /// Nothing for paths that are no file. "/" is index.html.
  [[nodiscard]] std::optional<HttpAnswer> Answer(const HttpQuery& query) const;

  [[nodiscard]] bool empty() const { return files_.empty(); }
  [[nodiscard]] std::size_t count() const { return files_.size(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  struct File {
    std::string content_type;
    std::string tag;  ///< With its quotes.
    bool is_immutable = false;
    std::shared_ptr<const std::string> content;
  };
  std::map<std::string, File, std::less<>> files_;  ///< By path, such as "/assets/a.js".
  std::size_t bytes_ = 0;
};

/// Headers of a page: scripts, styles and pictures only from here, frames nowhere.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> PageHeaders();

}  // namespace stridewire::server
