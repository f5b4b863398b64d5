// SPDX-License-Identifier: GPL-3.0-or-later
/// Image files as named channels: the only place that knows the image library.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace interglow::image {

/// Text attributes of an image file, by name.
using Attributes = std::vector<std::pair<std::string, std::string>>;

struct ChannelImage {
  int width = 0;
  int height = 0;
  std::vector<std::string> channel;
  std::vector<float> value;  ///< height × width × channels; row 0 is the top
  Attributes attributes;
  std::vector<std::pair<std::string, float>> numbers;  ///< attributes that are numbers
};

/// Reads the first part of an OpenEXR file (any channels of 16 or 32 bits) whole.
/// @throws InvalidInput if it is no readable OpenEXR file, or declares more pixels than its size can hold.
ChannelImage read_exr_channels(const std::filesystem::path& path);

/// Writes OpenEXR, 32-bit float, PIZ compression (lossless), atomically.
/// @throws InvalidInput if the file cannot be written.
void write_exr_channels(const std::filesystem::path& path, const ChannelImage& image);

/// One grey picture with the numbers that stand in its file.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<float> value;  ///< height × width; row 0 is the top
  int whole_bits = 0;        ///< 8, 16 or 32: whole numbers of so many bits; 0: floats
  double gamma = 1.0;        ///< exponent that the file says its values were encoded with (1 / gamma); 1: none said
};

/// Reads TIFF or PNG of one channel: 8, 16 or 32 bits whole (32 are rounded to single precision), or floats.
/// @throws InvalidInput naming what was found: another format, more than one channel or page, packed samples of other
///         sizes, more pixels than the file can hold, a damaged file.
GreyImage read_grey_file(const std::filesystem::path& path);

/// Writes TIFF (Deflate) or PNG of one channel and 16 bits, by the extension .tif, .tiff or .png, atomically.
void write_grey_words(const std::filesystem::path& path, int width, int height,
                      const std::vector<std::uint16_t>& value);

/// Writes PNG, atomically: 1 (grey), 3 (RGB) or 4 (RGBA) channels, height × width × channels values.
void write_png_bytes(const std::filesystem::path& path, int width, int height, int channels,
                     const std::vector<std::uint8_t>& value, const Attributes& attributes);
void write_png_words(const std::filesystem::path& path, int width, int height, int channels,
                     const std::vector<std::uint16_t>& value, const Attributes& attributes);

}  // namespace interglow::image
