// SPDX-License-Identifier: GPL-3.0-or-later
/// Sections of a cross-check's report that show distributions, maps and costs.
#pragma once

#include "report/page.h"
#include "verification/cross_check_run.h"

namespace interglow::verification {

/// Both pictures, maps of relative difference, z and spectral angle, spectra with two standard errors.
report::Json viewer_section(const CrossCheck& check);

/// Histogram of z with what chance would give (Student's t of the batches), and the quantiles of one against the other.
report::Json z_histogram_section(const CrossCheck& check);
report::Json z_quantile_section(const CrossCheck& check);

/// Correlation of z with itself along rows and columns, for distances of 1 to 16 pixels.
report::Json autocorrelation_section(const CrossCheck& check);

/// Error against time of both methods, log-log. The radiosity's error is measured against the path tracer, whose noise
/// is taken off.
report::Json error_against_time_section(const CrossCheck& check);

}  // namespace interglow::verification
