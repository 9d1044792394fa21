// Conjugate gradients in double precision, preconditioned by one multigrid cycle.
#pragma once

#include <cmath>
#include <vector>

#include "multigrid.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

struct SolveReport {
  int iterations = 0;
  double error = 0;  // estimated energy norm of the error, sqrt(r . M^-1 r)
  bool converged = false;
};

// Level: as in multigrid.h, in double. Coarse: the same system in the scalar of the cycle.
template <class Level, class Coarse>
class ConjugateGradients {
 public:
  static constexpr int K = Level::kCount;
  using Values = Vector<double, K>;

  void resize(const Grid& grid) {
    for (Values* values : {&r_, &p_, &q_}) values->resize(grid.nx, grid.ny);
    sums_.assign(static_cast<std::size_t>(grid.ny) + 1, 0.0);
  }

  // Solves A x = b to sqrt(r . M^-1 r) <= tolerance, starting from the given x.
  SolveReport solve(const Level& level, Multigrid<Coarse>& cycle, const Values& b, Values& x,
                    double tolerance, int largest_count, Team& team) {
    SolveReport report;
    wrap(level, x);
    team.rows(0, level.grid.ny + 1, level.grid.nx, [&](int j0, int j1) {
      level.apply_rows(x, j0, j1, [&](int k, int j, int i0, int i1, const double* ax) {
        const double* right = b[k].row(j);
        double* r = r_[k].row(j);
        for (int i = i0; i < i1; ++i) r[i] = right[i] - ax[i];
      });
    });
    double rho = precondition(level, cycle, team);
    double beta = 0;
    while (true) {
      report.error = std::sqrt(std::max(rho, 0.0));
      report.converged = report.error <= tolerance;  // false for NaN
      if (report.converged || report.iterations == largest_count || !std::isfinite(rho)) break;
      ++report.iterations;
      advance_direction(level, cycle, beta, team);
      const double curvature = apply_to_direction(level, team);
      if (!(curvature > 0)) break;
      step(level, x, rho / curvature, team);
      const double next = precondition(level, cycle, team);
      beta = next / rho;
      rho = next;
    }
    wrap(level, x);
    return report;
  }

 private:
  using S = typename Coarse::Scalar;

  static void wrap(const Level& level, Values& x) {
    if (!level.grid.periodic()) return;
    for (auto& field : x.part) field.wrap();
  }

  template <class Row>
  double sum(const Level& level, Team& team, Row row) {
    team.rows(0, level.grid.ny + 1, level.grid.nx, [&](int j0, int j1) {
      for (int j = j0; j < j1; ++j) {
        double total = 0;
        for (int k = 0; k < K; ++k) {
          const Range range = level.range(k);
          if (j >= range.j0 && j < range.j1) total += row(k, j, range.i0, range.i1);
        }
        sums_[j] = total;
      }
    });
    double total = 0;
    for (const double value : sums_) total += value;
    return total;
  }

  // z = M^-1 r, left in the cycle; returns r . z.
  double precondition(const Level& level, Multigrid<Coarse>& cycle, Team& team) {
    sum(level, team, [&](int k, int j, int i0, int i1) {
      const double* r = r_[k].row(j);
      S* right = cycle.right_side()[k].row(j);
      for (int i = i0; i < i1; ++i) right[i] = static_cast<S>(r[i]);
      return 0.0;
    });
    cycle.cycle(team);
    return sum(level, team, [&](int k, int j, int i0, int i1) {
      const double* r = r_[k].row(j);
      const S* z = cycle.solution()[k].row(j);
      double total = 0;
      for (int i = i0; i < i1; ++i) total += r[i] * static_cast<double>(z[i]);
      return total;
    });
  }

  void advance_direction(const Level& level, Multigrid<Coarse>& cycle, double beta, Team& team) {
    sum(level, team, [&](int k, int j, int i0, int i1) {
      const S* z = cycle.solution()[k].row(j);
      double* p = p_[k].row(j);
      for (int i = i0; i < i1; ++i) p[i] = static_cast<double>(z[i]) + beta * p[i];
      return 0.0;
    });
    wrap(level, p_);
  }

  // q = A p; returns p . q.
  double apply_to_direction(const Level& level, Team& team) {
    team.rows(0, level.grid.ny + 1, level.grid.nx, [&](int j0, int j1) {
      std::fill(sums_.begin() + j0, sums_.begin() + j1, 0.0);
      level.apply_rows(p_, j0, j1, [&](int k, int j, int i0, int i1, const double* ap) {
        double* q = q_[k].row(j);
        const double* p = p_[k].row(j);
        double total = 0;
        for (int i = i0; i < i1; ++i) {
          q[i] = ap[i];
          total += p[i] * ap[i];
        }
        sums_[j] += total;
      });
    });
    double total = 0;
    for (const double value : sums_) total += value;
    return total;
  }

  // x += alpha p, r -= alpha q.
  void step(const Level& level, Values& x, double alpha, Team& team) {
    sum(level, team, [&](int k, int j, int i0, int i1) {
      const double* p = p_[k].row(j);
      const double* q = q_[k].row(j);
      double* a = x[k].row(j);
      double* r = r_[k].row(j);
      for (int i = i0; i < i1; ++i) {
        a[i] += alpha * p[i];
        r[i] -= alpha * q[i];
      }
      return 0.0;
    });
  }

  Values r_, p_, q_;
  std::vector<double> sums_;
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
