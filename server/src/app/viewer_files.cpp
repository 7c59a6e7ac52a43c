#include "app/viewer_files.h"

#include <spdlog/fmt/fmt.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

namespace stridewire::server {
namespace {

namespace fs = std::filesystem;

// The viewer can show several servers, so the page may open WebSockets to any host.
constexpr const char* kContentSecurityPolicy =
    "default-src 'self'; connect-src 'self' ws: wss:; img-src 'self' data: blob:; "
    "style-src 'self'; script-src 'self' 'wasm-unsafe-eval'; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

constexpr std::array<std::pair<std::string_view, std::string_view>, 14> kTypes = {{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".webmanifest", "application/manifest+json"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".jpg", "image/jpeg"},
    {".ico", "image/x-icon"},
    {".woff2", "font/woff2"},
    {".wasm", "application/wasm"},
    {".txt", "text/plain; charset=utf-8"},
}};

std::string_view TypeOf(std::string_view path) {
  for (const auto& [ending, type] : kTypes) {
    if (path.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

bool IsPlainName(std::string_view name) {
  return std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-';
  });
}

Expected<std::string> ReadFile(const fs::path& path, std::size_t max_bytes) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return Fail(ErrorCode::kIo, "cannot open the file", path.string());
  std::string content;
  std::array<char, 16384> buffer;
  while (file.read(buffer.data(), buffer.size()) || file.gcount() > 0) {
    content.append(buffer.data(), static_cast<std::size_t>(file.gcount()));
    if (content.size() > max_bytes) {
      return Fail(ErrorCode::kLimitExceeded, "the viewer has too many bytes", path.string(),
                  static_cast<std::int64_t>(ViewerFiles::kMaxBytes));
    }
  }
  if (file.bad() || !file.eof()) return Fail(ErrorCode::kIo, "cannot read the file", path.string());
  return content;
}

std::string TagOf(const std::string& content) {
  const XXH128_hash_t hash = XXH3_128bits(content.data(), content.size());
  return fmt::format("\"{:016x}{:016x}\"", hash.high64, hash.low64);
}

}  // namespace

Expected<ViewerFiles> ViewerFiles::Read(const std::string& folder) {
  ViewerFiles viewer;
  std::error_code error;
  const fs::path root(folder);
  if (!fs::is_regular_file(root / "index.html", error)) {
    return Fail(ErrorCode::kNotFound, "the folder contains no index.html", folder);
  }
  auto it = fs::recursive_directory_iterator(root, error);
  for (; !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
    const fs::directory_entry& entry = *it;
    const std::string name = entry.path().filename().string();
    std::error_code ignored;
    if (name.starts_with('.') || entry.is_symlink(ignored)) {
      it.disable_recursion_pending();
      continue;
    }
    if (!IsPlainName(name)) {
      return Fail(ErrorCode::kInvalidArgument, "a file name may contain only A-Z a-z 0-9 . _ -",
                  entry.path().string());
    }
    if (!entry.is_regular_file(ignored)) continue;
    if (viewer.files_.size() >= kMaxFiles) {
      return Fail(ErrorCode::kLimitExceeded, "the viewer has too many files", folder,
                  static_cast<std::int64_t>(kMaxFiles));
    }
    auto content = ReadFile(entry.path(), kMaxBytes - viewer.bytes_);
    if (!content) return std::unexpected(content.error());
    viewer.bytes_ += content->size();
    const std::string path =
        fmt::format("/{}", entry.path().lexically_relative(root).generic_string());
    viewer.files_[path] = {.content_type = std::string(TypeOf(path)),
                           .tag = TagOf(*content),
                           .is_immutable = path.starts_with("/assets/"),
                           .content = std::make_shared<const std::string>(*std::move(content))};
  }
  if (error) return Fail(ErrorCode::kIo, "cannot read the folder", folder + ": " + error.message());
  return viewer;
}

Expected<ViewerFiles> ViewerFiles::Find(const std::string& viewer_dir) {
  if (!viewer_dir.empty()) {
    auto viewer = Read(viewer_dir);
    if (!viewer) viewer.error().where = "viewer_dir: " + viewer.error().where;
    return viewer;
  }
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (error) return ViewerFiles();
  const fs::path folder = program.parent_path().parent_path() / "share/stridewire/viewer";
  if (!fs::exists(folder / "index.html", error)) return ViewerFiles();
  return Read(folder.string());
}

std::optional<HttpAnswer> ViewerFiles::Answer(const HttpQuery& query) const {
  const auto it = files_.find(query.path == "/" ? std::string_view("/index.html") : query.path);
  if (it == files_.end()) return std::nullopt;
  const File& file = it->second;
  HttpAnswer answer{
      .content_type = file.content_type,
      .cache_control = file.is_immutable ? "public, max-age=31536000, immutable" : "no-cache"};
  if (file.content_type.starts_with("text/html")) answer.headers = PageHeaders();
  answer.headers.emplace_back("ETag", file.tag);
  if (query.if_none_match == "*" || query.if_none_match.find(file.tag) != std::string_view::npos) {
    answer.status = 304;
  } else {
    answer.shared_body = file.content;
  }
  return answer;
}

std::vector<std::pair<std::string, std::string>> PageHeaders() {
  return {{"Content-Security-Policy", kContentSecurityPolicy},
          {"X-Frame-Options", "DENY"},
          {"Referrer-Policy", "no-referrer"},
          {"Cross-Origin-Opener-Policy", "same-origin"}};
}

}  // namespace stridewire::server
