"""Files of `hkt polar`: polars of an outline as a CSV file, and a figure of them."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError, show
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.polar_table import SURFACES, PolarTable
from hkt_mdo.files.table import csv_text, parse_number, refuse_existing, write_new
from hkt_mdo.results import style
from hkt_mdo.results.charts import polar_panels
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.neuralfoil import ComputedPolar, compute_polars
from hkt_mdo.rotor.outline import Outline

LOW_CONFIDENCE = 0.8
"""NeuralFoil's confidence, 0 to 1, below which the report names the angles of attack."""

MOST_ROWS, MOST_REYNOLDS = 2000, 100
"""Most angles of attack and Reynolds numbers that are computed; more are most likely a slip."""


def report_polars(
    source: str,
    reynolds: list[float],
    alpha: np.ndarray,
    out: Path,
    n_crit: float,
    model: str,
    beside: Sequence[str],
    force: bool,
) -> list[str]:
    """Compute polars of an outline; write a CSV file, as `rotor.polar` takes it, and a figure.

    Parameters
    ----------
    source : str
        Name of a shipped outline, or a path.
    reynolds : list of float
        Reynolds numbers by the chord.
    alpha : numpy.ndarray, shape (n_alpha,)
        Angles of attack, deg, increasing.
    out : pathlib.Path
        Folder of the files; made if need be.
    n_crit : float
        Critical exponent of the transition criterion, as of `compute_polars`.
    model : str
        Size of NeuralFoil's network, as of `compute_polars`.
    beside : sequence of str
        Polars to draw beside: shipped names or paths.
    force : bool
        Whether files that are there may be replaced.

    Returns
    -------
    list of str
        The lines of a report.

    Raises
    ------
    InputError
        If an input is broken, NeuralFoil is not installed, or a file is there without `force`.
    """
    outline, name = Outline.from_file(source), Path(source).stem
    others = [(Path(other).name, table) for other in beside for table in read_polars(other)]
    table_file, figure_file = (out / f"{name}_polars.{suffix}" for suffix in ("csv", "png"))
    refuse_existing((table_file, figure_file), force)
    polars = compute_polars(outline, reynolds, np.deg2rad(alpha), n_crit, model, name)
    for polar in polars:
        Polar.from_polar_table(polar.table)  # refuses what could not be used
    conditions = f"NeuralFoil {version('neuralfoil')}, model {model}, n_crit {n_crit:g}"
    table = _csv(polars, f"{conditions}, outline {show(Path(source).name)}")
    picture = style.picture(draw_report(f"{name}: {conditions}", polars, others))
    write_new({table_file: table, figure_file: picture}, force)
    return [
        f"{name}: thickness {outline.thickness:.4f} c, area {outline.area:.4f} c²; second moments "
        f"about the chord line {outline.second_moments[0]:.3e} c⁴, across it "
        f"{outline.second_moments[1]:.3e} c⁴",
        conditions,
        *map(_confidence_line, polars),
        f"polars: {table_file}",
        f"figure: {figure_file}",
    ]


def parse_reynolds(text: str) -> list[float]:
    """Return the Reynolds numbers of a list.

    Parameters
    ----------
    text : str
        Different numbers and commas, such as ``2e5,5e5``.

    Returns
    -------
    list of float
        The numbers by size.

    Raises
    ------
    InputError
        If `text` is no such list or has more than `MOST_REYNOLDS` numbers.
    """
    cells = [parse_number(cell.strip()) for cell in text.split(",")]
    numbers = sorted({number for number in cells if number is not None})
    if not len(cells) == len(numbers) <= MOST_REYNOLDS:
        problem = f"is no list of up to {MOST_REYNOLDS} different numbers"
        remedy = "give Reynolds numbers by the chord, such as 2e5,5e5"
        raise InputError(problem, remedy, key="--reynolds", value=text)
    return numbers


def parse_alpha(text: str) -> np.ndarray:
    """Return the angles of attack of a range.

    Parameters
    ----------
    text : str
        First, last and step in degrees, such as ``-16:24:0.5``.

    Returns
    -------
    numpy.ndarray, shape (n_alpha,)
        Angles of attack, deg, increasing.

    Raises
    ------
    InputError
        If `text` is no such range, leaves -90 to 90 degrees or has more than `MOST_ROWS` angles.
    """
    numbers = [parse_number(cell.strip()) for cell in text.split(":")]
    if len(numbers) == 3 and None not in numbers:
        first, last, step = (float(number or 0.0) for number in numbers)
        if -90.0 <= first < last <= 90.0 and step > 0.0 and (last - first) / step < MOST_ROWS:
            return np.round(first + step * np.arange(int((last - first) / step + 1e-9) + 1), 9)
    problem = f"is no range of up to {MOST_ROWS} angles within -90 and 90 degrees"
    remedy = "give first, last and step in degrees, such as -16:24:0.5"
    raise InputError(problem, remedy, key="--alpha", value=text)


def _csv(polars: Sequence[ComputedPolar], remark: str) -> str:
    """Return the polars, one below the other, as CSV with a remark and a header."""
    rows: list[list[str]] = []
    for table, confidence in polars:
        coefficients = table.lift, table.drag, table.moment, *np.asarray(table.smallest_pressure)
        values = np.column_stack((np.rad2deg(table.alpha), *coefficients, confidence))
        rows += [[*(f"{x:.6f}" for x in row), f"{table.reynolds:.10g}"] for row in values]
    names = "alpha_deg", "cl", "cd", "cm", *SURFACES, "confidence", "reynolds"
    return csv_text(names, rows, [remark])


def _reynolds(table: PolarTable) -> str:
    """Return the Reynolds number the way it is written, Re 2e5; nothing where there is none."""
    return f"Re {table.reynolds:.5g}".replace("e+0", "e") if table.reynolds is not None else ""


def _confidence_line(polar: ComputedPolar) -> str:
    """Return how far a polar is to be trusted, and the angles where little."""
    alpha, confidence = np.rad2deg(polar.table.alpha), polar.confidence
    low = np.ma.clump_masked(np.ma.masked_less(confidence, LOW_CONFIDENCE))
    spans = [" to ".join(dict.fromkeys(f"{end:g}" for end in alpha[part][[0, -1]])) for part in low]
    where = f"below {LOW_CONFIDENCE:g} at {', '.join(spans)} degrees" if spans else "nowhere low"
    return (
        f"{_reynolds(polar.table)}: confidence {confidence.min():.2f} at least, "
        f"{confidence.mean():.2f} on average, {where}"
    )


def draw_report(
    title: str, polars: Sequence[ComputedPolar], others: Sequence[tuple[str, PolarTable]]
) -> Figure:
    """Return a figure of lift, drag, their ratio and suction over the angle of attack.

    Parameters
    ----------
    title : str
        What stands above.
    polars : sequence of ComputedPolar
        Polars with the confidence in each row.
    others : sequence of (str, PolarTable)
        Polars to draw beside, with their names.

    Returns
    -------
    matplotlib.figure.Figure
        Without a panel of the suction where no polar has one.
    """
    tables = [("", polar.table, polar.confidence >= LOW_CONFIDENCE) for polar in polars]
    tables += [(f"{name} ", table, np.full(table.alpha.size, True)) for name, table in others]
    first, last = polars[0].table.alpha[[0, -1]]
    curves = []
    for prefix, table, sure in tables:
        inside = (table.alpha >= first) & (table.alpha <= last)
        label = f"{prefix}{_reynolds(table)}".rstrip()
        polar = Polar.from_polar_table(table)
        curves.append((label, polar, table.alpha[inside], sure[inside]))
    title += f"\ndotted where the confidence is below {LOW_CONFIDENCE:g}"
    panels = polar_panels(curves)
    panels[1].log = True
    return style.figure_of_panels(panels, 6.4, 2.3, title)
