// SPDX-License-Identifier: GPL-3.0-or-later
/// Numbers inside a page: small enough that a picture with its spectra fits into a few megabytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "image/spectral_image.h"
#include "report/page.h"

namespace interglow::report {

/// {type, shape, scale, data}: half floats relative to the largest size (11 bits), deflated, base64. Not finite values
/// stay so.
Json pack_half(std::span<const float> values, const std::vector<int>& shape);

/// The same in full single precision.
Json pack_float(std::span<const float> values, const std::vector<int>& shape);

/// {wavelength_nm, basis, weights}: the picture averaged down to at most `largest_side` pixels a side, as weights of
/// the principal spectra that carry all but 1e-7 of its energy (at most `largest_rank`). Cost O(pixels × bands²).
Json pack_spectra(const image::SpectralImage& image, int largest_side = 256, int largest_rank = 8);

}  // namespace interglow::report
