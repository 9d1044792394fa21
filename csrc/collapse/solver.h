// The interface of the column-collapse solver that does not depend on the instruction set.
#pragma once

#include <memory>
#include <vector>

#include "parameters.h"

namespace granpinn::collapse {

// A field on the window, row by row: columns x rows values.
struct Table {
  int columns = 0, rows = 0;
  std::vector<double> values;
};

class Solver {
 public:
  virtual ~Solver() = default;

  // Fractions at centers [ny][nx], velocities on faces [ny][nx + 1] and [ny + 1][nx], of the box.
  virtual void set_state(const double* c, const double* u, const double* v) = 0;
  // One time step of at most `largest`. Throws std::runtime_error if a solve does not converge.
  virtual StepReport step(double largest) = 0;
  // Moves the fraction alone with the present velocities.
  virtual void advect_fraction(double step) = 0;
  virtual double time() const = 0;

  virtual Table fraction() const = 0;
  virtual Table pressure() const = 0;          // at centers, with the air's hydrostatic part
  virtual Table face_u() const = 0;            // columns = window + 1
  virtual Table face_v() const = 0;            // rows = window + 1
  virtual Table center_viscosity() const = 0;  // of the last step
  virtual Table corner_viscosity() const = 0;
};

// One definition per instruction set; `make_solver` picks the best that the processor has.
namespace generic {
std::unique_ptr<Solver> make_solver(const Parameters& parameters);
}
namespace avx2 {
std::unique_ptr<Solver> make_solver(const Parameters& parameters);
}
namespace avx512 {
std::unique_ptr<Solver> make_solver(const Parameters& parameters);
}

}  // namespace granpinn::collapse
