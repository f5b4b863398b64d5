// SPDX-License-Identifier: GPL-3.0-or-later
/// What a cross-check found, as a page and in words.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "report/page.h"
#include "verification/cross_check_run.h"

namespace interglow::verification {

/// Where a check came from.
struct Provenance {
  std::string title;  ///< of the scene
  std::string command_line;
  std::string version;
  std::vector<std::pair<std::string, std::string>> inputs;  ///< file, SHA-256
  std::vector<std::string> warnings;
};

/// One sentence for each verdict, with the figures it rests on.
std::string verdict_sentence(const CrossCheck& check, const CrossCheckParams& params);

/// report.json: the page's description (docs/report-format.md) and, under "result", all figures by name.
report::Json report_document(const CrossCheck& check, const CrossCheckParams& params, const Provenance& provenance);

}  // namespace interglow::verification
