// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/pixel_table.h"

#include <fmt/format.h>

#include "diagnostics/error.h"
#include "spectral/spectrum_file.h"

namespace interglow::image {

void write_pixel_table(const std::filesystem::path& path, const SpectralImage& image,
                       const std::vector<PixelPosition>& pixels, const std::vector<std::string>& comments) {
  std::vector<spectral::NamedValues> columns;
  for (const PixelPosition& pixel : pixels) {
    if (pixel.row < 0 || pixel.row >= image.height || pixel.column < 0 || pixel.column >= image.width) {
      throw InvalidParams(fmt::format("pixel table: row {}, column {} is outside the image of {} rows and {} columns.",
                                      pixel.row, pixel.column, image.height, image.width));
    }
    const Eigen::Map<const Eigen::VectorXf> spectrum(image.pixel(pixel.row, pixel.column), image.bands());
    columns.push_back({fmt::format("row{}_column{}", pixel.row, pixel.column), spectrum.cast<double>()});
  }
  std::vector<std::string> all = {"radiance [W m^-2 sr^-1 nm^-1]; row 0 is the top, column 0 the left"};
  all.insert(all.end(), comments.begin(), comments.end());
  spectral::write_spectra_csv(path, image.wavelength_nm, columns, all);
}

}  // namespace interglow::image
