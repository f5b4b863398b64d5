// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/donaldson_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "diagnostics/error.h"
#include "spectral/spectrum_file.h"
#include "spectral/table_file.h"

namespace interglow::spectral {
namespace {

enum class ColumnKind { kExcitation, kEmission, kBare };

struct MatrixColumns {
  ColumnKind kind;
  Eigen::VectorXd wavelength_nm;
};

/// Wavelength and kind of a column named "ex400", "em400", "ex400nm" or "400".
std::pair<ColumnKind, double> parse_column(const NumericTable& table, const std::string& name) {
  std::string_view text = name;
  ColumnKind kind = ColumnKind::kBare;
  if (text.starts_with("ex")) kind = ColumnKind::kExcitation;
  if (text.starts_with("em")) kind = ColumnKind::kEmission;
  if (kind != ColumnKind::kBare) text.remove_prefix(2);
  if (text.starts_with("_")) text.remove_prefix(1);
  if (text.ends_with("nm")) text.remove_suffix(2);
  double wavelength = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), wavelength);
  if (error != std::errc{} || end != text.data() + text.size()) {
    throw InvalidInput(
        fmt::format("{}: column \"{}\" is neither a wavelength of a matrix (\"ex400\", \"em400\", \"400\") nor one of "
                    "\"S\", \"alpha\" "
                    "and \"beta\". Rename it.",
                    table.path, name));
  }
  return {kind, wavelength};
}

MatrixColumns matrix_columns(const NumericTable& table) {
  MatrixColumns columns{ColumnKind::kBare, Eigen::VectorXd(static_cast<Eigen::Index>(table.column.size()))};
  for (std::size_t j = 0; j < table.column.size(); ++j) {
    const auto [kind, wavelength] = parse_column(table, table.column[j]);
    if (j == 0) columns.kind = kind;
    const auto index = static_cast<Eigen::Index>(j);
    if (kind != columns.kind || (j > 0 && wavelength <= columns.wavelength_nm[index - 1])) {
      throw InvalidInput(fmt::format(
          "{}: column \"{}\" follows \"{}\"; expected increasing wavelengths, all excitation (\"ex\") or all emission "
          "(\"em\"). Sort or rename the columns.",
          table.path, table.column[j], table.column[j - 1]));
    }
    columns.wavelength_nm[index] = wavelength;
  }
  return columns;
}

Orientation orientation_of(const NumericTable& table, ColumnKind kind, std::optional<Orientation> declared) {
  if (kind == ColumnKind::kBare) {
    if (declared) return *declared;
    throw InvalidInput(
        fmt::format("{}: the column names do not tell whether columns are excitation or emission. Name them \"ex400\" "
                    "or \"em400\", or "
                    "declare the orientation (CIE and ASTM tables have excitation rows).",
                    table.path));
  }
  const Orientation named = kind == ColumnKind::kExcitation ? Orientation::kEmissionRows : Orientation::kExcitationRows;
  if (declared && *declared != named) {
    throw InvalidInput(
        fmt::format("{}: the columns are {} by their names (\"{}\"), the declared orientation says the opposite. "
                    "Remove the declaration.",
                    table.path, kind == ColumnKind::kExcitation ? "excitation" : "emission", table.column.front()));
  }
  return named;
}

Eigen::Index index_of(const NumericTable& table, std::string_view name) {
  const auto found = std::find(table.column.begin(), table.column.end(), name);
  return found == table.column.end() ? -1 : found - table.column.begin();
}

BispectralTable from_triple(const NumericTable& table) {
  const Eigen::Index S = index_of(table, "S");
  const Eigen::Index alpha = index_of(table, "alpha");
  const Eigen::Index beta = index_of(table, "beta");
  if (S < 0 || alpha < 0 || beta < 0) {
    throw InvalidInput(
        fmt::format("{}: column \"{}\" is missing; a triple has \"S\" (reflectance), \"alpha\" (emission) and \"beta\" "
                    "(excitation, 1/nm).",
                    table.path, S < 0 ? "S" : (alpha < 0 ? "alpha" : "beta")));
  }
  const WavelengthGrid grid = WavelengthGrid::from_centers(table.wavelength_nm);
  const Eigen::VectorXd per_band = table.value.col(beta).cwiseProduct(grid.widths_nm());
  BispectralTable result{grid, grid, Eigen::MatrixXd(table.value.col(alpha) * per_band.transpose()), table.path};
  result.radiance_factor.triangularView<Eigen::Upper>().setZero();
  result.radiance_factor.diagonal() = table.value.col(S);
  return result;
}

void require_two_bands(const NumericTable& table, Eigen::Index columns) {
  if (table.wavelength_nm.size() >= 2 && columns >= 2) return;
  throw InvalidInput(
      fmt::format("{}: {} rows and {} columns; expected at least two bands either way, or their widths are "
                  "unknown.",
                  table.path, table.wavelength_nm.size(), columns));
}

}  // namespace

BispectralTable read_bispectral_table(const std::filesystem::path& path, std::optional<Orientation> orientation) {
  const NumericTable table = read_csv_table(path);
  for (const std::string_view name : {"S", "alpha", "beta"}) {
    if (index_of(table, name) < 0) continue;
    require_two_bands(table, 2);
    return from_triple(table);
  }
  const MatrixColumns columns = matrix_columns(table);
  require_two_bands(table, columns.wavelength_nm.size());
  const WavelengthGrid of_rows = WavelengthGrid::from_centers(table.wavelength_nm);
  const WavelengthGrid of_columns = WavelengthGrid::from_centers(columns.wavelength_nm);
  if (orientation_of(table, columns.kind, orientation) == Orientation::kEmissionRows) {
    return {of_rows, of_columns, table.value, table.path};
  }
  return {of_columns, of_rows, table.value.transpose(), table.path};
}

DonaldsonReading read_donaldson(const std::filesystem::path& path, const WavelengthGrid& grid,
                                const DonaldsonFileParams& params) {
  return resample(read_bispectral_table(path, params.orientation), grid, params.resample);
}

DonaldsonReading read_reflectance(const std::filesystem::path& path, std::string_view column,
                                  const WavelengthGrid& grid) {
  const Spectrum spectrum = read_spectrum(path, column);
  for (Eigen::Index i = 0; i < spectrum.value.size(); ++i) {
    if (spectrum.value[i] >= 0.0 && spectrum.value[i] <= 1.0) continue;
    throw InvalidInput(
        fmt::format("{}: reflectance at {} nm is {}; expected 0 to 1. Divide percentages by 100; tables with "
                    "luminescence are Donaldson "
                    "matrices.",
                    spectrum.source, spectrum.wavelength_nm[i], spectrum.value[i]));
  }
  return {{band_means(spectrum, grid, Outside::kHold), {}}, warn_where_uncovered(spectrum, grid, Outside::kHold)};
}

}  // namespace interglow::spectral
