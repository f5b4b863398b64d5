// SPDX-License-Identifier: GPL-3.0-or-later
/// Reports: one self-contained HTML page from a description of its sections. The same description is report.json.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace interglow::report {

/// Keys in the order they were written, so that the same report has the same bytes.
using Json = nlohmann::ordered_json;

/// The page: no requests, opens from a folder. `document` has title, subtitle, verdict {state, text}, sections, footer;
/// the sections (table, facts, text, chart, forest, viewer) are described in docs/report-format.md.
/// @throws InvalidParams if title, verdict or sections are missing or a section has an unknown type
std::string html_page(const Json& document);

}  // namespace interglow::report
