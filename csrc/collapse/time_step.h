// The state of a collapse and one time step of the projection method:
//
//   c moves with the velocity extrapolated to the middle of the step               (fraction.h)
//   eta from the old velocity and pressure                                         (friction.h)
//   f(v*) = -k p_old v* / |v| of side walls, if there are any                      (side_walls.h)
//   rho (v* - v)/dt + rho div(v v) = rho g - grad p_old + div(2 eta D(v*)) + f(v*) (viscous.h)
//   v** = v* + dt/rho grad p_old
//   div(dt/rho grad q) = div v**,  v = v** - dt/rho grad q                         (poisson.h)
//   p = q - 4/3 eta div v*   inside plugs                                          (friction.h)
//
// The last line is the rotational form of the pressure update (Timmermans, Minev, van de Vosse
// 1996). Without it the pressure in a plug, where eta dt / (rho L^2) is large, takes thousands of
// steps to relax. With constant eta, the projection adds grad(2 eta div v*) to the viscous
// force; the exact factor is between 1 and 2 depending on the sides, and 4/3 contracts the
// error by three per step for all of them.
//
// The old pressure gradient enters as the acceleration grad p_old / rho_old with the old density,
// because with the new one it would be wrong at a face that the grains have just reached. Gravity
// is reduced by the weight of the air: p = 0 is then exact on open sides beside air at rest.
#pragma once

#include "advection.h"
#include "fraction.h"
#include "friction.h"
#include "krylov.h"
#include "poisson.h"
#include "side_walls.h"
#include "solver.h"
#include "viscous.h"
#include "window.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

class CollapseSolver final : public Solver {
 public:
  explicit CollapseSolver(const Parameters& parameters);

  void set_state(const double* c, const double* u, const double* v) override;
  StepReport step(double largest) override;
  void advect_fraction(double step) override;
  double time() const override { return time_; }

  Table fraction() const override { return table(c_, 0, 0); }
  Table pressure() const override;
  Table face_u() const override { return table(velocity_[0], 1, 0); }
  Table face_v() const override { return table(velocity_[1], 0, 1); }
  Table center_viscosity() const override { return table(eta_center_, 0, 0); }
  Table corner_viscosity() const override { return table(eta_corner_, 1, 1); }

 private:
  using Velocity = Vector<double, 2>;
  // The multigrid cycles only precondition: single precision is enough for them.
  using Cycle = float;

  Table table(const Field<double>& field, int more_columns, int more_rows) const;
  void allocate(int nx, int ny);
  void fit_window();
  double choose_step(double largest);
  void extrapolate(double share);
  void fill_coefficients(double step);
  void build_cycles();
  void solve_viscous(double step, StepReport& report);
  void project(double step, StepReport& report, bool with_relief);
  void start_pressure();
  void check(const SolveReport& solve, const char* name) const;

  // Arithmetic mean over the two cells beside a face; c has ghost values.
  double density_at(int k, int i, int j) const {
    const double c = 0.5 * (c_(i, j) + (k == 0 ? c_(i - 1, j) : c_(i, j - 1)));
    return c * s_.density + (1 - c) * s_.air_density;
  }
  // Gravity less the buoyancy in air, per unit of mass.
  double weight_at(int k, int i, int j) const {
    return (k == 0 ? s_.gravity_x : s_.gravity_y) * (1 - s_.air_density / density_at(k, i, j));
  }
  // h div v
  double net_outflow(int i, int j) const {
    return velocity_[0](i + 1, j) - velocity_[0](i, j) + velocity_[1](i, j + 1) -
           velocity_[1](i, j);
  }
  template <class Body>
  void each_cell(Body body) {
    team_.rows(0, grid_.ny, grid_.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        for (int i = 0; i < grid_.nx; ++i) body(i, j);
      }
    });
  }
  // All faces whose velocity is unknown.
  template <class Body>
  void each_face(Body body) {
    team_.rows(0, grid_.ny + 1, grid_.nx, [&](int j0, int j1) {
      for (int k = 0; k < 2; ++k) {
        const Range range = viscous_.range(k);
        for (int j = std::max(j0, range.j0); j < std::min(j1, range.j1); ++j) {
          for (int i = range.i0; i < range.i1; ++i) body(k, i, j);
        }
      }
    });
  }
  template <class Value>
  double largest_over_cells(Value value) {
    team_.rows(0, grid_.ny, grid_.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        double largest = 0;
        for (int i = 0; i < grid_.nx; ++i) largest = std::max(largest, value(i, j));
        row_values_[j] = largest;
      }
    });
    return *std::max_element(row_values_.begin(), row_values_.begin() + grid_.ny);
  }

  static constexpr double kReliefShare = 4.0 / 3.0;

  Parameters s_;
  Team team_;
  Grid grid_;
  double time_ = 0, last_step_ = 0;
  int step_count_ = 0;
  double mass_scale_ = 1;  // mass x gravity^2, to make the tolerances relative

  Field<double> c_, eta_center_, eta_corner_, plug_eta_, relief_, drained_;
  Vector<double, 1> p_, divergence_;
  // now, one step ago, at the middle of the step, div(v v), grad p / rho, right side, drag of side
  // walls in the mass of the viscous solve
  Velocity velocity_, before_, middle_, advected_, pushed_, right_, drag_;
  std::vector<double> row_values_;
  FractionAdvection fraction_advection_;
  StrainRate strain_;

  ViscousLevel<double> viscous_;
  PoissonLevel<double> poisson_;
  Multigrid<ViscousLevel<Cycle>> viscous_cycle_;
  Multigrid<PoissonLevel<Cycle>> poisson_cycle_;
  ConjugateGradients<ViscousLevel<double>, ViscousLevel<Cycle>> viscous_solver_;
  ConjugateGradients<PoissonLevel<double>, PoissonLevel<Cycle>> poisson_solver_;
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
