"""Broken records of a flow: one flaw each, made from a sound file.

All are broken for `inflow: {profile: record, file: ...}` with every other key at its default.
"""

import io
import math
import random
from pathlib import Path
from tempfile import TemporaryDirectory

Broken = dict[str, tuple[str, bytes, str]]
"""By flaw: the file's name, its content, and what the message says."""

_RANDOM = random.Random(1)
TIMES = [0.5 * i for i in range(120)]
SPEEDS = [1.5 + 0.2 * math.sin(0.25 * time) + 0.03 * _RANDOM.gauss(0.0, 1.0) for time in TIMES]
ROWS = [f"{time:.1f},{speed:.4f}" for time, speed in zip(TIMES, SPEEDS, strict=True)]
HEADER = "time_s,speed_m_s"


def _csv(rows=ROWS, header=HEADER) -> bytes:
    return "\n".join([header, *rows, ""]).encode()


def _changed(changes: dict[int, str], header=HEADER) -> bytes:
    """Return the sound file with other lines; line 1 is the header, "" leaves a line out."""
    rows = [changes.get(line, row) for line, row in enumerate(ROWS, 2)]
    return _csv([row for row in rows if row], header)


def _dates(zone=lambda i: "") -> list[str]:
    return [
        f"2024-05-01T12:{i // 120:02d}:{0.5 * (i % 120):04.1f}{zone(i)},{speed:.4f}"
        for i, speed in enumerate(SPEEDS)
    ]


_CSV: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty; its first line is a header"),
    "header only": (_csv([]), "has no samples"),
    "no header": (_csv(ROWS[1:], ROWS[0]), "line 1 = '0.0,1.5"),
    "one column": (_csv(["1.5"] * 60, "speed_m_s"), "has no columns besides the time"),
    "three columns": (
        _csv([f"{row},3" for row in ROWS], f"{HEADER},temperature"),
        "give speed_column: of speed_m_s, temperature",
    ),
    "no unit of time": (_csv(header="time,speed_m_s"), "column time: has no unit that is known"),
    "a discharge": (
        _csv(header='time_s,"Discharge, cubic feet per second"'),
        "is a discharge in ft3/s, not a speed; give area",
    ),
    "centimetres that say metres": (
        _csv([f"{t},{100 * v:.2f}" for t, v in zip(TIMES, SPEEDS, strict=True)]),
        "is faster than any river",
    ),
    "a word": (_changed({40: "19.0,calm"}), "line 40, column speed_m_s = 'calm': must be a finite"),
    "NaN": (_changed({40: "19.0,NaN"}), "line 40, column speed_m_s: is missing; give"),
    "empty cells": (
        _changed({40: "19.0,", 41: "19.5,", 90: "44.0,"}),
        "line 40, column speed_m_s: is missing, as are 2 more",
    ),
    "a gap at the end": (
        _changed({121: "59.5,"}),
        "line 121, column speed_m_s: is missing",
    ),
    "the same time twice": (
        _changed({40: "18.5,1.5"}),
        "line 40, column time_s = '18.5 s since the first': is also the time of line 39",
    ),
    "time goes back": (
        _changed({40: "3.0,1.5"}),
        "line 40, column time_s = '3 s since the first': is before line 39",
    ),
    "uneven": (
        _csv([f"{t + 0.1 * math.sin(t):.3f},{v:.4f}" for t, v in zip(TIMES, SPEEDS, strict=True)]),
        "off an even spacing of 0.5",
    ),
    "absurd times": (
        _changed({2: "-1e308,1.5", 121: "1e308,1.5"}),
        "line 121, column time_s = 'inf s since the first': is no time",
    ),
    "a spike": (
        _changed({40: "19.0,4.5"}),
        "line 40, column speed_m_s = '4.5 m/s': differs from its neighbours like a spike; give",
    ),
    "marks of missing samples": (
        _changed({line: f"{0.5 * line - 1:.1f},-9999" for line in range(40, 60)}),
        "line 40, column speed_m_s = '-9999 m/s': is faster than any river",
    ),
    "flow that turns": (
        _csv([f"{t},{math.cos(0.1 * t):.4f}" for t in TIMES]),
        "the flow stops or reverses; choose a part without this",
    ),
    "too short": (_csv(ROWS[:9]), "has 9 samples; give 16 at least"),
    "a date that is none": (
        _csv([row.replace("05-01T12:00:30.0", "05-32T12:00:30.0") for row in _dates()]),
        "line 62, column time_s = '2024-05-32T12:00:30.0': is neither a number nor a date",
    ),
    "zones now and then": (
        _csv(_dates(lambda i: "Z" if i < 60 else "")),
        "line 62, column time_s = '2024-05-01T12:00:30.0': has a zone and others have none",
    ),
    "a clock set back": (
        _csv(_dates(lambda i: "+02:00" if i < 60 else "+03:00")),
        "line 62, column time_s = '-3570 s since the first': is before line 61",
    ),
    "one endless line": (b"time_s,speed_m_s\n" + b"1" * 200_000 + b",1\n", "line 2: is not CSV"),
}

_CSV_NAMES = {
    "record.tsv": (_csv(), "has the file extension .tsv; name it .csv"),
    "record": (_csv(), "has no file extension"),
    "csv.nc": (_csv(), "is not NetCDF"),
    "csv.parquet": (_csv(), "cannot be read as Parquet"),
}

BROKEN: Broken = {
    **{
        f"CSV: {flaw}": (f"{flaw.replace(' ', '_')}.csv", content, told)
        for flaw, (content, told) in _CSV.items()
    },
    **{f"ending: {name}": (name, content, told) for name, (content, told) in _CSV_NAMES.items()},
}

SOUND = ("sound.csv", _csv())
"""The file before it was spoiled."""


def binary() -> Broken:
    """Return broken NetCDF and Parquet files; needs xarray, netCDF4 and pyarrow."""
    return {**_netcdf(), **_parquet()}


def _netcdf() -> Broken:
    import numpy as np
    import xarray as xr

    count = len(TIMES)
    speed = np.array(SPEEDS)
    dates = np.datetime64("2024-05-01T12:00:00", "ns") + np.arange(count) * 500_000_000

    def line(values=speed, units="m s-1", time=dates, **further):
        variables = {"speed": ("time", values, {"units": units} if units else {}), **further}
        return xr.Dataset(variables, {"time": ("time", time)})

    def profile(labels=("E", "N", "U"), ranges=(1.0, 2.0, 3.0)):
        parts = [0.6 * speed, 0.8 * speed, 0.0 * speed]
        values = np.stack([np.broadcast_to(part, (len(ranges), count)) for part in parts])
        return xr.Dataset(
            {"vel": (("dir", "range", "time"), values, {"units": "m s-1"})},
            {"time": dates, "range": list(ranges), "dir": list(labels)},
        )

    def content(dataset, form="NETCDF4"):
        with TemporaryDirectory() as folder:
            path = Path(folder) / "record.nc"
            dataset.to_netcdf(path, format=form)
            return path.read_bytes()

    def spoiled(index, value):
        values = speed.copy()
        values[index] = value
        return line(values)

    sound, old = content(line()), content(line(), "NETCDF3_64BIT")
    back = dates.copy()
    back[40] = back[3]
    nowhere = line().drop_vars("time")
    cases = {
        "empty": (b"", "is not NetCDF"),
        "cut in its head": (sound[:60], "cannot be read as NetCDF"),
        "old, cut in the middle": (old[: len(old) // 2], "cannot be read as NetCDF"),
        "no time": (content(nowhere), "has nothing that is clearly the time"),
        "texts": (content(line(values=speed.astype(str))), "holds no numbers"),
        "NaN": (content(spoiled(40, np.nan)), "row 41, column speed: is missing"),
        "infinity": (content(spoiled(40, np.inf)), "row 41, column speed = inf: must be a finite"),
        "no date": (
            content(line(time=np.where(np.arange(count) == 7, np.datetime64("NaT"), dates))),
            "row 8, column time: is no time",
        ),
    }
    return {
        f"NetCDF: {flaw}": (f"{flaw.replace(' ', '_')}.nc", *case) for flaw, case in cases.items()
    }


def _parquet() -> Broken:
    import numpy as np
    import pandas as pd

    speed = pd.Series(SPEEDS, name="speed_m_s")
    dates = pd.date_range("2024-05-01T12:00:00", periods=len(TIMES), freq="500ms", name="time")

    def frame(values=speed, index=dates, name="speed_m_s"):
        return pd.DataFrame({name: np.asarray(values)}, index=index)

    def content(data):
        stream = io.BytesIO()
        data.to_parquet(stream)
        return stream.getvalue()

    sound = content(frame())
    twice = dates.to_numpy().copy()
    twice[40] = twice[39]
    hole = speed.copy()
    hole[40] = np.nan
    spike = speed.copy()
    spike[40] = 6.0
    cases = {
        "empty": (b"", "cannot be read as Parquet"),
        "cut": (sound[:-20], "cannot be read as Parquet"),
        "texts": (content(frame(speed.astype(str))), "column speed_m_s: holds no numbers"),
        "NaN": (content(frame(hole)), "row 41, column speed_m_s: is missing"),
    }
    return {
        f"Parquet: {flaw}": (f"{flaw.replace(' ', '_')}.parquet", *case)
        for flaw, case in cases.items()
    }
