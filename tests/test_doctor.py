"""granpinn.doctor: its report when the kernels work, and its advice when they do not."""

import sys
from importlib.metadata import PackageNotFoundError
from types import SimpleNamespace
from typing import Any, NoReturn

import pytest
import torch

from granpinn.commands import doctor


def fake_module(torch_versions: str) -> SimpleNamespace:
    info = {"torch_versions": torch_versions, "simd": "generic avx2"}
    return SimpleNamespace(build_info=lambda: info, cpu_capability=lambda: "avx2")


def test_a_missing_package_is_reported_as_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> NoReturn:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "version", absent)
    assert doctor.versions()["h5py"] == "missing"


def test_a_module_that_was_not_built_is_trouble_with_the_build_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "granpinn._C", None)  # import raises ImportError
    assert doctor.main([]) == 1
    text = capsys.readouterr().out
    assert "granpinn._C cannot be imported" in text
    assert "pip install --no-build-isolation" in text


def test_a_module_built_against_another_torch_is_trouble(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "granpinn._C", fake_module("2.5.1"))
    with pytest.raises(doctor.Trouble, match=r"compiled for torch 2\.5, but torch .* installed"):
        doctor.build()


@pytest.mark.parametrize(
    ("missing", "expected"),
    [
        ("", "built for 80-real 90a-real 90-virtual by NVIDIA 13.0.88"),
        ("switched off by GRANPINN_CUDA", "none: switched off by GRANPINN_CUDA"),
    ],
)
def test_the_cuda_part_is_reported_as_built_or_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, missing: str, expected: str
) -> None:
    monkeypatch.setattr(torch.version, "cuda", "13.2")
    info = {
        "cuda_missing": missing,
        "cuda_architectures": "80-real 90a-real 90-virtual",
        "cuda_compiler": "NVIDIA 13.0.88",
    }
    kernels = SimpleNamespace(build_info=lambda: info)
    monkeypatch.setitem(sys.modules, "granpinn._C", kernels)
    assert doctor.gpu()["kernels"] == expected


@pytest.mark.parametrize("factor", [1.001, float("nan")])
def test_wrong_kernels_are_trouble(monkeypatch: pytest.MonkeyPatch, factor: float) -> None:
    from granpinn import reference
    from granpinn.kernels import ops

    def wrong(*arguments: Any) -> tuple[torch.Tensor, ...]:
        return tuple(output * factor for output in reference.residual_loss(*arguments))

    monkeypatch.setattr(ops, "residual_loss", wrong)
    with pytest.raises(doctor.Trouble, match=r"strong residual kernel \(cpu, float64\) differs"):
        doctor.self_check()


def test_everything_works_here(capsys: pytest.CaptureFixture[str]) -> None:
    assert doctor.main([]) == 0
    text = capsys.readouterr().out
    for word in ("threads", "agrees with nested autograd", "The kernels work."):
        assert word in text
