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


@pytest.mark.parametrize(
    ("code", "unloaded"),
    [
        ("import granpinn", ("torch", "granpinn._C")),
        (
            "import granpinn.commands.shared.training_run, granpinn.commands.inspect",
            ("scipy.signal",),  # which few flows need
        ),
        (
            "from granpinn.commands import train; train.main(['--help'])",
            ("torch", "scipy", "h5py", "matplotlib"),
        ),
        (
            "from granpinn.commands.shared.cli import VERBS, command; "
            "[command(verb).parser() for verb in VERBS]",
            ("torch", "scipy.spatial", "scipy.ndimage", "matplotlib", "pandas", "pint"),
        ),
        (
            "import granpinn; flow = granpinn.simulate(cells=64, frames=5, t_end=0.5); "
            "granpinn.inspect(flow)",
            ("torch", "matplotlib"),
        ),
    ],
    ids=["import", "commands", "help", "parsers", "inspection"],
)
def test_large_libraries_are_loaded_when_they_are_needed(
    code: str, unloaded: tuple[str, ...]
) -> None:
    code += f"; import sys; print([name for name in {unloaded} if name in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines()[-1] == "[]"


def test_version_is_that_of_the_installed_distribution() -> None:
    from importlib.metadata import version

    assert granpinn.__version__ == version("granpinn")
