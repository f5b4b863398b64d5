// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "diagnostics/error.h"
#include "radiosity/reduced_system.h"
#include "radiosity/solution.h"
#include "radiosity/source_space.h"

namespace interglow::radiosity {
namespace {

/// Sources kept before the space is restarted from the residual: bounds memory and the cost of orthogonality.
constexpr Eigen::Index kMostSources = 384;
/// A round takes the directions within this factor of the strongest; the rest is smaller once those are in.
constexpr double kGrowShare = 1e-2;
/// Input and n-bounce sources are represented to this share of each column: rounding of the input itself.
constexpr double kRepresentation = 4e-15;
/// Residuals below this share of the solution are rounding.
constexpr double kRounding = 1e-14;

void check(const Transport& transport, const std::vector<spectral::Material>& materials,
           const std::vector<int>& element_material, const RowMatrix& direct) {
  const Eigen::Index n = transport.size();
  if (static_cast<Eigen::Index>(element_material.size()) != n || direct.rows() != n) {
    throw InvalidParams(fmt::format(
        "solve: {} elements in the transport, {} materials of elements and {} rows of direct light; expected "
        "the same number.",
        n, element_material.size(), direct.rows()));
  }
  for (std::size_t i = 0; i < element_material.size(); ++i) {
    if (element_material[i] < -1 || element_material[i] >= static_cast<int>(materials.size())) {
      throw InvalidParams(fmt::format("solve: element {} has material {}; expected -1 (black) or an index below {}.", i,
                                      element_material[i], materials.size()));
    }
  }
  for (const spectral::Material& material : materials) {
    const Eigen::Index bands = direct.cols();
    const Eigen::MatrixXd& luminescence = material.donaldson.luminescence;
    const bool sizes_agree =
        material.donaldson.bands() == bands &&
        (!material.donaldson.luminesces() || (luminescence.rows() == bands && luminescence.cols() == bands));
    if (!sizes_agree) {
      throw InvalidParams(
          fmt::format("material {}: {} reflectances and a {} x {} luminescence for direct light in {} bands.",
                      material.name, material.donaldson.bands(), luminescence.rows(), luminescence.cols(), bands));
    }
    if (!(material.donaldson.reflectance.array() >= 0.0).all() ||
        !(material.donaldson.reflectance.array() <= 1.0).all() || !luminescence.allFinite()) {
      throw InvalidParams(
          fmt::format("material {}: expected reflectances in [0, 1] and a finite luminescence.", material.name));
    }
  }
  if (!direct.allFinite()) throw InvalidParams("solve: direct light has a value that is not finite.");
}

Eigen::VectorXd weighted_norms(const RowMatrix& field, const Eigen::VectorXd& area) {
  return (area.transpose() * field.cwiseAbs2()).cwiseSqrt().transpose();
}

/// The solver's state while one set of given sources is worked on.
class SharedSpaceSolver {
 public:
  SharedSpaceSolver(const Transport& transport, const std::vector<spectral::Material>& materials,
                    const std::vector<int>& element_material, const std::vector<char>& active, Eigen::Index bands)
      : space_(transport, element_material, active), bands_(bands) {
    for (const MaterialSpace& space : space_.materials()) {
      donaldson_.push_back(&materials[static_cast<std::size_t>(space.material)].donaldson);
      luminesces_ = luminesces_ || donaldson_.back()->luminesces();
    }
    system_.emplace(space_, donaldson_);
  }

  /// Given light as irradiance: sources S E and D_L E.
  void start_from_irradiance(const RowMatrix& irradiance) {
    space_.start(irradiance, kRepresentation);
    given_irradiance_ = true;
    restart();
  }

  /// Given light as sources of the two histories, side by side.
  void start_from_sources(const RowMatrix& reflected, const RowMatrix& luminescent, double tolerance) {
    RowMatrix both(reflected.rows(), luminesces_ ? 2 * bands_ : bands_);
    both.leftCols(bands_) = reflected;
    if (luminesces_) both.rightCols(bands_) = luminescent;
    space_.start(both, tolerance);
    given_irradiance_ = false;
    restart();
  }

  /// One round of the infinite solve: Galerkin's solution, then growth towards what it misses.
  /// @param scale  per band of both histories, what `tolerance` is relative to; raised where the light is stronger
  /// @returns the largest residual of a band over its tolerance; at most 1 ends the solve
  double galerkin_round(double tolerance, std::array<Eigen::VectorXd, 2>& scale, bool grow_after) {
    Eigen::MatrixXd reflected_input(space_.sources(), bands_);
    Eigen::MatrixXd luminescent_input(space_.sources(), bands_);
    for (std::size_t m = 0; m < donaldson_.size(); ++m) {
      const MaterialSpace& space = space_.materials()[m];
      const Eigen::MatrixXd reflected = given_reflected(m);
      const Eigen::MatrixXd luminescent = given_luminescent(m);
      for (Eigen::Index s = 0; s < space.selected; ++s) {
        const Eigen::Index j = space.source[static_cast<std::size_t>(s)];
        reflected_input.row(j) = reflected.row(s);
        if (luminesces_) luminescent_input.row(j) = luminescent.row(s);
      }
    }
    system_->solve(reflected_input, luminescent_input, std::max(1e-3 * tolerance, 1e-15), amplitudes_);
    return grow_towards_sources(tolerance, kGrowShare, scale, grow_after);
  }

  /// One bounce: X = D (E + F X_before), the space grown until it holds X.
  void bounce(std::array<Eigen::VectorXd, 2>& scale) {
    grow_towards_sources(kRepresentation, 0.0, scale, true);
    Amplitudes next{.reflected = Eigen::MatrixXd::Zero(space_.sources(), bands_),
                    .luminescent = Eigen::MatrixXd::Zero(luminesces_ ? space_.sources() : 0, bands_)};
    for (std::size_t m = 0; m < donaldson_.size(); ++m) {
      const MaterialSpace& space = space_.materials()[m];
      const auto [reflected, luminescent] = outgoing(m);
      for (Eigen::Index s = 0; s < space.selected; ++s) {
        const Eigen::Index j = space.source[static_cast<std::size_t>(s)];
        next.reflected.row(j) = reflected.row(s);
        if (luminesces_) next.luminescent.row(j) = luminescent.row(s);
      }
    }
    amplitudes_ = std::move(next);
  }

  void add_to(Solution& solution) const {
    space_.add_sources(amplitudes_.reflected, solution.reflected_source);
    space_.add_arrivals(amplitudes_.reflected, solution.reflected);
    if (!luminesces_) return;
    space_.add_sources(amplitudes_.luminescent, solution.luminescent_source);
    space_.add_arrivals(amplitudes_.luminescent, solution.luminescent);
  }

  bool luminesces() const { return luminesces_; }
  Eigen::Index sources() const { return space_.sources(); }
  std::int64_t columns() const { return space_.columns_multiplied(); }
  bool grew() const { return grew_; }

 private:
  void restart() {
    system_->restart();
    amplitudes_.reflected = Eigen::MatrixXd::Zero(0, bands_);
    amplitudes_.luminescent = Eigen::MatrixXd::Zero(0, bands_);
  }

  Eigen::MatrixXd given_reflected(std::size_t m) const {
    const Eigen::MatrixXd& input = space_.materials()[m].input;
    if (!given_irradiance_) return input.leftCols(bands_);
    return input * donaldson_[m]->reflectance.asDiagonal();
  }

  Eigen::MatrixXd given_luminescent(std::size_t m) const {
    const Eigen::MatrixXd& input = space_.materials()[m].input;
    if (luminesces_ && !given_irradiance_) return input.rightCols(bands_);
    if (!donaldson_[m]->luminesces()) return Eigen::MatrixXd::Zero(input.rows(), bands_);
    return input * donaldson_[m]->luminescence.transpose();
  }

  /// D (E + F X) of both histories for the present sources X, in the basis of material m.
  std::pair<Eigen::MatrixXd, Eigen::MatrixXd> outgoing(std::size_t m) const {
    // Sources chosen since the last solve carry nothing yet.
    const Eigen::Index known = amplitudes_.reflected.rows();
    const Eigen::MatrixXd arriving = space_.materials()[m].arriving.leftCols(known);
    const auto reflect = donaldson_[m]->reflectance.asDiagonal();
    const Eigen::MatrixXd reflected_irradiance = arriving * amplitudes_.reflected;
    std::pair<Eigen::MatrixXd, Eigen::MatrixXd> result;
    result.first = given_reflected(m) + reflected_irradiance * reflect;
    if (!luminesces_) return result;
    const Eigen::MatrixXd luminescent_irradiance = arriving * amplitudes_.luminescent;
    result.second = given_luminescent(m) + luminescent_irradiance * reflect;
    if (donaldson_[m]->luminesces()) {
      result.second += (reflected_irradiance + luminescent_irradiance) * donaldson_[m]->luminescence.transpose();
    }
    return result;
  }

  /// What D (E + F X) has outside the selected vectors, per band relative to its scale and the tolerance; grows the
  /// space.
  double grow_towards_sources(double tolerance, double share, std::array<Eigen::VectorXd, 2>& scale, bool grow_after) {
    const std::size_t count = donaldson_.size();
    const Eigen::Index histories = luminesces_ ? 2 : 1;
    std::vector<Eigen::MatrixXd> missing(count);
    Eigen::VectorXd size = Eigen::VectorXd::Zero(histories * bands_);
    Eigen::VectorXd outside = Eigen::VectorXd::Zero(histories * bands_);
    for (std::size_t m = 0; m < count; ++m) {
      const auto [reflected, luminescent] = outgoing(m);
      Eigen::MatrixXd all(reflected.rows(), histories * bands_);
      all.leftCols(bands_) = reflected;
      if (luminesces_) all.rightCols(bands_) = luminescent;
      size += all.colwise().squaredNorm().transpose();
      missing[m] = all.bottomRows(space_.materials()[m].candidates());
      outside += missing[m].colwise().squaredNorm().transpose();
    }
    size = size.cwiseSqrt();
    outside = outside.cwiseSqrt();
    // Reflected light is measured against the directly lit source of its band; luminescence against all light of its
    // band.
    if (scale[0].size() == 0) scale = {size.head(bands_), size.head(bands_)};
    if (luminesces_) scale[1] = scale[1].cwiseMax(size.head(bands_) + size.tail(bands_));
    Eigen::VectorXd weight(histories * bands_);
    double worst = 0.0;
    for (Eigen::Index c = 0; c < weight.size(); ++c) {
      const double allowed =
          std::max(tolerance * scale[static_cast<std::size_t>(c / bands_)][c % bands_], kRounding * size[c]);
      // A column that meets its tolerance asks for nothing, and one without light has no scale.
      weight[c] = allowed > 0.0 && outside[c] > allowed ? 1.0 / allowed : 0.0;
      if (allowed > 0.0) worst = std::max(worst, outside[c] / allowed);
    }
    grew_ = false;
    if (worst <= 1.0 || !grow_after) return worst;
    for (Eigen::MatrixXd& block : missing) block = block * weight.asDiagonal();
    grew_ = space_.grow(missing, 0.5 / std::sqrt(static_cast<double>(count)), share) > 0;
    return worst;
  }

  SourceSpace space_;
  std::vector<const spectral::DonaldsonMatrix*> donaldson_;
  std::optional<ReducedSystem> system_;
  Amplitudes amplitudes_;
  Eigen::Index bands_;
  bool luminesces_ = false;
  bool given_irradiance_ = true;
  bool grew_ = false;
};

void solve_bounces(SharedSpaceSolver& solver, int bounces, Solution& solution, const Progress& progress) {
  std::array<Eigen::VectorXd, 2> scale;
  solver.start_from_irradiance(solution.direct);
  for (int bounce = 0; bounce < bounces; ++bounce) {
    progress.update("solve", static_cast<double>(bounce) / bounces);
    solver.bounce(scale);
    ++solution.iterations;
  }
  solver.add_to(solution);
}

/// D (E⁰ + H) - X, history by history.
struct Residual {
  RowMatrix reflected;
  RowMatrix luminescent;
  Eigen::VectorXd reflected_norm;
  Eigen::VectorXd luminescent_norm;
};

Residual residual(const Solution& solution, const Eigen::VectorXd& area,
                  const std::vector<spectral::Material>& materials, const std::vector<int>& element_material) {
  Residual r;
  const RowMatrix irradiance = solution.direct + solution.reflected;
  r.reflected = reflect(irradiance, materials, element_material) - solution.reflected_source;
  r.reflected_norm = weighted_norms(r.reflected, area);
  r.luminescent_norm = Eigen::VectorXd::Zero(r.reflected_norm.size());
  if (solution.luminescent.size() == 0) return r;
  r.luminescent = luminesce(irradiance + solution.luminescent, materials, element_material) +
                  reflect(solution.luminescent, materials, element_material) - solution.luminescent_source;
  r.luminescent_norm = weighted_norms(r.luminescent, area);
  return r;
}

/// Form factors that are wrong by more than what the scene absorbs say nothing about light that goes round so often.
void check_amplification(const Eigen::VectorXd& source, const Eigen::VectorXd& scale, double row_error) {
  for (Eigen::Index b = 0; b < scale.size(); ++b) {
    if (!(scale[b] > 0.0) || source[b] * row_error <= scale[b]) continue;
    throw NumericalFailure(fmt::format(
        "the radiosity system is singular in band {} to within the accuracy of the form factors: interreflection "
        "amplifies "
        "light {:.3g} times and the form factors of an element may be wrong by {:.3g}. Ask for a smaller transport "
        "tolerance, or give the closed scene reflectances further below 1.",
        b, source[b] / scale[b], row_error));
  }
}

void solve_all_bounces(SharedSpaceSolver& solver, const Transport& transport,
                       const std::vector<spectral::Material>& materials, const std::vector<int>& element_material,
                       const SolveParams& params, Solution& solution, const Progress& progress) {
  const Eigen::VectorXd& area = transport.area_mm2();
  // By area, as the norms are: a sliver whose row rounding spoils amplifies nothing.
  const double row_error = transport.report().error_estimate_rms;
  const Eigen::Index bands = solution.direct.cols();
  std::array<Eigen::VectorXd, 2> scale;
  double excess = 0.0;
  solver.start_from_irradiance(solution.direct);
  for (int pass = 0;; ++pass) {
    double first = 0.0;
    for (;;) {
      const bool may_grow = solution.iterations < params.max_iterations && solver.sources() < kMostSources;
      // Half the tolerance: the rest is for rounding between this estimate and the residual measured below.
      const double worst = solver.galerkin_round(0.5 * params.tolerance, scale, may_grow);
      first = std::max(first, worst);
      progress.update("solve", worst > 1.0 ? 1.0 - std::log(worst) / std::log(first * 1.001) : 1.0);
      if (!solver.grew()) break;
      ++solution.iterations;
    }
    solver.add_to(solution);

    const Residual r = residual(solution, area, materials, element_material);
    const std::array<Eigen::VectorXd, 2> source = {
        weighted_norms(solution.reflected_source, area),
        solver.luminesces() ? weighted_norms(solution.luminescent_source, area) : Eigen::VectorXd::Zero(bands)};
    check_amplification(source[0], scale[0], row_error);
    const double previous = excess;
    excess = 0.0;
    solution.relative_residual = 0.0;
    for (Eigen::Index b = 0; b < bands; ++b) {
      const std::array<double, 2> norm = {r.reflected_norm[b], r.luminescent_norm[b]};
      for (std::size_t h = 0; h < 2; ++h) {
        if (!(norm[h] > 0.0) || !(scale[h][b] > 0.0)) continue;
        solution.relative_residual = std::max(solution.relative_residual, norm[h] / scale[h][b]);
        excess = std::max(
            excess, norm[h] / std::max(params.tolerance * scale[h][b], kRounding * (source[0][b] + source[1][b])));
      }
    }
    solution.converged = excess <= 1.0;
    if (solution.converged || solution.iterations >= params.max_iterations || (pass > 0 && excess > 0.5 * previous))
      return;
    solver.start_from_sources(r.reflected, r.luminescent, std::max(kRepresentation, 0.01 / excess));
  }
}

}  // namespace

void validate(const SolveParams& params) {
  if (params.bounces && *params.bounces < 0)
    throw InvalidParams(fmt::format("bounces: {}; expected 0 or more.", *params.bounces));
  if (!(params.tolerance >= 1e-15 && params.tolerance <= 1e-2)) {
    throw InvalidParams(fmt::format("tolerance: {}; expected a value in [1e-15, 1e-2].", params.tolerance));
  }
  if (params.max_iterations < 1)
    throw InvalidParams(fmt::format("max_iterations: {}; expected at least 1.", params.max_iterations));
}

Solution solve(const Transport& transport, const std::vector<spectral::Material>& materials,
               const std::vector<int>& element_material, const RowMatrix& direct, const SolveParams& params,
               const Progress& progress) {
  validate(params);
  check(transport, materials, element_material, direct);
  const Eigen::Index n = transport.size();
  const Eigen::Index bands = direct.cols();
  std::vector<char> active;
  for (const spectral::Material& material : materials) {
    const bool sends =
        (material.donaldson.reflectance.array() != 0.0).any() || (material.donaldson.luminescence.array() != 0.0).any();
    active.push_back(sends ? 1 : 0);
  }
  SharedSpaceSolver solver(transport, materials, element_material, active, bands);

  Solution solution;
  solution.bounces = params.bounces;
  solution.direct = direct;
  solution.reflected = RowMatrix::Zero(n, bands);
  if (solver.luminesces()) solution.luminescent = RowMatrix::Zero(n, bands);
  if (params.bounces && *params.bounces == 0) return solution;
  solution.reflected_source = RowMatrix::Zero(n, bands);
  if (solver.luminesces()) solution.luminescent_source = RowMatrix::Zero(n, bands);
  if (params.bounces) {
    solve_bounces(solver, *params.bounces, solution, progress);
  } else {
    solve_all_bounces(solver, transport, materials, element_material, params, solution, progress);
  }
  solution.columns = solver.columns();
  return solution;
}

}  // namespace interglow::radiosity
