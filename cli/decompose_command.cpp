// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "cli/commands.h"
#include "cli/shading_files.h"
#include "cli/spectral_input.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "fitting/decomposition.h"
#include "spectral/spectrum.h"
#include "spectral/table_file.h"

namespace interglow::cli {
namespace {

struct Options {
  std::string image;
  std::string spectra;
  std::string mask;
  std::filesystem::path out;
  bool any_sign = false;
};

/// The columns of "table.csv:a,b,c" (all of them without a colon) as means over the image's bands.
fitting::ComponentBasis read_basis(const std::string& text, const Eigen::VectorXd& wavelength_nm) {
  const std::size_t colon = text.rfind(':');
  const std::string path = text.substr(0, colon);
  const spectral::NumericTable table = spectral::read_csv_table(path);
  fitting::ComponentBasis basis;
  basis.name = colon == std::string::npos ? table.column : CLI::detail::split(text.substr(colon + 1), ',');
  basis.spectrum.resize(wavelength_nm.size(), static_cast<Eigen::Index>(basis.name.size()));
  const auto grid = spectral::WavelengthGrid::from_centers(wavelength_nm);
  for (std::size_t c = 0; c < basis.name.size(); ++c) {
    const auto found = std::find(table.column.begin(), table.column.end(), basis.name[c]);
    if (found == table.column.end()) {
      throw InvalidInput(fmt::format("{}: no column \"{}\"; expected one of: {}.", path, basis.name[c],
                                     fmt::join(table.column, ", ")));
    }
    const spectral::Spectrum spectrum{table.wavelength_nm, table.value.col(found - table.column.begin()),
                                      path + ", column " + basis.name[c]};
    basis.spectrum.col(static_cast<Eigen::Index>(c)) = spectral::band_means(spectrum, grid, spectral::Outside::kRefuse);
  }
  return basis;
}

int decompose(const Options& options) {
  SpectralInput input = read_spectral_input(options.image);
  apply_mask(input, options.mask);
  const image::SpectralImage& image = input.image;
  const fitting::ComponentBasis basis = read_basis(options.spectra, image.wavelength_nm);
  std::vector<int> object;
  for (const std::uint8_t use : input.use) object.push_back(use != 0 ? 0 : -1);
  const fitting::Decomposition found = fitting::decompose(
      image, object, {basis}, {.sign = options.any_sign ? fitting::Sign::kAny : fitting::Sign::kNonNegative});
  nlohmann::json figures = decomposition_json(found);
  figures["image"] = options.image;
  figures["version"] = INTERGLOW_VERSION;
  write_shading(options.out / "shading.exr", found);
  files::write_text_atomically(options.out / "decomposition.json", figures.dump(2) + "\n");
  fmt::print("{} pixels, relative residual {:.3g}, {} with a term held at 0; {}\n", found.pixels,
             found.total_relative_residual, found.bounded, found.quality.front().sentence);
  return kSuccess;
}

}  // namespace

void add_decompose_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("decompose", "Writes every pixel as a sum of given spectra: shading terms");
  auto options = std::make_shared<Options>();
  command->add_option("image", options->image, "Spectral image of any format, or a capture")->required();
  command->add_option("--spectra", options->spectra, "table.csv:a,b with up to 5 columns [all columns]")->required();
  command->add_option("--mask", options->mask,
                      "Grey EXR, PNG or TIFF; only pixels that are not 0 are decomposed [all]");
  command->add_flag("--any-sign", options->any_sign, "Plain least squares; negative terms are allowed");
  command->add_option("--out", options->out, "Folder for shading.exr and decomposition.json")->required();
  add_session_options(*command, session);
  command->callback([options, &action] { action = [options] { return decompose(*options); }; });
}

}  // namespace interglow::cli
