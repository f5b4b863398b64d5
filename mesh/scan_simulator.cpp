// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/scan_simulator.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>

#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "mesh/mesh_writer.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;
constexpr double kMostPoints = 2e7;

/// Own distributions: those of the standard library differ between libraries.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * kPi * uniform());
  }

 private:
  std::mt19937_64 engine_;
};

struct Placed {
  Vector3d point, normal;
};

/// A surface over a rectangle of (s, y), both lengths along the surface.
struct Sheet {
  std::string name;
  double s_low, s_high, y_low, y_high;
  std::function<Placed(double s, double y)> place;
  std::function<bool(double s, double y)> is_seen;
  std::string truth;  ///< members of a JSON object
};

struct Hole {
  double s, y, half_s, half_y, turn;
  bool covers(double at_s, double at_y) const {
    const double u = std::cos(turn) * (at_s - s) + std::sin(turn) * (at_y - y);
    const double v = std::cos(turn) * (at_y - y) - std::sin(turn) * (at_s - s);
    return u * u / (half_s * half_s) + v * v / (half_y * half_y) < 1;
  }
};

Vector3d noisy(const Placed& placed, const ScanSimulationParams& params, Random& random) {
  double height = params.noise_sigma_mm * random.normal();
  if (random.uniform() < params.outlier_share) height += random.uniform(-params.outlier_mm, params.outlier_mm);
  return placed.point + height * placed.normal;
}

/// Keeps the points that triangles use.
TriangleMesh compact(const TriangleMesh& mesh) {
  TriangleMesh result;
  std::vector<int> index(mesh.points.size(), -1);
  for (auto t : mesh.triangles) {
    for (int& v : t) {
      if (index[v] < 0) {
        index[v] = static_cast<int>(result.points.size());
        result.points.push_back(mesh.points[v]);
      }
      v = index[v];
    }
    result.triangles.push_back(t);
  }
  return result;
}

SimulatedObject scan_sheet(const Sheet& sheet, const ScanSimulationParams& params, Random& random) {
  const auto cells = [&](double extent) {
    return std::max(1, static_cast<int>(std::lround(extent / params.spacing_mm)));
  };
  const double extent_s = sheet.s_high - sheet.s_low, extent_y = sheet.y_high - sheet.y_low;
  if (extent_s / params.spacing_mm * (extent_y / params.spacing_mm) > kMostPoints)
    throw InvalidParams(fmt::format("spacing_mm is {}: {} would have more than {:.0f} points; choose a larger spacing.",
                                    params.spacing_mm, sheet.name, kMostPoints));
  const int columns = cells(extent_s), rows = cells(extent_y);
  const double step_s = extent_s / columns, step_y = extent_y / rows;

  std::vector<Hole> holes;
  std::string holes_json;
  for (int i = 0; i < params.holes; ++i) {
    Hole hole{};
    hole.s = random.uniform(sheet.s_low, sheet.s_high);
    hole.y = random.uniform(sheet.y_low, sheet.y_high);
    hole.half_s = params.hole_mm * random.uniform(0.5, 1.5);
    hole.half_y = params.hole_mm * random.uniform(0.5, 1.5);
    hole.turn = random.uniform(0, kPi);
    holes_json +=
        fmt::format("{}{{\"s\": {:.17g}, \"y\": {:.17g}, \"half_axes\": [{:.17g}, {:.17g}], \"turn\": {:.17g}}}",
                    i == 0 ? "" : ", ", hole.s, hole.y, hole.half_s, hole.half_y, hole.turn);
    holes.push_back(hole);
  }

  TriangleMesh mesh;
  std::vector<int> index(static_cast<std::size_t>(columns + 1) * (rows + 1), -1);
  const auto at = [&](int i, int j) -> int& { return index[static_cast<std::size_t>(j) * (columns + 1) + i]; };
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i) {
      const double s =
          std::clamp(sheet.s_low + step_s * (i + params.jitter * random.uniform(-1, 1)), sheet.s_low, sheet.s_high);
      const double y =
          std::clamp(sheet.y_low + step_y * (j + params.jitter * random.uniform(-1, 1)), sheet.y_low, sheet.y_high);
      const double eaten = params.ragged_mm * random.uniform();
      const Vector3d point = noisy(sheet.place(s, y), params, random);
      const double inside = std::min({s - sheet.s_low, sheet.s_high - s, y - sheet.y_low, sheet.y_high - y});
      if (inside < eaten || !sheet.is_seen(s, y)) continue;
      if (std::any_of(holes.begin(), holes.end(), [&](const Hole& hole) { return hole.covers(s, y); })) continue;
      at(i, j) = static_cast<int>(mesh.points.size());
      mesh.points.push_back(point);
    }
  const Placed middle = sheet.place((sheet.s_low + sheet.s_high) / 2, (sheet.y_low + sheet.y_high) / 2);
  const Vector3d along_s =
      sheet.place((sheet.s_low + sheet.s_high) / 2 + step_s, (sheet.y_low + sheet.y_high) / 2).point - middle.point;
  const Vector3d along_y =
      sheet.place((sheet.s_low + sheet.s_high) / 2, (sheet.y_low + sheet.y_high) / 2 + step_y).point - middle.point;
  const bool turn = along_s.cross(along_y).dot(middle.normal) < 0;
  const auto add = [&](int a, int b, int c) {
    if (a >= 0 && b >= 0 && c >= 0) mesh.triangles.push_back(turn ? std::array{a, c, b} : std::array{a, b, c});
  };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const int a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
      const bool along_ac =
          a >= 0 && c >= 0 &&
          (b < 0 || d < 0 || (mesh.points[a] - mesh.points[c]).norm() <= (mesh.points[b] - mesh.points[d]).norm());
      if (along_ac) {
        add(a, b, c);
        add(a, c, d);
      } else {
        add(a, b, d);
        add(b, c, d);
      }
    }
  return {sheet.name, compact(mesh), fmt::format("{{{}, \"holes\": [{}]}}", sheet.truth, holes_json)};
}

/// A ball: the faces of an octahedron, divided and pushed out.
SimulatedObject scan_ball(const ScanSimulationParams& params, Random& random) {
  const double radius = params.radius_mm;
  // 4 n² points share the area 4 π R².
  const double divisions = std::max(2.0, std::round(std::sqrt(kPi) * radius / params.spacing_mm));
  if (4 * divisions * divisions > kMostPoints)
    throw InvalidParams(
        fmt::format("spacing_mm is {}: the ball would have more than {:.0f} points; choose a larger spacing.",
                    params.spacing_mm, kMostPoints));
  const int n = static_cast<int>(divisions);
  std::map<std::array<int, 3>, int> index;
  TriangleMesh mesh;
  const auto point = [&](const std::array<int, 3>& on) {  // |x| + |y| + |z| = n
    const auto [entry, is_new] = index.try_emplace(on, static_cast<int>(mesh.points.size()));
    if (is_new) {
      Vector3d direction(std::sin(kPi / 2 * on[0] / n), std::sin(kPi / 2 * on[1] / n), std::sin(kPi / 2 * on[2] / n));
      direction.normalize();
      const double shift = params.jitter * params.spacing_mm / radius;
      for (int k = 0; k < 3; ++k) direction[k] += shift * random.uniform(-1, 1) / std::numbers::sqrt3;
      direction.normalize();
      mesh.points.push_back(noisy({radius * direction, direction}, params, random));
    }
    return entry->second;
  };
  for (const int x : {1, -1})
    for (const int y : {1, -1})
      for (const int z : {1, -1}) {
        const auto at = [&](int i, int j) { return point({x * (n - i - j), y * i, z * j}); };
        const auto add = [&](int a, int b, int c) {
          mesh.triangles.push_back(x * y * z > 0 ? std::array{a, b, c} : std::array{a, c, b});
        };
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n - i; ++j) {
            const int a = at(i, j), b = at(i + 1, j), c = at(i, j + 1);
            add(a, b, c);
            if (j < n - i - 1) add(b, at(i + 1, j + 1), c);
          }
      }
  return {"ball", std::move(mesh),
          fmt::format("{{\"shape\": \"sphere\", \"radius\": {:.17g}, \"centre\": [0, 0, 0], \"normals\": \"outward\"}}",
                      radius)};
}

Sheet half_cylinder(const std::string& name, double axis_x, const ScanSimulationParams& params,
                    const std::vector<double>& contacts_s) {
  const double radius = params.radius_mm, strip = params.strip_mm;
  std::string contacts;
  for (double s : contacts_s) contacts += fmt::format("{}{:.17g}", contacts.empty() ? "" : ", ", s);
  return {
      name,
      0,
      kPi * radius,
      0,
      params.length_mm,
      [=](double s, double y) {
        const Vector3d normal(std::cos(s / radius), 0, std::sin(s / radius));
        return Placed{Vector3d(axis_x, y, 0) + radius * normal, normal};
      },
      [=](double s, double) {
        return std::none_of(contacts_s.begin(), contacts_s.end(),
                            [&](double contact) { return std::abs(s - contact) < strip; });
      },
      fmt::format(
          "\"shape\": \"half cylinder\", \"radius\": {:.17g}, \"axis_point\": [{:.17g}, 0, 0], \"axis\": [0, 1, 0], "
          "\"y\": [0, {:.17g}], \"contact_arc_lengths\": [{}], \"normals\": \"outward\"",
          radius, axis_x, params.length_mm, contacts)};
}

Sheet plane_under_arch(const ScanSimulationParams& params) {
  const double radius = params.radius_mm, margin = params.margin_mm, length = params.length_mm, strip = params.strip_mm;
  return {"plane",
          -radius - margin,
          radius + margin,
          -margin,
          length + margin,
          [](double s, double y) {
            return Placed{Vector3d(s, y, 0), Vector3d::UnitZ()};
          },
          [=](double s, double y) { return !(std::abs(s) < radius + strip && y > 0 && y < length); },
          fmt::format("\"shape\": \"plane z=0\", \"x\": [{:.17g}, {:.17g}], \"y\": [{:.17g}, {:.17g}], "
                      "\"blocked\": {{\"abs_x\": {:.17g}, \"y\": [0, {:.17g}]}}, \"normals\": \"+z\"",
                      -radius - margin, radius + margin, -margin, length + margin, radius, length)};
}

Sheet groove_side(const std::string& name, double side, const ScanSimulationParams& params) {
  const double half = params.groove_angle_deg * kPi / 360, strip = params.strip_mm;
  const Vector3d along(side * std::sin(half), 0, std::cos(half)), normal(-side * std::cos(half), 0, std::sin(half));
  return {
      name,
      0,
      params.radius_mm,
      0,
      params.length_mm,
      [=](double s, double y) {
        return Placed{s * along + Vector3d(0, y, 0), normal};
      },
      [=](double s, double) { return s >= strip; },
      fmt::format(
          "\"shape\": \"plane sheet\", \"point\": [0, 0, 0], \"across\": [{:.17g}, 0, {:.17g}], \"along\": [0, 1, 0], "
          "\"width\": {:.17g}, \"length\": {:.17g}, \"normal\": [{:.17g}, 0, {:.17g}]",
          along.x(), along.z(), params.radius_mm, params.length_mm, normal.x(), normal.z())};
}

}  // namespace

void validate(const ScanSimulationParams& params) {
  const auto require = [](bool good, const char* field, double value, const char* range) {
    if (!(good && std::isfinite(value)))
      throw InvalidParams(fmt::format("simulate-scan: {} is {}; expected {}.", field, value, range));
  };
  require(params.radius_mm > 0, "radius_mm", params.radius_mm, "a positive number");
  require(params.length_mm > 0, "length_mm", params.length_mm, "a positive number");
  require(params.gap_mm >= 0, "gap_mm", params.gap_mm, "zero or a positive number");
  require(params.margin_mm > 0, "margin_mm", params.margin_mm, "a positive number");
  require(params.groove_angle_deg > 0 && params.groove_angle_deg < 180, "groove_angle_deg", params.groove_angle_deg,
          "a number in (0, 180)");
  require(params.spacing_mm > 0, "spacing_mm", params.spacing_mm, "a positive number");
  require(params.noise_sigma_mm >= 0, "noise_sigma_mm", params.noise_sigma_mm, "zero or a positive number");
  require(params.jitter >= 0 && params.jitter <= 0.45, "jitter", params.jitter, "a number in [0, 0.45]");
  require(params.strip_mm >= 0, "strip_mm", params.strip_mm, "zero or a positive number");
  require(params.ragged_mm >= 0, "ragged_mm", params.ragged_mm, "zero or a positive number");
  require(params.holes >= 0 && params.holes <= 10000, "holes", params.holes, "a number from 0 to 10000");
  require(params.hole_mm > 0, "hole_mm", params.hole_mm, "a positive number");
  require(params.outlier_share >= 0 && params.outlier_share <= 0.5, "outlier_share", params.outlier_share,
          "a number in [0, 0.5]");
  require(params.outlier_mm >= 0, "outlier_mm", params.outlier_mm, "zero or a positive number");
}

std::vector<SimulatedObject> simulate_scan(const ScanSimulationParams& params) {
  validate(params);
  Random random(params.seed);
  const double radius = params.radius_mm;
  std::vector<Sheet> sheets;
  switch (params.scene) {
    case SimulatedScene::kHalfCylinders:
      sheets.push_back(half_cylinder("left", -radius - params.gap_mm / 2, params, {0}));
      sheets.push_back(half_cylinder("right", radius + params.gap_mm / 2, params, {kPi * radius}));
      break;
    case SimulatedScene::kArchOnPlane:
      sheets.push_back(half_cylinder("arch", 0, params, {0, kPi * radius}));
      sheets.push_back(plane_under_arch(params));
      break;
    case SimulatedScene::kVGroove:
      sheets.push_back(groove_side("left", -1, params));
      sheets.push_back(groove_side("right", 1, params));
      break;
    case SimulatedScene::kSphere:
      return {scan_ball(params, random)};
  }
  std::vector<SimulatedObject> objects;
  for (const Sheet& sheet : sheets) objects.push_back(scan_sheet(sheet, params, random));
  for (const SimulatedObject& object : objects)
    if (object.scan.triangles.empty())
      throw InvalidParams(
          fmt::format("simulate-scan: nothing of {} is left; choose a smaller spacing or strip.", object.name));
  return objects;
}

std::vector<std::filesystem::path> write_simulated_scan(const std::vector<SimulatedObject>& objects,
                                                        const ScanSimulationParams& params,
                                                        const std::filesystem::path& folder, const std::string& name,
                                                        const std::string& extension) {
  if (extension != "ply" && extension != "obj")
    throw InvalidParams(
        fmt::format("simulate-scan: the file format is \"{}\"; expected \"ply\" or \"obj\".", extension));
  std::vector<std::filesystem::path> written;
  std::string truths;
  for (const SimulatedObject& object : objects) {
    const std::string file = fmt::format("{}_{}.{}", name, object.name, extension);
    written.push_back(folder / file);
    write_mesh(written.back(), object.scan, "simulated scan");
    truths += fmt::format(
        "{}\n  {{\"object\": \"{}\", \"file\": \"{}\", \"points\": {}, \"triangles\": {}, \"true_surface\": {}}}",
        truths.empty() ? "" : ",", object.name, file, object.scan.points.size(), object.scan.triangles.size(),
        object.truth_json);
  }
  written.push_back(folder / (name + ".json"));
  files::write_text_atomically(
      written.back(),
      fmt::format(
          "{{\n \"unit\": \"mm\",\n \"parameters\": {{\"radius\": {}, \"length\": {}, \"gap\": {}, \"spacing\": {}, "
          "\"noise\": {}, \"jitter\": {}, \"strip\": {}, \"ragged\": {}, \"holes\": {}, \"hole_size\": {}, "
          "\"outlier_share\": {}, \"outlier_mm\": {}, \"seed\": {}}},\n \"objects\": [{}\n ]\n}}\n",
          params.radius_mm, params.length_mm, params.gap_mm, params.spacing_mm, params.noise_sigma_mm, params.jitter,
          params.strip_mm, params.ragged_mm, params.holes, params.hole_mm, params.outlier_share, params.outlier_mm,
          params.seed, truths));
  return written;
}

}  // namespace interglow::mesh
