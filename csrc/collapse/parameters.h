// The problem that the solver solves, in any consistent units.
#pragma once

#include "../math/laws/laws.h"

namespace granpinn::collapse {

// The condition on one side of the box, or on an open side of the window.
enum class Side {
  no_slip,    // u = v = 0
  free_slip,  // normal velocity 0, no shear stress
  open,       // p = 0, no traction
  periodic    // left and right only
};

struct Parameters {
  int cells_x = 0, cells_y = 0;  // of the whole box
  double spacing = 0;
  Side left = Side::free_slip, right = Side::no_slip, bottom = Side::no_slip, top = Side::open;

  // The friction law mu(I; theta) with I = d gamma_dot / sqrt(p / rho), and
  // eta = (cohesion + mu(I) p) / gamma_dot within [eta_min, eta_max]. A cohesive law adds its c.
  LawName law = LawName::mu_of_i;
  double theta[kMaxLawParameters] = {};  // the parameters of the law come first
  double grain_diameter = 0, cohesion = 0;
  double eta_min = 0, eta_max = 0;
  double density = 1, air_density = 0, air_viscosity = 0;
  double gravity_x = 0, gravity_y = 0;
  // Friction of side walls, side_wall = 2 mu_w / W; 0: none. side_walls.h has the force.
  double side_wall = 0, side_wall_speed = 1;
  // Newtonian grains of viscosity eta_max instead of the friction law: for verification.
  bool newtonian = false;

  // The window around the grains: its size is a multiple of `chunk` cells, with at least `margin`
  // cells of air beyond the grains. margin < 0: the whole box.
  int chunk = 16, margin = 8;

  double cfl = 0.5, largest_step = 1e-2;
  // Tolerances of the two solves: energy norm of the error relative to that of one step of gravity.
  double viscous_tolerance = 1e-4, pressure_tolerance = 1e-5;
  int largest_iteration_count = 200;
  int threads = 1;
};

// The record of one step.
struct StepReport {
  double time = 0, step = 0;
  int viscous_iterations = 0, pressure_iterations = 0;
  double viscous_error = 0, pressure_error = 0;  // the norms that the tolerances bound
  double largest_divergence = 0;                 // times the step: volume error per cell
  double largest_speed = 0;
  int window_x = 0, window_y = 0;
};

}  // namespace granpinn::collapse
