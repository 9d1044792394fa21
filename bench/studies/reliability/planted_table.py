"""The planted mistakes of gate V-4: each changes one line of a file.

The old text must occur exactly once in its file. A test checks that, so the table keeps in step
with the code.
"""

from __future__ import annotations

from dataclasses import dataclass

# Those that see most come first. The operators' own checks take longer and see little more.
KERNELS = (
    *("pointwise", "viscosity", "laws", "law_update", "arguments", "sampling", "network", "step"),
    *("gradients", "orthogonalize", "determinism", "small_work", "cuda", "accuracy"),
)
SOLVER = ("laws", "bagnold", "side_walls", "fraction", "smooth_flows", "balance", "collapse")

# The tests that could notice a mistake first, by area, in a minute or two; the suite follows.
TESTS = {
    "kernels": [f"tests/kernels/test_{name}.py" for name in KERNELS],
    "cuda": [f"tests/kernels/test_{name}.py" for name in KERNELS],
    "solver": [f"tests/simulation/test_{name}.py" for name in SOLVER],
    "physics": ["tests/physics", "tests/config", "tests/kernels/test_viscosity.py"],
    "data": ["tests/physics", "tests/data"],
    "units": [
        "tests/importers/test_units.py",
        "tests/importers/test_physical_units.py",
        "tests/importers/test_convert.py",
    ],
    "training": [
        "tests/training/test_schedule.py",
        "tests/training/test_objective.py",
        "tests/training/test_optimise.py",
        "tests/training/test_last_layer.py",
        "tests/training/test_law_variables.py",
        "tests/training/test_graphs.py",
        "tests/identification/test_members.py",
    ],
    "identification": ["tests/identification", "tests/fit", "tests/results"],
    "uncertainty": ["tests/uncertainty"],
    "results": ["tests/results", "tests/identification"],
    "simulation": ["tests/simulation/test_collapse.py", "tests/simulation/test_command.py"],
    "inspection": ["tests/inspection"],
    "side walls": [
        "tests/training/test_objective.py",
        "tests/inspection/test_side_walls.py",
        "tests/identification/test_side_walls.py",
    ],
    "walls": ["tests/data/test_walls.py", "tests/data/test_variants.py"],
    "strip": [
        "tests/data/test_surface_strip.py",
        "tests/data/test_variants.py",
        "tests/checks/test_profile_of_I0.py",
    ],
}


@dataclass(frozen=True)
class Mistake:
    """One wrong line.

    Attributes:
        area: a key of TESTS.
        kind: sign, factor, index, missing term, wrong constant, or unit.
    """

    area: str
    kind: str
    file: str
    old: str
    new: str

    @property
    def compiled(self) -> bool:
        return self.file.startswith("csrc/")

    @property
    def needs_gpu(self) -> bool:
        return self.area == "cuda"


def _rows(area: str, folder: str, rows: list[tuple[str, str, str, str]]) -> list[Mistake]:
    return [Mistake(area, kind, f"{folder}/{file}", old, new) for kind, file, old, new in rows]


MISTAKES = [
    *_rows("kernels", "csrc/math", [
        ("sign", "laws/mu_of_i.h", "theta_a[2] = -(mu_a * range * over * ratio);",
         "theta_a[2] = mu_a * range * over * ratio;"),
        ("missing term", "laws/mu_of_i.h", "return I_dmu * (rest - ratio); }",
         "return I_dmu * rest; }"),
        ("sign", "forms/mixed.h", "p.p_y - stress_y - force.y;", "p.p_y + stress_y - force.y;"),
        ("missing term", "forms/mixed.h", "v[kT] + u[kValue] * v[kX] + v[kValue] * v[kY]",
         "v[kT] + u[kValue] * v[kX]"),
        ("factor", "forms/mixed.h", "select(above_floor, T(0.5) * I_I_a / p.p, R(T(0)))",
         "select(above_floor, I_I_a / p.p, R(T(0)))"),
        ("wrong constant", "forms/mixed.h", "two_D2 * two_D2 + T(1e-12)",
         "two_D2 * two_D2 + T(1e-6)"),
        ("factor", "viscosity.h", "(T(0.25) * ID - T(0.5) * D) / p",
         "(T(0.5) * ID - T(0.5) * D) / p"),
        ("index", "viscosity.h", "select(less(R(c.eta_max), eta), high, inside)",
         "select(less(R(c.eta_max), eta), low, inside)"),
        ("wrong constant", "swish.h", "q * (r * (R(T(3)) + z * r) - (z + z) * q)",
         "q * (r * (R(T(2)) + z * r) - (z + z) * q)"),
        ("wrong constant", "philox.h", "key1 += 0xBB67AE85u;", "key1 += 0xBB67AE87u;"),
        ("missing term", "adam.h", "static_cast<T>(sqrt(1 - power_2)),", "static_cast<T>(1),"),
        ("sign", "law_variables.h", "theta * (T(1) - theta) * theta_a[k]",
         "theta * (T(1) + theta) * theta_a[k]"),
    ]),
    *_rows("kernels", "csrc", [
        ("index", "batch.h", "weights.values[kVelocity] *=", "weights.values[kSurface] *="),
        ("index", "batch.h", "a.places + 4 * e + 2, a.M", "a.places + 4 * e, a.M"),
        ("sign", "step.h", "const T moved = *param - rate * U;",
         "const T moved = *param + rate * U;"),
        ("index", "ops/step_arguments.h", "begin >= end && size >= 0", "size >= 0"),
        ("factor", "cpu/residual_loss.cpp", "square / (2.0 * static_cast<double>(points))",
         "square / static_cast<double>(points)"),
        ("index", "cpu/kernels.cpp",
         "for (int p = 0; p < kTile; ++p) w[p] = p < count ? T(1) : T(0);",
         "for (int p = 0; p < kTile; ++p) w[p] = T(1);"),
        ("missing term", "cpu/mlp_tile.h", "gW[out * ld + i] += sum.sum();",
         "gW[out * ld + i] = sum.sum();"),
        ("wrong constant", "cpu/orthogonalize.h", "b = T(-4.7750)", "b = T(-4.6750)"),
    ]),
    *_rows("solver", "csrc/collapse", [
        ("wrong constant", "advection.h", "from_a = (2 * b + 5 * a - before) / 6",
         "from_a = (2 * b + 4 * a - before) / 6"),
        ("factor", "time_step.cpp", "viscous_.cell(i, j) = 2 * eta_center_(i, j);",
         "viscous_.cell(i, j) = eta_center_(i, j);"),
        ("missing term", "time_step.cpp", "- pushed_[k](i, j) - advected_[k](i, j);",
         "- pushed_[k](i, j);"),
        ("factor", "friction.h", "return 1 / (c / eta_grains + (1 - c) / eta_air);",
         "return c * eta_grains + (1 - c) * eta_air;"),
        ("missing term", "friction.h", "friction.cohesion + friction.mu(", "friction.mu("),
        ("factor", "poisson.h", "coarse.by_x(I, J) = S(0.5) * (by_x",
         "coarse.by_x(I, J) = S(0.1) * (by_x"),
    ]),
    *_rows("physics", "granpinn/physics", [
        ("unit", "scales.py", "return cls(length, velocity, length / velocity, density * g",
         "return cls(length, velocity, length / velocity, density / g"),
        ("unit", "scales.py", '"viscosity": self.pressure * self.time,',
         '"viscosity": self.pressure / self.time,'),
        ("missing term", "rheology.py", "torch.clamp(torch.abs(p), min=p_floor)",
         "torch.clamp(p, min=p_floor)"),
    ]),
    *_rows("data", "granpinn/data", [
        ("factor", "scaling.py", "math.sqrt(grain_density / flow.density)",
         "(grain_density / flow.density)"),
        ("missing term", "scaling.py", "return float(h.max() - h.min()) + cell",
         "return float(h.max() - h.min())"),
        ("factor", "points.py", "torch.stack([velocity * of_data, physics * of_equations], 1)",
         "torch.stack([velocity, physics * of_equations], 1)"),
        ("factor", "noise.py", "return math.sqrt(sum(squares) / 2)",
         "return math.sqrt(sum(squares))"),
        ("index", "particles.py", "frame = np.searchsorted((t[1:] + t[:-1]) / 2, particles.t)",
         "frame = np.searchsorted(t[1:], particles.t)"),
    ]),
    *_rows("units", "granpinn/importers", [
        ("unit", "units.py", "found = found * (known * base) ** power",
         "found = found * (known * base)"),
        ("unit", "units.py", "found = float(candidate.to(registry.m / registry.px).magnitude)",
         "found = float(candidate.magnitude)"),
        ("wrong constant", "units.py", "fps = frame / second", "fps = frame / minute"),
    ]),
    *_rows("training", "granpinn/training", [
        ("factor", "schedule.py", "(1 + math.cos(math.pi * decayed)) / 2",
         "(1 + math.cos(math.pi * decayed)) / 3"),
        ("sign", "schedule.py", "self.progress(step) >= 1 - self.settings.average",
         "self.progress(step) >= self.settings.average"),
        ("index", "objective.py", "point, surface = point + len(s.points), surface + len(",
         "point, surface = point, surface + len("),
        ("factor", "optimise.py", "math.sqrt(max(1.0, g.m / g.n))", "max(1.0, g.m / g.n)"),
    ]),
    *_rows("uncertainty", "granpinn/uncertainty", [
        ("factor", "error_bars.py", "np.cov(values, rowvar=False) / K",
         "np.cov(values, rowvar=False)"),
        ("sign", "error_model.py", "sign * math.log(values[name] / within)",
         "math.log(values[name] / within)"),
        ("missing term", "error_model.py", "b[\"outline\"] * outline(known)", "0.0"),
        ("missing term", "error_model.py", "misfit**2 - NOISE_ERROR * min(misfit, noise) ** 2",
         "misfit**2"),
    ]),
    *_rows("identification", "granpinn/fit", [
        ("factor", "prediction.py", "D_xy = U * (z_y[:, 0] + z_x[:, 1]) / 2",
         "D_xy = U * (z_y[:, 0] + z_x[:, 1])"),
        ("factor", "scoring.py", "0.5 * (u_y + v_x) ** 2", "(u_y + v_x) ** 2"),
    ]),
    *_rows("results", "granpinn/results", [
        ("sign", "assessment.py", "key=lambda pair: GRADES.index(pair[0])",
         "key=lambda pair: -GRADES.index(pair[0])"),
        ("factor", "summary.py", "slope = (mu_2 - mu_s) / I0", "slope = (mu_2 - mu_s) * I0"),
        ("index", "fields.py", "np.searchsorted(self.index, (k * size, (k + 1) * size))",
         "np.searchsorted(self.index, (k * size, (k + 2) * size))"),
        ("unit", "zones.py", "d2 * fields.time >= D2_STAGNANT",
         "d2 / fields.time >= D2_STAGNANT"),
    ]),
    *_rows("simulation", "granpinn/simulation", [
        ("index", "engine.py", "0.5 * (self.v[1:] + self.v[:-1])",
         "0.5 * (self.v[1:] + self.v[1:])"),
        ("index", "engine.py", '"gravity_y": scene.gravity[1],',
         '"gravity_y": scene.gravity[0],'),
    ]),
    *_rows("cuda", "csrc/cuda", [
        ("missing term", "step.cu", "rates = adam_rates<T>(a.adam, row[0] * a.members.lr_scale[e]",
         "rates = adam_rates<T>(a.adam, row[0]"),
        ("index", "step.cu", "e * a.P + a.offset + i / a.size * a.apart",
         "e * a.P + a.offset + i / a.size * a.size"),
        ("index", "pointwise.cu", "z[k][c] = a.jets[(c * a.n + i) * a.fields + k];",
         "z[k][c] = a.jets[(c * a.n + i) * a.fields + (k ^ 1) % a.fields];"),
        ("wrong constant", "orthogonalize.cpp", "c = 2.0315", "c = 2.1315"),
    ]),
    *_rows("kernels", "csrc/math", [
        ("sign", "side_walls.h", "e[1] = e[1] + friction * way.along_y;",
         "e[1] = e[1] - friction * way.along_y;"),
        ("missing term", "side_walls.h", "v_a = v_a + friction * (a_v - along * way.along_y);",
         "v_a = v_a + friction * a_v;"),
    ]),
    *_rows("solver", "csrc/collapse", [
        ("missing term", "side_walls.h", "std::hypot(a, b)", "std::hypot(a, 0 * b)"),
        ("missing term", "side_walls.h", "s.side_wall * grains * pressure",
         "s.side_wall * pressure"),
    ]),
    *_rows("side walls", "granpinn", [
        ("factor", "physics/side_walls.py", "return 2 * friction / gap",
         "return friction / gap"),
        ("unit", "data/scaling.py", 'coefficient(friction, scales.to_dimensionless(gap, "length"))',
         "coefficient(friction, gap)"),
        ("index", "estimates/stress.py", "return k * u / speed, k * v / speed",
         "return k * u / speed, k * u / speed"),
        ("factor", "fit/assumptions.py", "lower + 2 * walls.friction_sd",
         "lower + walls.friction_sd"),
    ]),
    *_rows("walls", "granpinn/data", [
        ("missing term", "wall_points.py", "touch.sticks & closed & agrees(along)",
         "touch.sticks & closed"),
        ("sign", "wall_points.py", "touch.of_grains - through)", "touch.of_grains + through)"),
        ("missing term", "walls.py", "found[k[apart & (first * last <= 0)]] = True",
         "found[k[apart]] = True"),
        ("index", "walls.py", "segments.at(float(time))", "segments.at(float(t[0]))"),
        ("factor", "points.py", "physics.new_tensor([of_walls, 0.0])",
         "physics.new_tensor([of_data, 0.0])"),
    ]),
    *_rows("strip", "granpinn", [
        ("factor", "data/surface_strip.py", "np.minimum(width, thickest) / (dx * dy)",
         "np.minimum(width, thickest) / dx"),
        ("missing term", "data/surface_strip.py", "if not steady and abs(", "if steady and abs("),
        ("missing term", "data/variants.py", "drawn.weight * (strip.area / mean)[drawn.place]",
         "drawn.weight * (strip.area / strip.area)[drawn.place]"),
        ("factor", "data/surface_strip.py", "rng.random((count, 1)), weight / count)",
         "rng.random((count, 1)), weight)"),
        ("index", "fit/final_loss.py", "inside[inside >= first] += strip",
         "inside[inside >= first] += 0"),
    ]),
]  # fmt: skip
