// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/channel_file.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <cassert>
#include <fstream>
#include <memory>

#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;

/// OpenImageIO and OpenEXR keep threads of their own: as many as oneTBB may use here and now.
void match_thread_count() {
  const auto allowed =
      static_cast<int>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  OIIO::attribute("threads", allowed);
  OIIO::attribute("exr_threads", allowed > 1 ? allowed : -1);  // -1: none besides the caller's
}

void require_exr(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error))
    throw InvalidInput(path.string() + ": this is a folder; expected an OpenEXR file.");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InvalidInput(path.string() + ": this file cannot be opened. Check the name and the permissions.");
  char magic[4] = {};
  stream.read(magic, sizeof magic);
  const std::string found(magic, static_cast<std::size_t>(stream.gcount()));
  if (found != std::string("\x76\x2f\x31\x01", 4)) {
    throw InvalidInput(path.string() +
                       ": this is not an OpenEXR file (its first bytes are not 76 2f 31 01). Convert the image "
                       "to OpenEXR.");
  }
}

/// Refuses headers that promise far more than the file can hold, before anything is allocated for it.
void require_plausible_size(const fs::path& path, const OIIO::ImageSpec& spec, double bytes_per_value) {
  // Deflate, the strongest of the compressions, shrinks constant data by at most 1032.
  constexpr double kLargestRatio = 1032.0;
  constexpr double kLargestBytes = 64e9;
  const double bytes = bytes_per_value * spec.width * spec.height * spec.nchannels;
  std::error_code error;
  const double held = static_cast<double>(fs::file_size(path, error));
  if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0 || spec.depth > 1 || spec.deep || error ||
      bytes > kLargestRatio * held || bytes > kLargestBytes) {
    throw InvalidInput(
        fmt::format("{}: {} x {} pixels with {} channels{} in a file of {} bytes; expected a flat image that the file "
                    "can hold. Write it "
                    "again.",
                    path.string(), spec.width, spec.height, spec.nchannels, spec.deep ? " (deep)" : "", held));
  }
}

[[noreturn]] void fail_write(const fs::path& path, const std::string& reason) {
  throw InvalidInput(fmt::format("{}: cannot be written ({}). Check that the folder is writable and the disk has room.",
                                 path.string(), reason));
}

void write(const fs::path& path, const OIIO::ImageSpec& spec, const void* value) {
  match_thread_count();
  files::write_atomically(path, [&](const fs::path& temporary) {
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(path.extension().string().substr(1));
    if (!output) fail_write(path, OIIO::geterror());
    if (!output->open(temporary.string(), spec) || !output->write_image(spec.format, value) || !output->close()) {
      fail_write(path, output->geterror());
    }
  });
}

void require_extension(const fs::path& path, const std::string& extension) {
  if (path.extension() == extension) return;
  throw InvalidParams(fmt::format("{}: expected a file name ending in {}.", path.string(), extension));
}

void write_png(const fs::path& path, OIIO::ImageSpec spec, const void* value, const Attributes& attributes) {
  require_extension(path, ".png");
  for (const auto& [name, text] : attributes) spec.attribute(name, text);
  write(path, spec, value);
}

template <typename Number>
void read_grey_values(OIIO::ImageInput& input, const fs::path& path, GreyImage& image) {
  const auto width = static_cast<std::size_t>(image.width);
  std::vector<Number> value(width * static_cast<std::size_t>(image.height));
  const OIIO::TypeDesc type = OIIO::BaseTypeFromC<Number>::value;
  // Line by line: read_image takes whole compressed strips of TIFF apart itself and passes over those that are cut off
  // (OpenImageIO 2.4.7; can go when a cut strip makes it fail).
  bool whole = true;
  if (input.spec().tile_width > 0) {
    whole = input.read_image(0, 0, 0, 1, type, value.data());
  } else {
    for (int row = 0; row < image.height && whole; ++row)
      whole = input.read_scanline(row, 0, type, value.data() + static_cast<std::size_t>(row) * width);
  }
  if (!whole) {
    throw InvalidInput(
        fmt::format("{}: the pixels cannot be read ({}); the file is damaged or cut off. Write it again.",
                    path.string(), input.geterror()));
  }
  image.value.assign(value.begin(), value.end());
}

}  // namespace

GreyImage read_grey_file(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    throw InvalidInput(path.string() + ": no such file; expected a TIFF or PNG of one channel.");
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path.string());
  if (!input || (input->format_name() != std::string_view("tiff") && input->format_name() != std::string_view("png"))) {
    const std::string reason = input ? fmt::format("it is {}", input->format_name()) : OIIO::geterror();
    throw InvalidInput(fmt::format("{}: not a readable TIFF or PNG ({}). Write it again.", path.string(), reason));
  }
  const OIIO::ImageSpec spec = input->spec();
  if (spec.nchannels != 1) {
    throw InvalidInput(fmt::format("{}: {} channels; expected one. Write one grey picture a band, without alpha.",
                                   path.string(), spec.nchannels));
  }
  const auto size = static_cast<int>(spec.format.size());
  const int sample_bits = spec.get_int_attribute("oiio:BitsPerSample", 8 * size);
  if (sample_bits != 8 * size) {
    throw InvalidInput(
        fmt::format("{}: samples packed to {} bits; expected 8, 16 or 32. Write 16 bits.", path.string(), sample_bits));
  }
  require_plausible_size(path, spec, size);
  GreyImage image;
  image.width = spec.width;
  image.height = spec.height;
  image.gamma = spec.get_float_attribute("oiio:Gamma", 1.0F);
  switch (spec.format.basetype) {
    case OIIO::TypeDesc::UINT8:
      read_grey_values<std::uint8_t>(*input, path, image);
      image.whole_bits = 8;
      break;
    case OIIO::TypeDesc::UINT16:
      read_grey_values<std::uint16_t>(*input, path, image);
      image.whole_bits = 16;
      break;
    case OIIO::TypeDesc::UINT32:
      read_grey_values<std::uint32_t>(*input, path, image);
      image.whole_bits = 32;
      break;
    case OIIO::TypeDesc::FLOAT:
      read_grey_values<float>(*input, path, image);
      break;
    default:
      throw InvalidInput(fmt::format("{}: values of type {}; expected whole numbers without sign or 32-bit floats.",
                                     path.string(), spec.format.c_str()));
  }
  if (input->seek_subimage(1, 0))
    throw InvalidInput(path.string() + ": more than one page; expected one. Write one file a band.");
  return image;
}

void write_grey_words(const fs::path& path, int width, int height, const std::vector<std::uint16_t>& value) {
  assert(value.size() == static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (path.extension() != ".png" && path.extension() != ".tif" && path.extension() != ".tiff")
    throw InvalidParams(path.string() + ": expected a file name ending in .png, .tif or .tiff.");
  OIIO::ImageSpec spec(width, height, 1, OIIO::TypeUInt16);
  spec.attribute("oiio:ColorSpace", "Linear");
  if (path.extension() != ".png") spec.attribute("compression", "zip");
  // Of noisy counts the strongest compression saves 2 % more and takes several times as long.
  spec.attribute("tiff:zipquality", 1);
  spec.attribute("png:compressionLevel", 1);
  write(path, spec, value.data());
}

ChannelImage read_exr_channels(const fs::path& path) {
  require_exr(path);
  match_thread_count();
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path.string());
  if (!input) {
    throw InvalidInput(
        fmt::format("{}: not a readable OpenEXR file ({}). Write it again.", path.string(), OIIO::geterror()));
  }
  const OIIO::ImageSpec& spec = input->spec();
  require_plausible_size(path, spec, 4.0);
  ChannelImage image;
  image.width = spec.width;
  image.height = spec.height;
  image.channel = spec.channelnames;
  for (const OIIO::ParamValue& attribute : spec.extra_attribs) {
    if (attribute.type() == OIIO::TypeString)
      image.attributes.emplace_back(attribute.name().string(), attribute.get_string());
    if (attribute.type() == OIIO::TypeFloat)
      image.numbers.emplace_back(attribute.name().string(), attribute.get_float());
  }
  image.value.resize(static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(spec.height) *
                     image.channel.size());
  if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeFloat, image.value.data())) {
    throw InvalidInput(
        fmt::format("{}: the pixels cannot be read ({}); the file is damaged or cut off. Write it again.",
                    path.string(), input->geterror()));
  }
  return image;
}

void write_exr_channels(const fs::path& path, const ChannelImage& image) {
  require_extension(path, ".exr");
  assert(image.value.size() ==
         static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height) * image.channel.size());
  OIIO::ImageSpec spec(image.width, image.height, static_cast<int>(image.channel.size()), OIIO::TypeFloat);
  spec.channelnames = image.channel;
  // Of the lossless ones PIZ gave the smallest files of spectral images in the least time but RLE's.
  spec.attribute("compression", "piz");
  for (const auto& [name, text] : image.attributes) spec.attribute(name, text);
  for (const auto& [name, number] : image.numbers) spec.attribute(name, number);
  write(path, spec, image.value.data());
}

void write_png_bytes(const fs::path& path, int width, int height, int channels, const std::vector<std::uint8_t>& value,
                     const Attributes& attributes) {
  OIIO::ImageSpec spec(width, height, channels, OIIO::TypeUInt8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  write_png(path, std::move(spec), value.data(), attributes);
}

void write_png_words(const fs::path& path, int width, int height, int channels, const std::vector<std::uint16_t>& value,
                     const Attributes& attributes) {
  write_png(path, OIIO::ImageSpec(width, height, channels, OIIO::TypeUInt16), value.data(), attributes);
}

}  // namespace interglow::image
