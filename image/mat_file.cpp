// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/mat_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hdf5.h>
#include <matio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string_view>
#include <vector>

#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;

using MatHandle = std::unique_ptr<mat_t, decltype([](mat_t* file) { Mat_Close(file); })>;
using Variable = std::unique_ptr<matvar_t, decltype([](matvar_t* variable) { Mat_VarFree(variable); })>;

/// HDF5 prints its failures to stderr unless it is told not to; what was set before comes back.
class QuietHdf5 {
 public:
  QuietHdf5() {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietHdf5() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  QuietHdf5(const QuietHdf5&) = delete;
  QuietHdf5& operator=(const QuietHdf5&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

// The cube's name in the files that are written, and the stem of names that are taken for wavelengths.
constexpr const char* kCube = "cube";
constexpr const char* kWavelength = "wavelength_nm";
constexpr std::array<std::string_view, 5> kWavelengthStems = {"wavelength", "wave", "wl", "lambda", "bands"};

struct Listed {
  std::string name;
  std::vector<std::size_t> size;
  bool numeric = false;
  std::string text() const { return fmt::format("{} ({})", name, fmt::join(size, " × ")); }
};

bool is_numeric(const matvar_t& variable) {
  return variable.class_type >= MAT_C_DOUBLE && variable.class_type <= MAT_C_UINT64;
}

std::vector<std::size_t> size_of(const matvar_t& variable) { return {variable.dims, variable.dims + variable.rank}; }

std::vector<Listed> list_variables(const fs::path& path) {
  const MatHandle file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) throw InvalidInput(path.string() + ": not a readable MATLAB file. Save it again.");
  std::vector<Listed> list;
  while (const Variable variable{Mat_VarReadNextInfo(file.get())}) {
    if (variable->name == nullptr) continue;
    list.push_back({variable->name, size_of(*variable), is_numeric(*variable) && variable->isComplex == 0});
  }
  return list;
}

std::string join_names(const std::vector<Listed>& list) {
  std::vector<std::string> names;
  for (const Listed& variable : list) names.push_back(variable.text());
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string choose_cube(const std::vector<Listed>& list, const std::string& wanted, const fs::path& path) {
  if (!wanted.empty()) return wanted;
  std::vector<Listed> cubes;
  for (const Listed& variable : list) {
    if (variable.numeric && variable.size.size() == 3) cubes.push_back(variable);
  }
  if (cubes.size() == 1) return cubes.front().name;
  throw InvalidInput(fmt::format("{}: {} numeric arrays of three dimensions; name the one to read. Variables: {}.",
                                 path.string(), cubes.size(), join_names(list)));
}

std::string choose_wavelength(const std::vector<Listed>& list, std::size_t bands, const fs::path& path) {
  std::vector<std::string> found;
  for (const Listed& variable : list) {
    std::size_t count = 1;
    std::size_t longest = 0;
    for (const std::size_t side : variable.size) {
      count *= side;
      longest = std::max(longest, side);
    }
    if (!variable.numeric || count != bands || longest != bands) continue;
    const std::string name = lower(variable.name);
    if (std::any_of(kWavelengthStems.begin(), kWavelengthStems.end(),
                    [&](std::string_view stem) { return name.starts_with(stem); }))
      found.push_back(variable.name);
  }
  if (found.size() == 1) return found.front();
  throw InvalidInput(fmt::format(
      "{}: {} vectors of {} numbers whose names say wavelengths; name the one to use, or give the wavelengths. "
      "Variables: {}.",
      path.string(), found.size(), bands, join_names(list)));
}

/// A numeric array in double precision, as MATLAB keeps it: the first index runs fastest.
struct Array {
  std::vector<std::size_t> size;
  std::vector<float> value;
  std::vector<double> exact;  ///< only where asked for
  int whole_bits = 0;
};

template <typename Number>
void copy_values(const matvar_t& variable, std::size_t count, bool exact, Array& array) {
  const auto* from = static_cast<const Number*>(variable.data);
  if (exact) {
    for (std::size_t i = 0; i < count; ++i) array.exact.push_back(static_cast<double>(from[i]));
  } else {
    array.value.resize(count);
    for (std::size_t i = 0; i < count; ++i) array.value[i] = static_cast<float>(from[i]);
  }
  array.whole_bits = std::is_integral_v<Number> ? static_cast<int>(8 * sizeof(Number)) : 0;
}

std::size_t bytes_of(matio_classes type) {
  switch (type) {
    case MAT_C_INT8:
    case MAT_C_UINT8:
      return 1;
    case MAT_C_INT16:
    case MAT_C_UINT16:
      return 2;
    case MAT_C_SINGLE:
    case MAT_C_INT32:
    case MAT_C_UINT32:
      return 4;
    default:
      return 8;
  }
}

Array read_array(mat_t* file, const std::string& name, const std::vector<Listed>& list, const fs::path& path,
                 bool exact) {
  const Variable variable(Mat_VarReadInfo(file, name.c_str()));
  if (!variable) {
    throw InvalidInput(
        fmt::format("{}: no variable \"{}\"; expected one of: {}.", path.string(), name, join_names(list)));
  }
  if (!is_numeric(*variable) || variable->isComplex != 0) {
    throw InvalidInput(fmt::format("{}: \"{}\" is {}; expected a full array of real numbers. Save it as one.",
                                   path.string(), name,
                                   variable->isComplex != 0 ? "complex" : "a cell, structure, text or sparse array"));
  }
  Array array;
  array.size = size_of(*variable);
  // Deflate, which versions 5 and 7.3 use, shrinks constant data by at most 1032.
  constexpr double kLargestRatio = 1032.0;
  std::error_code failed;
  const auto held = static_cast<double>(fs::file_size(path, failed));
  double bytes = static_cast<double>(bytes_of(variable->class_type));
  std::size_t count = 1;
  for (const std::size_t side : array.size) {
    bytes *= static_cast<double>(side);
    count *= side;
  }
  if (failed || bytes > kLargestRatio * held || bytes > 64e9) {
    throw InvalidInput(fmt::format("{}: \"{}\" is said to have {} values, more than a file of {} bytes can hold.",
                                   path.string(), name, fmt::join(array.size, " × "), held));
  }
  if (count == 0) throw InvalidInput(fmt::format("{}: \"{}\" is empty.", path.string(), name));
  if (Mat_VarReadDataAll(file, variable.get()) != 0 || variable->data == nullptr ||
      static_cast<double>(variable->nbytes) < bytes) {
    throw InvalidInput(
        fmt::format("{}: the values of \"{}\" cannot be read; the file is damaged or cut off. Save it "
                    "again.",
                    path.string(), name));
  }
  switch (variable->class_type) {
    case MAT_C_DOUBLE:
      copy_values<double>(*variable, count, exact, array);
      break;
    case MAT_C_SINGLE:
      copy_values<float>(*variable, count, exact, array);
      break;
    case MAT_C_INT8:
      copy_values<std::int8_t>(*variable, count, exact, array);
      break;
    case MAT_C_UINT8:
      copy_values<std::uint8_t>(*variable, count, exact, array);
      break;
    case MAT_C_INT16:
      copy_values<std::int16_t>(*variable, count, exact, array);
      break;
    case MAT_C_UINT16:
      copy_values<std::uint16_t>(*variable, count, exact, array);
      break;
    case MAT_C_INT32:
      copy_values<std::int32_t>(*variable, count, exact, array);
      break;
    case MAT_C_UINT32:
      copy_values<std::uint32_t>(*variable, count, exact, array);
      break;
    case MAT_C_INT64:
      copy_values<std::int64_t>(*variable, count, exact, array);
      break;
    default:
      copy_values<std::uint64_t>(*variable, count, exact, array);
      break;
  }
  return array;
}

void require_increasing(const Eigen::VectorXd& wavelength_nm, const std::string& where) {
  for (Eigen::Index b = 0; b < wavelength_nm.size(); ++b) {
    if (!(wavelength_nm[b] >= 100.0 && wavelength_nm[b] <= 20000.0))
      throw InvalidInput(fmt::format("{}: entry {} is {}; expected 100 to 20000 nm.", where, b + 1, wavelength_nm[b]));
    if (b > 0 && !(wavelength_nm[b] > wavelength_nm[b - 1])) {
      throw InvalidInput(
          fmt::format("{}: entry {} is {} nm after {} nm; expected increasing wavelengths. Sort the bands.", where,
                      b + 1, wavelength_nm[b], wavelength_nm[b - 1]));
    }
  }
}

void require_file(const fs::path& path) {
  std::error_code failed;
  if (!fs::is_regular_file(path, failed))
    throw InvalidInput(path.string() + ": this file cannot be opened. Check the name.");
}

[[noreturn]] void fail_write(const fs::path& path) {
  throw InvalidInput(path.string() + ": cannot be written. Check that the folder is writable and the disk has room.");
}

void write_variable(mat_t* file, const char* name, matio_classes type, matio_types stored,
                    std::vector<std::size_t> size, void* data, const fs::path& path) {
  const Variable variable(
      Mat_VarCreate(name, type, stored, static_cast<int>(size.size()), size.data(), data, MAT_F_DONT_COPY_DATA));
  if (!variable || Mat_VarWrite(file, variable.get(), MAT_COMPRESSION_ZLIB) != 0) fail_write(path);
}

/// The cube as MATLAB keeps it.
template <typename Number>
std::vector<Number> column_major(const SpectralImage& image, const fs::path& path) {
  const auto width = static_cast<std::size_t>(image.width);
  const auto height = static_cast<std::size_t>(image.height);
  const auto bands = static_cast<std::size_t>(image.bands());
  std::vector<Number> values(width * height * bands);
  for (std::size_t row = 0; row < height; ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      for (std::size_t band = 0; band < bands; ++band) {
        const float value = image.value[(row * width + column) * bands + band];
        if (std::is_integral_v<Number> && !(value >= 0.0F && value <= 65535.0F && value == std::floor(value))) {
          throw InvalidInput(fmt::format(
              "{}: row {}, column {}, band {}: {} is no whole number from 0 to 65535. Write singles instead.",
              path.string(), row, column, band + 1, value));
        }
        values[row + height * (column + width * band)] = static_cast<Number>(value);
      }
    }
  }
  return values;
}

}  // namespace

MatFile read_mat(const fs::path& path, const MatNames& names, const Eigen::VectorXd& wavelength_nm) {
  require_file(path);
  const QuietHdf5 quiet;
  const std::vector<Listed> list = list_variables(path);
  MatFile result;
  result.cube = choose_cube(list, names.cube, path);
  const MatHandle file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) throw InvalidInput(path.string() + ": not a readable MATLAB file. Save it again.");
  const Array cube = read_array(file.get(), result.cube, list, path, false);
  if (cube.size.size() != 2 && cube.size.size() != 3) {
    throw InvalidInput(fmt::format("{}: \"{}\" has {} values; expected rows × columns × bands.", path.string(),
                                   result.cube, fmt::join(cube.size, " × ")));
  }
  const std::size_t height = cube.size[0];
  const std::size_t width = cube.size[1];
  const std::size_t bands = cube.size.size() == 3 ? cube.size[2] : 1;
  if (std::max(height, width) > (1U << 24U))
    throw InvalidInput(
        fmt::format("{}: \"{}\" has {} rows and {} columns.", path.string(), result.cube, height, width));
  SpectralImage& image = result.image;
  image.width = static_cast<int>(width);
  image.height = static_cast<int>(height);
  std::string where = "The given wavelengths";
  if (wavelength_nm.size() > 0 && names.wavelength.empty()) {
    image.wavelength_nm = wavelength_nm;
  } else {
    const std::string name = names.wavelength.empty() ? choose_wavelength(list, bands, path) : names.wavelength;
    const Array found = read_array(file.get(), name, list, path, true);
    image.wavelength_nm =
        Eigen::Map<const Eigen::VectorXd>(found.exact.data(), static_cast<Eigen::Index>(found.exact.size()));
    where = fmt::format("{}: \"{}\"", path.string(), name);
  }
  if (static_cast<std::size_t>(image.wavelength_nm.size()) != bands) {
    throw InvalidInput(
        fmt::format("{}: {} wavelengths for the {} values of \"{}\" (rows × columns × bands) in {}; expected {}.",
                    where, image.wavelength_nm.size(), fmt::join(cube.size, " × "), result.cube, path.string(), bands));
  }
  require_increasing(image.wavelength_nm, where);
  image.value.resize(cube.value.size());
  for (std::size_t band = 0; band < bands; ++band) {
    for (std::size_t column = 0; column < width; ++column) {
      for (std::size_t row = 0; row < height; ++row)
        image.value[(row * width + column) * bands + band] = cube.value[row + height * (column + width * band)];
    }
  }
  result.whole_bits = cube.whole_bits;
  return result;
}

void write_mat(const fs::path& path, const SpectralImage& image, MatType type) {
  const auto width = static_cast<std::size_t>(image.width);
  const auto height = static_cast<std::size_t>(image.height);
  const auto bands = static_cast<std::size_t>(image.bands());
  if (image.width < 1 || image.height < 1 || bands < 1 || image.value.size() != width * height * bands) {
    throw InvalidParams(fmt::format("image: {} values for {} × {} pixels of {} bands.", image.value.size(), image.width,
                                    image.height, bands));
  }
  const std::size_t bytes = image.value.size() * (type == MatType::kSingle ? 4 : 2);
  const mat_ft version = bytes < std::size_t{std::numeric_limits<std::int32_t>::max()} ? MAT_FT_MAT5 : MAT_FT_MAT73;
  Eigen::VectorXd wavelength_nm = image.wavelength_nm;
  files::write_atomically(path, [&](const fs::path& temporary) {
    // A header text of its own: libmatio's has the date in it.
    const char* text = version == MAT_FT_MAT5 ? "MATLAB 5.0 MAT-file, written by interglow" : nullptr;
    const MatHandle file(Mat_CreateVer(temporary.c_str(), text, version));
    if (!file) fail_write(path);
    if (type == MatType::kSingle) {
      std::vector<float> value = column_major<float>(image, path);
      write_variable(file.get(), kCube, MAT_C_SINGLE, MAT_T_SINGLE, {height, width, bands}, value.data(), path);
    } else {
      std::vector<std::uint16_t> value = column_major<std::uint16_t>(image, path);
      write_variable(file.get(), kCube, MAT_C_UINT16, MAT_T_UINT16, {height, width, bands}, value.data(), path);
    }
    write_variable(file.get(), kWavelength, MAT_C_DOUBLE, MAT_T_DOUBLE, {bands, 1}, wavelength_nm.data(), path);
  });
}

}  // namespace interglow::image
