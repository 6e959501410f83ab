"""What `hkt polar` writes: polars of an outline as a CSV file, and a figure of them."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError, show
from hkt_mdo.files.polar import PolarTable, read_polars
from hkt_mdo.files.shipped import parse_number
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.neuralfoil import ComputedPolar, compute_polars
from hkt_mdo.rotor.outline import Outline

__all__ = ["parse_alpha", "parse_reynolds", "report_polars"]

LOW_CONFIDENCE = 0.8
"""Below it the report names the angles of attack."""

MOST_ROWS, MOST_REYNOLDS = 2000, 100

_COLORS = ("#0b3c6f", "#c4501b", "#4fb286", "#8a4fa3", "#b8860b", "#4a4a4a")
_DASHES = ((0, (5, 2)), (0, (1, 1)), (0, (5, 1, 1, 1)), (0, (8, 2)))


def report_polars(
    source: str | Path,
    reynolds: Sequence[float],
    alpha: np.ndarray,
    out: Path,
    *,
    n_crit: float = 9.0,
    model: str = "xlarge",
    beside: Sequence[str] = (),
    force: bool = False,
) -> list[str]:
    """Compute the polars of an outline and write them: a CSV file and a figure.

    The CSV file has the columns alpha_deg, cl, cd, cm, confidence, reynolds and is a polar as
    `rotor.polar` takes it. Both files appear whole or not at all.

    Parameters
    ----------
    source : str or pathlib.Path
        The outline: a shipped name or the path of a file.
    reynolds : sequence of float
        Reynolds numbers by the chord, increasing.
    alpha : array, shape (n_rows,), deg
        Angles of attack, increasing.
    out : pathlib.Path
        Folder of the files, made if need be.
    n_crit : float
        See `hkt_mdo.rotor.neuralfoil.compute_polars`.
    model : str
        Size of the network.
    beside : sequence of str
        Polars to draw beside: shipped names or paths of files.
    force : bool
        Whether to replace files that are there.

    Returns
    -------
    list of str
        Lines of the report.

    Raises
    ------
    InputError
        If an input is broken, NeuralFoil is not installed, or the files are there.
    OSError
        If the folder or the files cannot be written.
    """
    outline, name = Outline.from_file(source), Path(source).stem
    others = [(other, read_polars(other)) for other in beside]
    table_file, figure_file = (out / f"{name}_polars.{suffix}" for suffix in ("csv", "png"))
    for path in (table_file, figure_file):
        if os.path.lexists(path) and not (force and path.is_file()):
            raise InputError(
                "is there already", "give --force to replace it, or another --out", file=path
            )
    polars = compute_polars(outline, reynolds, np.deg2rad(alpha), n_crit, model, name)
    for polar in polars:
        Polar.from_polar_table(polar.table)  # refuses what could not be used

    conditions = f"NeuralFoil {version('neuralfoil')}, model {model}, n_crit {n_crit:g}"
    text = _csv_text(polars, f"{conditions}, outline {show(Path(source).name)}")
    picture = _picture(name, polars, others, conditions)
    out.mkdir(parents=True, exist_ok=True)
    parts = [path.with_name(path.name + ".part") for path in (table_file, figure_file)]
    try:
        for part, content in zip(parts, (text.encode(), picture), strict=True):
            part.write_bytes(content)
        for part, path in zip(parts, (table_file, figure_file), strict=True):
            part.replace(path)
    finally:
        for part in parts:
            part.unlink(missing_ok=True)
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
    """Return the Reynolds numbers of a list such as ``2e5,5e5``, by size.

    Raises
    ------
    InputError
        If it is no list of up to 100 different positive numbers.
    """
    numbers = [parse_number(cell.strip()) for cell in text.split(",")]
    found = sorted(number for number in numbers if number is not None)
    if len(found) < len(numbers) or len(set(found)) < len(found) or len(found) > MOST_REYNOLDS:
        raise InputError(
            f"is no list of up to {MOST_REYNOLDS} different numbers",
            "give Reynolds numbers by the chord, such as 2e5,5e5",
            key="--reynolds",
            value=text,
        )
    return found


def parse_alpha(text: str) -> np.ndarray:
    """Return the angles of attack (deg) of a range such as ``-16:24:0.5``.

    Raises
    ------
    InputError
        If it is no range of 8 to 2000 angles within -90 and 90 degrees.
    """
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
        table = polar.table
        columns = np.column_stack(
            (
                np.rad2deg(table.alpha),
                table.lift,
                table.drag,
                np.asarray(table.moment),
                polar.confidence,
            )
        )
        lines += [
            ",".join(f"{value:.6f}" for value in row) + f",{table.reynolds:.10g}" for row in columns
        ]
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
    name: str,
    polars: Sequence[ComputedPolar],
    others: Sequence[tuple[str, Sequence[PolarTable]]],
    conditions: str,
) -> bytes:
    """Return a PNG of lift and drag over the angle of attack, and of lift over drag."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3)

    def draw(table: PolarTable, label: str, sure: np.ndarray | None = None, **style) -> None:
        alpha = np.rad2deg(table.alpha)
        curves = (alpha, table.lift), (alpha, table.drag), (table.drag, table.lift)
        for panel, (x, y) in zip(panels, curves, strict=True):
            panel.plot(x, y, label=label.replace("$", r"\$"), linewidth=1.0, **style)
            if sure is not None:
                panel.plot(x, np.where(sure, y, np.nan), linewidth=2.4, **style)

    for index, polar in enumerate(polars):
        label = _reynolds(polar.table)
        draw(
            polar.table,
            label,
            polar.confidence >= LOW_CONFIDENCE,
            color=_COLORS[index % len(_COLORS)],
        )
    angle, lift = panels[0].get_xlim(), panels[0].get_ylim()  # of the outline's own polars
    color = len(polars)
    for index, (source, tables) in enumerate(others):
        for table in tables:
            label = f"{Path(source).name} {_reynolds(table)}".rstrip()
            dashes = _DASHES[index % len(_DASHES)]
            draw(table, label, color=_COLORS[color % len(_COLORS)], linestyle=dashes)
            color += 1
    names = "angle of attack (deg)", "lift coefficient", "drag coefficient"
    for panel, (x, y) in zip(panels, ((0, 1), (0, 2), (2, 1)), strict=True):
        panel.set(xlabel=names[x], ylabel=names[y])
        panel.grid(color="0.9")
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set(xlim=angle, ylim=lift)
    panels[1].set(xlim=angle, yscale="log")
    panels[2].set(ylim=lift, xscale="log")
    figure.suptitle(
        f"{name}: {conditions}\nthick where the confidence is {LOW_CONFIDENCE:g} or more".replace(
            "$", r"\$"
        ),
        fontsize=10,
    )
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(4, len(labels)),
        frameon=False,
        fontsize=9,
    )
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=150)
    return file.getvalue()
