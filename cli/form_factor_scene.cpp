// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/form_factor_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "radiosity/form_factor.h"
#include "radiosity/transport.h"
#include "radiosity/transport_file.h"
#include "scene/scene_builder.h"
#include "scene/scene_file.h"

namespace interglow::cli {
namespace {

/// Fronts and backs of the objects, in the order of the elements.
struct Groups {
  std::vector<std::string> name;
  std::vector<int> of_element;
};

Groups groups_of(const scene::Scene& scene, const radiosity::Elements& elements) {
  Groups groups;
  std::map<std::pair<char, int>, int> number;
  for (std::size_t e = 0; e < elements.face.size(); ++e) {
    const auto [it, added] =
        number.try_emplace({elements.back[e], elements.object[e]}, static_cast<int>(groups.name.size()));
    if (added) {
      const std::string& object = scene.objects[static_cast<std::size_t>(elements.object[e])].name;
      groups.name.push_back(elements.back[e] != 0 ? object + " (back)" : object);
    }
    groups.of_element.push_back(it->second);
  }
  return groups;
}

std::string table(const Groups& groups, const radiosity::Transport& transport) {
  const auto count = static_cast<Eigen::Index>(groups.name.size());
  radiosity::RowMatrix member = radiosity::RowMatrix::Zero(transport.size(), count);
  for (Eigen::Index e = 0; e < transport.size(); ++e) member(e, groups.of_element[static_cast<std::size_t>(e)]) = 1.0;
  const Eigen::VectorXd area = member.transpose() * transport.area_mm2();
  const Eigen::MatrixXd exchange = member.transpose() * transport.area_mm2().asDiagonal() * transport.apply(member);
  std::size_t width = 12;
  for (const std::string& name : groups.name) width = std::max(width, name.size() + 2);
  std::string text = fmt::format("{:<{}}", "from \\ to", width);
  for (const std::string& name : groups.name) text += fmt::format("{:>{}}", name, width);
  text += fmt::format("{:>{}}\n", "escapes", width);
  for (Eigen::Index i = 0; i < count; ++i) {
    text += fmt::format("{:<{}}", groups.name[static_cast<std::size_t>(i)], width);
    double sum = 0.0;
    for (Eigen::Index j = 0; j < count; ++j) {
      const double factor = exchange(i, j) / area[i];
      sum += factor;
      text += fmt::format("{:>{}.6f}", factor, width);
    }
    text += fmt::format("{:>{}.6f}\n", 1.0 - sum, width);
  }
  return text;
}

}  // namespace

std::string evaluate_scene_form_factors(const SceneFormFactors& request, const Progress& progress) {
  if (!request.output.empty()) radiosity::check_form_factor_file(request.output);
  const scene::SceneDescription description = scene::read_scene_file(request.scene);
  const scene::BuiltScene built = scene::build_scene(description, progress);
  const radiosity::Elements elements = radiosity::make_elements(built.scene);
  const radiosity::TransportParams params{
      .tolerance = request.tolerance.value_or(description.solve.form_factor_tolerance),
      .occlusion = description.solve.occlusion,
      .smooth_closure = description.solve.smooth_closure};
  const radiosity::Transport transport = radiosity::Transport::build(elements, params, progress);
  if (!request.output.empty()) radiosity::write_form_factors(transport, request.output, request.comment, progress);
  const radiosity::TransportReport& report = transport.report();
  std::string text = table(groups_of(built.scene, elements), transport);
  text +=
      fmt::format("\n{} elements, {} pairs: {} face one another, {} partly hidden, {} hidden, {} stored ({:.1f} MB)\n",
                  report.elements, report.pairs, report.facing_pairs, report.partially_visible_pairs,
                  report.blocked_pairs, report.stored_pairs, 1e-6 * static_cast<double>(report.bytes));
  for (std::size_t m = 0; m < report.pairs_by_method.size(); ++m) {
    if (report.pairs_by_method[m] > 0) {
      text += fmt::format("  {} by {}\n", report.pairs_by_method[m],
                          radiosity::name(static_cast<radiosity::FormFactorMethod>(m)));
    }
  }
  text +=
      fmt::format("closure |row sum - 1|: maximum {:.3e}, RMS {:.3e} (a closed scene has 0); largest row sum {:.9f}\n",
                  report.closure_max, report.closure_rms, report.max_row_sum);
  text += fmt::format("estimated error of a row: {:.3e} at most, {:.3e} asked for\n", report.error_estimate_max,
                      params.tolerance);
  if (params.smooth_closure)
    text += fmt::format("closure smoothing changed a form factor by up to {:.3e}\n", report.smoothing_change_max);
  text += fmt::format("time: {:.3f} s search, {:.3f} s form factors\n", report.seconds_search, report.seconds_factors);
  for (const std::string& warning : built.warnings) text += "warning: " + warning + "\n";
  return text;
}

}  // namespace interglow::cli
