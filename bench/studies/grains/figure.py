"""mu against I of every scene: shear cell, the scene's own stress, momentum balance, identified."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bench.studies.grains.law import friction, mu_of_i
from bench.studies.grains.make import SUMMARY

COLUMNS = 4
MARKERS = {"along_D": "o", "norm": "^"}


def draw(scenes: Sequence[Path], scores: Sequence[dict[str, Any]], path: Path) -> None:
    """One panel for each scene; an identified law for each of its scores."""
    columns = min(COLUMNS, len(scenes))
    rows = -(-len(scenes) // columns)
    figure = Figure(figsize=(3.4 * columns, 2.8 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, scene in zip(axes, scenes, strict=False):
        summary = json.loads((scene / SUMMARY).read_text())
        key = (summary["scene"], summary["material"])
        panel(axis, summary, [s for s in scores if (s["scene"], s["material"]) == key])
    for axis in axes[len(scenes) :]:
        axis.set_visible(False)
    axes[0].legend(fontsize=5, loc="upper left")
    figure.savefig(path, dpi=150)


def panel(axis: Axes, summary: dict[str, Any], scores: Sequence[dict[str, Any]]) -> None:
    """mu(I) of one scene."""
    low, high = summary["own"]["along_D"]["I_range"]
    i = np.geomspace(low, max(high, 1.01 * low), 100)
    if summary["truth"] is not None:
        axis.plot(i, mu_of_i(summary["truth"], i), "k-", label="shear cell")
    for name, marker in MARKERS.items():
        points = summary["own"][name]["points"]
        label = "own stress, along D" if name == "along_D" else "own stress, |tau|"
        axis.plot([p["I"] for p in points], [p["mu"] for p in points], marker, ms=3, label=label)
    balance = (summary["balance"] or {}).get("points", [])
    axis.plot([p["I"] for p in balance], [p["mu"] for p in balance], "x", ms=3, label="balance")
    for found in scores:
        mu = friction(found["name"], found["law"])(i)
        axis.plot(i, mu, "r-", lw=1, label=f"granpinn, seed {found['seed']}")
    axis.set_xscale("log")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_title(f"{summary['title']}; friction {summary['material']:g}", fontsize=7)
    axis.set_xlabel("I")
    axis.set_ylabel("mu")
