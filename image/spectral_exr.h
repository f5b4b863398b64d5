// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectral images in OpenEXR files, in the layout of Fichet, Pacanowski and Wilkie (2021).
#pragma once

#include <filesystem>
#include <string>

#include "image/channel_file.h"
#include "image/preview.h"
#include "image/spectral_image.h"

namespace interglow::image {

/// What a spectral file holds beside the pixels.
struct SpectralFile {
  SpectralImage image;
  std::string emissive_units;  ///< as written in the file; empty if it does not say
  Attributes attributes;       ///< all text attributes
};

/// Writes the emissive layout: one 32-bit channel a band, `S0.550,000000nm` (the comma is the layout's decimal mark),
/// and the preview as R, G, B in linear sRGB. Attributes: spectralLayoutVersion "1.0", emissiveUnits "W.m^-2.sr^-1"
/// (the one string all readers take), EV (log2 of the preview's exposure), interglow:unit (the values are per nm),
/// polarisation handedness is not written as there is no polarisation. `attributes` are added: command line, version.
/// @param preview  same size as the image
/// @throws InvalidParams if sizes disagree, InvalidInput if the file cannot be written. Written atomically.
void write_spectral_exr(const std::filesystem::path& path, const SpectralImage& image, const RgbImage& preview,
                        const Attributes& attributes = {});

/// The same with the preview of automatic exposure.
void write_spectral_exr(const std::filesystem::path& path, const SpectralImage& image,
                        const Attributes& attributes = {});

/// Reads the S0 channels of any writer of the layout: any number of digits, decimal comma or point, wavelengths in
/// metres or frequencies in hertz with any SI prefix; ordered by wavelength whatever their order in the file. A file
/// with a `Y` channel (or a single one) and no S0 is a grey image: one band at `kGreyWavelengthNm`.
/// @throws InvalidInput if there is no such channel, a wavelength appears twice, or a pixel is not finite.
SpectralFile read_spectral_exr(const std::filesystem::path& path);

/// Where a grey image puts its only band; the middle of the camera's range.
inline constexpr double kGreyWavelengthNm = 550.0;

/// The layout's name of an emissive channel, for instance "S0.550,000000nm".
std::string emissive_channel_name(double wavelength_nm);

}  // namespace interglow::image
