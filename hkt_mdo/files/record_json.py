"""Records from JSON files: data of NOAA and USGS as MHKiT and these services save them."""

import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import TIME_UNITS, Columns, RecordFile, choose, parse_rows
from hkt_mdo.files.table import MAX_RECORD_BYTES, parse_number, read_text

NOAA = {"s": "cm/s", "d": ""}
"""Columns of currents of NOAA as MHKiT saves them, speed and direction, with their units."""
TIME = "time"
"""What messages call the times of a JSON file."""

_TIME = re.compile(r"-?\d+(\.\d*)?$|\d{4}-")
_PLAUSIBLE = 3e7, 4.2e9  # s since 1970: from 1971 to 2103, which no other unit of these reaches


class _Series(NamedTuple):
    """A column of a file with its times."""

    name: str
    times: Sequence[Any]
    values: Sequence[Any]
    qualifiers: Sequence[str] = ()  # what tells it from others of the same name, in this order
    unit: str = ""


def read_json(options: RecordFile) -> Columns:
    """Read time and speed from a JSON file.

    Three forms are known: columns as pandas writes them, ``{"s": {"1478606640000": 67.3, ...}}``,
    times since 1970 or dates; ``{"columns": ..., "index": ..., "data": ...}``; and a response of
    USGS' water services (WaterML in JSON), its columns by their description and, where there are
    several of one, by site and method (sensor). The unit of times since 1970 is
    `RecordFile.time_unit`, else the one that makes the year plausible.

    Parameters
    ----------
    options : RecordFile
        The file, which column, and its unit.

    Returns
    -------
    Columns
        Time and speed as in the file.

    Raises
    ------
    InputError
        If its columns are not clear; what `json` raises where the file is broken.
    """
    path = Path(options.file)
    data = json.loads(read_text(path, "record", MAX_RECORD_BYTES))
    try:
        series = _series(data)
    except (KeyError, TypeError, IndexError, AttributeError, ValueError):
        series = []
    if not series:
        remedy = "give columns over times since 1970 (MHKiT, pandas), a response of USGS, or CSV"
        raise InputError("is JSON, and no record of a known form", remedy, file=path)
    empty = [column for column in series if not column.times]
    messages = [f"{', '.join((column.name, *column.qualifiers))}: no samples" for column in empty]
    series = [column for column in series if column.times] or series
    columns = _names(series)
    noaa = "metadata" in data and {*columns} == {*NOAA}
    if noaa:
        options = options.model_copy(update={"speed_column": options.speed_column or "s"})
    if options.time_column not in (None, TIME):
        remedy, key = "leave time_column out", "time_column"
        raise InputError("has the times of each value beside it", remedy, file=path, key=key)
    names = choose([TIME, *columns], TIME, options)
    _, times, values, _, unit = series[columns.index(names[1])]
    if noaa and not options.speed_unit:
        unit = NOAA[names[1]]
    if len(times) != len(values):
        problem = f"has {len(times)} times and {len(values)} values"
        raise InputError(problem, "give a value for each time", file=path, key=names[1])
    rows = zip(count(1), map(str, times), map(str, values), strict=False)
    raw = parse_rows(rows, names, path, "row")
    epoch = "" if raw.dated or options.time_unit else _epoch_unit(raw.time)
    order = np.argsort(raw.time, kind="stable")  # an object of JSON has no order
    messages += ["rows sorted by time"] * bool(np.any(np.diff(order) != 1))
    return replace(raw.at(order), messages=tuple(messages), units=(epoch, unit))


def _series(data: Any) -> list[_Series]:
    """Return the columns of a file, each with its times."""
    if isinstance(data.get("value"), dict):
        entries = data["value"]["timeSeries"]
        return [_usgs(entry, sensor) for entry in entries for sensor in entry["values"]]
    if {"columns", "index", "data"} <= set(data):
        columns = zip(*data["data"], strict=True)
        return [
            _Series(str(name), data["index"], values)
            for name, values in zip(data["columns"], columns, strict=True)
        ]
    tables = {name: table for name, table in data.items() if isinstance(table, dict) and table}
    return [
        _Series(name, list(table), list(table.values()))
        for name, table in tables.items()
        if _TIME.match(next(iter(table)))
    ]


def _usgs(entry: dict[str, Any], sensor: dict[str, Any]) -> _Series:
    """Return the series of one sensor of USGS; its number for missing values becomes NaN."""
    variable, samples = entry["variable"], sensor["value"]
    missing, name = variable.get("noDataValue"), variable["variableDescription"]
    source, (method, *_) = entry.get("sourceInfo", {}), sensor.get("method") or [{}]
    (site, *_) = source.get("siteCode") or [{}]
    qualifiers = [f"site {site.get('value')} {source.get('siteName', '')}".strip()]
    qualifiers += [f"method {method.get('methodID')} {method.get('methodDescription', '')}".strip()]
    numbers = [parse_number(str(sample["value"])) for sample in samples]
    values = [None if number == missing else number for number in numbers]
    return _Series(name, [sample["dateTime"] for sample in samples], values, qualifiers, name)


def _names(series: list[_Series]) -> list[str]:
    """Return a name of each series, with as much about it as makes the name unique."""
    names = [column.name for column in series]
    for at in range(max(len(column.qualifiers) for column in series)):
        counts = Counter(names)
        names = [
            f"{name}, {column.qualifiers[at]}" if counts[name] > 1 else name
            for name, column in zip(names, series, strict=True)
        ]
    return names


def _epoch_unit(time: np.ndarray) -> str:
    """Return the unit of times since 1970 that makes their years plausible; empty for none."""
    low, high = _PLAUSIBLE
    candidates = ((unit, np.abs(time) * TIME_UNITS[unit]) for unit in ("s", "ms", "us", "ns"))
    return next((unit for unit, t in candidates if low < np.min(t) and np.max(t) < high), "")
