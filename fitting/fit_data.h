// SPDX-License-Identifier: GPL-3.0-or-later
/// A capture as a fit sees it: values, their standard deviations, and smaller pictures of the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "fitting/capture.h"
#include "fitting/fit_params.h"
#include "image/spectral_image.h"

namespace interglow::fitting {

struct FitData {
  image::SpectralImage image;
  std::vector<std::uint8_t> use;  ///< height × width; 1: takes part
  std::vector<float> sigma;       ///< standard deviation of each value (pixels × bands), as `image.value`
  std::size_t residuals = 0;      ///< values of the pixels that take part
};

/// Noise of the capture and of the model together; 0.2 % of the band's bright values where the noise is not known.
/// @throws InvalidInput if the capture is dark in all bands
FitData fit_data(const Capture& capture, const FitParams& params);

/// Means over blocks of factor × factor pixels; a block is used if all its pixels are. Every value of a band counts
/// alike, with `sigma_share` of the band's bright values: in small pictures the model errs more than the noise does.
FitData reduced(const FitData& data, int factor, double sigma_share);

/// Value below which this share of the values lies; orders them. 0 if there are none.
double quantile(std::vector<float>& values, double share);

}  // namespace interglow::fitting
