// SPDX-License-Identifier: GPL-3.0-or-later
/// The radiating elements of a scene: one for each side of a face that can exchange light.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mesh/patch_mesh.h"
#include "scene/scene.h"

namespace interglow::radiosity {

/// Geometric faces of all objects in one numbering (object order, then face order), with shared points.
struct Faces {
  std::vector<Eigen::Vector3d> points;   ///< mm; points of different objects are distinct entries
  std::vector<mesh::Face> corners;       ///< counter-clockwise seen from the front
  std::vector<int> object;               ///< object of each face
  Eigen::Index size() const { return static_cast<Eigen::Index>(corners.size()); }
};

/// A face side that radiates or absorbs. Structure of arrays, one row an element.
/// Front elements come first, in face order; then the back elements, in face order: backs of two-sided objects carry the
/// object's material, backs of one-sided sheets that are not closed are black; closed objects have none.
struct Elements {
  Faces faces;
  std::vector<int> face;                 ///< face of each element
  std::vector<char> back;                ///< 1 if the element is the back side of its face
  std::vector<int> material;             ///< index into Scene::materials; -1: black
  std::vector<int> object;
  Eigen::VectorXd area_mm2;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> normal;    ///< unit, towards the side of the element
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> centroid;  ///< mm
  std::vector<int> front_element;        ///< element of each face's front
  std::vector<int> back_element;         ///< element of each face's back; -1: none

  Eigen::Index size() const { return area_mm2.size(); }
};

/// Cost O(faces). @throws InvalidInput naming object and face if a face has no area or a quad is not planar to 1e-6 of its size.
Elements make_elements(const scene::Scene& scene);

}  // namespace interglow::radiosity
