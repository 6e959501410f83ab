"""Records in JSON, as MHKiT saves them: currents of a NOAA station, series of the USGS."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import MAX_BYTES, Columns, RecordOptions, check_length, choose
from hkt_mdo.files.table import read_bytes

NOAA = {"s": "cm/s"}
"""Columns of a NOAA file whose unit is known: the speed."""
REMEDY = "give JSON that MHKiT has saved of a NOAA or USGS station, or CSV"


def read_json(path: Path, options: RecordOptions) -> Columns:
    """Read time and speed, or discharge, of a station's file.

    Parameters
    ----------
    path : pathlib.Path
        The file: columns of numbers by times in ms, as MHKiT has currents of NOAA (`s`, cm/s, and
        the direction `d`, degrees), or a time series of the USGS' water services.
    options : RecordOptions
        Which column, and its unit.

    Returns
    -------
    Columns
        Time and speed in s and m/s.

    Raises
    ------
    InputError
        If the file is broken, or its columns or units are not clear.
    """
    file = str(path)
    try:
        data = json.loads(read_bytes(path, MAX_BYTES, "record"))
        found = (
            _usgs(data) if "timeSeries" in data.get("value", ()) else _by_times(data, options, file)
        )
    except InputError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError):
        raise InputError("is no record of a station", REMEDY, file=path) from None
    name, unit, times, values = found
    check_length(len(times), file)
    if not times:
        raise InputError("has no samples", REMEDY, file=path)
    order = np.argsort(times, kind="stable")
    time, speed = (np.array(each, dtype=float)[order] for each in (times, values))
    rows = Columns(file, ("time", name), time - time[0], speed, lambda row: f"sample {row + 1}")
    return rows.in_si(True, options, ("", unit))


def _by_times(data: dict[str, Any], options: RecordOptions, file: str):
    """Return name, unit, times (s) and values of a column by times in ms."""
    names = [name for name, column in data.items() if name != "metadata"]
    default = RecordOptions(speed_column=options.speed_column or ("s" if "s" in names else None))
    _, name = choose(["time", *names], "time", default, file)
    column = data[name]
    times = [1e-3 * float(key) for key in column]
    values = [float("nan") if value is None else float(value) for value in column.values()]
    unit = "" if options.speed_unit else NOAA.get(name, "")
    return name, unit, times, values


def _usgs(data: dict[str, Any]):
    """Return name, unit, times (s) and values of the first series of the USGS."""
    series = data["value"]["timeSeries"][0]
    about = series["variable"]
    none = float(about.get("noDataValue", -999999.0))
    rows = series["values"][0]["value"]
    times = [datetime.fromisoformat(row["dateTime"]).timestamp() for row in rows]
    values = [float(row["value"]) for row in rows]
    unit = {"ft3/s": "ft3/s", "ft/s": "ft/s"}.get(about["unit"]["unitCode"], "")
    return about["variableName"], unit, times, [np.nan if x == none else x for x in values]
