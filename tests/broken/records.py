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
    "nothing but remarks": (b"# a record\n# of nothing\n\n", "is empty"),
    "header only": (_csv([]), "has a header but no samples"),
    "no header": (_csv(ROWS[1:], ROWS[0]), "line 1 = '0.0,1.5"),
    "one column": (_csv(["1.5"] * 60, "speed_m_s"), "has no columns besides the time"),
    "three columns": (
        _csv([f"{row},3" for row in ROWS], f"{HEADER},temperature"),
        "give speed_column: of time_s, speed_m_s, temperature",
    ),
    "the same column twice": (
        _csv([f"{row},1" for row in ROWS], f"{HEADER},time_s"),
        "time_column = 'time_s': appears twice",
    ),
    "semicolons": (
        _csv([row.replace(",", ";") for row in ROWS], "time_s;speed_m_s"),
        "line 1 = 'time_s;speed_m_s': has no commas",
    ),
    "tabs": (
        _csv([row.replace(",", "\t") for row in ROWS], "time_s\tspeed_m_s"),
        "has no commas between its columns",
    ),
    "decimal commas": (
        _csv([row.replace(".", ",") for row in ROWS]),
        "line 2 = '0,0,1,5",
    ),
    "no unit of time": (_csv(header="time,speed_m_s"), "column time: has no unit that is known"),
    "no unit of speed": (_csv(header="time_s,speed"), "give speed_unit, or name it with its unit"),
    "unknown unit of speed": (_csv(header="time_s,speed [furlong/week]"), "has no unit"),
    "a pressure": (_csv(header="time_s,pressure [dbar]"), "column pressure [dbar]: has no unit"),
    "a discharge": (
        _csv(header='time_s,"Discharge, cubic feet per second"'),
        "is a discharge in ft3/s, not a speed; give area",
    ),
    "centimetres that say metres": (
        _csv([f"{t},{100 * v:.2f}" for t, v in zip(TIMES, SPEEDS, strict=True)]),
        "is faster than any river",
    ),
    "cut in a line": (_csv()[:-9], "line 121 = '59.': has 1 cells where the header has 2"),
    "a row too short": (_changed({40: "19.0"}), "line 40 = '19.0': has 1 cells"),
    "a row too long": (_changed({40: "19.0,1.5,1.6"}), "line 40 = '19.0,1.5,1.6': has 3 cells"),
    "a word": (_changed({40: "19.0,calm"}), "line 40, column speed_m_s = 'calm': must be a finite"),
    "a unit in a cell": (_changed({40: "19.0,1.5 m/s"}), "line 40, column speed_m_s = '1.5 m/s'"),
    "infinity": (_changed({40: "19.0,inf"}), "line 40, column speed_m_s = 'inf': must be a finite"),
    "overflow": (_changed({40: "19.0,1e999"}), "line 40, column speed_m_s = '1e999'"),
    "no time": (_changed({40: ",1.5"}), "line 40, column time_s = '': must be a finite number"),
    "NaN": (_changed({40: "19.0,NaN"}), "line 40, column speed_m_s: is missing; give"),
    "empty cells": (
        _changed({40: "19.0,", 41: "19.5,", 90: "44.0,"}),
        "line 40, column speed_m_s: is missing, as are 2 more",
    ),
    "a gap at the end": (
        _changed({121: "59.5,"}),
        "line 121, column speed_m_s: is missing",
    ),
    "missing rows": (
        _changed({40: "", 41: ""}),
        "line 40, column time_s = '20 s since the first': ends a gap of 1 s; give gaps",
    ),
    "a gap of hours": (
        _csv([*ROWS[:60], *(f"{t + 10800},{v:.4f}" for t, v in zip(TIMES, SPEEDS, strict=True))]),
        "ends a gap of 10770 s, and no more than 1.5 s may be interpolated",
    ),
    "the same time twice": (
        _changed({40: "18.5,1.5"}),
        "line 40, column time_s = '18.5 s since the first': is also the time of line 39",
    ),
    "time goes back": (
        _changed({40: "3.0,1.5"}),
        "line 40, column time_s = '3 s since the first': is before line 39",
    ),
    "sorted backwards": (_csv(ROWS[::-1]), "line 3, column time_s = '-0.5 s since the first'"),
    "times rounded to seconds": (
        _csv([f"{math.floor(t)},{v:.4f}" for t, v in zip(TIMES, SPEEDS, strict=True)]),
        "line 3, column time_s = '0 s since the first': is also the time of line 2",
    ),
    "uneven": (
        _csv([f"{t + 0.1 * math.sin(t):.3f},{v:.4f}" for t, v in zip(TIMES, SPEEDS, strict=True)]),
        "off an even spacing of 0.5",
    ),
    "absurd times": (
        _changed({2: "-1e308,1.5", 121: "1e308,1.5"}),
        "line 121, column time_s = 'inf s since the first': is no time",
    ),
    "one absurd time": (
        _changed({121: "1e300,1.5"}),
        "line 121, column time_s = '1e+300 s since the first': ",
    ),
    "a spike": (
        _changed({40: "19.0,4.5"}),
        "line 40, column speed_m_s = '4.5 m/s': stands off from its neighbours like a spike; give",
    ),
    "absurd speeds": (
        _changed({40: "19.0,1e300", 80: "39.0,-1e300"}),
        "line 40, column speed_m_s = '1e+300 m/s': stands off from its neighbours like a spike, "
        "and 1 more do",
    ),
    "marks of missing samples": (
        _changed({line: f"{0.5 * line - 1:.1f},-9999" for line in range(40, 60)}),
        "line 40, column speed_m_s = '-9999 m/s': is faster than any river",
    ),
    "no flow": (_csv([f"{t},0" for t in TIMES]), "falls to 0 m/s when low-passed"),
    "flow that turns": (
        _csv([f"{t},{math.cos(0.1 * t):.4f}" for t in TIMES]),
        "the flow stands still or turns; take a part where it runs one way",
    ),
    "flow of the other sign": (
        _csv([f"{t},{-v:.4f}" for t, v in zip(TIMES, SPEEDS, strict=True)]),
        "mend the sign",
    ),
    "too short": (_csv(ROWS[:9]), "has 9 samples; give 16 at least"),
    "a date that is none": (
        _csv([row.replace("05-01T12:00:30.0", "05-32T12:00:30.0") for row in _dates()]),
        "line 62, column time_s = '2024-05-32T12:00:30.0': is neither a number nor a date",
    ),
    "dates of another country": (
        _csv([row.replace("2024-05-01T", "05/01/2024 ") for row in _dates()]),
        "line 2, column time_s = '05/01/2024 12:00:00.0': is neither a number nor a date",
    ),
    "zones now and then": (
        _csv(_dates(lambda i: "Z" if i < 60 else "")),
        "line 62, column time_s = '2024-05-01T12:00:30.0': has a zone and others have none",
    ),
    "a clock set back": (
        _csv(_dates(lambda i: "+02:00" if i < 60 else "+03:00")),
        "line 62, column time_s = '-3570 s since the first': is before line 61",
    ),
    "UTF-16": (_csv().decode().encode("utf-16"), "line 1: is not UTF-8 text; save it as UTF-8"),
    "Latin-1": (
        _csv(header="time_s,speed_m_s,Bemerkung für später".replace(",Bem", " Bem")).replace(
            "ü".encode(), b"\xfc"
        ),
        "line 1: is not UTF-8 text",
    ),
    "Latin-1 far down": (
        _csv([*ROWS[:99], "49.5,1.5 # Böe"]).replace("ö".encode(), b"\xf6"),
        "line 101: is not UTF-8 text",
    ),
    "binary": (bytes(range(256)) * 8, "is not text"),
    "a quote that never ends": (_changed({40: '19.0,"1.5'}), "is not CSV"),
    "one endless line": (b"time_s,speed_m_s\n" + b"1" * 200_000 + b",1\n", "line 2: is not CSV"),
}

_CSV_NAMES = {
    "record.tsv": (_csv(), "has the ending .tsv; name it .csv"),
    "record": (_csv(), "has no ending that says its kind"),
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
        "not NetCDF": (b"PK\x03\x04" + b"\0" * 100, "is not NetCDF"),
        "cut in its head": (sound[:60], "cannot be read as NetCDF"),
        "cut in the middle": (sound[: len(sound) // 2], "cannot be read as NetCDF"),
        "old, cut in its head": (old[:60], "cannot be read as NetCDF"),
        "old, cut in the middle": (old[: len(old) // 2], "cannot be read as NetCDF"),
        "no time": (content(nowhere), "has nothing that is plainly the time"),
        "no variable": (content(line()[["time"]]), "has no columns besides the time"),
        "many variables": (
            content(line(heading=("time", speed), pressure=("time", speed))),
            "give speed_column: of time, speed, heading, pressure",
        ),
        "no unit": (content(line(units="")), "column speed: has no unit that is known"),
        "another unit": (content(line(units="dbar")), "has no unit that is known"),
        "a discharge": (content(line(units="m3/s")), "is a discharge in m3/s, not a speed"),
        "texts": (content(line(values=speed.astype(str))), "holds no numbers"),
        "depth bins": (content(profile()), "give bins: [lower, upper]; there are 3 from 1 to 3 m"),
        "beams": (content(profile(labels=(1, 2, 3))), "is along the beams of the instrument"),
        "NaN": (content(spoiled(40, np.nan)), "row 41, column speed: is missing"),
        "infinity": (content(spoiled(40, np.inf)), "row 41, column speed = inf: must be a finite"),
        "a spike": (content(spoiled(40, 5.0)), "row 41, column speed = '5 m/s': stands off"),
        "time goes back": (
            content(line(time=back)),
            "row 41, column time = '1.5 s since the first'",
        ),
        "no date": (
            content(line(time=np.where(np.arange(count) == 7, np.datetime64("NaT"), dates))),
            "row 8, column time: is no time",
        ),
        "too short": (content(line().isel(time=slice(9))), "has 9 samples; give 16 at least"),
        "flow of the other sign": (content(line(-speed)), "the flow stands still or turns"),
        "faster than any river": (content(line(speed * 100)), "is faster than any river"),
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
        "not Parquet": (b"PAR1 and nothing else", "cannot be read as Parquet"),
        "cut": (sound[:-20], "cannot be read as Parquet"),
        "no columns": (content(frame()[[]]), "has no columns besides the time"),
        "no rows": (content(frame().iloc[:0]), "has 0 samples"),
        "no unit": (content(frame(name="speed")), "column speed: has no unit that is known"),
        "texts": (content(frame(speed.astype(str))), "column speed_m_s: holds no numbers"),
        "time of texts": (
            content(frame(index=pd.Index(dates.astype(str), name="time"))),
            "column time: holds no numbers and no dates",
        ),
        "NaN": (content(frame(hole)), "row 41, column speed_m_s: is missing"),
        "a spike": (content(frame(spike)), "row 41, column speed_m_s = '6 m/s': stands off"),
        "the same time twice": (
            content(frame(index=pd.DatetimeIndex(twice, name="time"))),
            "row 41, column time = '19.5 s since the first': is also the time of row 40",
        ),
        "missing rows": (
            content(frame().drop(index=dates[40:43])),
            "row 41, column time = '21.5 s since the first': ends a gap of 1.5 s",
        ),
        "two speeds": (
            content(frame().assign(v_m_s=1.0)),
            "give speed_column: of time, speed_m_s, v_m_s",
        ),
    }
    return {
        f"Parquet: {flaw}": (f"{flaw.replace(' ', '_')}.parquet", *case)
        for flaw, case in cases.items()
    }
