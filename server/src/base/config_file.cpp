// Reads the configuration (config.h) from TOML. toml++ and its exceptions are used only here.
#include <spdlog/fmt/fmt.h>
#include <toml++/toml.h>

#include <optional>

#include "base/config.h"

namespace stridewire::server {
namespace {

std::string Where(const std::string& file, const toml::source_region& source,
                  std::string_view key) {
  return fmt::format("{}:{}: {}", file, static_cast<unsigned>(source.begin.line), key);
}

// Returns the value of `node` as text for ConfigKey::set. Returns nullopt if the type of the value
// is wrong for `key`.
std::optional<std::string> ScalarText(const toml::node& node, const ConfigKey& key) {
  if (key.is_list) {
    const toml::array* items = node.as_array();
    if (items == nullptr) return std::nullopt;
    std::string list;
    for (const toml::node& item : *items) {
      const auto text = item.value_exact<std::string>();
      // An empty item would be lost in the comma-separated text.
      if (!text || text->empty()) return std::nullopt;
      if (!list.empty()) list += ',';
      list += *text;
    }
    return list;
  }
  if (key.is_text) return node.value_exact<std::string>();
  if (key.is_flag) {
    const auto flag = node.value_exact<bool>();
    return flag ? std::optional(std::string(*flag ? "true" : "false")) : std::nullopt;
  }
  if (const auto whole = node.value_exact<std::int64_t>()) return std::to_string(*whole);
  if (const auto number = node.value_exact<double>()) return fmt::format("{}", *number);
  return std::nullopt;
}

const ConfigKey* FindKey(std::string_view section, std::string_view name) {
  for (const ConfigKey& key : ConfigKeys()) {
    if (key.section == section && key.name == name) return &key;
  }
  return nullptr;
}

Status SetKey(const ConfigKey& key, const toml::node& node, const std::string& where,
              Config& config) {
  const auto text = ScalarText(node, key);
  if (!text) {
    return Fail(ErrorCode::kInvalidArgument,
                key.is_list   ? "expected a list of strings, such as [\"https://example.org\"]"
                : key.is_text ? "expected a string in quotes"
                : key.is_flag ? "expected true or false"
                              : "expected a number",
                where);
  }
  return key.Set(config, *text, fmt::format("{} = {}", where, *text));
}

Status ReadWorld(const toml::table& table, const std::string& name, const std::string& file,
                 Config& config) {
  WorldConfig world;
  for (const auto& [key, node] : table) {
    const std::string where =
        Where(file, node.source(), "worlds." + name + "." + std::string(key.str()));
    if (key == "library") {
      const auto library = node.value_exact<std::string>();
      if (!library || library->empty()) {
        return Fail(ErrorCode::kInvalidArgument, "expected a file name or 'builtin', in quotes",
                    where);
      }
      world.library = *library;
    } else if (key == "terrain") {
      const auto terrain = node.value_exact<std::string>();
      if (!terrain || terrain->empty()) {
        return Fail(ErrorCode::kInvalidArgument, "expected a file name in quotes", where);
      }
      world.terrain = *terrain;
    } else if (key == "persistent") {
      const auto persistent = node.value_exact<bool>();
      if (!persistent) return Fail(ErrorCode::kInvalidArgument, "expected true or false", where);
      world.persistent = *persistent;
    } else if (key == "idle_motion" || key == "stride_variation") {
      std::optional<bool>& value =
          key == "idle_motion" ? world.idle_motion : world.stride_variation;
      value = node.value_exact<bool>();
      if (!value) {
        return Fail(ErrorCode::kInvalidArgument, "expected true or false", where);
      }
    } else {
      return Fail(ErrorCode::kInvalidArgument, "unknown key", where);
    }
  }
  config.worlds[name] = world;
  return {};
}

Status ReadTable(const toml::table& root, const std::string& file, Config& config) {
  for (const auto& [key, node] : root) {
    const std::string name(key.str());
    if (const ConfigKey* known = FindKey("", name)) {
      if (Status status = SetKey(*known, node, Where(file, node.source(), name), config); !status) {
        return status;
      }
      continue;
    }
    const toml::table* table = node.as_table();
    if (name != "limits" && name != "worlds") {
      return Fail(ErrorCode::kInvalidArgument, "unknown key", Where(file, node.source(), name));
    }
    if (table == nullptr) {
      return Fail(ErrorCode::kInvalidArgument,
                  "expected a section, such as [limits] or [worlds.plaza]",
                  Where(file, node.source(), name));
    }
    for (const auto& [inner_key, inner] : *table) {
      const std::string inner_name(inner_key.str());
      const std::string where = Where(file, inner.source(), name + "." + inner_name);
      if (name == "limits") {
        const ConfigKey* known = FindKey("limits", inner_name);
        if (known == nullptr) return Fail(ErrorCode::kInvalidArgument, "unknown key", where);
        if (Status status = SetKey(*known, inner, where, config); !status) return status;
      } else {
        if (!IsWorldName(inner_name)) {
          return Fail(ErrorCode::kInvalidArgument,
                      "expected a world name: 1 to 64 bytes of UTF-8 without control characters",
                      where);
        }
        const toml::table* world = inner.as_table();
        if (world == nullptr) {
          return Fail(ErrorCode::kInvalidArgument,
                      "expected a section, such as [limits] or [worlds.plaza]", where);
        }
        if (Status status = ReadWorld(*world, inner_name, file, config); !status) return status;
      }
    }
  }
  return {};
}

}  // namespace

Status ReadConfigText(std::string_view text, const std::string& name, Config& config) {
  Config read = config;
  try {
    const toml::table root = toml::parse(text, name);
    if (Status status = ReadTable(root, name, read); !status) return status;
  } catch (const toml::parse_error& error) {
    return Fail(ErrorCode::kMalformed, "invalid TOML",
                fmt::format("{}:{}: {}", name, static_cast<unsigned>(error.source().begin.line),
                            error.description()));
  }
  config = std::move(read);
  return {};
}

}  // namespace stridewire::server
