// The Python module granpinn._collapse: NumPy arrays in and out (granpinn/simulation/engine.py).
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>

#include "solver.h"

namespace py = pybind11;

namespace granpinn::collapse {
namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::unique_ptr<Solver> make_solver(const Parameters& parameters) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
    return avx512::make_solver(parameters);
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    return avx2::make_solver(parameters);
  }
#endif
  return generic::make_solver(parameters);
}

py::array_t<double> to_numpy(const Table& table) {
  py::array_t<double> out({table.rows, table.columns});
  std::copy(table.values.begin(), table.values.end(), out.mutable_data());
  return out;
}

void check_shape(const Array& array, const char* name, int rows, int columns) {
  if (array.ndim() == 2 && array.shape(0) == rows && array.shape(1) == columns) return;
  throw py::value_error(std::string(name) + " must have shape [" + std::to_string(rows) + ", " +
                        std::to_string(columns) + "]");
}

int law_parameters(const Parameters& s) {
  return visit_law(s.law, [](auto law) { return law.parameters; });
}

std::string law_name(const Parameters& s) {
  return visit_law(s.law, [](auto law) { return std::string(law.name); });
}

void set_law(Parameters& s, const std::string& name) {
  if (!law_named(name, &s.law)) throw py::value_error("law must be a friction law, got " + name);
  std::fill_n(s.theta, kMaxLawParameters, 0.0);
}

std::vector<double> theta(const Parameters& s) { return {s.theta, s.theta + law_parameters(s)}; }

void set_theta(Parameters& s, const std::vector<double>& values) {
  const int count = law_parameters(s);
  if (static_cast<int>(values.size()) != count) {
    throw py::value_error("theta must have " + std::to_string(count) + " parameters of the law " +
                          law_name(s) + ", got " + std::to_string(values.size()));
  }
  std::copy(values.begin(), values.end(), s.theta);
}

// The number of cells of a field, with its ghosts, is an int.
constexpr int kMostCells = 1 << 15;

const Parameters& checked(const Parameters& s) {
  for (const int cells : {s.cells_x, s.cells_y}) {
    if (cells < 1 || cells > kMostCells) {
      throw py::value_error("cells must be from 1 to " + std::to_string(kMostCells) + ", got " +
                            std::to_string(cells));
    }
  }
  if (!(s.side_wall >= 0 && s.side_wall_speed > 0)) {
    throw py::value_error("side_wall must be at least 0 and side_wall_speed above 0, got " +
                          std::to_string(s.side_wall) + " and " +
                          std::to_string(s.side_wall_speed));
  }
  if (s.chunk < 1) throw py::value_error("chunk must be positive, got " + std::to_string(s.chunk));
  return s;
}

class PySolver {
 public:
  explicit PySolver(const Parameters& s) : s_(checked(s)), solver_(make_solver(s)) {}

  void set_state(const Array& c, const Array& u, const Array& v) {
    check_shape(c, "c", s_.cells_y, s_.cells_x);
    check_shape(u, "u", s_.cells_y, s_.cells_x + 1);
    check_shape(v, "v", s_.cells_y + 1, s_.cells_x);
    const double *c_data = c.data(), *u_data = u.data(), *v_data = v.data();
    py::gil_scoped_release release;
    solver_->set_state(c_data, u_data, v_data);
  }
  // Several steps in one call: between calls a thread waits for Python.
  py::dict step(double largest, int count) {
    if (count < 1) throw py::value_error("count must be positive, got " + std::to_string(count));
    StepReport r;
    {
      py::gil_scoped_release release;
      for (int k = 0; k < count; ++k) r = solver_->step(largest);
    }
    py::dict out;
    out["time"] = r.time;
    out["step"] = r.step;
    out["viscous_iterations"] = r.viscous_iterations;
    out["pressure_iterations"] = r.pressure_iterations;
    out["viscous_error"] = r.viscous_error;
    out["pressure_error"] = r.pressure_error;
    out["largest_divergence"] = r.largest_divergence;
    out["largest_speed"] = r.largest_speed;
    out["window"] = py::make_tuple(r.window_x, r.window_y);
    return out;
  }
  void advect_fraction(double step) { solver_->advect_fraction(step); }
  double time() const { return solver_->time(); }
  py::dict state() const {
    py::dict out;
    out["c"] = to_numpy(solver_->fraction());
    out["p"] = to_numpy(solver_->pressure());
    out["u"] = to_numpy(solver_->face_u());
    out["v"] = to_numpy(solver_->face_v());
    out["eta_center"] = to_numpy(solver_->center_viscosity());
    out["eta_corner"] = to_numpy(solver_->corner_viscosity());
    return out;
  }

 private:
  Parameters s_;
  std::unique_ptr<Solver> solver_;
};

}  // namespace

PYBIND11_MODULE(_collapse, m) {
  m.doc() = "The column-collapse solver.";
  py::enum_<Side>(m, "Side")
      .value("no_slip", Side::no_slip)
      .value("free_slip", Side::free_slip)
      .value("open", Side::open)
      .value("periodic", Side::periodic);
  py::class_<Parameters> parameters(m, "Parameters");
  parameters.def(py::init<>())
      .def_readwrite("cells_x", &Parameters::cells_x)
      .def_readwrite("cells_y", &Parameters::cells_y)
      .def_readwrite("spacing", &Parameters::spacing)
      .def_readwrite("left", &Parameters::left)
      .def_readwrite("right", &Parameters::right)
      .def_readwrite("bottom", &Parameters::bottom)
      .def_readwrite("top", &Parameters::top)
      .def_property("law", &law_name, &set_law)
      .def_property("theta", &theta, &set_theta)
      .def_readwrite("grain_diameter", &Parameters::grain_diameter)
      .def_readwrite("cohesion", &Parameters::cohesion)
      .def_readwrite("eta_min", &Parameters::eta_min)
      .def_readwrite("eta_max", &Parameters::eta_max)
      .def_readwrite("density", &Parameters::density)
      .def_readwrite("air_density", &Parameters::air_density)
      .def_readwrite("air_viscosity", &Parameters::air_viscosity)
      .def_readwrite("gravity_x", &Parameters::gravity_x)
      .def_readwrite("gravity_y", &Parameters::gravity_y)
      .def_readwrite("side_wall", &Parameters::side_wall)
      .def_readwrite("side_wall_speed", &Parameters::side_wall_speed)
      .def_readwrite("newtonian", &Parameters::newtonian)
      .def_readwrite("chunk", &Parameters::chunk)
      .def_readwrite("margin", &Parameters::margin)
      .def_readwrite("cfl", &Parameters::cfl)
      .def_readwrite("largest_step", &Parameters::largest_step)
      .def_readwrite("viscous_tolerance", &Parameters::viscous_tolerance)
      .def_readwrite("pressure_tolerance", &Parameters::pressure_tolerance)
      .def_readwrite("largest_iteration_count", &Parameters::largest_iteration_count)
      .def_readwrite("threads", &Parameters::threads);
  py::class_<PySolver>(m, "Solver")
      .def(py::init<const Parameters&>(), py::call_guard<py::gil_scoped_release>())
      .def("set_state", &PySolver::set_state)
      .def("step", &PySolver::step, py::arg("largest"), py::arg("count") = 1)
      .def("advect_fraction", &PySolver::advect_fraction)
      .def_property_readonly("time", &PySolver::time)
      .def("state", &PySolver::state);
}

}  // namespace granpinn::collapse
