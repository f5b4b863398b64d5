// SPDX-License-Identifier: GPL-3.0-or-later
#include "report/page.h"

#include <fmt/format.h>

#include <array>
#include <string_view>

#include "diagnostics/error.h"

namespace interglow::report {
namespace detail {
extern const char* const kPageTemplate;  // generated from report/page
}

namespace {

void check(const Json& document) {
  for (const char* key : {"title", "verdict", "sections"}) {
    if (!document.contains(key)) throw InvalidParams(fmt::format("report: \"{}\" is missing.", key));
  }
  static constexpr std::array<std::string_view, 6> kTypes = {"table", "facts", "text", "chart", "forest", "viewer"};
  for (const Json& section : document.at("sections")) {
    const std::string type = section.value("type", "");
    bool known = false;
    for (const std::string_view one : kTypes) known |= type == one;
    if (!known || !section.contains("title")) {
      throw InvalidParams(
          fmt::format("report: section \"{}\" has type \"{}\"; expected a title and one of table, facts, text, chart, "
                      "forest, viewer.",
                      section.value("title", ""), type));
    }
  }
}

}  // namespace

std::string html_page(const Json& document) {
  check(document);
  // "</" would end the script element that carries the data; "<!--" would change how it is read.
  std::string data = document.dump();
  std::string safe;
  safe.reserve(data.size());
  for (const char c : data) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  static constexpr std::string_view kPlace = "/*DATA*/";
  const std::string_view page = detail::kPageTemplate;
  const std::size_t at = page.find(kPlace);
  std::string html;
  html.reserve(page.size() + safe.size());
  html += page.substr(0, at);
  html += safe;
  html += page.substr(at + kPlace.size());
  return html;
}

}  // namespace interglow::report
