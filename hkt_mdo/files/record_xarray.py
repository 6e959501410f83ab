"""Records from NetCDF and Parquet files, as MHKiT saves its data."""

import io
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import install, needed
from hkt_mdo.files.record_table import SPEED_UNITS, SPEEDS, Columns, RecordFile, choose, named_unit
from hkt_mdo.files.table import MAX_RECORD_BYTES, read_bytes

_HORIZONTAL = {("e", "n"), ("x", "y"), ("u", "v"), ("streamwise", "x-stream")}
"""Labels of two horizontal components of a velocity, in small letters."""


def _need(name: str, options: RecordFile) -> Any:
    """Return a module of the extra `records`."""
    return needed(name, f"{install('records')}, or save the record as CSV", file=options.file)


def read_parquet(options: RecordFile) -> Columns:
    """Read time and speed from a Parquet file by pandas.

    Parameters
    ----------
    options : RecordFile
        The file, which columns, and their units.

    Returns
    -------
    Columns
        Time and speed as in the data.

    Raises
    ------
    InputError
        If a library is not installed; what they raise where the file is broken.
    """
    _need("pyarrow.parquet", options)
    pandas = _need("pandas", options)
    content = io.BytesIO(read_bytes(Path(options.file), MAX_RECORD_BYTES, "record"))
    return _from_frame(pandas.read_parquet(content), options)


def read_netcdf(options: RecordFile) -> Columns:
    """Read time and speed from a NetCDF file, version 3 (CDF) or 4 (HDF5), by xarray.

    Parameters
    ----------
    options : RecordFile
        The file, which variables, and their units.

    Returns
    -------
    Columns
        Time and speed as in the data.

    Raises
    ------
    InputError
        If a library is not installed; what they raise where the file is broken.
    """
    xarray, path = _need("xarray", options), Path(options.file)
    engine: dict[str, Any] = {"engine": "netcdf4"}
    if read_bytes(path, MAX_RECORD_BYTES, "record").startswith(b"CDF"):
        engine = {"engine": "scipy", "mmap": False}  # netCDF4 reads zeros where a file is cut
    else:
        _need("netCDF4", options)
    with xarray.open_dataset(path, decode_times=False, decode_timedelta=False, **engine) as dataset:
        return _from_dataset(_with_dates(dataset, xarray.decode_cf), options)


def _with_dates(data: Any, decode: Callable) -> Any:
    """Return a Dataset with dates for those times since a date that can be decoded.

    Files of EPIC (USGS) have the Julian day and the milliseconds of the day beside each other.
    """
    dates = {}
    for name, variable in data.variables.items():
        unit = str(variable.attrs.get("units", ""))
        if re.search(r"since \d+-\d", unit):
            with suppress(ValueError, OverflowError):
                alone = decode(type(data)({name: variable}), decode_timedelta=False)
                dates[name] = alone.variables[name]
        elif "julian day" in unit.lower() and f"{name}2" in data:
            days = variable.values + data[f"{name}2"].values / 86.4e6
            dates[name] = variable.dims, days, {"units": "days"}
    return data.assign(dates)


def _check_kinds(raw: Columns) -> None:
    """Refuse a time that is neither number nor date, and a speed that is no number."""
    for column, values in enumerate((raw.time, raw.speed)):
        if values.dtype.kind not in ("iufM", "iuf")[column]:
            problem = ("holds no numbers and no dates", "holds no numbers")[column]
            raise raw.refuse_column(column, problem, "write it as numbers, or choose another")


def _checked(raw: Columns) -> Columns:
    """Return columns of dates or numbers with dates in seconds; refuse infinite speeds."""
    for row in np.flatnonzero(np.isinf(raw.speed))[:1]:
        raise raw.refuse("must be a finite number", "mark missing samples by NaN", row, 1)
    if raw.time.dtype.kind != "M":
        return replace(raw, time=raw.time.astype(float))
    dates = raw.time.astype("datetime64[ns]")
    return replace(raw, time=(dates - dates[:1]) / np.timedelta64(1, "s"), dated=True)


def _from_frame(frame: Any, options: RecordFile) -> Columns:
    """Take two columns of a DataFrame; its index is the first if it has a name or dates."""
    if frame.index.nlevels == 1 and (frame.index.name or frame.index.dtype.kind == "M"):
        frame = frame.reset_index(allow_duplicates=True)
    columns = [str(name) for name in frame.columns]
    names = choose(columns, next(iter(columns), None), options)
    time, speed = (frame.iloc[:, columns.index(name)] for name in names[:2])
    _check_kinds(Columns(options.file, names, time, speed))
    speeds, plain = speed.to_numpy(float, na_value=np.nan), time.dtype.kind != "M"
    times = time.to_numpy(float, na_value=np.nan) if plain else time.to_numpy("datetime64[ns]")
    return _checked(Columns(options.file, names, times, speeds))


def _from_dataset(data: Any, options: RecordFile) -> Columns:
    """Take a variable over time of a Dataset: a speed, or a profiler's velocity."""
    vectors = [name for name, variable in data.variables.items() if variable.ndim == 1]
    dates = [name for name in vectors if name in data.dims and data[name].dtype.kind == "M"]
    times = [name for name in ("time", "dateTime") if name in vectors] + dates
    if options.speed_column in data.data_vars:  # a variable may have a time of its own
        dimensions = data[options.speed_column].dims
        times = [name for name in times if data[name].dims[0] in dimensions]
    plain = len(set(times)) == 1 or (times and times[0] in ("time", "dateTime"))
    default = times[0] if plain else None
    chosen = options.time_column or default
    dimension = data[chosen].dims[0] if chosen in vectors else None
    along = {dimension} if options.time_column else {data[name].dims[0] for name in times}
    speeds = [str(name) for name, v in data.data_vars.items() if along & set(v.dims)]
    speeds = [name for name in speeds if name != chosen and data[name].dtype.kind != "M"]
    speeds.sort(key=lambda name: _unlikeness(data[name]))
    columns = [*([str(chosen)] if chosen in vectors else vectors), *speeds]
    names = choose(columns, None if default is None else str(default), options)
    time, speed = data[names[0]], data[names[1]]
    units = str(time.attrs.get("units", "")), str(speed.attrs.get("units", ""))
    raw = Columns(options.file, names, time, speed, units=units)
    _check_kinds(raw)
    return _checked(replace(_profile(raw, dimension, options), time=time.values))


def _unlikeness(variable: Any) -> int:
    """Return a rank of a variable for messages: the likeliest speed of the flow comes first."""
    described = f"{variable.name} {variable.attrs.get('long_name')}".lower()
    unit = named_unit(str(variable.attrs.get("units")), SPEEDS)
    return 2 if unit is None else int("sound" in described)


def _profile(raw: Columns, dimension: Any, options: RecordFile) -> Columns:
    """Return columns with the speed of a variable, averaged over bins, and its two components."""
    speed: Any = raw.speed
    others = [name for name in speed.dims if name != dimension]
    coordinates = [name for name in others if name in speed.coords]
    labelled = [name for name in coordinates if name == "dir" or speed[name].dtype.kind in "USOT"]
    bins = [name for name in others if name not in labelled]
    if len(bins) > 1 or options.bins is None:  # such as one latitude and one longitude
        speed = speed.squeeze([name for name in bins if speed.sizes[name] == 1])
        bins = [name for name in bins if name in speed.dims]
    if len(labelled) > 1 or len(bins) > 1:
        remedy = "give a variable over time, depth bins and components at most"
        problem = f"has the dimensions {', '.join(map(str, speed.dims))}"
        raise raw.refuse_column(1, problem, remedy)
    parts, messages = [speed], []
    for name in labelled:
        labels = [str(label) for label in speed[name].values]
        chosen = _chosen_components(labels, raw, options)
        parts = [speed.isel({name: labels.index(label)}) for label in chosen]
        horizontal = "horizontal " * (tuple(map(str.lower, chosen)) in _HORIZONTAL)
        kind = "component" if len(chosen) == 1 else f"{horizontal}speed of"
        messages.append(f"{speed.name}: {kind} {' and '.join(chosen)}")
    for name in bins:
        numbers = name in coordinates and speed[name].dtype.kind in "iuf" and speed[name].size
        if not numbers:
            remedy = f"give {name} its values in metres"
            raise raw.refuse_column(1, f"has no distances along {name}", remedy)
        unit = str(speed[name].attrs.get("units") or "").split() or ["m"]  # such as m above bed
        length = named_unit(f"{unit[0]}/s", SPEEDS)  # a length has the name of its speed
        if length not in SPEED_UNITS:
            problem = f"has distances along {name} in {' '.join(unit)}"
            raise raw.refuse_column(1, problem, "give them in metres")
        centres = speed[name].values.astype(float) * SPEED_UNITS[length]
        available = f"there are {centres.size} from {_span(centres)}"
        if options.bins is None:
            remedy = f"give bins: [lower, upper]; {available}"
            raise raw.refuse_column(1, f"has depth bins along {name}", remedy)
        inside = np.flatnonzero((centres >= options.bins[0]) & (centres <= options.bins[1]))
        if not inside.size:
            raise options.refuse("bins", "has no bin", f"widen it; {available}")
        parts = [part.isel({name: inside}) for part in parts]
        messages.append(f"average of {inside.size} bins from {_span(centres[inside])}")
    arrays = [part.transpose(dimension, *bins).values.astype(float) for part in parts]
    if len(arrays) == 2:
        arrays.append(np.hypot(*arrays))
    *components, size = (np.mean(array, axis=1) if bins else array for array in arrays)
    velocity = np.stack(components) if components else None
    axes = ("component",) * bool(labelled) + ("bins",) * bool(bins)
    return replace(raw, speed=size, parts=velocity, messages=tuple(messages), axes=axes)


def _chosen_components(labels: list[str], raw: Columns, options: RecordFile) -> list[str]:
    """Return the labels of the requested components, or of the two horizontal ones."""
    available = f"there are {', '.join(labels)}"
    if all(label.isdigit() for label in labels):
        remedy = "rotate it to earth or flow coordinates"
        raise raw.refuse_column(1, "is along the beams of the instrument", remedy)
    if options.component is None:
        if tuple(map(str.lower, labels[:2])) not in _HORIZONTAL:
            problem = "has no two horizontal components at its head"
            raise raw.refuse_column(1, problem, f"give component: {available}")
        return labels[:2]
    wanted = [label.strip() for label in options.component.split(",")]
    if len(wanted) > 2 or not {*wanted} <= {*labels}:
        raise options.refuse("component", "is no component", available)
    return wanted


def _span(centres: np.ndarray) -> str:
    """Return the range of depth bins, as messages have it."""
    return f"{np.min(centres):.4g} to {np.max(centres):.4g} m"
