"""Which of the compiled operators fit the torch that is installed; the sentence where none do."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from granpinn.kernels import builds
from granpinn.kernels.builds import WrongTorch, choose, why_no_cuda

BUILT = ("2.11.0+cu130", "2.12.0+cu130", "2.13.0+cu130")


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
