// Cholesky factorisation of a symmetric positive definite band matrix, for the coarsest grid.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "isa.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

class BandMatrix {
 public:
  // A zero matrix of n rows with `width` diagonals below the main one.
  void reset(int n, int width) {
    n_ = n;
    width_ = width;
    a_.assign(static_cast<std::size_t>(n) * (width + 1), 0.0);
  }
  int size() const { return n_; }

  // Adds to entry (i, j) and, being symmetric, (j, i).
  void add(int i, int j, double value) { at(std::max(i, j), std::min(i, j)) += value; }

  // A = L L^T in place. A pivot that vanishes (the constant pressure of a closed box) is replaced
  // by one that makes its unknown zero.
  void factorise() {
    for (int i = 0; i < n_; ++i) {
      const int first = std::max(0, i - width_);
      const double original = at(i, i);
      for (int j = first; j <= i; ++j) {
        double sum = at(i, j);
        const int start = std::max(first, j - width_);
        const double* row_i = &at(i, start);
        const double* row_j = &at(j, start);
        for (int k = 0; k < j - start; ++k) sum -= row_i[k] * row_j[k];
        if (j < i) {
          at(i, j) = sum / at(j, j);
        } else {
          at(i, i) = sum > 1e-12 * original ? std::sqrt(sum) : 1e150;
        }
      }
    }
  }

  // x = A^-1 x.
  void solve(std::vector<double>& x) const {
    for (int i = 0; i < n_; ++i) {
      const int first = std::max(0, i - width_);
      const double* row = &at(i, first);
      double sum = x[i];
      for (int k = first; k < i; ++k) sum -= row[k - first] * x[k];
      x[i] = sum / at(i, i);
    }
    for (int i = n_ - 1; i >= 0; --i) {
      const int first = std::max(0, i - width_);
      const double* row = &at(i, first);
      x[i] /= at(i, i);
      for (int k = first; k < i; ++k) x[k] -= row[k - first] * x[i];
    }
  }

 private:
  // Row i holds columns i - width .. i.
  double& at(int i, int j) {
    return a_[static_cast<std::size_t>(i) * (width_ + 1) + j - i + width_];
  }
  const double& at(int i, int j) const {
    return a_[static_cast<std::size_t>(i) * (width_ + 1) + j - i + width_];
  }

  int n_ = 0, width_ = 0;
  std::vector<double> a_;
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
