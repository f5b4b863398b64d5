// SPDX-License-Identifier: GPL-3.0-or-later
/// A registration in words and as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "fitting/affine_registration.h"

namespace interglow::cli {

/// Lines for the terminal.
void print_registration(const fitting::AffineRegistration& found);

nlohmann::json registration_json(const fitting::AffineRegistration& found);

/// The image registered on the reference by the means of their bands and resampled on its pixels.
struct RegisteredImage {
  fitting::AffineRegistration found;
  fitting::WarpedImage warped;
};

/// @throws NumericalFailure if the registration did not converge
RegisteredImage register_on(const image::SpectralImage& image, const image::SpectralImage& reference,
                            const fitting::AffineParams& params = {});

}  // namespace interglow::cli
