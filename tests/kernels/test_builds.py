"""Which of the compiled operators fit the torch that is installed; the sentence where none do."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from granpinn.command import exit_codes
from granpinn.kernels import builds
from granpinn.kernels.builds import WrongTorch, choose, why_no_cuda

BUILT = ("2.11.0+cu130", "2.12.0+cu130", "2.13.0+cu130")
REBUILD = "or build granpinn from source against this torch"


@pytest.mark.parametrize(
    ("found", "chosen"),
    [
        ("2.11.0", BUILT[0]),
        ("2.12.1+cpu", BUILT[1]),
        ("2.13.0a0+git4ae21b", BUILT[2]),
        ("2.13", BUILT[2]),
    ],
)
def test_the_build_of_the_same_minor_release_is_chosen(found: str, chosen: str) -> None:
    assert choose(found, BUILT) == chosen


@pytest.mark.parametrize("found", ["2.10.1", "2.14.0+cu132", "3.11.0", "2.1.0", "1.13.0"])
def test_another_torch_is_one_sentence_with_what_to_install(found: str) -> None:
    with pytest.raises(WrongTorch) as raised:
        choose(found, BUILT)
    assert str(raised.value).startswith(
        f"granpinn's operators are compiled for torch 2.11 to 2.13, but torch {found} is "
        f"installed: run pip install 'torch>=2.11,<2.14', {REBUILD}"
    )


def test_a_build_from_source_names_its_one_torch() -> None:
    with pytest.raises(WrongTorch, match=r"compiled for torch 2\.13, .*'torch>=2\.13,<2\.14', or"):
        choose("2.15.0", BUILT[2:])


@pytest.mark.parametrize(
    ("found", "missing", "reason"),
    [
        ("13.2", "", ""),
        ("12.8", "", "they are built for CUDA 13, but torch for CUDA 12.8"),
        (None, "", "torch is a build without CUDA, install one for CUDA 13"),
        ("13.0", "switched off by GRANPINN_CUDA", "switched off by GRANPINN_CUDA"),
    ],
)
def test_kernels_for_gpus_need_a_torch_with_their_cuda(
    found: str | None, missing: str, reason: str
) -> None:
    assert why_no_cuda(found, "NVIDIA 13.0.88", missing) == reason


def test_the_operators_in_use_are_those_of_this_torch() -> None:
    from granpinn import _C

    builds.load()  # a second time: without effect
    assert builds.torch_build() in _C.build_info()["torch_versions"].split()
    minor = ".".join(torch.__version__.split(".")[:2])
    loaded = [Path(path).name for path in torch.ops.loaded_libraries if "granpinn" in path]
    assert loaded[0] == f"libgranpinn_torch_{minor}.so"


def module(folder: Path, versions: str) -> SimpleNamespace:
    info = {"torch_versions": versions, "cuda_missing": "not here", "cuda_compiler": ""}
    return SimpleNamespace(__file__=str(folder / "_C.so"), build_info=lambda: info)


def test_a_torch_that_differs_from_its_release_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its operators cannot be loaded: here the file holds none."""
    minor = ".".join(torch.__version__.split(".")[:2])
    (tmp_path / f"libgranpinn_torch_{minor}.so").write_text("no operators")
    monkeypatch.setitem(sys.modules, "granpinn._C", module(tmp_path, f"{minor}.0"))
    with pytest.raises(WrongTorch, match=r"do not fit torch .*: install the release, or build"):
        builds.load()


def test_kernels_that_are_not_built_are_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "granpinn._C", None)  # import raises ImportError
    with pytest.raises(ImportError, match="not built for this Python: build them from a clone"):
        builds.load()


def test_a_wrong_torch_ends_a_command_with_its_sentence_alone() -> None:
    assert exit_codes.conclusion(WrongTorch("the reason and the remedy")) == (
        1,
        "the reason and the remedy",
    )
