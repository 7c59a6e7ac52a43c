#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace stridewire {

// Escapes text for use between tags and in double-quoted attributes. Invalid UTF-8 and control
// characters are replaced.
[[nodiscard]] std::string EscapeHtml(std::string_view text);

[[nodiscard]] std::string EncodeBase64(std::string_view bytes);

// Rows of plain text; the first row is the header. Cells that contain numbers are right-aligned.
using HtmlTable = std::vector<std::vector<std::string>>;
[[nodiscard]] std::string TableHtml(const HtmlTable& rows);

// Returns a figure with its caption. The SVG is embedded in the page.
[[nodiscard]] std::string PictureHtml(std::string_view svg, std::string_view caption,
                                      std::string_view file);

// Returns the whole page. `body` must be HTML.
[[nodiscard]] std::string PageHtml(std::string_view title, std::string_view body);

}  // namespace stridewire
