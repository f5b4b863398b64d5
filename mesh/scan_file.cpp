// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/scan_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "mesh/polygon_file.h"

namespace interglow::mesh {
namespace {

namespace fs = std::filesystem;
using detail::PolygonFile;

/// Diagonals of things that somebody scans, with room: beyond them the unit is wrong, and products of lengths overflow.
constexpr double kSmallestExtent_mm = 1e-6;
constexpr double kLargestExtent_mm = 1e9;
constexpr std::size_t kMostCorners = 2000;  // ear clipping costs the square

struct Bytes {
  std::unique_ptr<char[]> data;
  std::size_t size = 0;
  std::string_view view() const { return {data.get(), size}; }
};

Bytes read_whole(const fs::path& path, const std::string& name) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InvalidInput(name + ": this file does not exist. Check the path.");
  if (!fs::is_regular_file(status))
    throw InvalidInput(name + ": this is not a file. Give the path of an OBJ, PLY, STL or OFF file.");
  const std::uintmax_t size = fs::file_size(path, error);
  std::ifstream stream(path, std::ios::binary);
  if (error || !stream) throw InvalidInput(name + ": this file cannot be opened. Check its permissions.");
  Bytes bytes{std::make_unique_for_overwrite<char[]>(size), static_cast<std::size_t>(size)};
  stream.read(bytes.data.get(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(stream.gcount()) != size) {
    throw InvalidInput(name + ": this file cannot be read to its end. Check the disk, or copy it again.");
  }
  return bytes;
}

std::string lower_case_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  return extension;
}

PolygonFile read_format(std::string_view bytes, const fs::path& path, const std::string& name,
                        const ReadParams& params) {
  const std::string extension = lower_case_extension(path);
  if (bytes.starts_with("ply\n") || bytes.starts_with("ply\r") || bytes.starts_with("ply ")) {
    return detail::read_ply(bytes, name, params.range_grid_edge_ratio);
  }
  const std::string_view first_word = bytes.substr(0, std::min(bytes.find_first_of(" \t\r\n"), bytes.size()));
  if (extension == ".off" || (first_word.size() <= 6 && first_word.ends_with("OFF")))
    return detail::read_off(bytes, name);
  if (extension == ".obj") return detail::read_obj(bytes, name);
  if (extension == ".stl") return detail::read_stl(bytes, name);
  if (extension == ".ply") {
    throw InvalidInput(name + ":1: the first line is not \"ply\", so this is not a PLY file. Copy or export it again.");
  }
  throw InvalidInput(
      fmt::format("{}: the extension \"{}\" is none of .obj, .ply, .stl, .off, and the content is neither PLY nor "
                  "OFF. Export the scan in one of these formats.",
                  name, extension));
}

/// Corners without repetitions: neighbours that are equal, and a whole round told more than once.
void remove_repetitions(std::vector<int>& polygon) {
  polygon.erase(std::unique(polygon.begin(), polygon.end()), polygon.end());
  while (polygon.size() > 1 && polygon.front() == polygon.back()) polygon.pop_back();
  const std::size_t n = polygon.size();
  for (std::size_t period = 3; 2 * period <= n; ++period) {
    if (n % period == 0 &&
        std::equal(polygon.begin() + static_cast<std::ptrdiff_t>(period), polygon.end(), polygon.begin())) {
      polygon.resize(period);
      return;
    }
  }
}

std::string plural(std::size_t count, std::string_view one, std::string_view many) {
  return fmt::format("{} {}", count, count == 1 ? one : many);
}

class Assembly {
 public:
  Assembly(PolygonFile file, const std::string& name) : file_(std::move(file)), name_(name) {}

  ScanFile run(const ReadParams& params) {
    const std::size_t faces = file_.face_place.size();
    ReadReport& report = scan_.report;
    report.format = file_.format;
    report.points_in_file = file_.points_in_file;
    report.points_welded = file_.points_welded;
    report.faces_in_file = faces + file_.incomplete_faces;
    report.incomplete_faces = file_.incomplete_faces;
    report.warnings = std::move(file_.warnings);
    if (file_.points.empty()) throw InvalidInput(name_ + ": no points were found. Export the scan as a triangle mesh.");
    if (report.faces_in_file == 0) {
      throw InvalidInput(fmt::format("{}: {} but no faces: a point cloud. Make a triangle mesh of it before.", name_,
                                     plural(file_.points.size(), "point", "points")));
    }
    if (file_.points.size() >= static_cast<std::size_t>(std::numeric_limits<int>::max())) {
      throw InvalidInput(name_ + ": more than 2147483646 points. Reduce the scan before.");
    }
    finite_.resize(file_.points.size());
    for (std::size_t i = 0; i < file_.points.size(); ++i) finite_[i] = file_.points[i].allFinite();
    scan_.mesh.triangles.reserve(file_.corners.size() / 3);
    for (std::size_t face = 0; face < faces; ++face) add_face(face);
    drop_unusable_points();
    warn();
    check_remains(params);
    scale(params.mm_per_unit);
    return std::move(scan_);
  }

 private:
  std::string place(std::size_t face) const { return fmt::format("{} {}", file_.place_name, file_.face_place[face]); }

  void add_face(std::size_t face) {
    const int* corners = file_.corners.data() + file_.face_begin[face];
    const std::size_t count = file_.face_begin[face + 1] - file_.face_begin[face];
    for (std::size_t k = 0; k < count; ++k) {
      if (corners[k] >= 0 && static_cast<std::size_t>(corners[k]) < file_.points.size()) continue;
      if (file_.bad_index_is_fatal) {
        throw InvalidInput(
            fmt::format("{}: {}: a face has the corner {}, but there are {} points (counted from 0). Reading is out of "
                        "step with the file: its counts, types or byte order are wrong. Export it again.",
                        name_, place(face), index_text(corners[k]), file_.points.size()));
      }
      if (scan_.report.faces_with_bad_index++ == 0) first_bad_index_ = place(face);
      return;
    }
    if (count < 3) {
      if (scan_.report.incomplete_faces++ == file_.incomplete_faces) first_incomplete_ = place(face);
      return;
    }
    for (std::size_t k = 0; k < count; ++k) {
      if (finite_[corners[k]]) continue;
      ++scan_.report.faces_of_unusable_points;
      return;
    }
    if (count == 3) {
      scan_.mesh.triangles.push_back({corners[0], corners[1], corners[2]});
      return;
    }
    add_polygon(face, corners, count);
  }

  void add_polygon(std::size_t face, const int* corners, std::size_t count) {
    polygon_.assign(corners, corners + count);
    remove_repetitions(polygon_);
    if (polygon_.size() < count && repeating_faces_++ == 0) {
      first_repeating_ = fmt::format("{}: {} corners, {} of them different", place(face), count, polygon_.size());
    }
    if (polygon_.size() < 3) {
      if (scan_.report.incomplete_faces++ == file_.incomplete_faces) first_incomplete_ = place(face);
      return;
    }
    if (polygon_.size() > kMostCorners) {
      throw InvalidInput(
          fmt::format("{}: {}: a polygon of {} corners; at most {} are read. Triangulate the mesh before.", name_,
                      place(face), polygon_.size(), kMostCorners));
    }
    if (polygon_.size() > 3) ++scan_.report.polygons_triangulated;
    detail::triangulate_polygon(file_.points, polygon_.data(), polygon_.size(), scan_.mesh.triangles);
  }

  static std::string index_text(int index) {
    if (index < 0) return "before the first point";
    return index == std::numeric_limits<int>::max() ? "2147483647 or more" : std::to_string(index);
  }

  void drop_unusable_points() {
    std::vector<int> new_index(file_.points.size(), -1);
    auto& points = scan_.mesh.points;
    if (std::find(finite_.begin(), finite_.end(), false) == finite_.end()) {
      points = std::move(file_.points);
      return;
    }
    for (std::size_t i = 0; i < file_.points.size(); ++i) {
      if (!finite_[i]) {
        ++scan_.report.unusable_points;
        continue;
      }
      new_index[i] = static_cast<int>(points.size());
      points.push_back(file_.points[i]);
    }
    for (auto& triangle : scan_.mesh.triangles) {
      for (int& corner : triangle) corner = new_index[corner];
    }
  }

  void warn() {
    const ReadReport& report = scan_.report;
    Warnings& warnings = scan_.report.warnings;
    if (report.unusable_points > 0) {
      warnings.push_back(fmt::format("{}: {} without finite coordinates dropped, and with them {}.", name_,
                                     plural(report.unusable_points, "point", "points"),
                                     plural(report.faces_of_unusable_points, "face", "faces")));
    }
    if (report.faces_with_bad_index > 0) {
      warnings.push_back(
          fmt::format("{}: {} with a corner index out of range dropped (first: {}; there are {} points).", name_,
                      plural(report.faces_with_bad_index, "face", "faces"), first_bad_index_, report.points_in_file));
    }
    if (!first_incomplete_.empty()) {
      warnings.push_back(fmt::format("{}: {} with fewer than three corners dropped (first: {}).", name_,
                                     plural(report.incomplete_faces - file_.incomplete_faces, "face", "faces"),
                                     first_incomplete_));
    }
    if (repeating_faces_ > 0) {
      warnings.push_back(fmt::format("{}: {} with repeated corners, which were taken once (first: {}).", name_,
                                     plural(repeating_faces_, "polygon", "polygons"), first_repeating_));
    }
  }

  void check_remains(const ReadParams& params) const {
    const ReadReport& report = scan_.report;
    const std::size_t dropped = report.faces_with_bad_index + report.incomplete_faces + report.faces_of_unusable_points;
    if (dropped > 0 && 2 * dropped > report.faces_in_file) {
      throw InvalidInput(fmt::format("{}: {} of {} faces cannot be used. {} Export the file again.", name_, dropped,
                                     report.faces_in_file, fmt::join(report.warnings, " ")));
    }
    if (params.strict && (dropped > 0 || report.unusable_points > 0 || !report.warnings.empty())) {
      throw InvalidInput(fmt::format("{} Refused, because damaged files are to be refused (strict).",
                                     fmt::join(report.warnings, " ")));
    }
  }

  void scale(double mm_per_unit) {
    auto& points = scan_.mesh.points;
    // Points that no face uses may be anywhere.
    Eigen::Vector3d low = points[scan_.mesh.triangles.front()[0]];
    Eigen::Vector3d high = low;
    for (const auto& triangle : scan_.mesh.triangles) {
      for (const int corner : triangle) {
        low = low.cwiseMin(points[corner]);
        high = high.cwiseMax(points[corner]);
      }
    }
    // stableNorm: squares of coordinates may overflow here, before they were checked.
    const double extent_mm = (high - low).stableNorm() * mm_per_unit;
    if (!(extent_mm >= kSmallestExtent_mm && extent_mm <= kLargestExtent_mm)) {
      throw InvalidInput(fmt::format(
          "{}: the scan is {:.3g} mm large with {:g} mm per file unit; expected {:g} to {:g} mm. Set the unit "
          "of the file (mm_per_unit: 1 for mm, 1000 for metres), or scale it.",
          name_, extent_mm, mm_per_unit, kSmallestExtent_mm, kLargestExtent_mm));
    }
    const double farthest_mm = std::max(low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff()) * mm_per_unit;
    if (!(farthest_mm <= 1e6 * kLargestExtent_mm)) {
      throw InvalidInput(
          fmt::format("{}: the scan lies {:.3g} mm from the origin. Move it nearer.", name_, farthest_mm));
    }
    if (mm_per_unit == 1.0) return;
    for (Eigen::Vector3d& point : points) point *= mm_per_unit;
  }

  PolygonFile file_;
  const std::string& name_;
  ScanFile scan_;
  std::vector<bool> finite_;
  std::vector<int> polygon_;
  std::size_t repeating_faces_ = 0;
  std::string first_bad_index_;
  std::string first_incomplete_;
  std::string first_repeating_;
};

}  // namespace

void validate(const ReadParams& params) {
  if (!(params.mm_per_unit > 0.0) || !std::isfinite(params.mm_per_unit)) {
    throw InvalidParams(
        fmt::format("ReadParams: mm_per_unit is {}; expected a finite number greater than 0.", params.mm_per_unit));
  }
  if (!(params.range_grid_edge_ratio > 1.0)) {
    throw InvalidParams(fmt::format("ReadParams: range_grid_edge_ratio is {}; expected a number greater than 1.",
                                    params.range_grid_edge_ratio));
  }
}

ScanFile read_scan_bytes(std::string_view bytes, const fs::path& path, const ReadParams& params) {
  validate(params);
  const std::string name = path.string();
  if (bytes.empty()) throw InvalidInput(name + ": this file is empty (0 bytes). Copy or export it again.");
  return Assembly(read_format(bytes, path, name, params), name).run(params);
}

ScanFile read_scan(const fs::path& path, const ReadParams& params) {
  const Bytes bytes = read_whole(path, path.string());
  return read_scan_bytes(bytes.view(), path, params);
}

}  // namespace interglow::mesh
