// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/spectral_exr.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <optional>
#include <string_view>

#include "diagnostics/error.h"

namespace interglow::image {
namespace {

constexpr double kLightSpeedNmPerS = 2.99792458e17;

/// Factor of an SI prefix; empty for an unknown one.
std::optional<double> prefix_factor(std::string_view prefix) {
  struct Prefix {
    std::string_view name;
    double factor;
  };
  static constexpr Prefix kPrefixes[] = {{"", 1.0},        {"Y", 1e24}, {"Z", 1e21}, {"E", 1e18}, {"P", 1e15},
                                         {"T", 1e12},      {"G", 1e9},  {"M", 1e6},  {"k", 1e3},  {"h", 1e2},
                                         {"da", 1e1},      {"d", 1e-1}, {"c", 1e-2}, {"m", 1e-3}, {"u", 1e-6},
                                         {"\u00b5", 1e-6}, {"n", 1e-9}, {"p", 1e-12}};
  for (const Prefix& known : kPrefixes) {
    if (known.name == prefix) return known.factor;
  }
  return std::nullopt;
}

/// Wavelength of a channel "S0.<number><unit>"; empty if the channel is something else.
std::optional<double> emissive_wavelength_nm(std::string_view channel) {
  if (!channel.starts_with("S0.")) return std::nullopt;
  std::string text(channel.substr(3));
  std::replace(text.begin(), text.end(), ',', '.');
  double number = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || !(number > 0.0)) return std::nullopt;
  std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
  const bool is_frequency = unit.ends_with("Hz");
  if (!is_frequency && !unit.ends_with("m")) return std::nullopt;
  unit.remove_suffix(is_frequency ? 2 : 1);
  const std::optional<double> factor = prefix_factor(unit);
  if (!factor) return std::nullopt;
  if (is_frequency) return kLightSpeedNmPerS / (number * *factor);
  // Not by way of metres: 550 nm must be exactly 550.
  return unit == "n" ? number : number * *factor * 1e9;
}

struct Band {
  double wavelength_nm;
  std::size_t channel;
};

std::vector<Band> bands_of(const ChannelImage& file, const std::filesystem::path& path) {
  std::vector<Band> bands;
  for (std::size_t c = 0; c < file.channel.size(); ++c) {
    if (const auto wavelength = emissive_wavelength_nm(file.channel[c])) bands.push_back({*wavelength, c});
  }
  if (bands.empty()) {
    const auto grey = std::find(file.channel.begin(), file.channel.end(), "Y");
    if (grey != file.channel.end()) return {{kGreyWavelengthNm, static_cast<std::size_t>(grey - file.channel.begin())}};
    if (file.channel.size() == 1) return {{kGreyWavelengthNm, 0}};
    throw InvalidInput(
        fmt::format("{}: no channel such as \"S0.550,000000nm\" among {} (\"{}\", ...); expected a spectral image of "
                    "emissive layout, or one "
                    "grey channel.",
                    path.string(), file.channel.size(), file.channel.front()));
  }
  std::stable_sort(bands.begin(), bands.end(),
                   [](const Band& a, const Band& b) { return a.wavelength_nm < b.wavelength_nm; });
  for (std::size_t i = 1; i < bands.size(); ++i) {
    if (bands[i].wavelength_nm > bands[i - 1].wavelength_nm) continue;
    throw InvalidInput(
        fmt::format("{}: channels \"{}\" and \"{}\" are the same wavelength; expected one each. Remove one.",
                    path.string(), file.channel[bands[i - 1].channel], file.channel[bands[i].channel]));
  }
  return bands;
}

std::string attribute_of(const ChannelImage& file, std::string_view name) {
  for (const auto& [key, text] : file.attributes) {
    if (key == name) return text;
  }
  return {};
}

void require_same_size(const std::filesystem::path& path, const SpectralImage& image, const RgbImage& preview) {
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (image.width > 0 && image.height > 0 && image.bands() > 0 && preview.width == image.width &&
      preview.height == image.height && preview.value.size() == 3 * pixels &&
      image.value.size() == pixels * static_cast<std::size_t>(image.bands())) {
    return;
  }
  throw InvalidParams(fmt::format(
      "{}: spectral image of {} x {} pixels, {} bands and {} values with a preview of {} x {}; expected at least one "
      "pixel and "
      "band, and the same size of both.",
      path.string(), image.width, image.height, image.bands(), image.value.size(), preview.width, preview.height));
}

}  // namespace

std::string emissive_channel_name(double wavelength_nm) {
  std::string name = fmt::format("S0.{:.6f}nm", wavelength_nm);
  std::replace(name.begin() + 3, name.end(), '.', ',');
  return name;
}

void write_spectral_exr(const std::filesystem::path& path, const SpectralImage& image, const RgbImage& preview,
                        const Attributes& attributes) {
  require_same_size(path, image, preview);
  ChannelImage file;
  file.width = image.width;
  file.height = image.height;
  file.channel = {"R", "G", "B"};
  for (const double wavelength : image.wavelength_nm) file.channel.push_back(emissive_channel_name(wavelength));
  const auto bands = static_cast<std::size_t>(image.bands());
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  file.value.resize(pixels * (bands + 3));
  for (std::size_t p = 0; p < pixels; ++p) {
    float* to = file.value.data() + p * (bands + 3);
    to = std::copy_n(preview.value.data() + 3 * p, 3, to);
    std::copy_n(image.value.data() + p * bands, bands, to);
  }
  file.attributes = {
      {"spectralLayoutVersion", "1.0"}, {"emissiveUnits", "W.m^-2.sr^-1"}, {"interglow:unit", "W.m^-2.sr^-1.nm^-1"}};
  file.attributes.insert(file.attributes.end(), attributes.begin(), attributes.end());
  file.numbers = {{"EV", static_cast<float>(std::log2(preview.exposure))}};
  write_exr_channels(path, file);
}

void write_spectral_exr(const std::filesystem::path& path, const SpectralImage& image, const Attributes& attributes) {
  write_spectral_exr(path, image, make_preview(image), attributes);
}

SpectralFile read_spectral_exr(const std::filesystem::path& path) {
  const ChannelImage file = read_exr_channels(path);
  const std::vector<Band> bands = bands_of(file, path);
  SpectralFile result;
  result.attributes = file.attributes;
  result.emissive_units = attribute_of(file, "emissiveUnits");
  SpectralImage& image = result.image;
  image.width = file.width;
  image.height = file.height;
  image.wavelength_nm.resize(static_cast<Eigen::Index>(bands.size()));
  for (std::size_t b = 0; b < bands.size(); ++b)
    image.wavelength_nm[static_cast<Eigen::Index>(b)] = bands[b].wavelength_nm;
  const std::size_t pixels = static_cast<std::size_t>(file.width) * static_cast<std::size_t>(file.height);
  image.value.resize(pixels * bands.size());
  for (std::size_t p = 0; p < pixels; ++p) {
    const float* from = file.value.data() + p * file.channel.size();
    float* to = image.value.data() + p * bands.size();
    for (std::size_t b = 0; b < bands.size(); ++b) {
      to[b] = from[bands[b].channel];
      if (std::isfinite(to[b])) continue;
      throw InvalidInput(fmt::format(
          "{}: row {}, column {}, channel \"{}\" is {}; expected finite radiances. Replace such pixels before.",
          path.string(), p / static_cast<std::size_t>(file.width), p % static_cast<std::size_t>(file.width),
          file.channel[bands[b].channel], to[b]));
    }
  }
  return result;
}

}  // namespace interglow::image
