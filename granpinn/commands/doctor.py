"""``python -m granpinn.doctor``: what is installed, and which kernels run here.

Nothing is imported before it is needed, so that a broken torch or a module that was not built is
reported like every other result. Exit code 0 if the kernels work, 1 otherwise, with what to do.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("doctor")

import os
import platform
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import granpinn
from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.parser import Parser

Section = dict[str, Any]

BUILD_HINT = (
    "build it in the source tree with the torch that is installed: "
    "pip install scikit-build-core pybind11 cmake ninja && pip install --no-build-isolation -e ."
)
LARGEST_ERROR = {"float64": 1e-8, "float32": 1e-3}  # of the kernels, relative L2


class Trouble(Exception):
    """The kernels do not work; the message says why and what to do."""


def versions() -> Section:
    """Versions of Python and of the packages that a result depends on."""
    found = {"granpinn": granpinn.__version__, "python": platform.python_version()}
    for name in ("torch", "numpy", "h5py", "safetensors"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "missing"
    return found


def load(name: str, hint: str) -> Any:
    """The module `name`; Trouble where it cannot be imported."""
    try:
        return import_module(name)
    except Exception as error:  # a damaged binary package raises OSError, RuntimeError, ...
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise Trouble(f"{name} cannot be imported ({reason}): {hint}") from error


def build() -> Section:
    """What the module was built with; Trouble where the torch that runs is another one."""
    load("torch", "pip install 'torch>=2.11'")
    info: Section = dict(load("granpinn._C", BUILD_HINT).build_info())
    try:
        info["torch_version"] = import_module("granpinn.kernels.builds").torch_build()
    except ImportError as error:
        raise Trouble(str(error)) from error
    return info


def cpu() -> Section:
    """The processor, the instruction set that the kernels use on it, and the threads."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    torch, kernels = import_module("torch"), import_module("granpinn._C")
    return {
        "processor": (models or [platform.machine()])[0],
        "kernels": f"{kernels.cpu_capability()}, of those built: {kernels.build_info()['simd']}",
        "threads": torch.get_num_threads(),
        "cores": os.cpu_count(),
        "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "not set"),
    }


def gpu() -> Section:
    """The GPUs, the driver, and whether this build has kernels for them."""
    torch, info = import_module("torch"), import_module("granpinn._C").build_info()
    path = Path("/proc/driver/nvidia/version")
    driver = path.read_text().splitlines()[0].strip() if path.exists() else "none seen"
    if torch.version.cuda is None:
        seen = "none: this torch was built without CUDA"
    elif not torch.cuda.is_available():
        seen = f"none: torch was built for CUDA {torch.version.cuda} but finds no device or driver"
    else:
        names = [
            f"{torch.cuda.get_device_name(i)}, compute capability {major}.{minor}"
            for i in range(torch.cuda.device_count())
            for major, minor in [torch.cuda.get_device_capability(i)]
        ]
        seen = f"{'; '.join(names)} (CUDA {torch.version.cuda})"
    missing = import_module("granpinn.kernels.builds").cuda_missing()
    built = f"built for {info['cuda_architectures']} by {info['cuda_compiler']}"
    return {"devices": seen, "driver": driver, "kernels": f"none: {missing}" if missing else built}


def self_check() -> Section:
    """The fused loss and its gradient against nested autograd, on five points and every device."""
    torch = import_module("torch")
    missing = import_module("granpinn.kernels.builds").cuda_missing()
    report = {}
    for form in ("strong", "mixed"):
        report[form] = agreement(form, "cpu", "float64")
        if torch.cuda.is_available() and not missing:
            for dtype in LARGEST_ERROR:
                report[f"{form}, GPU {dtype}"] = agreement(form, "cuda", dtype)
    return report


def agreement(form: str, device: str, dtype: str) -> str:
    """How well the kernel of a device agrees with nested autograd.

    Raises:
        Trouble: they differ by more than LARGEST_ERROR.
    """
    ops = load("granpinn.kernels.ops", BUILD_HINT)
    reference = load("granpinn.reference", BUILD_HINT)

    fused = [x.double().cpu() for x in ops.residual_loss(*small_problem(form, device, dtype))]
    truth = reference.residual_loss(*small_problem(form, "cpu", "float64"))
    error = max(
        float((f - t).norm() / t.norm().clamp_min(1e-300))
        for f, t in zip(fused, truth, strict=True)
    )
    if not error < LARGEST_ERROR[dtype]:  # not `>=`: nan is Trouble as well
        raise Trouble(
            f"the {form} residual kernel ({device}, {dtype}) differs from nested autograd by "
            f"{error:.1e} (expected < {LARGEST_ERROR[dtype]:.0e}): {BUILD_HINT}; if it persists, "
            "report it with this text"
        )
    return f"agrees with nested autograd to {error:.0e}"


def small_problem(form: str, device: str, dtype: str) -> tuple[Any, ...]:
    """Arguments of residual_loss for a random network, five points and four surface points."""
    from granpinn.kernels.network import OUTPUTS, NetworkSpec
    from granpinn.physics import constants, laws, terms

    torch = import_module("torch")
    generator = torch.Generator().manual_seed(0)
    kind = {"device": device, "dtype": getattr(torch, dtype)}

    def draw(*shape: int) -> Any:
        return torch.randn(shape, generator=generator, dtype=torch.float64).to(**kind)

    spec = NetworkSpec((3, 8, OUTPUTS[form]), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), form)
    params = draw(spec.n_params)
    theta = torch.tensor([p.start for p in laws.DEFAULT.parameters], **kind)
    inside = (draw(5, 3), draw(5, 2), torch.ones(5, 2, **kind))
    batch = terms.LossPoints(*inside, draw(4, 3), draw(4))
    physics = constants.Physics(
        grain_diameter=0.01,
        g_x=0.0,
        g_y=-1.0,
        eta_min=0.0,
        eta_max=1e4,
        velocity_scale=1.0,
        pressure_scale=1.0,
        pressure_floor=1e-4,
    )
    return params, theta, batch, torch.ones(len(terms.NAMES), **kind), spec, physics


SECTIONS = {"versions": versions, "build": build, "cpu": cpu, "gpu": gpu, "self-check": self_check}


def parser() -> Parser:
    return Parser("doctor", "", "Show what is installed, and which kernels run.")


def run(argv: Sequence[str]) -> int:
    parser().parse_args(argv)
    try:
        for title, section in SECTIONS.items():
            print("\n".join([title, *(f"  {key:<16} {value}" for key, value in section().items())]))
    except Trouble as trouble:
        print(f"\nThe kernels do not work: {trouble}")
        return 1
    print("\nThe kernels work.")
    return 0


main = partial(exit_code, "doctor", run)
