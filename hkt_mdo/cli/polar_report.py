"""What `hkt polar` writes: polars of an outline as a CSV file, and a figure of them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.cli.parts import refuse_existing, write_files
from hkt_mdo.errors import InputError, show
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.polar_table import PolarTable
from hkt_mdo.files.table import parse_number
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.neuralfoil import ComputedPolar, compute_polars
from hkt_mdo.rotor.outline import Outline

__all__ = ["parse_alpha", "parse_reynolds", "report_polars"]

LOW_CONFIDENCE = 0.8
"""Below it the report names the angles of attack."""

MOST_ROWS, MOST_REYNOLDS = 2000, 100


def report_polars(
    source: str,
    reynolds: Sequence[float],
    alpha: np.ndarray,
    out: Path,
    n_crit: float = 9.0,
    model: str = "xlarge",
    beside: Sequence[str] = (),
    force: bool = False,
) -> list[str]:
    """Compute the polars of an outline, write a CSV file and a figure, and return a report's lines.

    The CSV file has the columns alpha_deg, cl, cd, cm, confidence, reynolds and is a polar as
    `rotor.polar` takes it. `source` is a shipped name or a file; `reynolds` and `alpha` (deg)
    increase; `n_crit` and `model` are those of `compute_polars`; `beside` names polars to draw
    beside. Raises `InputError` if an input is broken, NeuralFoil is not installed, or the files are
    there and `force` is not given.
    """
    outline, name = Outline.from_file(source), Path(source).stem
    others = [(Path(other).name, table) for other in beside for table in read_polars(other)]
    table_file, figure_file = (out / f"{name}_polars.{suffix}" for suffix in ("csv", "png"))
    refuse_existing((table_file, figure_file), force)
    polars = compute_polars(outline, reynolds, np.deg2rad(alpha), n_crit, model, name)
    for polar in polars:
        Polar.from_polar_table(polar.table)  # refuses what could not be used
    conditions = f"NeuralFoil {version('neuralfoil')}, model {model}, n_crit {n_crit:g}"
    text = _csv_text(polars, f"{conditions}, outline {show(Path(source).name)}")
    picture = _picture(f"{name}: {conditions}", polars, others)
    write_files({table_file: text.encode(), figure_file: picture})
    return [
        f"{name}: thickness {outline.thickness:.4f} c, area {outline.area:.4f} c²; second moments "
        f"about the chord line {outline.second_moments.xx:.3e} c⁴, across it "
        f"{outline.second_moments.yy:.3e} c⁴",
        conditions,
        *map(_confidence_line, polars),
        f"polars: {table_file}",
        f"figure: {figure_file}",
    ]


def parse_reynolds(text: str) -> list[float]:
    """Return the Reynolds numbers of a list such as ``2e5,5e5``, by size, else raise InputError."""
    numbers = [parse_number(cell.strip()) for cell in text.split(",")]
    found = sorted({number for number in numbers if number is not None})
    if len(found) < len(numbers) or len(found) > MOST_REYNOLDS:
        raise InputError(
            f"is no list of up to {MOST_REYNOLDS} different numbers",
            "give Reynolds numbers by the chord, such as 2e5,5e5",
            key="--reynolds",
            value=text,
        )
    return found


def parse_alpha(text: str) -> np.ndarray:
    """Return the angles of attack (deg) of a range as ``-16:24:0.5``, else raise InputError."""
    numbers = [parse_number(cell.strip()) for cell in text.split(":")]
    if len(numbers) == 3 and None not in numbers:
        first, last, step = (float(number or 0.0) for number in numbers)
        if -90.0 <= first < last <= 90.0 and step > 0.0 and (last - first) / step < MOST_ROWS:
            return np.round(first + step * np.arange(int((last - first) / step + 1e-9) + 1), 9)
    raise InputError(
        f"is no range of up to {MOST_ROWS} angles within -90 and 90 degrees",
        "give first, last and step in degrees, such as -16:24:0.5",
        key="--alpha",
        value=text,
    )


# Parts --------------------------------------------------------------------------------------------


def _csv_text(polars: Sequence[ComputedPolar], remark: str) -> str:
    lines = [f"# {remark}", "alpha_deg,cl,cd,cm,confidence,reynolds"]
    for polar in polars:
        table, moment = polar.table, np.asarray(polar.table.moment)
        columns = np.rad2deg(table.alpha), table.lift, table.drag, moment, polar.confidence
        for row in zip(*columns, strict=True):
            lines.append(",".join(f"{value:.6f}" for value in row) + f",{table.reynolds:.10g}")
    return "\n".join(lines) + "\n"


def _reynolds(table: PolarTable) -> str:
    """Return the Reynolds number the way it is written, Re 2e5; nothing where there is none."""
    if table.reynolds is None:
        return ""
    digits, _, power = f"{table.reynolds:.4e}".partition("e")
    return f"Re {digits.rstrip('0').rstrip('.')}e{int(power)}"


def _confidence_line(polar: ComputedPolar) -> str:
    """Return how far a polar is to be trusted, and the angles where little."""
    alpha, confidence = np.rad2deg(polar.table.alpha), polar.confidence
    low = np.concatenate(([False], confidence < LOW_CONFIDENCE, [False]))
    begins, ends = (np.flatnonzero(np.diff(low.astype(int)) == sign) for sign in (1, -1))
    spans = [
        f"{alpha[begin]:g}" if end - begin == 1 else f"{alpha[begin]:g} to {alpha[end - 1]:g}"
        for begin, end in zip(begins, ends, strict=True)
    ]
    where = f"below {LOW_CONFIDENCE:g} at {', '.join(spans)} degrees" if spans else "nowhere low"
    return (
        f"{_reynolds(polar.table)}: confidence {confidence.min():.2f} at least, "
        f"{confidence.mean():.2f} on average, {where}"
    )


def _picture(
    title: str, polars: Sequence[ComputedPolar], others: Sequence[tuple[str, PolarTable]]
) -> bytes:
    """Return a PNG of lift and drag over the angle of attack, and of lift over drag."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3)

    def draw(table: PolarTable, shown: Any = True, **style: Any) -> None:
        alpha = np.rad2deg(table.alpha)
        curves = (alpha, table.lift), (alpha, table.drag), (table.drag, table.lift)
        for panel, (x, y) in zip(panels, curves, strict=True):
            panel.plot(x, np.where(shown, y, np.nan), **style)

    for index, polar in enumerate(polars):
        color, sure = f"C{index}", polar.confidence >= LOW_CONFIDENCE
        draw(polar.table, color=color, linewidth=1.0, label=_reynolds(polar.table))
        draw(polar.table, sure, color=color, linewidth=2.4)
    angles, lifts = panels[0].get_xlim(), panels[0].get_ylim()  # of the outline's own polars
    for index, (name, table) in enumerate(others, start=len(polars)):
        label = f"{name} {_reynolds(table)}".rstrip().replace("$", r"\$")
        draw(table, color=f"C{index}", linewidth=1.0, linestyle="--", label=label)
    panels[0].set(
        xlabel="angle of attack (deg)", ylabel="lift coefficient", xlim=angles, ylim=lifts
    )
    panels[1].set(xlabel="angle of attack (deg)", ylabel="drag coefficient", xlim=angles)
    panels[2].set(xlabel="drag coefficient", ylabel="lift coefficient", ylim=lifts)
    panels[1].set_yscale("log")
    panels[2].set_xscale("log")
    for panel in panels:
        panel.grid(color="0.9")
    thick = f"thick where the confidence is {LOW_CONFIDENCE:g} or more"
    figure.suptitle(f"{title}\n{thick}".replace("$", r"\$"), fontsize=10)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=150)
    return file.getvalue()
