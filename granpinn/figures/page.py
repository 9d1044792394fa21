"""From a result to report.html, one page that needs no other file and no network.

The page lists what is missing of fields and history.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import jinja2
import numpy as np
from markupsafe import Markup

from granpinn.config.fields import as_text, flatten
from granpinn.figures import album
from granpinn.output import write_text
from granpinn.output.table import Table
from granpinn.output.templates import environment
from granpinn.progress import duration
from granpinn.results import Result, number
from granpinn.results.assessment import reach_of
from granpinn.results.result import in_words, percent, true_friction

if TYPE_CHECKING:
    from granpinn.identification.identified import Identification

TEMPLATES = Path(__file__).parent / "templates"
ANSWER = ("friction_law", "pressure")  # the figures directly under the numbers
SYMBOLS = {"mu(I)": "μ(I)", "mu_s": "μₛ", "mu_2": "μ₂", "I0": "I₀", "+-": "±"}
LETTERS = {r"\mu": "μ", r"\alpha": "α", r"\infty": "∞"}  # of the symbols of laws
# Settings that name folders of one machine; the page omits them.
OWN_PLACE = ("flow", "further_flows", "out")


def build(run: Identification, folder: Path, time: float | None = None) -> Path:
    """Draw the figures of a run into its folder and write its page; the path of report.html.

    Args:
        time: of the maps, in the unit of the flow file; by default 0.7 of the last.
    """
    pictures, missing = album.draw_all(run, folder / "figures", time)
    page = folder / "report.html"
    write_text(page, render(run, pictures, missing))
    return page


def render(
    result: Result, pictures: Sequence[album.Picture] = (), missing: dict[str, str] | None = None
) -> str:
    """The page, with every figure inside."""
    settings = {k: as_text(v) for k, v in flatten(result.settings).items() if k not in OWN_PLACE}
    law, curve = result.friction_law, result.law.curve
    true = None if curve is None else true_friction(result, np.array(curve.I))
    flows = Table(
        ("Flow", "inertial numbers", "vectors", "use"),
        [
            (flow.input.name, flow.shear, f"{flow.data.n_points:,}", flow.assessment.headline)
            for flow in result.flows
        ],
    )
    return template("report.html").render(
        r=result,
        flows=flows,
        law=law,
        missing={in_words(name): why for name, why in result.not_done.items()} | (missing or {}),
        has_truth=any(result.error_percent.get(name) is not None for name in law.names),
        reach=reach_of(result),
        off=None if curve is None or true is None else float(np.abs(true - curve.mu).max()),
        a=result.assessment,
        answer=[picture for picture in pictures if picture.name in ANSWER],
        pictures=[picture for picture in pictures if picture.name not in ANSWER],
        settings=settings,
    )


def template(name: str) -> jinja2.Template:
    """A template of this folder with filters for numbers, symbols, sentences and pictures."""
    templates = environment(TEMPLATES, autoescape=True)
    templates.filters |= {"number": number, "percent": percent, "duration": duration}
    templates.filters |= {"symbol": symbol, "reason": in_symbols, "base64": encoded}
    return templates.get_template(name)


def symbol(latex: str) -> Markup:
    r"""A symbol of a law, such as \mu_s, in HTML."""
    base, *index = re.split(r"(?<!\\)_", re.sub(r"\\mathrm\{(.*)\}", r"\1", latex), maxsplit=1)
    for command, letter in LETTERS.items():
        base, index = (base.replace(command, letter), [i.replace(command, letter) for i in index])
    parts = (part.replace("\\", "") for part in (base, *index))
    return Markup("<i>{}</i><sub>{}</sub>" if index else "<i>{}</i>").format(*parts)


def in_symbols(text: str) -> str:
    """A sentence of the terminal with the symbols of the page."""
    for name, own in SYMBOLS.items():
        text = text.replace(name, own)
    return text


def encoded(content: bytes) -> str:
    """Bytes in base64."""
    return base64.b64encode(content).decode("ascii")
