// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/fitted_scene.h"

#include <fmt/format.h>

#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <vector>

#include "diagnostics/error.h"
#include "spectral/spectrum_file.h"

namespace interglow::cli {
namespace {

std::string triple(const Eigen::Vector3d& v) { return fmt::format("[{:.10g}, {:.10g}, {:.10g}]", v.x(), v.y(), v.z()); }

/// Quoted paths of a line that name existing files beside the scene, as seen from the new folder.
std::string with_paths(const std::string& line, const std::filesystem::path& from, const std::filesystem::path& to) {
  static const std::regex kQuoted("\"([^\"]+)\"");
  std::string result;
  auto rest = line.cbegin();
  for (std::sregex_iterator it(line.begin(), line.end(), kQuoted), end; it != end; ++it) {
    const std::string text = (*it)[1];
    result.append(rest, (*it)[0].first);
    std::error_code error;
    const bool is_file =
        !std::filesystem::path(text).is_absolute() && std::filesystem::is_regular_file(from / text, error);
    result += is_file ? "\"" + std::filesystem::proximate(from / text, to).generic_string() + "\"" : (*it)[0].str();
    rest = (*it)[0].second;
  }
  result.append(rest, line.cend());
  return result;
}

}  // namespace

void write_fitted_materials(const fitting::ForwardModel& model, const fitting::FitState& state,
                            const std::filesystem::path& folder) {
  const scene::Scene& scene = model.scene();
  const Eigen::VectorXd& nm = scene.grid.centers_nm();
  for (std::size_t m = 0; m < scene.materials.size(); ++m) {
    const double raise = state.raise[static_cast<Eigen::Index>(m)];
    if (raise == 0.0) continue;
    const spectral::DonaldsonMatrix& measured = scene.materials[m].donaldson;
    const double scale = state.scale[static_cast<Eigen::Index>(m)];
    const Eigen::VectorXd reflectance = (scale * measured.reflectance.array() + raise).cwiseMax(0.0).cwiseMin(1.0);
    std::vector<spectral::NamedValues> columns;
    if (measured.luminesces()) {
      Eigen::MatrixXd matrix = scale * measured.luminescence;
      matrix.diagonal() += reflectance;
      for (Eigen::Index band = 0; band < nm.size(); ++band)
        columns.push_back({fmt::format("ex{:.10g}", nm[band]), matrix.col(band)});
    } else {
      columns.push_back({"reflectance", reflectance});
    }
    spectral::write_spectra_csv(
        folder / (scene.materials[m].name + ".csv"), nm, columns,
        {fmt::format("Fitted by interglow: the given spectrum times {:.6g}, its reflectance {:+.6g} in all bands.",
                     scale, raise)});
  }
}

std::string fitted_scene_text(const scene::SceneDescription& description, const fitting::ForwardModel& model,
                              const fitting::FitState& state, const std::filesystem::path& folder) {
  const scene::Scene& scene = model.scene();
  const scene::Camera camera = fitting::pinhole_camera(state.camera, scene.camera);
  const std::filesystem::path from = std::filesystem::absolute(description.file).parent_path();
  const std::filesystem::path to = std::filesystem::absolute(folder);
  std::ostringstream out;
  out << fmt::format(
      "# Fitted by interglow. Beside this file: w/w' = {:.6g}, blur {:.4g} px, principal point ({:.6g}, {:.6g}) px, "
      "radial\n"
      "# distortion {:.4g}; gains and offsets of the bands are in report.json.\n",
      state.w, state.blur_px, state.camera.principal_px.x(), state.camera.principal_px.y(), state.camera.distortion);
  std::ifstream in(description.file);
  if (!in) throw InvalidInput(description.file.string() + ": cannot be read again.");
  static const std::regex kHeader(R"(^\s*\[\s*([^\]]+?)\s*\]\s*(#.*)?$)");
  static const std::regex kKey(R"(^\s*([A-Za-z_]+)\s*=.*)");
  std::set<std::string> replaced;
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (std::regex_match(line, match, kHeader)) {
      const std::string section = match[1];
      out << line << '\n';
      replaced.clear();
      if (section == "camera") {
        out << "position_mm = " << triple(camera.position) << "\ntarget_mm = " << triple(camera.target)
            << "\nup = " << triple(camera.up)
            << fmt::format("\nhorizontal_fov_deg = {:.10g}\n", camera.horizontal_fov_deg);
        replaced = {"position_mm", "target_mm", "up", "horizontal_fov_deg"};
      } else if (section == "light." + scene.directional_lights.front().name) {
        out << "direction = " << triple(state.light_direction) << '\n';
        replaced = {"direction"};
      }
      for (std::size_t m = 0; m < scene.materials.size(); ++m) {
        const double scale = state.scale[static_cast<Eigen::Index>(m)];
        if (section != "material." + scene.materials[m].name) continue;
        if (state.raise[static_cast<Eigen::Index>(m)] != 0.0) {
          const std::string table = scene.materials[m].name + ".csv";
          if (scene.materials[m].donaldson.luminesces()) {
            out << fmt::format(
                "donaldson = \"{}\"\ndonaldson_rows = \"emission\"\nkeep_anti_stokes = true\nkeep_noise = true\n",
                table);
          } else {
            out << fmt::format("reflectance = \"{}\"\n", table);
          }
          replaced = {"reflectance",      "reflectance_column", "donaldson", "donaldson_rows",
                      "keep_anti_stokes", "keep_noise",         "scale"};
          continue;
        }
        if (scale == 1.0) continue;
        out << fmt::format("scale = {:.10g}\n", scale * description.materials[m].scale);
        replaced = {"scale"};
      }
      continue;
    }
    if (std::regex_match(line, match, kKey) && replaced.contains(match[1])) continue;
    out << with_paths(line, from, to) << '\n';
  }
  const std::string text = out.str();
  const scene::SceneDescription again = scene::parse_scene(text, folder / "scene.toml");
  if ((again.camera.position - camera.position).norm() > 1e-6 * (1.0 + camera.position.norm())) {
    throw InvalidInput(
        description.file.string() +
        ": its camera is not written as a [camera] table of its own; the fitted scene cannot be written. "
        "Write one key a line under [camera].");
  }
  return text;
}

}  // namespace interglow::cli
