"""The arithmetic of the GPU benchmark's table, without the measurements: ratios, rates, goals."""

from __future__ import annotations

from typing import Any

from bench.rivals import EAGER, OURS

Row = dict[str, Any]
# ms of a step in the strong form on an H200; the mixed form has 0.6 of it
GOALS = {
    OURS["fp32"]: {512: 0.08, 32768: 4.3, 262144: 34.0},
    OURS["fast"]: {512: 0.05, 32768: 1.8, 262144: 13.0},
}
MIXED = 0.6


def complete(rows: list[Row], ceilings: dict[str, float], l2_mb: float | None = None) -> None:
    """Adds to every measured row its rates and its ratios to eager autograd and the best rival.

    `stays_in_l2` says whether the second-level cache holds all that a step touches: its weights,
    Adam's state and the batch, which stay from step to step, and its tensors at their peak.
    """
    for row in rows:
        if "ms" not in row:
            continue
        row["tflops"] = row["flop"] / row["ms"] / 1e9
        row["of_sgemm"] = row["tflops"] / ceilings["sgemm_tflops"]
        row["of_tf32"] = row["tflops"] / ceilings["tf32_tflops"]
        row["of_copy"] = row["traffic"] / row["ms"] / 1e9 / ceilings["copy_tb_per_s"]
        if l2_mb and "peak_gb" in row:
            row["stays_in_l2"] = row["resident_mb"] + 1e3 * row["peak_gb"] <= l2_mb
        others = [
            other
            for other in rows
            if (other["form"], other["points"]) == (row["form"], row["points"])
            and "ms" in other
            and other["name"] not in OURS.values()
        ]
        eager = next((other for other in others if other["name"] == EAGER), None)
        if eager:
            row["times_faster_than_eager"] = eager["ms"] / row["ms"]
        if others and row["name"] in OURS.values():
            best = min(others, key=lambda other: float(other["ms"]))
            row["best_rival"] = best["name"]
            row["times_faster_than_best_rival"] = best["ms"] / row["ms"]
        goal = goal_ms(row)
        if goal is not None:
            row["goal_ms"] = goal
            row["goal_reached"] = row["ms"] <= goal


def goal_ms(row: Row) -> float | None:
    goal = GOALS.get(row["name"], {}).get(row["points"])
    if goal is None:
        return None
    return goal if row["form"] == "strong" else MIXED * goal


def text(rows: list[Row]) -> str:
    """One table for each form (ms of a step), and a line for every row of granpinn."""
    parts = []
    for form in dict.fromkeys(row["form"] for row in rows):
        mine = [row for row in rows if row["form"] == form]
        sizes = sorted({row["points"] for row in mine})
        head = f"{form} form, ms per step"
        lines = [f"{head:<40}" + "".join(f"{f'B = {size:,}':>14}" for size in sizes)]
        lines[0] += f"{'launches':>10}{'peak GB':>9}"
        for name in dict.fromkeys(row["name"] for row in mine):
            lines.append(_line(name, [row for row in mine if row["name"] == name], sizes))
        parts.append("\n".join(lines))
    parts.append(
        "Adam: granpinn's own in its rows, in the others torch's (on a GPU fused) or JAX's."
    )
    ours = [row for row in rows if row["name"] in OURS.values() and "ms" in row]
    parts.append("\n".join(_comparison(row) for row in ours))
    failed = [row for row in rows if "error" in row]
    parts.append("\n".join(f"{_where(row)}: {row['error']}" for row in failed))
    return "\n\n".join(part for part in parts if part)


def _line(name: str, rows: list[Row], sizes: list[int]) -> str:
    cells = []
    for size in sizes:
        row = next((row for row in rows if row["points"] == size), {})
        cells.append(f"{significant(row['ms']) if 'ms' in row else '-':>14}")
    few = [row["launches"] for row in rows if row.get("launches") is not None]
    peaks = [row["peak_gb"] for row in rows if row.get("peak_gb") is not None]
    launches = f"{few[0]:.0f}" if few else "-"
    peak = f"{max(peaks):.2f}" if peaks else "-"
    return f"{name:<40}" + "".join(cells) + f"{launches:>10}{peak:>9}"


def _comparison(row: Row) -> str:
    line = f"{_where(row)}: {significant(row['ms'])} ms, {row['tflops']:.1f} TFLOP/s"
    line += f" ({row['of_sgemm']:.0%} of sgemm, {row['of_tf32']:.0%} of TF32)"
    if "best_rival" in row:
        line += f", {row['times_faster_than_best_rival']:.2f}x {row['best_rival']}"
    if "goal_ms" in row:
        verdict = "reached" if row["goal_reached"] else "MISSED"
        line += f"; goal {significant(row['goal_ms'])} ms {verdict}"
    return line


def _where(row: Row) -> str:
    return f"{row['name']}, {row['form']}, B = {row['points']:,}"


def significant(x: float) -> str:
    """Three significant figures, without an exponent."""
    return f"{x:.3g}" if x < 100 else f"{x:.0f}"
