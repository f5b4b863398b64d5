// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/run_images.h"

#include "image/pixel_table.h"
#include "image/png.h"
#include "image/preview.h"
#include "image/spectral_exr.h"

namespace interglow::cli {

image::SpectralImage indirect_luminescence(const rendering::RenderedImages& images) {
  if (images.ll.value.empty()) return images.lr;
  if (images.lr.value.empty()) return images.ll;
  image::SpectralImage sum = images.lr;
  for (std::size_t k = 0; k < sum.value.size(); ++k) sum.value[k] += images.ll.value[k];
  return sum;
}

WrittenImages write_images(const rendering::RenderedImages& images, const scene::OutputDescription& output,
                           const std::filesystem::path& folder, const std::string& command_line) {
  const image::Attributes attributes = {{"interglow:command", command_line}, {"interglow:version", INTERGLOW_VERSION}};
  WrittenImages written;
  written.exposure = output.exposure.value_or(image::automatic_exposure(images.total));
  const auto write = [&](const std::string& name, const image::SpectralImage& picture) {
    image::SpectralImage black;
    if (picture.value.empty()) {
      black = {images.total.width, images.total.height, images.total.wavelength_nm, {}};
      black.value.assign(images.total.value.size(), 0.0F);
    }
    const image::SpectralImage& shown = picture.value.empty() ? black : picture;
    const image::RgbImage preview = image::make_preview(shown, {.exposure = written.exposure});
    image::write_spectral_exr(folder / (name + ".exr"), shown, preview, attributes);
    image::write_png(folder / (name + ".png"), preview, attributes);
    written.files.push_back(name + ".exr");
    written.files.push_back(name + ".png");
    written.clipped_share.emplace_back(name, preview.clipped_share);
  };
  write("image", images.total);
  if (output.components) {
    write("components/re", images.re);
    write("components/rr", images.rr);
    write("components/le", images.le);
    write("components/li", indirect_luminescence(images));
    write("components/rl", images.rl);
    if (output.split_li) {
      write("components/lr", images.lr);
      write("components/ll", images.ll);
    }
  }
  if (!output.spectra_px.empty()) {
    std::vector<image::PixelPosition> pixels;
    for (const auto& [column, row] : output.spectra_px) pixels.push_back({.row = row, .column = column});
    image::write_pixel_table(folder / "spectra.csv", images.total, pixels, {command_line});
    written.files.emplace_back("spectra.csv");
  }
  return written;
}

}  // namespace interglow::cli
