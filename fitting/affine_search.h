// SPDX-License-Identifier: GPL-3.0-or-later
/// Rough alignments to start from, without any knowledge of where one image lies on the other.
#pragma once

#include <vector>

#include "fitting/affine_registration.h"

namespace interglow::fitting {

/// The best shift of every turn and scale of the search by normalised correlation, at whole pixels; best first, at most
/// `most`. Shifts that leave less than a third of the fixed image covered are not considered.
/// Cost O(turns × scales × shifts × pixels): for images of some 30 pixels a side.
std::vector<Affine> search_affine(const image::ScalarMap& fixed, const image::ScalarMap& moving,
                                  const AffineParams& params, std::size_t most);

}  // namespace interglow::fitting
