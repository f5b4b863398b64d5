// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/band_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <numeric>
#include <optional>
#include <sstream>
#include <string_view>

#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "image/channel_file.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;

constexpr const char* kListFile = "wavelengths.csv";
constexpr const char* kListHead = "file,wavelength_nm";

struct NamedBand {
  std::string file;
  double wavelength_nm = 0.0;
};

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// "band2" before "band10": runs of digits compare as numbers, ties by the text itself.
bool before_as_numbers(const std::string& a, const std::string& b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const auto run = [](const std::string& text, std::size_t& at) {
        while (at + 1 < text.size() && text[at] == '0' && is_digit(text[at + 1])) ++at;
        const std::size_t first = at;
        while (at < text.size() && is_digit(text[at])) ++at;
        return std::string_view(text).substr(first, at - first);
      };
      const std::string_view left = run(a, i), right = run(b, j);
      if (left.size() != right.size()) return left.size() < right.size();
      if (left != right) return left < right;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  return (a.size() - i) != (b.size() - j) ? (a.size() - i) < (b.size() - j) : a < b;
}

std::vector<std::string> pictures_in(const fs::path& folder) {
  std::error_code failed;
  if (!fs::is_directory(folder, failed)) throw InvalidInput(folder.string() + ": no such folder.");
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, failed)) {
    std::string extension = entry.path().extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    if (extension == ".tif" || extension == ".tiff" || extension == ".png")
      names.push_back(entry.path().filename().string());
  }
  if (failed) throw InvalidInput(fmt::format("{}: cannot be read ({}).", folder.string(), failed.message()));
  if (names.empty())
    throw InvalidInput(folder.string() + ": no .tif, .tiff or .png files; expected one grey picture a band.");
  std::sort(names.begin(), names.end(), before_as_numbers);
  return names;
}

void require_wavelength(double value, const std::string& where) {
  if (!(value >= 100.0 && value <= 20000.0))
    throw InvalidInput(fmt::format("{}: {}; expected a wavelength of 100 to 20000 nm.", where, value));
}

/// A decimal number that is the whole text.
std::optional<double> number_of(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::vector<NamedBand> read_list(const fs::path& folder, const std::vector<std::string>& pictures) {
  const fs::path path = folder / kListFile;
  std::ifstream in(path);
  std::string line;
  std::vector<NamedBand> bands;
  for (int number = 1; std::getline(in, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line.front() == '#') continue;
    const std::string where = fmt::format("{}:{}", path.string(), number);
    if (bands.empty() && line == kListHead) continue;
    const std::size_t comma = line.rfind(',');
    const std::optional<double> wavelength =
        comma == std::string::npos ? std::nullopt : number_of(std::string_view(line).substr(comma + 1));
    if (!wavelength) {
      throw InvalidInput(fmt::format(
          "{}: \"{}\"; expected a file name, a comma and a wavelength with a decimal point, after the line \"{}\".",
          where, line, kListHead));
    }
    require_wavelength(*wavelength, where);
    const std::string file = line.substr(0, comma);
    if (std::find(pictures.begin(), pictures.end(), file) == pictures.end())
      throw InvalidInput(fmt::format("{}: \"{}\" is not in the folder.", where, file));
    if (std::any_of(bands.begin(), bands.end(), [&](const NamedBand& band) { return band.file == file; }))
      throw InvalidInput(fmt::format("{}: \"{}\" is listed twice.", where, file));
    bands.push_back({file, *wavelength});
  }
  for (const std::string& picture : pictures) {
    if (std::none_of(bands.begin(), bands.end(), [&](const NamedBand& band) { return band.file == picture; }))
      throw InvalidInput(
          fmt::format("{}: does not list \"{}\", which is in the folder. Add or move it.", path.string(), picture));
  }
  return bands;
}

/// The number directly before "nm"; empty if there is none, or the name goes on with a letter.
std::optional<double> wavelength_in_name(const std::string& name) {
  for (std::size_t at = name.rfind("nm"); at != std::string::npos && at > 0; at = name.rfind("nm", at - 1)) {
    std::size_t first = at;
    while (first > 0 && (is_digit(name[first - 1]) || name[first - 1] == '.')) --first;
    while (first < at && name[first] == '.') ++first;
    if (first < at) return number_of(std::string_view(name).substr(first, at - first));
  }
  return std::nullopt;
}

std::vector<NamedBand> order_bands(const fs::path& folder, const Eigen::VectorXd& wavelength_nm) {
  const std::vector<std::string> pictures = pictures_in(folder);
  const bool listed = fs::exists(folder / kListFile);
  std::vector<NamedBand> bands;
  if (listed) {
    bands = read_list(folder, pictures);
  } else if (wavelength_nm.size() > 0) {
    if (static_cast<std::size_t>(wavelength_nm.size()) != pictures.size()) {
      throw InvalidInput(fmt::format("{}: {} pictures ({} to {}) for {} wavelengths; expected one each.",
                                     folder.string(), pictures.size(), pictures.front(), pictures.back(),
                                     wavelength_nm.size()));
    }
    for (std::size_t b = 0; b < pictures.size(); ++b) {
      bands.push_back({pictures[b], wavelength_nm[static_cast<Eigen::Index>(b)]});
      require_wavelength(bands[b].wavelength_nm, "The given wavelengths");
      if (b > 0 && !(bands[b].wavelength_nm > bands[b - 1].wavelength_nm)) {
        throw InvalidInput(fmt::format(
            "The given wavelengths: entry {} is {} nm after {} nm; expected increasing wavelengths. Files in another "
            "order need a {} in {}.",
            b + 1, bands[b].wavelength_nm, bands[b - 1].wavelength_nm, kListFile, folder.string()));
      }
    }
  } else {
    for (const std::string& picture : pictures) {
      const std::optional<double> wavelength = wavelength_in_name(picture);
      if (!wavelength) {
        throw InvalidInput(
            fmt::format("{}: the wavelength of \"{}\" is not known. Put {} there (lines \"{}\"), name the files like "
                        "band_550nm.tif, or give the wavelengths.",
                        folder.string(), picture, kListFile, kListHead));
      }
      require_wavelength(*wavelength, fmt::format("{}: \"{}\"", folder.string(), picture));
      bands.push_back({picture, *wavelength});
    }
  }
  std::stable_sort(bands.begin(), bands.end(),
                   [](const NamedBand& a, const NamedBand& b) { return a.wavelength_nm < b.wavelength_nm; });
  for (std::size_t b = 1; b < bands.size(); ++b) {
    if (bands[b].wavelength_nm == bands[b - 1].wavelength_nm)
      throw InvalidInput(fmt::format("{}: {} and {} are both {} nm; expected one picture a wavelength.",
                                     folder.string(), bands[b - 1].file, bands[b].file, bands[b].wavelength_nm));
  }
  if (listed && wavelength_nm.size() > 0) {
    if (static_cast<std::size_t>(wavelength_nm.size()) != bands.size())
      throw InvalidInput(fmt::format("{}: {} lists {} bands, {} wavelengths are given.", folder.string(), kListFile,
                                     bands.size(), wavelength_nm.size()));
    for (std::size_t b = 0; b < bands.size(); ++b) {
      const double given = wavelength_nm[static_cast<Eigen::Index>(b)];
      if (given != bands[b].wavelength_nm)
        throw InvalidInput(fmt::format("{}: band {} is {} nm in {} and {} nm as given. Correct one.", folder.string(),
                                       b + 1, bands[b].wavelength_nm, kListFile, given));
    }
  }
  return bands;
}

}  // namespace

BandFolder read_band_folder(const fs::path& folder, const Eigen::VectorXd& wavelength_nm) {
  const std::vector<NamedBand> bands = order_bands(folder, wavelength_nm);
  BandFolder result;
  SpectralImage& image = result.image;
  image.wavelength_nm.resize(static_cast<Eigen::Index>(bands.size()));
  for (std::size_t b = 0; b < bands.size(); ++b) {
    const GreyImage grey = read_grey_file(folder / bands[b].file);
    if (b == 0) {
      image.width = grey.width;
      image.height = grey.height;
      result.whole_bits = grey.whole_bits;
      result.gamma = grey.gamma;
      image.value.resize(grey.value.size() * bands.size());
    }
    if (grey.width != image.width || grey.height != image.height || grey.whole_bits != result.whole_bits ||
        grey.gamma != result.gamma) {
      const auto type = [](int bits) { return bits == 0 ? std::string("floats") : fmt::format("{} bits", bits); };
      throw InvalidInput(
          fmt::format("{}: {} × {} pixels of {}, gamma {}; {} has {} × {} of {}, gamma {}. All bands must "
                      "be alike.",
                      (folder / bands[b].file).string(), grey.width, grey.height, type(grey.whole_bits), grey.gamma,
                      bands.front().file, image.width, image.height, type(result.whole_bits), result.gamma));
    }
    image.wavelength_nm[static_cast<Eigen::Index>(b)] = bands[b].wavelength_nm;
    for (std::size_t p = 0; p < grey.value.size(); ++p) image.value[p * bands.size() + b] = grey.value[p];
    result.files.push_back(bands[b].file);
  }
  return result;
}

void write_band_folder(const fs::path& folder, const SpectralImage& image, const std::string& extension) {
  const auto bands = static_cast<std::size_t>(image.bands());
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (pixels == 0 || bands == 0 || image.value.size() != pixels * bands) {
    throw InvalidParams(fmt::format("image: {} values for {} × {} pixels of {} bands.", image.value.size(), image.width,
                                    image.height, bands));
  }
  std::string list = std::string(kListHead) + "\n";
  for (std::size_t b = 0; b < bands; ++b) {
    const double wavelength = image.wavelength_nm[static_cast<Eigen::Index>(b)];
    std::vector<std::uint16_t> words(pixels);
    for (std::size_t p = 0; p < pixels; ++p) {
      const float value = image.value[p * bands + b];
      if (!(value >= 0.0F && value <= 65535.0F && value == std::floor(value))) {
        const auto width = static_cast<std::size_t>(image.width);
        throw InvalidInput(fmt::format("{}: row {}, column {}, {} nm: {} is no whole number from 0 to 65535.",
                                       folder.string(), p / width, p % width, wavelength, value));
      }
      words[p] = static_cast<std::uint16_t>(value);
    }
    const std::string file = fmt::format("band_{}nm{}", wavelength, extension);
    write_grey_words(folder / file, image.width, image.height, words);
    list += fmt::format("{},{}\n", file, wavelength);
  }
  files::write_text_atomically(folder / kListFile, list);
}

}  // namespace interglow::image
