"""Records from JSON files: data of NOAA and USGS as MHKiT and these services save them."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import (
    MAX_BYTES,
    Columns,
    RecordOptions,
    check_length,
    choose,
    column_key,
)
from hkt_mdo.files.table import parse_number, read_text

NOAA = {"s": "cm/s", "d": ""}
"""Columns of currents of NOAA as MHKiT saves them, speed and direction, with their units."""
TIME = "time"
"""What messages call the times of a JSON file."""

_KNOWN = "columns over times in milliseconds (MHKiT, pandas), or a response of USGS"
_MILLISECONDS = re.compile(r"-?\d{6,16}", re.ASCII)

_Series = tuple[Sequence[Any], Sequence[Any]]  # times and values


def read_json(path: Path, options: RecordOptions) -> Columns:
    """Read time and speed from a JSON file.

    Three forms are known: columns as pandas writes them, ``{"s": {"1478606640000": 67.3, ...}}``,
    times in milliseconds since 1970 or as dates; ``{"columns": ..., "index": ..., "data": ...}``;
    and a response of USGS' water services (WaterML in JSON), its columns by their description.

    Parameters
    ----------
    path : pathlib.Path
        The file.
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
    text = read_text(path, "record", MAX_BYTES)
    try:
        data = json.loads(text)
        series = _series(data)
    except (ValueError, RecursionError) as error:
        problem = f"cannot be read as JSON ({error})"
        raise InputError(problem, "write the file anew, or as CSV", file=path) from None
    except (KeyError, TypeError, IndexError, AttributeError):
        series = []
    if not series:
        remedy = f"give {_KNOWN}, or write it as CSV"
        raise InputError("is JSON, and no record of a known form", remedy, file=path)
    unit, columns = "", [name for name, _ in series]
    if "metadata" in data and {*columns} == {*NOAA}:  # a station of NOAA
        options = replace(options, speed_column=options.speed_column or "s")
        unit = "" if options.speed_unit else NOAA[options.speed_column]
    names = choose([TIME, *columns], TIME, options, str(path))
    times, values = dict(series)[names[1]]
    check_length(len(times), str(path))
    rows, speeds = list(map(_seconds, times)), list(map(_speed, values))
    for name, numbers, given in zip(names, (rows, speeds), (times, values), strict=True):
        for row in [at for at, number in enumerate(numbers) if number is None][:1]:
            problem = "is neither a number nor a date" if numbers is rows else "is no number"
            key = f"row {row + 1}, {column_key(name)}"
            remedy = "correct it, or write the file as CSV"
            raise InputError(problem, remedy, file=path, key=key, value=given[row])
    seconds, speed = np.array(rows, dtype=float), np.array(speeds, dtype=float)
    order = np.argsort(seconds, kind="stable")  # an object of JSON has no order
    place = [f"row {row + 1}" for row in order]
    messages = () if np.all(np.diff(order) == 1) else ("rows sorted by time",)
    raw = Columns(
        str(path),
        names,
        (seconds - np.min(seconds, initial=np.inf))[order],
        speed[order],
        place.__getitem__,
        messages,
    )
    return raw.in_si(True, options, ("", unit))


def _series(data: Any) -> list[tuple[str, _Series]]:
    """Return the columns of a file by name, each with its times."""
    if isinstance(data.get("value"), dict):  # USGS
        return [_usgs(each) for each in data["value"]["timeSeries"]]
    if {"columns", "index", "data"} <= set(data):
        columns = zip(*data["data"], strict=True)
        return [
            (str(name), (data["index"], values))
            for name, values in zip(data["columns"], columns, strict=True)
        ]
    tables = {name: table for name, table in data.items() if isinstance(table, dict) and table}
    return [
        (name, (list(table), list(table.values())))
        for name, table in tables.items()
        if _seconds(next(iter(table))) is not None
    ]


def _usgs(series: dict[str, Any]) -> tuple[str, _Series]:
    """Return one series of USGS; its number for missing values becomes NaN."""
    variable = series["variable"]
    missing = variable.get("noDataValue")
    samples = series["values"][0]["value"]
    numbers = [parse_number(str(each["value"])) for each in samples]
    values = [None if number is None or number == missing else number for number in numbers]
    return variable["variableDescription"], ([each["dateTime"] for each in samples], values)


def _seconds(time: object) -> float | None:
    """Return a time in seconds, of milliseconds or of a date in UTC where it has no zone."""
    if isinstance(time, int | float) or _MILLISECONDS.fullmatch(str(time)):
        return float(str(time)) / 1e3
    try:
        date = datetime.fromisoformat(str(time)[:64])
    except ValueError:
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _speed(value: object) -> float | None:
    """Return a number, NaN of a missing one, None of all else."""
    if value is None:
        return np.nan
    return parse_number(str(value)) if isinstance(value, int | float | str) else None
