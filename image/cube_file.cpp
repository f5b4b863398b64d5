// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/cube_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "diagnostics/error.h"
#include "image/band_folder.h"
#include "image/envi.h"
#include "image/spectral_exr.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;

std::string extension_of(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return extension;
}

/// Bits of ENVI's data types of whole numbers; 0 for floats.
int envi_bits(const std::string& type) {
  if (type == "1") return 8;
  if (type == "2" || type == "12") return 16;
  if (type == "3" || type == "13") return 32;
  return type == "14" || type == "15" ? 64 : 0;
}

}  // namespace

CubeFile read_cube(const fs::path& path, const CubeHints& hints) {
  std::error_code failed;
  if (!fs::exists(path, failed)) throw InvalidInput(path.string() + ": there is no such file or folder.");
  if (fs::is_directory(path, failed)) {
    BandFolder folder = read_band_folder(path, hints.wavelength_nm);
    return {std::move(folder.image), "folder of bands", folder.whole_bits, folder.gamma};
  }
  const std::string extension = extension_of(path);
  if (extension == ".mat") {
    MatFile file = read_mat(path, hints.mat, hints.wavelength_nm);
    return {std::move(file.image), "MATLAB", file.whole_bits, 1.0};
  }
  if (extension == ".tif" || extension == ".tiff" || extension == ".png")
    throw InvalidInput(path.string() + ": one picture; expected the folder with one a band.");
  if (hints.wavelength_nm.size() > 0) {
    throw InvalidInput(
        fmt::format("{}: wavelengths are given, but this file has its own. Leave them out, or correct "
                    "the file.",
                    path.string()));
  }
  if (extension == ".exr") return {read_spectral_exr(path).image, "spectral EXR", 0, 1.0};
  EnviFile file = read_envi(path);
  return {std::move(file.image), "ENVI",
          file.header.count("reflectance scale factor") != 0 ? 0 : envi_bits(file.header.at("data type")), 1.0};
}

void write_cube(const fs::path& path, const SpectralImage& image) {
  const std::string extension = extension_of(path);
  if (extension == ".exr") {
    write_spectral_exr(path, image);
  } else if (extension == ".mat") {
    write_mat(path, image);
  } else if (extension == ".bil") {
    write_envi(path, image, {.interleave = Interleave::kBandInterleavedByLine});
  } else if (extension == ".bip") {
    write_envi(path, image, {.interleave = Interleave::kBandInterleavedByPixel});
  } else if (extension == ".img" || extension == ".dat" || extension == ".raw" || extension == ".bsq") {
    write_envi(path, image);
  } else {
    throw InvalidParams(fmt::format(
        "{}: expected a file name ending in .exr, .mat, .img, .dat, .raw, .bsq, .bil or .bip.", path.string()));
  }
}

}  // namespace interglow::image
