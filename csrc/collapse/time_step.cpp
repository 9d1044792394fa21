#include "time_step.h"

#include <cstdio>
#include <stdexcept>

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {
namespace {

template <class S>
void convert(const Field<double>& from, Field<S>& to, const Grid& grid, Team& team) {
  team.rows(0, grid.ny + 1, grid.nx, [&](int j0, int j1) {
    for (int j = j0; j < j1; ++j) {
      const double* a = from.row(j);
      S* b = to.row(j);
      for (int i = 0; i <= grid.nx; ++i) b[i] = static_cast<S>(a[i]);
    }
  });
}

}  // namespace

StepReport CollapseSolver::step(double largest) {
  StepReport report;
  const double dt = choose_step(largest);
  extrapolate(last_step_ > 0 ? 0.5 * dt / last_step_ : 0.0);
  fraction_advection_.advance(c_, middle_[0], middle_[1], dt, s_.spacing, step_count_ % 2 == 1,
                              team_);
  advect_momentum(middle_[0], middle_[1], advected_[0], advected_[1], grid_, s_.spacing, team_);
  fill_coefficients(dt);
  build_cycles();
  solve_viscous(dt, report);
  project(dt, report, true);
  last_step_ = dt;
  time_ += dt;
  ++step_count_;
  report.time = time_;
  report.step = dt;
  report.window_x = grid_.nx;
  report.window_y = grid_.ny;
  fit_window();
  return report;
}

// The pressure of a flow without friction, as if gravity were switched on now. Without it, the
// first viscous step would see a free fall that is stopped at the walls, and leave eddies behind.
void CollapseSolver::start_pressure() {
  if (s_.gravity_x == 0 && s_.gravity_y == 0) return;
  StepReport report;
  fill_coefficients(s_.largest_step);
  build_cycles();
  each_face(
      [&](int k, int i, int j) { velocity_[k](i, j) = s_.largest_step * weight_at(k, i, j); });
  project(s_.largest_step, report, false);
  velocity_ = before_;
}

double CollapseSolver::choose_step(double largest) {
  const double fastest = largest_over_cells([&](int i, int j) {
    const Field<double>&u = velocity_[0], &v = velocity_[1];
    return std::max(std::abs(u(i, j)), std::abs(u(i + 1, j))) +
           std::max(std::abs(v(i, j)), std::abs(v(i, j + 1)));
  });
  double step = s_.largest_step;
  if (fastest > 0) step = std::min(step, s_.cfl * s_.spacing / fastest);
  // The last steps before an output are of equal length.
  return largest / std::max(std::ceil(largest / step - 1e-9), 1.0);
}

// middle_ = velocity_ + share (velocity_ - before_), with ghost values; before_ = velocity_.
void CollapseSolver::extrapolate(double share) {
  team_.rows(0, grid_.ny + 1, grid_.nx, [&](int j0, int j1) {
    for (int j = j0; j < j1; ++j) {
      for (int k = 0; k < 2; ++k) {
        const double* now = velocity_[k].row(j);
        double* then = before_[k].row(j);
        double* out = middle_[k].row(j);
        for (int i = 0; i <= grid_.nx; ++i) {
          out[i] = now[i] + share * (now[i] - then[i]);
          then[i] = now[i];
        }
      }
    }
  });
  fill_velocity_ghosts(middle_[0], middle_[1], grid_);
}

void CollapseSolver::fill_coefficients(double step) {
  fill_velocity_ghosts(velocity_[0], velocity_[1], grid_);
  fill_pressure_ghosts(p_[0], grid_);
  // The first step needs a low viscosity: with the viscosity of grains at rest, an unstable column
  // would stand for many steps.
  const Field<double> no_pressure(grid_.nx, grid_.ny);
  const Field<double>& pressure = step_count_ == 0 ? no_pressure : p_[0];
  drained_ = c_;
  if (grid_.bottom == Side::no_slip) drain_floor(drained_, grid_);
  strain_.update(velocity_[0], velocity_[1], s_.spacing, team_);
  visit_law(s_.law, [&](auto law) {
    mixture_viscosity(Friction<decltype(law)>(s_), strain_, pressure, drained_, eta_center_,
                      eta_corner_, grid_, s_, team_);
  });
  if (grid_.periodic()) eta_center_.wrap();
  plug_viscosity(c_, eta_center_, eta_corner_, plug_eta_, grid_, team_);
  const double area = s_.spacing * s_.spacing;
  team_.rows(0, grid_.ny + 1, grid_.nx, [&](int j0, int j1) {
    for (int j = j0; j < j1; ++j) {
      double sum = 0;
      for (int i = 0; i < grid_.nx && j < grid_.ny; ++i) {
        viscous_.cell(i, j) = 2 * eta_center_(i, j);
        sum += c_(i, j);
      }
      row_values_[j] = sum;
    }
  });
  double mass = 0;
  for (const double value : row_values_) mass += value;
  const double gravity_squared = s_.gravity_x * s_.gravity_x + s_.gravity_y * s_.gravity_y;
  mass_scale_ = mass * s_.density * area * (gravity_squared > 0 ? gravity_squared : 1);
  viscous_.corner_eta = eta_corner_;
  each_face([&](int k, int i, int j) {
    const int n = k == 0 ? i : j, last = k == 0 ? grid_.nx : grid_.ny;
    const bool on_side = !(k == 0 && grid_.periodic()) && (n == 0 || n == last);
    const double density = density_at(k, i, j);
    viscous_.mass[k](i, j) = (on_side ? 0.5 : 1.0) * density * area / step;
    (k == 0 ? poisson_.by_x : poisson_.by_y)(i, j) = (on_side ? 2.0 : 1.0) / density;
    if (s_.side_wall > 0) {
      const double drag = side_wall_drag(k, i, j, c_, pressure, velocity_[0], velocity_[1], s_);
      drag_[k](i, j) = (on_side ? 0.5 : 1.0) * area * drag;
      viscous_.mass[k](i, j) += drag_[k](i, j);
    }
  });
  viscous_.finish(team_);
  poisson_.finish(team_);
}

void CollapseSolver::build_cycles() {
  auto& viscous = viscous_cycle_.finest();
  convert(viscous_.cell, viscous.cell, grid_, team_);
  convert(viscous_.corner_eta, viscous.corner_eta, grid_, team_);
  for (int k = 0; k < 2; ++k) convert(viscous_.mass[k], viscous.mass[k], grid_, team_);
  viscous.finish(team_);
  viscous_cycle_.build(team_);
  auto& poisson = poisson_cycle_.finest();
  convert(poisson_.by_x, poisson.by_x, grid_, team_);
  convert(poisson_.by_y, poisson.by_y, grid_, team_);
  poisson.finish(team_);
  poisson_cycle_.build(team_);
}

void CollapseSolver::solve_viscous(double step, StepReport& report) {
  each_face([&](int k, int i, int j) {
    const double push = weight_at(k, i, j) - pushed_[k](i, j) - advected_[k](i, j);
    const double v = before_[k](i, j) + step * push;
    right_[k](i, j) = (viscous_.mass[k](i, j) - drag_[k](i, j)) * v;
  });
  // Ghost values of the solved velocity are 0 (viscous.h).
  for (int k = 0; k < 2; ++k) velocity_[k].clear();
  each_face([&](int k, int i, int j) { velocity_[k](i, j) = before_[k](i, j); });
  const double unit = std::sqrt(mass_scale_ * step);
  const SolveReport solve =
      viscous_solver_.solve(viscous_, viscous_cycle_, right_, velocity_,
                            s_.viscous_tolerance * unit, s_.largest_iteration_count, team_);
  report.viscous_iterations = solve.iterations;
  report.viscous_error = solve.error / unit;
  check(solve, "viscous");
}

void CollapseSolver::project(double step, StepReport& report, bool with_relief) {
  const double h = s_.spacing;
  each_cell([&](int i, int j) {
    relief_(i, j) = with_relief ? -kReliefShare * plug_eta_(i, j) * net_outflow(i, j) / h : 0.0;
  });
  each_face([&](int k, int i, int j) { velocity_[k](i, j) += step * pushed_[k](i, j); });
  if (grid_.periodic()) velocity_[0].wrap();
  each_cell([&](int i, int j) { divergence_[0](i, j) = -h / step * net_outflow(i, j); });
  // Ghost values of the solved pressure are 0 (poisson.h).
  for (int j = -1; j <= grid_.ny; ++j) {
    p_[0](-1, j) = p_[0](grid_.nx, j) = 0;
    if (j < 0 || j == grid_.ny) std::fill_n(p_[0].row(j), grid_.nx, 0.0);
  }
  const double unit = std::sqrt(mass_scale_);
  const SolveReport solve =
      poisson_solver_.solve(poisson_, poisson_cycle_, divergence_, p_, s_.pressure_tolerance * unit,
                            s_.largest_iteration_count, team_);
  report.pressure_iterations = solve.iterations;
  report.pressure_error = solve.error / unit;
  check(solve, "pressure");
  const auto push = [&](int k, int i, int j) {
    const double before = k == 0 ? p_[0](i - 1, j) : p_[0](i, j - 1);
    return (k == 0 ? poisson_.by_x : poisson_.by_y)(i, j) * (p_[0](i, j) - before) / h;
  };
  each_face([&](int k, int i, int j) { velocity_[k](i, j) -= step * push(k, i, j); });
  each_cell([&](int i, int j) { p_[0](i, j) += relief_(i, j); });
  if (grid_.periodic()) {
    for (Field<double>* field : {&velocity_[0], &velocity_[1], &p_[0]}) field->wrap();
  }
  each_face([&](int k, int i, int j) { pushed_[k](i, j) = push(k, i, j); });
  report.largest_divergence =
      largest_over_cells([&](int i, int j) { return std::abs(net_outflow(i, j)) * step / h; });
  report.largest_speed = largest_over_cells([&](int i, int j) {
    return std::max(std::abs(velocity_[0](i, j)), std::abs(velocity_[1](i, j)));
  });
}

void CollapseSolver::check(const SolveReport& solve, const char* name) const {
  if (solve.converged) return;
  // No stream of the standard library: other modules of the process may bring their own copy of it.
  char text[400];
  std::snprintf(
      text, sizeof text,
      "the %s solve of step %lld at t = %g stopped after %d iterations with error %g on %d "
      "x %d cells: use smaller steps (cfl, largest_step) or a finer grid",
      name, static_cast<long long>(step_count_), time_, solve.iterations, solve.error, grid_.nx,
      grid_.ny);
  throw std::runtime_error(text);
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
