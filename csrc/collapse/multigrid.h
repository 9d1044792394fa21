// One V-cycle of geometric multigrid as a preconditioner, for any level type.
//
// A level L of a system with K quantities provides
//   grid, range(k), inverse         sizes, unknowns, 1 / diagonal of the operator A (0 off them)
//   apply_rows(x, j0, j1, emit)     calls emit(k, j, i0, i1, row) with the rows j0 <= j < j1 of A x
//   coarsen(coarse)                 fills the next coarser level
//   restrict_to(r, coarse_r), prolong_from(coarse_x, x)     transposes of each other
//   kLargestEigenvalue              bound of the eigenvalues of diag(A)^-1 A, for any coefficients
//   factorise(matrix), solve(matrix, b, x)                  direct solve on the coarsest grid
// The smoother is the Chebyshev iteration of the fourth kind (Lottes, Optimal polynomial smoothers
// for multigrid V-cycles, 2023): it needs no lower bound of the spectrum, vectorises, and does not
// depend on the number of threads. The cycle is symmetric and positive definite.
#pragma once

#include <memory>
#include <vector>

#include "band_matrix.h"
#include "field.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {

template <class Level>
class Multigrid {
 public:
  using S = typename Level::Scalar;
  static constexpr int K = Level::kCount;
  using Values = Vector<S, K>;

  // Allocates the hierarchy for a grid whose sides are halved `levels - 1` times.
  void resize(const Grid& grid, int levels, int degree) {
    degree_ = degree;
    rooms_.clear();
    Grid current = grid;
    for (int l = 0; l < levels; ++l, current = current.coarser()) {
      auto room = std::make_unique<Room>();
      room->level.resize(current);
      for (Values* values : {&room->r, &room->x, &room->d, &room->e}) {
        values->resize(current.nx, current.ny);
      }
      rooms_.push_back(std::move(room));
    }
  }
  Level& finest() { return rooms_.front()->level; }
  Values& right_side() { return rooms_.front()->r; }
  const Values& solution() const { return rooms_.front()->x; }

  // Builds the coarser levels from the finest.
  void build(Team& team) {
    for (std::size_t l = 0; l + 1 < rooms_.size(); ++l) {
      rooms_[l]->level.coarsen(rooms_[l + 1]->level, team);
    }
    rooms_.back()->level.factorise(coarsest_);
  }

  // From right_side() to solution(); destroys right_side().
  void cycle(Team& team, std::size_t l = 0) {
    Room& room = *rooms_[l];
    if (l + 1 == rooms_.size()) {
      room.level.solve(coarsest_, room.r, room.x);
      return;
    }
    const S scale = S(1) / S(Level::kLargestEigenvalue);
    start(team, room, S(4) / S(3) * scale);
    for (int k = 1; k < degree_; ++k) sweep(team, room, k, scale);
    subtract(team, room);
    Room& coarse = *rooms_[l + 1];
    room.level.restrict_to(room.r, coarse.r, team);
    cycle(team, l + 1);
    room.level.prolong_from(coarse.x, room.d, team);
    add(team, room);
    for (int k = 0; k < degree_; ++k) sweep(team, room, k, scale);
  }

 private:
  struct Room {
    Level level;
    Values r, x, d, e;
  };

  template <class Body>
  void each_row(Team& team, const Level& level, Body body) {
    team.rows(0, level.grid.ny + 1, level.grid.nx, [&](int j0, int j1) {
      for (int k = 0; k < K; ++k) {
        const Range range = level.range(k);
        for (int j = std::max(j0, range.j0); j < std::min(j1, range.j1); ++j) {
          body(k, j, range.i0, range.i1);
        }
      }
    });
  }

  // d = factor r / diagonal, x = d.
  void start(Team& team, Room& room, S factor) {
    each_row(team, room.level, [&](int k, int j, int i0, int i1) {
      const S* r = room.r[k].row(j);
      const S* inverse = room.level.inverse[k].row(j);
      S* d = room.d[k].row(j);
      S* x = room.x[k].row(j);
      GRANPINN_INDEPENDENT
      for (int i = i0; i < i1; ++i) x[i] = d[i] = factor * inverse[i] * r[i];
    });
  }

  // x += d.
  void add(Team& team, Room& room) {
    each_row(team, room.level, [&](int k, int j, int i0, int i1) {
      const S* d = room.d[k].row(j);
      S* x = room.x[k].row(j);
      GRANPINN_INDEPENDENT
      for (int i = i0; i < i1; ++i) x[i] += d[i];
    });
  }

  // Step k of the iteration: r -= A d, d <- a d + b r / diagonal, x += d.
  void sweep(Team& team, Room& room, int k, S scale) {
    const S a = k == 0 ? S(0) : S(2 * k - 1) / S(2 * k + 3);
    const S b = k == 0 ? S(4) / S(3) * scale : S(8 * k + 4) / S(2 * k + 3) * scale;
    wrap(room);
    team.rows(0, room.level.grid.ny + 1, room.level.grid.nx, [&](int j0, int j1) {
      room.level.apply_rows(room.d, j0, j1, [&](int q, int j, int i0, int i1, const S* ad) {
        S* r = room.r[q].row(j);
        const S* inverse = room.level.inverse[q].row(j);
        const S* d = room.d[q].row(j);
        S* e = room.e[q].row(j);
        S* x = room.x[q].row(j);
        GRANPINN_INDEPENDENT
        for (int i = i0; i < i1; ++i) {
          r[i] -= ad[i];
          e[i] = a * d[i] + b * inverse[i] * r[i];
          x[i] += e[i];
        }
      });
    });
    std::swap(room.d, room.e);
  }

  // r -= A d.
  void subtract(Team& team, Room& room) {
    wrap(room);
    team.rows(0, room.level.grid.ny + 1, room.level.grid.nx, [&](int j0, int j1) {
      room.level.apply_rows(room.d, j0, j1, [&](int q, int j, int i0, int i1, const S* ad) {
        S* r = room.r[q].row(j);
        GRANPINN_INDEPENDENT
        for (int i = i0; i < i1; ++i) r[i] -= ad[i];
      });
    });
  }

  void wrap(Room& room) {
    if (!room.level.grid.periodic()) return;
    for (auto& field : room.d.part) field.wrap();
  }

  int degree_ = 2;
  std::vector<std::unique_ptr<Room>> rooms_;
  BandMatrix coarsest_;
};

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
