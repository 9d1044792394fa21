"""Quantities with units: their values, and one sentence for nonsense."""

from __future__ import annotations

import pytest

from granpinn.importers import DataFileError, units


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("0.8 mm", "length", 8e-4),
        ("800um", "length", 8e-4),
        ("800 µm", "length", 8e-4),
        ("2.5 g/cm^3", "density", 2500),
        ("2.5 g cm-3", "density", 2500),
        ("2500 kg/m**3", "density", 2500),
        ("981 cm/s^2", "acceleration", 9.81),
        ("1.2 deg", "angle", 0.020943951023931952),
        ("-3 °", "angle", -0.05235987755982988),
        ("0.1 rad", "angle", 0.1),
        ("2e-3 s", "time", 2e-3),
        (".5 ms", "time", 5e-4),
    ],
)
def test_quantities(text: str, dimension: str, value: float) -> None:
    assert units.SI.number(text, dimension, "--x") == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["0.12 mm/px", "120 um/pixel", f"{1 / 0.12!r} px/mm"])
def test_scale(text: str) -> None:
    assert units.scale(text) == pytest.approx(1.2e-4, rel=1e-12)


@pytest.mark.parametrize("text", ["500 Hz", "0.5 kHz", "500 fps", "500 frame/s", "2 ms", "500 1/s"])
def test_time_of_a_frame(text: str) -> None:
    assert units.frame_time(text, "--frame-rate") == pytest.approx(2e-3, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "dimension", "factor"),
    [
        ("px/frame", "velocity", 1e-4 / 2e-3),
        ("pixel", "length", 1e-4),
        ("px/s", "velocity", 1e-4),
        ("mm/s", "velocity", 1e-3),
        ("m/frame", "velocity", 500),
        ("frame", "time", 2e-3),
        ("[mm]", "length", 1e-3),
    ],
)
def test_factors(unit: str, dimension: str, factor: float) -> None:
    found = units.Calibration(1e-4, 2e-3, 2e-3).factor(unit, dimension, "x")
    assert found == pytest.approx(factor, rel=1e-12)


NONSENSE = [
    "3",
    "mm",
    "3 bananas",
    "3 s",
    "nan mm",
    "1e999 mm",
    "3 mm^99",
    "2 (mm",
    "9**9**9 mm",
    "3 mm; import os",
    "3 " + "m*" * 40 + "m",
    "",
]


@pytest.mark.parametrize("text", NONSENSE)
def test_nonsense_is_refused(text: str) -> None:
    with pytest.raises(DataFileError, match="grain_diameter must be") as caught:
        units.SI.number(text, "length", "--grain-diameter")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["0.12 mm", "0 mm/px", "-1 mm/px", "3 px/s", "x"])
def test_wrong_scales_are_refused(text: str) -> None:
    with pytest.raises(DataFileError, match="scale must be"):
        units.scale(text)


@pytest.mark.parametrize("text", ["0 Hz", "-2 ms", "3 m", "5"])
def test_wrong_rates_are_refused(text: str) -> None:
    with pytest.raises(DataFileError, match="frame_rate must be a rate or a time"):
        units.frame_time(text, "--frame-rate")


def test_what_is_missing_is_named() -> None:
    with pytest.raises(DataFileError, match="u is in px/frame: give scale"):
        units.Calibration(delay=1.0).factor("px/frame", "velocity", "u")
    with pytest.raises(DataFileError, match="u is in m/frame: give frame_rate"):
        units.Calibration(1.0).factor("m/frame", "velocity", "u")
    with pytest.raises(DataFileError, match="u must be a unit of velocity, got 'm'"):
        units.SI.factor("m", "velocity", "u")


def test_a_power_of_zero_is_no_unit() -> None:
    with pytest.raises(DataFileError, match="t must be a unit such as mm"):
        units.unit("ms0", "t")
