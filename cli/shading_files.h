// SPDX-License-Identifier: GPL-3.0-or-later
/// Decompositions as files and figures.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "fitting/decomposition.h"

namespace interglow::cli {

/// One channel a component, and `relative_residual`; not-a-number outside the mask.
void write_shading(const std::filesystem::path& path, const fitting::Decomposition& found);

/// Pixels, residual, and for each object the singular values, condition number and angles of its spectra.
nlohmann::json decomposition_json(const fitting::Decomposition& found);

}  // namespace interglow::cli
