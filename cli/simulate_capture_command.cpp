// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <memory>
#include <string>

#include "cli/commands.h"
#include "cli/simulated_capture.h"

namespace interglow::cli {
void add_simulate_capture_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command =
      app.add_subcommand("simulate-capture", "Writes the capture that a real camera might make of a scene");
  auto shared = std::make_shared<SimulatedCaptureRequest>();
  SimulatedCaptureRequest& request = *shared;
  fitting::SensorParams& sensor = request.sensor;
  command->add_option("scene", request.scene, "Scene file (docs/scene-format.md)")->required();
  command->add_option("--out", request.out, "Folder for the capture; made if it does not exist")->required();
  command->add_option("--size", request.size, "Pixels along the longer side [the scene's]");
  command->add_option("--edge-length", request.edge_length_mm, "Edge length of all patches [mm; the scene's]");
  command->add_option("--path-traced", request.paths, "Render by this many paths a pixel in place of radiosity")
      ->capture_default_str();
  command->add_option("--w-ratio", request.indirect_scale, "Factor on the light between the objects: w/w' to be found")
      ->capture_default_str();
  command->add_option("--format", request.format, "tif, png (one file a band), envi or mat")
      ->check(CLI::IsMember({"tif", "png", "envi", "mat"}))
      ->capture_default_str();
  command->add_option("--bits", sensor.bits, "Bits of the converter")->capture_default_str();
  command->add_option("--full-well", sensor.full_well_electrons, "Electrons at full scale")->capture_default_str();
  command->add_option("--read-noise", sensor.read_electrons, "Standard deviation in the dark [electrons]")
      ->capture_default_str();
  command->add_option("--black", sensor.black_counts, "Counts without light")->capture_default_str();
  command->add_option("--peak", sensor.peak, "Brightest signal over full scale; above 1 saturates")
      ->capture_default_str();
  command->add_flag("--expose-bands", sensor.expose_bands, "Each band with an exposure of its own, which is declared");
  command->add_option("--gain-spread", sensor.gain_spread, "Unknown gain of each band: 1 plus or minus up to this")
      ->capture_default_str();
  command->add_option("--blur", sensor.blur_px, "Standard deviation of the lens's blur [px]")->capture_default_str();
  command->add_option("--glare", sensor.glare, "Share of the light spread over the picture")->capture_default_str();
  command->add_option("--stray", sensor.stray, "Offset that dark frames lack, over the brightest value")
      ->capture_default_str();
  command->add_option("--response", sensor.response_sigma, "Standard deviation of the pixels' responses")
      ->capture_default_str();
  command->add_option("--shift-x", request.shift_px.x(), "Misalignment: the sensor looks further right [px]")
      ->capture_default_str();
  command->add_option("--shift-y", request.shift_px.y(), "Misalignment: the sensor looks further down [px]")
      ->capture_default_str();
  command->add_option("--turn", request.turn_deg, "Misalignment: turn about the middle [degrees]")
      ->capture_default_str();
  command->add_option("--scale", request.scale, "Misalignment: scale about the middle")->capture_default_str();
  command->add_option("--dark-frames", sensor.dark_frames, "Dark frames to write")->capture_default_str();
  command->add_option("--white-frames", sensor.white_frames, "White frames to write")->capture_default_str();
  command->add_option("--white-reflectance", request.white_reflectance, "Reflectance of the white target")
      ->capture_default_str();
  command->add_option("--seed", sensor.seed, "Seed of the noise")->capture_default_str();
  add_session_options(*command, session);
  command->callback([shared, command, &session, &action] {
    // The options as they were typed, so that the capture can be made again.
    shared->command_line = "interglow simulate-capture " + shared->scene.string();
    for (const CLI::Option* option : command->get_options()) {
      if (option->count() == 0 || option->get_positional()) continue;
      shared->command_line += " " + option->get_name();
      if (option->get_items_expected_max() == 0) continue;
      for (const std::string& value : option->results()) shared->command_line += " " + value;
    }
    action = [shared, &session] {
      const std::string lines = write_simulated_capture(*shared, session.progress);
      session.clear_progress();
      fmt::print("{}", lines);
      return static_cast<int>(kSuccess);
    };
  });
}

}  // namespace interglow::cli
