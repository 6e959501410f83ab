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


def _speeds(value) -> bytes:
    """Return a record of the sound times and other speeds."""
    return _csv([f"{t},{value(t, v)}" for t, v in zip(TIMES, SPEEDS, strict=True)])


_THREE = [f"{row},3" for row in ROWS]
_DISCHARGE = 'time_s,"Discharge, cubic feet per second"'
_MARKS = {line: f"{0.5 * line - 1:.1f},-9999" for line in range(40, 60)}
_BAD_DATE = [row.replace("05-01T12:00:30.0", "05-32T12:00:30.0") for row in _dates()]

_CSV: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty; its first line is a header"),
    "header only": (_csv([]), "has no samples"),
    "no header": (_csv(ROWS[1:], ROWS[0]), "line 1 = '0.0,1.5"),
    "one column": (_csv(["1.5"] * 60, "speed_m_s"), "has no columns besides the time"),
    "three columns": (_csv(_THREE, f"{HEADER},temperature"), "give speed_column: of speed_m_s, "),
    "no unit of time": (_csv(header="time,speed_m_s"), "column time: has no unit that is known"),
    "a discharge": (_csv(header=_DISCHARGE), "is a discharge in ft3/s, not a speed; give area"),
    "centimetres": (_speeds(lambda t, v: f"{100 * v:.2f}"), "is faster than any river"),
    "a word": (_changed({40: "19.0,calm"}), "line 40, column speed_m_s = 'calm': must be a finite"),
    "NaN": (_changed({40: "19.0,NaN"}), "line 40, column speed_m_s: is at a gap of 0.5 s; give"),
    "a gap at the end": (_changed({121: "59.5,"}), "line 121, column speed_m_s: is missing"),
    "the same time twice": (_changed({40: "18.5,1.5"}), "is also the time of line 39"),
    "time goes back": (_changed({40: "3.0,1.5"}), "time_s = '3 s since the first': is before line"),
    "absurd times": (_changed({121: "1e308,1.5"}, "t_h,v_m_s"), "'inf s since the first'"),
    "milliseconds": (_changed({2: "1.7e12,1.5"}), "column time_s: begins at 1.7e+12 s, more than"),
    "spaces": (_csv(header="time_s speed_m_s"), "add the speed after a comma; lines of text above"),
    "a spike": (_changed({40: "19.0,4.5"}), "line 40, column speed_m_s = '4.5 m/s': differs from"),
    "marks of missing samples": (_changed(_MARKS), "line 40, column speed_m_s = '-9999 m/s': is"),
    "flow that turns": (_speeds(lambda t, v: f"{math.cos(0.1 * t):.4f}"), "stops or reverses"),
    "too short": (_csv(ROWS[:9]), "has 9 samples; give 16 at least"),
    "a date that is none": (_csv(_BAD_DATE), "line 62, column time_s = '2024-05-32T12:00:30.0'"),
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
    "csv.nc": (_csv(), "cannot be read as NetCDF"),
    "csv.parquet": (_csv(), "cannot be read as Parquet"),
}

BROKEN: Broken = {
    f"CSV: {flaw}": (f"{flaw.replace(' ', '_')}.csv", *broken) for flaw, broken in _CSV.items()
}
BROKEN |= {f"ending: {name}": (name, *broken) for name, broken in _CSV_NAMES.items()}

SOUND = ("sound.csv", _csv())
"""The file before it was spoiled."""


def binary() -> Broken:
    """Return broken NetCDF and Parquet files; needs xarray, netCDF4 and pyarrow."""
    return {**_netcdf(), **_parquet()}


def _netcdf() -> Broken:
    import numpy as np
    import xarray as xr

    speed = np.array(SPEEDS)
    dates = np.datetime64("2024-05-01T12:00:00", "ns") + np.arange(len(TIMES)) * 500_000_000

    def content(values=speed, time=dates, form="NETCDF4", without=()):
        line = xr.Dataset({"speed": ("time", values, {"units": "m s-1"})}, {"time": ("time", time)})
        with TemporaryDirectory() as folder:
            path = Path(folder) / "record.nc"
            line.drop_vars(without).to_netcdf(path, format=form)
            return path.read_bytes()

    old, at_40 = content(form="NETCDF3_64BIT"), np.arange(len(TIMES)) == 40
    no_date = np.where(at_40, np.datetime64("NaT"), dates)
    hole, endless = (np.where(at_40, value, speed) for value in (np.nan, np.inf))
    return {
        "NetCDF: empty": ("empty.nc", b"", "cannot be read as NetCDF"),
        "NetCDF: cut": ("cut.nc", content()[:60], "cannot be read as NetCDF"),
        "NetCDF: old, cut": ("old.nc", old[: len(old) // 2], "cannot be read as NetCDF"),
        "NetCDF: no time": ("no_time.nc", content(without=["time"]), "nothing that is clearly the"),
        "NetCDF: texts": ("texts.nc", content(speed.astype(str)), "holds no numbers"),
        "NetCDF: NaN": ("nan.nc", content(hole), "row 41, column speed: is at a gap"),
        "NetCDF: infinity": ("infinity.nc", content(endless), "row 41, column speed = 'inf m/s'"),
        "NetCDF: no date": ("date.nc", content(time=no_date), "row 41, column time: is no time"),
    }


def _parquet() -> Broken:
    import numpy as np
    import pandas as pd

    speed = pd.Series(SPEEDS, name="speed_m_s")
    dates = pd.date_range("2024-05-01T12:00:00", periods=len(TIMES), freq="500ms", name="time")
    hole = speed.where(speed.index != 40)

    def content(values):
        stream = io.BytesIO()
        pd.DataFrame({"speed_m_s": np.asarray(values)}, index=dates).to_parquet(stream)
        return stream.getvalue()

    return {
        "Parquet: empty": ("empty.parquet", b"", "cannot be read as Parquet"),
        "Parquet: cut": ("cut.parquet", content(speed)[:-20], "cannot be read as Parquet"),
        "Parquet: texts": ("texts.parquet", content(speed.astype(str)), "holds no numbers"),
        "Parquet: NaN": ("nan.parquet", content(hole), "row 41, column speed_m_s: is at a gap"),
    }
