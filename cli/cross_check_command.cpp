// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "cli/commands.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "files/sha256.h"
#include "report/page.h"
#include "scene/scene_builder.h"
#include "verification/check_scene.h"
#include "verification/cross_check_run.h"
#include "verification/report_document.h"

namespace interglow::cli {
namespace {

constexpr int kDefaultSize_px = 128;
/// Silhouettes and shadow edges are to be resolved better than the margin, whatever the scene asks for its picture.
constexpr int kSamplesPerSide = 16;

struct Options {
  std::filesystem::path scene, out, reference, standard_error;
  std::string command_line;
  std::string method = "radiosity";
  std::optional<int> size{};
  verification::CrossCheckParams check{};
};

verification::CrossCheck run_check(const Options& options, const scene::Scene& scene, verification::Provenance& from,
                                   const Progress& progress) {
  if (options.reference.empty()) {
    if (options.method != "radiosity" || !options.standard_error.empty()) {
      throw InvalidParams("--method and --standard-error need --reference, the picture to compare with.");
    }
    const scene::Scene flat = verification::check_scene(scene, options.size.value_or(kDefaultSize_px));
    return verification::cross_check_scene(flat, options.check, progress);
  }
  const auto reference = verification::read_reference(options.reference, options.standard_error, options.size);
  for (const auto& file : {options.reference, options.standard_error}) {
    if (!file.empty()) from.inputs.emplace_back(file.string(), files::sha256_of_file(file));
  }
  const scene::Scene flat = verification::check_scene(scene, std::max(scene.camera.width, scene.camera.height));
  const auto method =
      options.method == "radiosity" ? verification::Method::kRadiosity : verification::Method::kPathTracer;
  return verification::cross_check_reference(flat, reference, method, options.check, progress);
}

int cross_check(Options options, const Session& session) {
  const scene::SceneDescription description = scene::read_scene_file(options.scene);
  if (description.solve.model == scene::LightModel::kPaper) {
    throw InvalidInput(
        fmt::format("{}: solve.model is \"paper\"; the cross-check is of the exact model. Set it to \"exact\".",
                    options.scene.string()));
  }
  const scene::BuiltScene built = scene::build_scene(description, session.progress);
  const scene::SolveDescription& solve = description.solve;
  options.check.radiosity = {
      .transport = {.tolerance = solve.form_factor_tolerance,
                    .occlusion = solve.occlusion,
                    .smooth_closure = solve.smooth_closure,
                    .black_sides = built.scene.sky.has_value()},
      .solve = {.bounces = solve.bounces, .tolerance = solve.tolerance, .max_iterations = solve.max_iterations},
      .render = {.samples_per_side = std::max(kSamplesPerSide, description.render.samples_per_side),
                 .gather_tolerance = description.render.gather_tolerance}};
  verification::Provenance from{.title = options.scene.string(),
                                .command_line = options.command_line,
                                .version = INTERGLOW_VERSION,
                                .inputs = {},
                                .warnings = built.warnings};
  for (const scene::InputFile& input : built.inputs) from.inputs.emplace_back(input.path.string(), input.sha256);
  const verification::CrossCheck check = run_check(options, built.scene, from, session.progress);
  const report::Json document = verification::report_document(check, options.check, from);
  files::write_text_atomically(options.out / "report.html", report::html_page(document));
  files::write_text_atomically(options.out / "report.json", document.dump(1) + "\n");
  session.clear_progress();
  fmt::print("{}: {}\n{}\n", cross_check::name(check.verdict), verification::verdict_sentence(check, options.check),
             (options.out / "report.html").string());
  switch (check.verdict) {
    case cross_check::Verdict::kAgrees:
      return kSuccess;
    case cross_check::Verdict::kDisagrees:
      return kDisagrees;
    case cross_check::Verdict::kUndecided:
      break;
  }
  return kUndecided;
}

}  // namespace

void add_cross_check_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand(
      "cross-check",
      "Checks radiosity against a path tracer or a reference image: exit status 0 agrees, 3 disagrees, 4 undecided");
  auto options = std::make_shared<Options>();
  auto& agreement = options->check.agreement;
  command->add_option("scene", options->scene, "Scene file (docs/scene-format.md)")->required();
  command->add_option("--out", options->out, "Folder for report.html and report.json")->required();
  command->add_option("--margin", agreement.margin, "Largest relative difference that counts as agreement")
      ->capture_default_str();
  command->add_option("--confidence", agreement.confidence, "Confidence of each claim of agreement")
      ->capture_default_str();
  command
      ->add_option("--tiles", agreement.tiles_per_side, "Tiles along each side of the picture, each judged by itself")
      ->capture_default_str();
  command->add_option("--time-limit", options->check.time_limit_s, "Seconds after which no more samples are added")
      ->capture_default_str();
  command->add_option("--size", options->size,
                      fmt::format("Pixels along the longer side [{}, or those of the reference]", kDefaultSize_px));
  command->add_option("--seed", options->check.seed, "Seed of the path tracer")->capture_default_str();
  command->add_option("--reference", options->reference,
                      "Picture (spectral or grey EXR) in the path tracer's place [none]");
  command->add_option("--standard-error", options->standard_error,
                      "Standard error of that picture (EXR) [none: no verdict]");
  command->add_option("--method", options->method, "Which method is compared with the reference")
      ->check(CLI::IsMember({"radiosity", "path-tracer"}))
      ->capture_default_str();
  add_session_options(*command, session);
  command->callback([options, command, &session, &action] {
    options->command_line = "interglow cross-check " + options->scene.string();
    for (const CLI::Option* option : command->get_options()) {
      if (option->count() == 0 || option->get_lnames().empty()) continue;  // the scene has no name
      options->command_line += " --" + option->get_lnames().front();
      for (const std::string& value : option->results()) options->command_line += " " + value;
    }
    action = [options, &session] { return cross_check(*options, session); };
  });
}

}  // namespace interglow::cli
