"""Tables as trackpy, pandas, R, spreadsheets, TrackMate and TracTrac write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import DataFileError, read, read_vectors

MATERIAL = {"grain_diameter": "2 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}


FRAMES, GRAINS = 7, 40


def rows() -> Any:
    """frame, particle, x, y, u, v of grains in a shear flow [n, 6], in pixels and frames."""
    frame, particle = np.meshgrid(np.arange(FRAMES), np.arange(GRAINS), indexing="ij")
    x0, y0 = np.random.default_rng(1).uniform(10, 200, (2, GRAINS))
    u, v = 0.01 * y0 + 0.2, 0.02 * x0 + 0.1
    parts = (frame, particle, x0 + frame * u, y0 + frame * v, u + 0 * frame, v + 0 * frame)
    return np.stack([np.ravel(part) for part in parts], axis=1).astype(float)


def table(
    names: str = "frame,particle,x,y",
    order: str = "fpxy",
    separator: str = ",",
    sign: str = ".",
    above: tuple[str, ...] = (),
) -> str:
    """A table as text; i in the order is a number of the row."""
    parts = dict(zip("fpxyuv", rows().T, strict=True))
    parts |= {"i": np.arange(len(rows())), "e": np.full(len(rows()), np.nan)}
    lines = [
        separator.join("" if np.isnan(parts[key][k]) else f"{parts[key][k]:.9g}" for key in order)
        for k in range(len(rows()))
    ]
    body = "\n".join(lines).replace(".", sign) if sign == "," else "\n".join(lines)
    return "\n".join([*above, names.replace(",", separator), body, ""])


TRACKMATE = (
    "LABEL,TRACK_ID,POSITION_X,POSITION_Y,FRAME,ID",
    "Label,Track ID,X,Y,Frame,Spot ID",
    "Label,Track ID,X,Y,Frame,Spot ID",
)


DIALECTS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "pandas with tabs": (
        table(",y,x,ep,frame,particle", "iyxefp", "\t", ","),
        "utf-8",
        {},
    ),
    "comments above": (table(above=("# made by hand", "# frame rate, x, 500")), "utf-8", {}),
    "a title above": (table(above=("Tracks of film 3", "")), "utf-8", {}),
    "UTF-16": (table(separator="\t"), "utf-16", {}),
    "UTF-16 without a mark": (table(separator="\t"), "utf-16-le", {}),
    "Latin-1": (table(above=("# gr\u00f6\u00dfe",)), "latin-1", {}),
    "units in names": (table("frame,particle,x_px,y_px"), "utf-8", {}),
    "TrackMate": (
        table(",,(pixel),(pixel),,", "ppxyfi", above=TRACKMATE),
        "utf-8",
        {},
    ),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_tables_of_all_dialects_are_one_flow(tmp_path: Path, name: str) -> None:
    text, encoding, settings = DIALECTS[name]
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode(encoding))
    settings = {"length_unit": "px", **settings}
    flow = read(
        path, scale="1 mm/px", frame_rate="10 Hz", flip_y="no", surface="none",
        **MATERIAL, **settings,
    )  # fmt: skip
    assert flow.particles is not None
    found = np.lexsort((flow.particles.x, flow.particles.t))
    expected = rows()[np.lexsort((rows()[:, 2], rows()[:, 0]))]
    np.testing.assert_allclose(flow.particles.u[found], 0.01 * expected[:, 4], rtol=1e-5)
    np.testing.assert_allclose(flow.particles.x[found], 1e-3 * expected[:, 2], rtol=1e-5)


def test_rows_of_one_particle_and_frame(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(table() + "3,7,1000,1000\n")
    with pytest.raises(DataFileError, match="got particle 7 more than once at frame 3, and 1 such"):
        read_vectors(path)


def tractrac_text(folder: Path) -> Path:
    above = ("# TracTrac v3.0", "#  Parameters: {'vid_loop': 2}")
    names = "#  Frame ID x y Vx Vy Vx(prediction) Vy(prediction)"
    (folder / "a.txt").write_text(table(names, "fpxyuvuv", " ", above=above))
    return folder / "a.txt"


def test_velocities_of_programs_are_taken_as_measured(tmp_path: Path) -> None:
    fields = read_vectors(tractrac_text(tmp_path))
    assert (fields.length_unit, fields.velocity_unit) == (None, None)
    found, expected = (np.lexsort(a) for a in ((fields.u, fields.t), (rows()[:, 4], rows()[:, 0])))
    np.testing.assert_allclose(fields.t[found], rows()[expected, 0])
    for values, k in ((fields.x, 2), (fields.y, 3), (fields.u, 4), (fields.v, 5)):
        np.testing.assert_allclose(values[found], rows()[expected, k], rtol=1e-7)


GRIDS = {
    "units in names": ("x [mm],y [mm],u [mm/s],v [mm/s]", ",", ".", {}),
    "decimal commas": ("X [mm],Y [mm],Vx [mm/s],Vy [mm/s]", ";", ",", {}),
    "names alone": (
        "x,y,u,v",
        "\t",
        ".",
        {"length_unit": "mm", "velocity_unit": "mm/s", "flip_y": "no"},
    ),
}


@pytest.mark.parametrize("name", GRIDS)
def test_tables_of_any_program_are_grids(tmp_path: Path, name: str) -> None:
    names, separator, sign, settings = GRIDS[name]
    y, x = np.meshgrid(np.arange(5) + 0.5, np.arange(4) + 0.5, indexing="ij")
    for k in range(3):
        parts = (x, y, 2 * y + k, np.where(x + y > 6.5, np.nan, -x))
        rows = np.stack([part.ravel() for part in parts], 1)
        lines = [separator.join(f"{v:g}" for v in row).replace(".", sign) for row in rows]
        lines = [names.replace(",", separator), *lines, ""]
        (tmp_path / f"f{k}.csv").write_text("\n".join(lines))
    flow = read(
        tmp_path / "f*.csv", frame_rate="10 Hz", surface="none", force=True, **settings, **MATERIAL
    )
    np.testing.assert_allclose(flow.y, (np.arange(5) + 0.5) * 1e-3)
    assert flow.u.shape == (3, 5, 4)
    assert flow.u[2, 1, 0] == pytest.approx(5e-3)
    assert np.isnan(flow.v[0, 4, 3])
    assert flow.v[0, 0, 1] == pytest.approx(-1.5e-3)


def test_a_table_in_pixels_does_not_say_where_y_points(tmp_path: Path) -> None:
    lines = [
        "x [px],y [px],vx [px/frame],vy [px/frame]",
        "1,1,0,0",
        "2,1,0,0",
        "1,2,1,0",
        "2,2,1,0",
    ]
    (tmp_path / "f.csv").write_text("\n".join([*lines, ""]))
    with pytest.raises(DataFileError, match="flip_y yes or no"):
        read(tmp_path / "f.csv", frame_rate="10 Hz", scale="1 mm/px", steady=True, **MATERIAL)
