// SPDX-License-Identifier: GPL-3.0-or-later
#include "exchange/scene_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cctype>

namespace interglow::exchange::detail {

PolyLine poly_line(const spectral::WavelengthGrid& grid, const Eigen::VectorXd& bands) {
  const Eigen::Index last = grid.size() - 1;
  PolyLine line{{grid.lower_edge_nm(0)}, {bands[0]}};
  for (Eigen::Index band = 0; band <= last; ++band) {
    line.wavelength_nm.push_back(grid.center_nm(band));
    line.value.push_back(bands[band]);
  }
  line.wavelength_nm.push_back(grid.upper_edge_nm(last));
  line.value.push_back(bands[last]);
  return line;
}

std::string joined(const std::vector<double>& numbers, const char* separator) {
  return fmt::format("{}", fmt::join(numbers, separator));
}

std::string text(const Eigen::Vector3d& point, const char* separator) {
  return fmt::format("{}{}{}{}{}", point.x(), separator, point.y(), separator, point.z());
}

std::string mesh_file(const scene::Scene& scene, std::size_t object) {
  std::string name = scene.objects[object].name;
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-') c = '_';
  }
  return fmt::format("meshes/{:02}_{}.ply", object + 1, name);
}

}  // namespace interglow::exchange::detail
