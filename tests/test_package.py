"""The public names of the package, which are imported at their first use."""

import subprocess
import sys

import pytest

import granpinn


@pytest.mark.parametrize("name", sorted({*granpinn.__all__} - {"__version__", "laws"}))
def test_public_names_load(name: str) -> None:
    assert callable(getattr(granpinn, name))


def test_commands_leave_the_functions_of_their_names() -> None:
    code = (
        "import granpinn; from granpinn.commands import convert, inspect, simulate; "
        "print(callable(granpinn.inspect), callable(granpinn.convert), callable(granpinn.simulate),"
        "granpinn.laws.__name__)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["True", "True", "True", "granpinn.laws"]


def test_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(AttributeError, match="no attribute 'solve'.*identify"):
        _ = granpinn.solve


def test_import_loads_neither_torch_nor_the_kernels() -> None:
    code = "import granpinn, sys; print('torch' in sys.modules, 'granpinn._C' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["False", "False"]


def test_commands_load_no_part_of_scipy_that_few_flows_need() -> None:
    code = (
        "import granpinn.command.training_run, granpinn.commands.inspect, sys; "
        "print('scipy.signal' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["False"]


def test_help_of_train_loads_no_large_library() -> None:
    code = (
        "import sys; from granpinn.commands import train; train.main(['--help']); "
        "print([name for name in ('torch', 'scipy', 'h5py', 'matplotlib') if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines()[-1] == "[]"


def test_version_is_that_of_the_installed_distribution() -> None:
    from importlib.metadata import version

    assert granpinn.__version__ == version("granpinn")
