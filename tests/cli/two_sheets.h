// SPDX-License-Identifier: GPL-3.0-or-later
/// A folder with two flat sheets at a right angle, red and yellow, and a scene of them. Neither sees itself, so with
/// one bounce the light between them has the spectrum S_i S_j E exactly.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/temporary_folder.h"

namespace interglow::cli {

class TwoSheets : public testing::Test {
 protected:
  /// Bands from 450 to 650 nm; `mesh_setting` is a line for each sheet, or empty.
  static std::string scene(int step_nm, int width_px, int height_px, const std::string& mesh_setting = "") {
    return "[wavelengths]\nfirst_nm = 450\nlast_nm = 650\nstep_nm = " + std::to_string(step_nm) +
           R"(
[material.red]
reflectance = "red.csv"
[material.yellow]
reflectance = "yellow.csv"
[object.floor]
mesh = "floor.obj"
material = "red"
remesh = "none"
)" + mesh_setting +
           R"(
[object.wall]
mesh = "wall.obj"
material = "yellow"
remesh = "none"
)" + mesh_setting +
           R"(
[light.sun]
kind = "directional"
direction = [-1, 0.2, -1]
spectrum = 1.0
[camera]
position_mm = [200, 20, 200]
target_mm = [10, 20, 10]
up = [0, 0, 1]
horizontal_fov_deg = 12
width_px = )" +
           std::to_string(width_px) + "\nheight_px = " + std::to_string(height_px) + "\n";
  }

  void SetUp() override {
    write("floor.obj", "v 0 0 0\nv 40 0 0\nv 40 40 0\nv 0 40 0\nf 1 2 3 4\n");
    write("wall.obj", "v 0 0 0\nv 0 40 0\nv 0 40 40\nv 0 0 40\nf 1 2 3 4\n");
    write("red.csv", "wavelength,r\n400,0.1\n550,0.2\n700,0.8\n");
    write("yellow.csv", "wavelength,r\n400,0.1\n550,0.7\n700,0.7\n");
  }

  std::filesystem::path file(const std::string& name) const { return folder_ / name; }
  void write(const std::string& name, const std::string& text) const { std::ofstream(file(name)) << text; }

 private:
  const test::TemporaryFolder folder_;
};

}  // namespace interglow::cli
