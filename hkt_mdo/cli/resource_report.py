"""Files of `hkt resource`: hours of each speed, constituents of the tide, and figures."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from hkt_mdo.dynamics.harmonics import Tide, constituents
from hkt_mdo.dynamics.long_record import FlowSamples, RecordResource, span_words
from hkt_mdo.dynamics.resource import YEAR, Resource, in_bins
from hkt_mdo.files.table import csv_text, write_new
from hkt_mdo.files.yaml_text import dump
from hkt_mdo.messages import validated
from hkt_mdo.results import style
from hkt_mdo.results.panel import COLORS, GREY, Curve, Panel

HOURS = YEAR / 3600.0
DAYS_201 = 35.0  # of a record for a harmonic analysis
DAYS_SHOWN = 15.0  # of the record, beside its prediction
MOST_SHOWN = 20_000  # samples in a figure


def report_resource(
    file: Path, out: Path, keys: Sequence[str], asked: str, force: bool
) -> Iterable[str]:
    """Read a record, write the files that a case takes, and return the lines of a report.

    Parameters
    ----------
    file : Path
        The record.
    out : Path
        Folder to write to.
    keys : sequence of str
        Keys of `RecordResource`, as ``key=value``.
    asked : str
        Names of tidal constituents with commas between them, ``auto``, or empty for none.
    force : bool
        Whether to replace what is there.

    Returns
    -------
    iterable of str
        The lines.

    Raises
    ------
    InputError
        If a key or the record is not as it should be, or a file is there already.
    """
    record = validated(RecordResource, {"file": str(file)}, "hkt resource", keys)
    samples, length = record.samples, record.samples.time[-1]
    speed, share = in_bins(samples.speed, samples.share, record.bin_width)
    rows = zip(speed, HOURS * share, strict=True)
    table = csv_text(["speed_m_s", "hours"], ([f"{x:.10g}" for x in row] for row in rows))
    fields = record.model_dump(mode="json", exclude_defaults=True, include={*Resource.model_fields})
    section = dump({"resource": {"profile": "histogram", "file": "resource.csv"} | fields})
    if length < 0.98 * YEAR:
        note = f"# The record has {span_words(length)}, which may be unlike the rest of a year.\n"
        section = note + section
    files: dict[str, str | bytes] = {"resource.csv": table, "case.yaml": section}
    lines = [*samples.messages, *_statistics(record, bool(asked))]
    panels = {"resource": resource_panels(speed, share, samples)}
    if asked:
        names = [] if asked.strip() == "auto" else [name.strip() for name in asked.split(",")]
        tide = constituents(samples, names)
        files["tide.yaml"] = dump({"resource": tide.section | fields})
        lines += _of_tide(tide)
        panels["tide"] = [tide_panel(samples, tide)]
    for name, chart in panels.items():
        figure = style.figure_of_panels(chart, 7.0, 3.0, f"{file.name}: {name}")
        files[f"{name}.png"] = style.picture(figure)
    write_new({out / name: content for name, content in files.items()}, force)
    return [*lines, f"Written: {out}: {', '.join(files)}"]


def _statistics(record: RecordResource, tidal: bool) -> Iterator[str]:
    """Yield what characterizes the flow, and the uncertainty by the length of the record."""
    samples, cube = record.samples, record.mean_cube
    share, size, back = samples.share, np.abs(samples.speed), samples.speed < 0.0
    yield (
        f"mean speed {float(share @ size):.4g} m/s, mean cubed speed {cube:.4g} m³/s³ (cube root "
        f"{np.cbrt(cube):.4g} m/s), at most {np.max(size):.4g} m/s"
    )
    if np.any(back):
        time, cubes = float(np.sum(share[back])), float(share[back] @ size[back] ** 3) / cube
        yield (
            f"the flow runs the other way in {100.0 * time:.3g} % of the time, with "
            f"{100.0 * cubes:.3g} % of the mean cubed speed"
        )
    scatter, length = samples.scatter(size**3), samples.time[-1]
    text, block = "unknown, less than 3", f"blocks of {samples.block / 86400.0:.5g} days"
    if scatter is not None:
        text = f"{100.0 * scatter:.2g} %, by the scatter of"
    what = "standard uncertainty of the mean cubed speed by the length of the record"
    yield f"{what}: {text} {block}"
    if tidal and length < DAYS_201 * 86400.0:
        least = f"IEC TS 62600-201 asks for {DAYS_201:g} days at least"
        yield f"constituents of the tide from {span_words(length)}: for these {least}"


def _of_tide(tide: Tide) -> Iterator[str]:
    """Yield the constituents and the share of the variance that they explain."""
    share = 100.0 * tide.explained
    yield f"the tide explains {share:.4g} % of the variance, mean {tide.flow.mean:.4g} m/s"
    for name, wave in zip(tide.names, tide.flow.constituents, strict=True):
        hours, phase = 2.0 * np.pi / wave.angular_frequency / 3600.0, np.rad2deg(wave.phase)
        yield f"{name}: {wave.amplitude:.4f} m/s, {phase:.1f} deg, period {hours:.4f} h"


def resource_panels(speed: np.ndarray, share: np.ndarray, samples: FlowSamples) -> list[Panel]:
    """Return the hours of each speed in a year, and the share of time in which it is exceeded."""
    hours = Panel("hours a year (h)", "speed of the flow (m/s)", from_zero=True)
    ways = {"forward": speed >= 0.0, "the other way": speed < 0.0}
    for index, (word, mask) in enumerate(ways.items()):
        if np.any(mask):
            order = np.argsort(np.abs(speed[mask]))
            x, y = np.abs(speed[mask])[order], HOURS * share[mask][order]
            hours.curves.append(Curve(x, y, word, COLORS[index], index, "bar"))
    fastest = np.argsort(-np.abs(samples.speed))
    every = max(1, fastest.size // MOST_SHOWN)
    rank, size = 100.0 * np.cumsum(samples.share[fastest]), np.abs(samples.speed[fastest])
    curve = Curve(rank[::every], size[::every], "", COLORS[0])
    return [hours, Panel("speed of the flow (m/s)", "exceeded in a share of the time (%)", [curve])]


def tide_panel(samples: FlowSamples, tide: Tide) -> Panel:
    """Return the last days of a record and what the tide predicts of them."""
    last = samples.time >= samples.time[-1] - DAYS_SHOWN * 86400.0
    time = samples.time[last]
    fine = np.linspace(time[0], time[-1], 3000)
    curves = [
        Curve(time / 86400.0, samples.speed[last], "record", GREY, 0, "points"),
        Curve(fine / 86400.0, tide.flow.speed_at(fine), "tide", COLORS[0]),
    ]
    return Panel("speed (m/s)", "time since the first sample (days)", curves)
