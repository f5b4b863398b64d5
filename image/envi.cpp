// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/envi.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>
#include <vector>

#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "image/envi_header.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kLargestSide = 1 << 24;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

fs::path header_of(const fs::path& path) {
  if (lower(path.extension().string()) == ".hdr") return path;
  fs::path appended = path;
  appended += ".hdr";
  if (fs::exists(appended)) return appended;
  fs::path replaced = path;
  return replaced.replace_extension(".hdr");
}

fs::path data_of(const fs::path& path, const fs::path& header) {
  if (path != header) return path;
  fs::path stem = header;
  stem.replace_extension();
  if (fs::is_regular_file(stem)) return stem;
  for (const char* extension : {".img", ".dat", ".raw", ".bsq", ".bil", ".bip", ".bin"}) {
    fs::path candidate = stem;
    candidate += extension;
    if (fs::is_regular_file(candidate)) return candidate;
  }
  throw InvalidInput(
      fmt::format("{}: no data file beside it; expected {} or the same with .img, .dat, .raw, .bsq, .bil, "
                  ".bip or .bin.",
                  header.string(), stem.string()));
}

Interleave interleave_of(const EnviHeader& header) {
  const std::string name = lower(header.text("interleave"));
  if (name == "bsq") return Interleave::kBandSequential;
  if (name == "bil") return Interleave::kBandInterleavedByLine;
  if (name == "bip") return Interleave::kBandInterleavedByPixel;
  throw InvalidInput(fmt::format("{} = {}; expected bsq, bil or bip.", header.place("interleave"), name));
}

std::size_t bytes_of(std::int64_t type, const EnviHeader& header) {
  switch (type) {
    case 1:
      return 1;
    case 2:
    case 12:
      return 2;
    case 3:
    case 4:
    case 13:
      return 4;
    case 5:
    case 14:
    case 15:
      return 8;
    default:
      throw InvalidInput(fmt::format("{} = {}; expected a real type: 1, 2, 3, 4, 5, 12, 13, 14 or 15.",
                                     header.place("data type"), type));
  }
}

template <typename Number>
double decode(const char* bytes, bool swap) {
  std::array<char, sizeof(Number)> copy;
  std::memcpy(copy.data(), bytes, copy.size());
  if (swap) std::reverse(copy.begin(), copy.end());
  Number number;
  std::memcpy(&number, copy.data(), copy.size());
  return static_cast<double>(number);
}

using Decoder = double (*)(const char*, bool);

Decoder decoder_of(std::int64_t type) {
  switch (type) {
    case 1:
      return decode<std::uint8_t>;
    case 2:
      return decode<std::int16_t>;
    case 3:
      return decode<std::int32_t>;
    case 4:
      return decode<float>;
    case 5:
      return decode<double>;
    case 12:
      return decode<std::uint16_t>;
    case 13:
      return decode<std::uint32_t>;
    case 14:
      return decode<std::int64_t>;
    default:
      return decode<std::uint64_t>;
  }
}

/// Wavelengths in nm and the order of the file's bands that makes them increase.
struct Bands {
  Eigen::VectorXd wavelength_nm;
  std::vector<std::size_t> place;  ///< of each band of the file in the image
};

Bands bands_of(const EnviHeader& header, std::size_t count) {
  std::vector<double> listed = header.numbers("wavelength");
  if (listed.size() != count) {
    throw InvalidInput(fmt::format("{}: {} entries; expected one a band, that is {}.", header.place("wavelength"),
                                   listed.size(), count));
  }
  const std::string unit = header.has("wavelength units") ? lower(header.text("wavelength units")) : "";
  if (unit.starts_with("micro") || unit == "um" || unit == "µm") {
    for (double& value : listed) value *= 1000.0;
  } else if (!unit.empty() && !unit.starts_with("nano") && unit != "nm" && unit != "unknown") {
    throw InvalidInput(
        fmt::format("{} = {}; expected Nanometers or Micrometers.", header.place("wavelength units"), unit));
  }
  for (const double value : listed) {
    if (!(value >= 100.0 && value <= 20000.0)) {
      throw InvalidInput(
          fmt::format("{}: {} nm; expected 100 to 20000 nm. Set \"wavelength units\" to Nanometers or "
                      "Micrometers as the list is.",
                      header.place("wavelength"), value));
    }
  }
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return listed[a] < listed[b]; });
  Bands bands{Eigen::VectorXd(static_cast<Eigen::Index>(count)), std::vector<std::size_t>(count)};
  for (std::size_t b = 0; b < count; ++b) {
    bands.wavelength_nm[static_cast<Eigen::Index>(b)] = listed[order[b]];
    bands.place[order[b]] = b;
    if (b > 0 && listed[order[b]] == listed[order[b - 1]]) {
      throw InvalidInput(fmt::format("{}: {} nm is given to bands {} and {}; each band needs its own.",
                                     header.place("wavelength"), listed[order[b]], order[b - 1] + 1, order[b] + 1));
    }
  }
  return bands;
}

/// Where value (row, column, band) stands, counted in values.
std::size_t index_of(Interleave interleave, std::size_t width, std::size_t height, std::size_t bands, std::size_t row,
                     std::size_t column, std::size_t band) {
  switch (interleave) {
    case Interleave::kBandSequential:
      return (band * height + row) * width + column;
    case Interleave::kBandInterleavedByLine:
      return (row * bands + band) * width + column;
    default:
      return (row * width + column) * bands + band;
  }
}

const char* name_of(Interleave interleave) {
  return interleave == Interleave::kBandSequential          ? "bsq"
         : interleave == Interleave::kBandInterleavedByLine ? "bil"
                                                            : "bip";
}

template <typename Number>
void encode(std::string& bytes, std::size_t index, Number number, bool swap) {
  std::array<char, sizeof(Number)> copy;
  std::memcpy(copy.data(), &number, copy.size());
  if (swap) std::reverse(copy.begin(), copy.end());
  std::copy(copy.begin(), copy.end(), bytes.begin() + static_cast<std::ptrdiff_t>(index * copy.size()));
}

}  // namespace

EnviFile read_envi(const fs::path& path) {
  const fs::path header_file = header_of(path);
  const EnviHeader header = EnviHeader::read(header_file);
  EnviFile file;
  file.header = header.entries();
  file.data_file = data_of(path, header_file);
  const auto width = static_cast<std::uint64_t>(header.whole("samples", 1, kLargestSide));
  const auto height = static_cast<std::uint64_t>(header.whole("lines", 1, kLargestSide));
  const auto bands = static_cast<std::uint64_t>(header.whole("bands", 1, 1 << 15));
  const std::int64_t type = header.whole("data type", 1, 15);
  const std::size_t bytes = bytes_of(type, header);
  const std::uint64_t offset =
      header.has("header offset")
          ? static_cast<std::uint64_t>(header.whole("header offset", 0, std::numeric_limits<std::int32_t>::max()))
          : 0;
  const Interleave interleave = interleave_of(header);
  const bool big_endian = bytes > 1 && header.whole("byte order", 0, 1) == 1;
  const Bands order = bands_of(header, bands);

  std::error_code failed;
  const std::uint64_t size = fs::file_size(file.data_file, failed);
  // At most 2^24 · 2^24 · 2^15 · 8 = 2^66 would overflow; bounded by the file's size before multiplying on.
  if (failed) throw InvalidInput(fmt::format("{}: cannot be read.", file.data_file.string()));
  const std::uint64_t pixels = width * height;
  const bool fits = pixels <= size / bytes / bands + 1;
  if (!fits || offset + pixels * bands * bytes != size) {
    throw InvalidInput(fmt::format(
        "{}: {} bytes; {} says {} samples × {} lines × {} bands of {} bytes after {}. Correct the entry that is wrong.",
        file.data_file.string(), size, header_file.string(), width, height, bands, bytes, offset));
  }
  std::string raw(static_cast<std::size_t>(size), '\0');
  std::ifstream in(file.data_file, std::ios::binary);
  if (!in.read(raw.data(), static_cast<std::streamsize>(raw.size())))
    throw InvalidInput(fmt::format("{}: cannot be read.", file.data_file.string()));

  // Not-a-number equals nothing, so that without the entry nothing is ignored.
  const double ignored =
      header.has("data ignore value") ? header.number("data ignore value") : std::numeric_limits<double>::quiet_NaN();
  const double scale = header.has("reflectance scale factor") ? header.number("reflectance scale factor") : 1.0;
  if (!(scale > 0.0)) {
    throw InvalidInput(
        fmt::format("{} = {}; expected a number above 0.", header.place("reflectance scale factor"), scale));
  }
  file.image.width = static_cast<int>(width);
  file.image.height = static_cast<int>(height);
  file.image.wavelength_nm = order.wavelength_nm;
  file.image.value.resize(static_cast<std::size_t>(pixels * bands));
  const Decoder decode_value = decoder_of(type);
  const bool swap = big_endian != (std::endian::native == std::endian::big);
  for (std::size_t row = 0; row < height; ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      float* pixel = file.image.pixel(static_cast<int>(row), static_cast<int>(column));
      for (std::size_t band = 0; band < bands; ++band) {
        const std::size_t index = index_of(interleave, width, height, bands, row, column, band);
        const double value = decode_value(raw.data() + offset + index * bytes, swap);
        pixel[order.place[band]] =
            value == ignored ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(value / scale);
      }
    }
  }
  return file;
}

void write_envi(const fs::path& path, const SpectralImage& image, const EnviParams& params) {
  if (lower(path.extension().string()) == ".hdr")
    throw InvalidParams(fmt::format("{}: expected the name of the data file; its header gets .hdr.", path.string()));
  if (params.description.find_first_of("{}") != std::string::npos)
    throw InvalidParams("description: contains a brace, which ENVI headers cannot hold.");
  const auto width = static_cast<std::size_t>(image.width);
  const auto height = static_cast<std::size_t>(image.height);
  const auto bands = static_cast<std::size_t>(image.bands());
  if (image.width < 1 || image.height < 1 || bands < 1 || image.value.size() != width * height * bands) {
    throw InvalidParams(fmt::format("image: {} values for {} × {} pixels of {} bands.", image.value.size(), image.width,
                                    image.height, bands));
  }
  const bool swap = params.big_endian != (std::endian::native == std::endian::big);
  std::string raw(image.value.size() * (params.type == EnviType::kFloat32 ? 4 : 2), '\0');
  for (std::size_t row = 0; row < height; ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      const float* pixel = image.pixel(static_cast<int>(row), static_cast<int>(column));
      for (std::size_t band = 0; band < bands; ++band) {
        const std::size_t index = index_of(params.interleave, width, height, bands, row, column, band);
        const float value = pixel[band];
        if (params.type == EnviType::kFloat32) {
          encode(raw, index, value, swap);
        } else if (value >= 0.0F && value <= 65535.0F && value == std::floor(value)) {
          encode(raw, index, static_cast<std::uint16_t>(value), swap);
        } else {
          throw InvalidInput(
              fmt::format("{}: row {}, column {}, band {}: {} is no whole number from 0 to 65535. Write "
                          "32-bit floats instead.",
                          path.string(), row, column, band + 1, value));
        }
      }
    }
  }
  std::string header = fmt::format(
      "ENVI\ndescription = {{{}}}\nsamples = {}\nlines = {}\nbands = {}\nheader offset = 0\nfile type = ENVI Standard\n"
      "data type = {}\ninterleave = {}\nbyte order = {}\nwavelength units = Nanometers\nwavelength = {{",
      params.description, width, height, bands, params.type == EnviType::kFloat32 ? 4 : 12, name_of(params.interleave),
      params.big_endian ? 1 : 0);
  for (std::size_t b = 0; b < bands; ++b)
    header += fmt::format("{}{}", b > 0 ? ", " : "", image.wavelength_nm[static_cast<Eigen::Index>(b)]);
  files::write_text_atomically(path, raw);
  fs::path header_file = path;
  files::write_text_atomically(header_file.replace_extension(".hdr"), header + "}\n");
}

}  // namespace interglow::image
