// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectral images in ENVI files: a text header (.hdr) beside raw values.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "image/spectral_image.h"

namespace interglow::image {

struct EnviFile {
  SpectralImage image;                        ///< bands in order of wavelength, whatever their order in the file
  std::map<std::string, std::string> header;  ///< all entries; keys in lower case, values without braces
  std::filesystem::path data_file;
};

/// Reads BSQ, BIL or BIP of the real data types 1, 2, 3, 4, 5, 12, 13, 14 and 15 in either byte order. Values are kept
/// in single precision: whole numbers beyond 2^24 and doubles are rounded. `data ignore value` becomes not-a-number,
/// `reflectance scale factor` divides. Wavelengths may be in nanometres or micrometres; without a unit they must lie
/// between 100 and 20000 and are nanometres.
///
/// @param path  the header, or the data file beside a header with the same name
/// @throws InvalidInput naming file, line, key and value: entries that are missing or contradict each other, a data
/// file
///         that is not found or has another size than the header says, complex values, wavelengths given twice.
EnviFile read_envi(const std::filesystem::path& path);

enum class Interleave {
  kBandSequential,         ///< bsq
  kBandInterleavedByLine,  ///< bil
  kBandInterleavedByPixel  ///< bip
};

enum class EnviType {
  kFloat32,  ///< 4
  kUint16,   ///< 12; values must be whole numbers from 0 to 65535
};

struct EnviParams {
  Interleave interleave = Interleave::kBandSequential;
  EnviType type = EnviType::kFloat32;
  bool big_endian = false;
  std::string description{};  ///< without braces
};

/// Writes the data file `path` and `path` with the extension .hdr, each atomically, the header last.
/// @throws InvalidParams if sizes disagree or path has the extension .hdr; InvalidInput if a value does not fit the
/// type,
///         naming its place, or a file cannot be written.
void write_envi(const std::filesystem::path& path, const SpectralImage& image, const EnviParams& params = {});

}  // namespace interglow::image
