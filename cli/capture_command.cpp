// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "cli/commands.h"
#include "fitting/capture_file.h"
#include "image/channel_file.h"

namespace interglow::cli {
namespace {

struct Options {
  std::string capture;
  std::string out;
  std::string use;
};

double share(std::size_t part, std::size_t whole) {
  return 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

/// Median over used pixels of value over standard deviation, in the band where that is largest.
std::string signal_to_noise(const fitting::Capture& capture) {
  double best = 0.0;
  int best_band = 0;
  for (int b = 0; b < capture.image.bands(); ++b) {
    std::vector<double> ratio;
    for (std::size_t p = 0; p < capture.use.size(); ++p) {
      if (capture.use[p] == 0) continue;
      const double value = capture.image.value[p * static_cast<std::size_t>(capture.image.bands()) + b];
      ratio.push_back(value / std::sqrt(capture.variance(p, b)));
    }
    const auto middle = ratio.begin() + static_cast<std::ptrdiff_t>(ratio.size() / 2);
    std::nth_element(ratio.begin(), middle, ratio.end());
    if (*middle > best) {
      best = *middle;
      best_band = b;
    }
  }
  return fmt::format("{:.0f} (median, at {} nm)", best, capture.image.wavelength_nm[best_band]);
}

int show_capture(const Options& options) {
  const fitting::CaptureSource source = fitting::read_capture_source(options.capture);
  const fitting::Capture capture = fitting::load_capture(source);
  const image::SpectralImage& image = capture.image;
  const std::size_t pixels = capture.use.size();
  fmt::print("{} × {} pixels, {} bands from {} to {} nm\n", image.width, image.height, image.bands(),
             image.wavelength_nm[0], image.wavelength_nm[image.bands() - 1]);
  fmt::print("values: {}; {} dark and {} white frames\n",
             capture.has_white() ? "radiance factors" : "counts over exposure", capture.dark_frames,
             capture.white_frames);
  if (capture.noise.known()) {
    fmt::print("noise{}: read {:.3g} counts, {:.3g} counts an electron; signal to noise {}\n",
               source.noise ? "" : " (from repeated frames)", capture.noise.read_sigma, capture.noise.shot_gain,
               signal_to_noise(capture));
  }
  fmt::print("pixels used: {} ({:.1f} %); masked {}, saturated {}, invalid {}\n", capture.used,
             share(capture.used, pixels), capture.masked, capture.saturated, capture.invalid);
  for (const std::string& warning : capture.warnings) fmt::print("warning: {}\n", warning);
  if (!options.out.empty()) image::write_cube(options.out, image);
  if (!options.use.empty()) {
    std::vector<std::uint16_t> words;
    for (const std::uint8_t use : capture.use) words.push_back(use != 0 ? 65535 : 0);
    image::write_grey_words(options.use, image.width, image.height, words);
  }
  return kSuccess;
}

}  // namespace

void add_capture_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("capture", "Checks a capture, corrects it and converts it to another format");
  auto options = std::make_shared<Options>();
  command->add_option("capture", options->capture, "capture.toml, its folder, or a bare .exr, .hdr, .mat or folder")
      ->required();
  command->add_option("--out", options->out, "File for the corrected values: .exr, .mat, .img, .bil or .bip [none]");
  command->add_option("--use", options->use, "PNG or TIFF for the pixels that can be used [none]");
  add_session_options(*command, session);
  command->callback([options, &action] { action = [options] { return show_capture(*options); }; });
}

}  // namespace interglow::cli
