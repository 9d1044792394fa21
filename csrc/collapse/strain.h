// The strain rate for the friction law, at cell centers and corners.
//
// The equations are ill-posed where
//   C = 4 a^2 - 4 a + mu^2 (1 - a/2)^2 > 0,   a = I mu'(I) / mu(I)
// (Barker, Schaeffer, Bohorquez, Gray 2015). Short waves grow fastest there, and shear bands get
// as thin as the grid allows. Inside the grains, gamma_dot^2 is therefore blended with its value of
// the mean D over nine cells, weights (1 2 1) x (1 2 1) / 16. The mean has the share min(1, 4 C),
// and none where the law is well-posed. The difference is of second order.
#pragma once

#include <cmath>

#include "../math/cohesion.h"
#include "field.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

inline double inertial_number(double gamma_dot, double p, const Parameters& s) {
  return s.grain_diameter * gamma_dot / std::sqrt(std::max(p / s.density, 1e-30));
}

// A friction law (csrc/math/laws/) with the values of its parameters, and the cohesion that adds to
// it.
template <class Law>
struct Friction {
  double theta[Law::parameters];
  double cohesion;

  explicit Friction(const Parameters& s) : cohesion(s.cohesion) {
    std::copy_n(s.theta, Law::parameters, theta);
    if constexpr (is_cohesive<Law>) cohesion += theta[Law::cohesion];
  }
  double mu(double I) const { return typename Law::template Jet<double>(I, theta).mu; }
  // C of the header; 0 for grains without friction.
  double ill_posedness(double I) const {
    const typename Law::template Jet<double> jet(I, theta);
    if (jet.mu <= 0) return 0;
    const double a = jet.I_dmu / jet.mu;
    return 4 * a * a - 4 * a + jet.mu * jet.mu * (1 - a / 2) * (1 - a / 2);
  }
};

class StrainRate {
 public:
  void resize(const Grid& grid) {
    grid_ = grid;
    for (Field<double>* field : {&normal_, &shear_, &mean_normal_, &mean_shear_}) {
      field->resize(grid.nx, grid.ny);
    }
  }

  // From face velocities with ghost values and the cell size h.
  void update(const Field<double>& u, const Field<double>& v, double h, Team& team) {
    u_ = &u;
    v_ = &v;
    scale_ = 1 / (h * h);
    team.rows(-1, grid_.ny + 1, grid_.nx * 2, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        for (int i = -1; i <= grid_.nx; ++i) {
          normal_(i, j) = u(i + 1, j) - u(i, j) - (v(i, j + 1) - v(i, j));
          shear_(i, j) = 0.25 * (corner_shear(i, j) + corner_shear(i + 1, j) +
                                 corner_shear(i, j + 1) + corner_shear(i + 1, j + 1));
        }
      }
    });
    team.rows(-1, grid_.ny + 1, grid_.nx * 2, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        average(normal_, mean_normal_, j);
        average(shear_, mean_shear_, j);
      }
    });
    if (grid_.periodic()) {
      mean_normal_.wrap();
      mean_shear_.wrap();
    }
  }

  // gamma_dot^2 for the friction law, where the pressure is p. c has ghost values.
  template <class Law>
  double squared_at_center(int i, int j, double p, const Field<double>& c,
                           const Friction<Law>& friction, const Parameters& s) const {
    const double here = squared(normal_(i, j), shear_(i, j));
    if (!grains_only(c, i - 1, i + 1, j - 1, j + 1)) return here;
    return blend(here, squared(mean_normal_(i, j), mean_shear_(i, j)), p, friction, s);
  }
  template <class Law>
  double squared_at_corner(int i, int j, double p, const Field<double>& c,
                           const Friction<Law>& friction, const Parameters& s) const {
    const double here = squared(four(normal_, i, j), corner_shear(i, j));
    if (!grains_only(c, i - 1, i, j - 1, j)) return here;
    const double mean = squared(four(mean_normal_, i, j), four(mean_shear_, i, j));
    return blend(here, mean, p, friction, s);
  }

 private:
  // h (u_y + v_x)
  double corner_shear(int i, int j) const {
    return (*u_)(i, j) - (*u_)(i, j - 1) + (*v_)(i, j) - (*v_)(i - 1, j);
  }
  // 2 D:D of a velocity without divergence, from h (u_x - v_y) and h (u_y + v_x).
  double squared(double normal, double shear) const {
    return (normal * normal + shear * shear) * scale_;
  }
  static double four(const Field<double>& a, int i, int j) {
    return 0.25 * (a(i, j) + a(i - 1, j) + a(i, j - 1) + a(i - 1, j - 1));
  }
  static bool grains_only(const Field<double>& c, int i0, int i1, int j0, int j1) {
    double least = 1;
    for (int j = j0; j <= j1; ++j) {
      for (int i = i0; i <= i1; ++i) least = std::min(least, c(i, j));
    }
    return least >= 1;
  }
  template <class Law>
  static double blend(double here, double mean, double p, const Friction<Law>& friction,
                      const Parameters& s) {
    const double C = friction.ill_posedness(inertial_number(std::sqrt(here), p, s));
    const double share = std::min(1.0, std::max(0.0, 4 * C));
    return here + share * (mean - here);
  }
  // The row j of the mean over nine cells; ghost cells keep their own value.
  void average(const Field<double>& from, Field<double>& to, int j) const {
    const double *low = from.row(j - 1), *a = from.row(j), *high = from.row(j + 1);
    double* out = to.row(j);
    const bool ghost = j < 0 || j >= grid_.ny;
    for (int i = -1; i <= grid_.nx; ++i) out[i] = a[i];
    for (int i = 0; i < grid_.nx && !ghost; ++i) {
      const double left = low[i - 1] + 2 * a[i - 1] + high[i - 1];
      const double here = low[i] + 2 * a[i] + high[i];
      const double right = low[i + 1] + 2 * a[i + 1] + high[i + 1];
      out[i] = (left + 2 * here + right) / 16;
    }
  }

  Grid grid_;
  const Field<double>*u_ = nullptr, *v_ = nullptr;
  double scale_ = 1;
  Field<double> normal_, shear_, mean_normal_, mean_shear_;
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
