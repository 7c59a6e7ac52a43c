#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/http_server.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// The files of the viewer, read into memory at the start. Requests cannot access any other files.
///
/// Files in assets/ have a hash of their content in their names, so browsers may cache them
/// forever. Browsers revalidate other files with their entity tags. Empty if there is no viewer.
class ViewerFiles {
 public:
  static constexpr std::size_t kMaxFiles = 256;
  /// Maximum size of all files together.
  static constexpr std::size_t kMaxBytes = std::size_t{64} << 20;

  ViewerFiles() = default;

  /// Reads a folder recursively, except hidden files and symbolic links. Fails with kNotFound if it
  /// has no index.html, kLimitExceeded if there are too many files or bytes, kInvalidArgument if a
  /// name contains characters other than A-Z a-z 0-9 . _ -, or kIo. Errors name the path.
  [[nodiscard]] static Expected<ViewerFiles> Read(const std::string& folder);

  /// Reads `viewer_dir`. If it is empty, reads the viewer that was built or installed with this
  /// program, or returns an empty object if there is none.
  [[nodiscard]] static Expected<ViewerFiles> Find(const std::string& viewer_dir);

  /// Returns nullopt if no file has this path. The path "/" is index.html.
  [[nodiscard]] std::optional<HttpAnswer> Answer(const HttpQuery& query) const;

  [[nodiscard]] bool empty() const { return files_.empty(); }
  [[nodiscard]] std::size_t count() const { return files_.size(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  struct File {
    std::string content_type;
    std::string tag;  ///< Entity tag, including its quotes.
    bool is_immutable = false;
    std::shared_ptr<const std::string> content;
  };
  std::map<std::string, File, std::less<>> files_;  ///< Files by path, such as "/assets/a.js".
  std::size_t bytes_ = 0;
};

/// Returns the security headers of a page. The page may not load scripts, styles or images from
/// other servers, and may not be embedded in frames.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> PageHeaders();

}  // namespace stridewire::server
