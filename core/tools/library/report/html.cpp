#include "html.h"

#include <algorithm>
#include <cstdint>

#include "offline/base/utf8.h"

namespace stridewire {
namespace {

constexpr std::string_view kReplacement = "\xef\xbf\xbd";

bool IsNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789.-+ %") == std::string::npos;
}

constexpr std::string_view kStyle = R"(
body { font: 16px/1.5 sans-serif; color: #1a1a1a; background: #fff; max-width: 1200px;
       margin: 2em auto; padding: 0 1em; }
h2 { margin-top: 2.2em; border-bottom: 1px solid #bbb; }
figure { margin: 1.2em 0; }
figcaption { color: #333; max-width: 60em; }
p, ul, dl { max-width: 60em; }
img { max-width: 100%; height: auto; }
table { border-collapse: collapse; margin: 1em 0; display: block; max-width: 100%;
        overflow-x: auto; font-size: 0.9em; }
th, td { border: 1px solid #bbb; padding: 0.2em 0.5em; text-align: left; vertical-align: top; }
th { background: #eee; }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
dt { font-weight: bold; }
dd { margin: 0 0 0.6em 1.5em; }
.verdict { border-left: 6px solid #2e7d32; background: #eef6ee; padding: 0.2em 1em; }
.verdict.failed { border-color: #b71c1c; background: #fbeeee; }
nav { background: #f5f5f5; padding: 0.2em 1em; margin: 1em 0; }
nav h2 { margin: 0.4em 0; border: 0; font-size: 1.1em; }
nav ul { columns: 3; padding-left: 1.2em; max-width: none; }
)";

}  // namespace

std::string EscapeHtml(std::string_view text) {
  std::string escaped;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = Utf8SequenceLength(text, i);
    const char c = text[i];
    if (length == 0) {
      escaped += kReplacement;
    } else if (length > 1) {
      escaped += text.substr(i, length);
    } else if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else if (c == '"') {
      escaped += "&quot;";
    } else if (c == '\'') {
      escaped += "&#39;";
    } else if ((static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7f) {
      escaped += kReplacement;
    } else {
      escaped += c;
    }
    i += length == 0 ? 1 : length;
  }
  return escaped;
}

std::string EncodeBase64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
    }
  }
  return text;
}

std::string TableHtml(const HtmlTable& rows) {
  std::string html = "<table>\n";
  for (std::size_t r = 0; r < rows.size(); ++r) {
    html += "<tr>";
    for (const std::string& cell : rows[r]) {
      const char* const tag = r == 0 ? "th" : "td";
      html += std::string("<") + tag + (r > 0 && IsNumber(cell) ? " class=\"n\">" : ">") +
              EscapeHtml(cell) + "</" + tag + ">";
    }
    html += "</tr>\n";
  }
  return html + "</table>\n";
}

std::string PictureHtml(std::string_view svg, std::string_view caption, std::string_view file) {
  return "<figure><img alt=\"" + EscapeHtml(caption) + "\" src=\"data:image/svg+xml;base64," +
         EncodeBase64(svg) + "\">\n<figcaption>" + EscapeHtml(caption) + " (" + EscapeHtml(file) +
         ")</figcaption></figure>\n";
}

std::string PageHtml(std::string_view title, std::string_view body) {
  const std::string safe_title = EscapeHtml(title);
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width\">\n<title>" +
         safe_title + "</title>\n<style>" + std::string(kStyle) +
         "</style>\n</head>\n<body>\n<h1>" + safe_title + "</h1>\n" + std::string(body) +
         "</body>\n</html>\n";
}

}  // namespace stridewire
