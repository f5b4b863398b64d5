// SPDX-License-Identifier: GPL-3.0-or-later
/// The report of a fit: what was found, how sure it is, what it does not know, and what w/w′ may stand for.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "diagnostics/error.h"
#include "fitting/attribution.h"
#include "fitting/capture.h"
#include "fitting/scene_fit.h"
#include "fitting/uncertainty.h"
#include "report/page.h"

namespace interglow::cli {

struct FitReportInput {
  std::string title;
  std::string command_line;
  std::string version;
  std::vector<std::pair<std::string, std::string>> inputs;  ///< file, SHA-256
  Warnings warnings;
  double seconds = 0.0;
};

/// One line for the terminal and the head of the report: state and sentence.
std::pair<std::string, std::string> fit_verdict(const fitting::SceneFit& fit, const fitting::Uncertainty& uncertainty,
                                                const fitting::Attribution& attribution);

/// For report::html_page (docs/report-format.md).
report::Json fit_report(const fitting::ForwardModel& model, const fitting::Capture& capture,
                        const fitting::FitState& start, const fitting::SceneFit& fit, const fitting::FitParams& params,
                        const fitting::Uncertainty& uncertainty, const fitting::Attribution& attribution,
                        const image::SpectralImage& fitted, const FitReportInput& input);

}  // namespace interglow::cli
