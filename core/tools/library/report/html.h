#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace stridewire {

// Text safe between tags and inside double-quoted attributes: & < > " ' are escaped, bytes that no
// UTF-8 is made of and control characters replaced.
[[nodiscard]] std::string EscapeHtml(std::string_view text);

[[nodiscard]] std::string EncodeBase64(std::string_view bytes);

// Rows of plain text; the first is the head. Numbers stand right.
using HtmlTable = std::vector<std::vector<std::string>>;
[[nodiscard]] std::string TableHtml(const HtmlTable& rows);

// A picture inside the page itself, with its caption below.
[[nodiscard]] std::string PictureHtml(std::string_view svg, std::string_view caption,
                                      std::string_view file);

// The whole page; `body` is HTML already.
[[nodiscard]] std::string PageHtml(std::string_view title, std::string_view body);

}  // namespace stridewire
