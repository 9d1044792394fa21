// Allocation, the moving window, and the readers of the state.
#include "time_step.h"

namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE {
namespace {

constexpr int kSmoothingDegree = 3;

// The window can be halved this often: it consists of whole chunks.
int level_count(int chunk) {
  int levels = 1;
  while (chunk % 2 == 0) {
    chunk /= 2;
    ++levels;
  }
  return levels;
}

}  // namespace

CollapseSolver::CollapseSolver(const Parameters& parameters) : s_(parameters), team_(s_.threads) {
  allocate(window_size(0, 0, s_.cells_x, s_), window_size(0, 0, s_.cells_y, s_));
}

void CollapseSolver::allocate(int nx, int ny) {
  grid_ = window_grid(nx, ny, s_);
  for (Field<double>* field :
       {&c_, &eta_center_, &eta_corner_, &plug_eta_, &relief_, &p_[0], &divergence_[0]}) {
    field->resize(nx, ny);
  }
  for (Velocity* v : {&velocity_, &before_, &middle_, &advected_, &pushed_, &right_, &drag_}) {
    v->resize(nx, ny);
  }
  fraction_advection_.resize(grid_);
  strain_.resize(grid_);
  row_values_.assign(static_cast<std::size_t>(ny) + 1, 0.0);
  const int levels = level_count(s_.chunk);
  viscous_.resize(grid_);
  poisson_.resize(grid_);
  viscous_cycle_.resize(grid_, levels, kSmoothingDegree);
  poisson_cycle_.resize(grid_, levels, kSmoothingDegree);
  viscous_solver_.resize(grid_);
  poisson_solver_.resize(grid_);
}

void CollapseSolver::set_state(const double* c, const double* u, const double* v) {
  const int box_x = s_.cells_x, box_y = s_.cells_y;
  int columns = 0, rows = 0;
  occupied_cells([&](int i, int j) { return c[j * box_x + i]; }, box_x, box_y, columns, rows);
  allocate(window_size(columns, box_x, box_x, s_), window_size(rows, box_y, box_y, s_));
  for (int j = 0; j <= grid_.ny; ++j) {
    for (int i = 0; i <= grid_.nx; ++i) {
      if (i < box_x && j < box_y) c_(i, j) = c[j * box_x + i];
      if (j < box_y) velocity_[0](i, j) = u[j * (box_x + 1) + i];
      if (i < box_x) velocity_[1](i, j) = v[j * box_x + i];
    }
  }
  before_ = velocity_;
  fill_fraction_ghosts(c_, grid_);
  start_pressure();
}

void CollapseSolver::fit_window() {
  int columns = 0, rows = 0;
  occupied_cells(c_, grid_.nx, grid_.ny, columns, rows);
  const int nx = window_size(columns, grid_.nx, s_.cells_x, s_);
  const int ny = window_size(rows, grid_.ny, s_.cells_y, s_);
  const int old_nx = grid_.nx, old_ny = grid_.ny;
  if (nx == old_nx && ny == old_ny) return;
  const auto moved = [&](const Field<double>& field, int more_x, int more_y, bool continued) {
    return moved_to(field, old_nx + more_x, old_ny + more_y, nx, ny, continued);
  };
  Field<double> c = moved(c_, 0, 0, false), p = moved(p_[0], 0, 0, false);
  Field<double> eta_center = moved(eta_center_, 0, 0, true);
  Field<double> eta_corner = moved(eta_corner_, 1, 1, true);
  Velocity velocity, before, pushed;
  for (int k = 0; k < 2; ++k) {
    velocity[k] = moved(velocity_[k], k == 0, k == 1, true);
    before[k] = moved(before_[k], k == 0, k == 1, true);
    pushed[k] = moved(pushed_[k], k == 0, k == 1, false);
  }
  allocate(nx, ny);
  c_ = std::move(c);
  p_[0] = std::move(p);
  eta_center_ = std::move(eta_center);
  eta_corner_ = std::move(eta_corner);
  velocity_ = std::move(velocity);
  before_ = std::move(before);
  pushed_ = std::move(pushed);
  fill_fraction_ghosts(c_, grid_);
}

void CollapseSolver::advect_fraction(double step) {
  fraction_advection_.advance(c_, velocity_[0], velocity_[1], step, s_.spacing,
                              step_count_ % 2 == 1, team_);
  time_ += step;
  ++step_count_;
}

Table CollapseSolver::table(const Field<double>& field, int more_columns, int more_rows) const {
  Table out{grid_.nx + more_columns, grid_.ny + more_rows, {}};
  for (int j = 0; j < out.rows; ++j) {
    out.values.insert(out.values.end(), field.row(j), field.row(j) + out.columns);
  }
  return out;
}

Table CollapseSolver::pressure() const {
  Table out = table(p_[0], 0, 0);
  const double h = s_.spacing, top = s_.cells_y * h;
  // Between periodic sides a mean gradient holds the air, and the rest of the pressure is periodic.
  const double along = grid_.periodic() ? 0 : s_.gravity_x;
  for (int j = 0; j < out.rows; ++j) {
    for (int i = 0; i < out.columns; ++i) {
      const double x = (i + 0.5) * h, y = (j + 0.5) * h - top;
      out.values[static_cast<std::size_t>(j) * out.columns + i] +=
          s_.air_density * (along * x + s_.gravity_y * y);
    }
  }
  return out;
}

std::unique_ptr<Solver> make_solver(const Parameters& parameters) {
  return std::make_unique<CollapseSolver>(parameters);
}

}  // namespace granpinn::collapse::GRANPINN_SIMD_NAMESPACE
