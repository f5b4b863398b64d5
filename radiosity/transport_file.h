// SPDX-License-Identifier: GPL-3.0-or-later
/// Matrices of form factors as files.
#pragma once

#include <filesystem>
#include <string>

#include "diagnostics/progress.h"
#include "radiosity/transport.h"

namespace interglow::radiosity {

/// Before any work: whether `write_form_factors` would take this name.
/// @throws InvalidParams if the ending is neither .mtx nor .npz, or the file is a folder
void check_form_factor_file(const std::filesystem::path& path);

/// Writes F, rows and columns in the order of the elements, doubles in full precision.
///
/// `.mtx`: Matrix Market, coordinate real general, indices from 1; `comment` goes to its head, one line a `%` line.
/// `.npz`: compressed rows as scipy.sparse.load_npz reads them (data, indices, indptr, shape, format), and `area_mm2`
/// besides. The file is whole or not there.
/// @throws InvalidParams as `check_form_factor_file` does, or if an .npz would pass 4 GiB; InvalidInput if it cannot be
/// written
/// Cost O(stored pairs); memory for .npz about 24 bytes a stored pair.
void write_form_factors(const Transport& transport, const std::filesystem::path& path, const std::string& comment = {},
                        const Progress& progress = {});

}  // namespace interglow::radiosity
