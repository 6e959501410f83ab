"""Records of NetCDF and Parquet files and of pandas and xarray objects, as MHKiT saves them."""

from __future__ import annotations

import importlib
import importlib.util
import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import (
    MAX_BYTES,
    Columns,
    Name,
    RecordOptions,
    check_length,
    choose,
    in_si,
)
from hkt_mdo.files.table import read_bytes
from hkt_mdo.files.units import SPEEDS, named_unit

__all__ = ["columns_from", "read_netcdf", "read_parquet"]

MAX_VALUES = 50_000_000
"""Largest number of values that are read of a profiler's record: samples times bins times two."""

# Parquet, pandas ----------------------------------------------------------------------------------


def _need(name: str, file: object) -> Any:
    """Return a module of the extra `records`."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise InputError(
            f"needs the package {name.partition('.')[0]}, which is not installed",
            "pip install 'hkt_mdo[records]', or save the record as CSV",
            file=file,
        ) from None


def read_parquet(path: Path, options: RecordOptions) -> Columns:
    """Read two columns of a Parquet file."""
    parquet = _need("pyarrow.parquet", path)
    _need("pandas", path)
    content = read_bytes(path, MAX_BYTES, "record")
    try:
        file = parquet.ParquetFile(io.BytesIO(content))
        rows, empty = file.metadata.num_rows, file.schema_arrow.empty_table().to_pandas()
    except Exception as error:  # whatever a broken file makes the library say
        raise _unreadable("Parquet", error, path) from None
    check_length(rows, str(path))
    wanted = _frame_columns(empty, str(path), options)
    try:
        columns = [name for name in empty.columns if str(name) in wanted]
        frame = file.read(columns=columns, use_pandas_metadata=True).to_pandas()
    except Exception as error:
        raise _unreadable("Parquet", error, path) from None
    return _from_frame(frame, str(path), options)


def _unreadable(kind: str, error: Exception, path: Path) -> InputError:
    reason = re.sub(r"\s+", " ", str(error))[:120] or type(error).__name__
    return InputError(
        f"cannot be read as {kind} ({reason})", "write the file anew, or as CSV", file=path
    )


def _frame_columns(frame: Any, file: str, options: RecordOptions) -> tuple[str, str]:
    """Return the names of the time, which may be the index, and of the speed."""
    names = [str(name) for name in frame.columns]
    default = names[0] if names else None
    if frame.index.nlevels == 1 and (frame.index.name or frame.index.dtype.kind == "M"):
        default = str(frame.index.name or "index")
        names.insert(0, default)
    time, speed = choose(names, default, options, file)
    _check_kind(_frame_column(frame, time), time, "iufM", file)
    _check_kind(_frame_column(frame, speed), speed, "iuf", file)
    return time, speed


def _check_kind(column: Any, name: str, kinds: str, file: str) -> None:
    """Refuse a column whose type is none of NumPy's kinds: i, u, f for numbers, M for dates."""
    if column.dtype.kind not in kinds:
        raise InputError(
            "holds no numbers" + (" and no dates" if "M" in kinds else ""),
            "write it as numbers, or choose another",
            file=file,
            key=Name(name).place,
        )


def _frame_column(frame: Any, name: str) -> Any:
    """Return a column, or the index, as a Series."""
    for number, column in enumerate(frame.columns):
        if str(column) == name:
            return frame.iloc[:, number]
    return frame.index.to_series()


def _from_frame(frame: Any, file: str, options: RecordOptions) -> Columns:
    """Take two columns of a DataFrame."""
    check_length(len(frame), file)
    names = _frame_columns(frame, file, options)
    time, speed = (_frame_column(frame, name) for name in names)
    if hasattr(time.dtype, "tz"):
        time = time.dt.tz_convert(None)
    times = time.to_numpy() if time.dtype.kind == "M" else time.to_numpy(float, na_value=np.nan)
    speeds = speed.to_numpy(dtype=float, na_value=np.nan)
    return _checked(file, times, speeds, (Name(names[0]), Name(names[1])), options)


def _checked(
    file: str,
    time: np.ndarray,
    speed: np.ndarray,
    names: tuple[Name, Name],
    options: RecordOptions,
    messages: tuple[str, ...] = (),
) -> Columns:
    """Return columns in s and m/s of dates or numbers, and speeds that may be missing."""
    infinite = np.flatnonzero(np.isinf(speed))
    if infinite.size:
        raise InputError(
            "must be a finite number",
            "mark missing samples by NaN",
            file=file,
            key=f"row {infinite[0] + 1}, {names[1].place}",
            value=float(speed[infinite[0]]),
        )
    dated = time.dtype.kind == "M"
    since = _since_first(time) if dated else time.astype(float)
    places = names[0].place, names[1].place
    raw = Columns(file, places, since, speed, lambda row: f"row {row + 1}", messages)
    return in_si(raw, names, dated, options)


def _since_first(dates: np.ndarray) -> np.ndarray:
    """Return dates in seconds since the first, NaN where there is none."""
    nanoseconds = dates.astype("datetime64[ns]")
    since = (nanoseconds - nanoseconds[:1]).astype(np.int64) * 1e-9
    return np.where(np.isnat(nanoseconds), np.nan, since)


# NetCDF, xarray -----------------------------------------------------------------------------------


def read_netcdf(path: Path, options: RecordOptions) -> Columns:
    """Read a variable over time of a NetCDF file."""
    xarray = _need("xarray", path)
    head = read_bytes(path, MAX_BYTES, "record")[:8]
    if head.startswith(b"CDF"):
        engine = "scipy"
    elif head.startswith(b"\x89HDF\r\n\x1a\n"):
        engine = "netcdf4" if importlib.util.find_spec("netCDF4") else "h5netcdf"
        if engine == "h5netcdf" and not importlib.util.find_spec("h5netcdf"):
            _need("netCDF4", path)
    else:
        raise InputError("is not NetCDF", "write the file anew, or as CSV", file=path)
    try:
        further = {"mmap": False} if engine == "scipy" else {}
        dataset = xarray.open_dataset(path, engine=engine, decode_timedelta=False, **further)
    except Exception as error:  # whatever a broken file makes the library say
        raise _unreadable("NetCDF", error, path) from None
    with dataset:
        try:
            return _from_dataset(dataset, str(path), options)
        except InputError:
            raise
        except Exception as error:
            raise _unreadable("NetCDF", error, path) from None


def _from_dataset(data: Any, file: str, options: RecordOptions) -> Columns:
    """Take a variable over time of a Dataset: a speed, or a profiler's velocity."""
    lines = [name for name, variable in data.variables.items() if variable.ndim == 1]
    dates = [name for name in lines if name in data.dims and data[name].dtype.kind == "M"]
    usual = [name for name in ("time", "dateTime") if name in lines]
    default = next(iter(usual or (dates if len(dates) == 1 else [])), None)
    chosen = options.time_column or default
    dimension = data[chosen].dims[0] if chosen in lines else None
    names = [str(name) for name, v in data.data_vars.items() if dimension in v.dims]
    names = [name for name in names if name != chosen]
    # what has a unit of speed comes first in a message
    names.sort(key=lambda name: named_unit(str(data[name].attrs.get("units")), SPEEDS) is None)
    time_name, speed_name = choose(
        [*([str(chosen)] if chosen in lines else lines), *names],
        None if default is None else str(default),
        options,
        file,
    )
    time, speed = data[time_name], data[speed_name]
    _check_kind(time, time_name, "iufM", file)
    _check_kind(speed, speed_name, "iuf", file)
    check_length(time.size, file)
    messages: list[str] = []
    values = _profile(speed, dimension, file, options, messages)
    named = (
        Name(time_name, str(time.attrs.get("units", ""))),
        Name(speed_name, str(speed.attrs.get("units", ""))),
    )
    return _checked(file, time.values, values, named, options, tuple(messages))


_HORIZONTAL = {("e", "n"), ("x", "y"), ("u", "v"), ("streamwise", "x-stream")}


def _profile(
    speed: Any, dimension: Any, file: str, options: RecordOptions, messages: list[str]
) -> np.ndarray:
    """Return the speed over time: of the chosen component or horizontal, averaged over bins."""
    key = Name(str(speed.name)).place

    def refuse(problem: str, remedy: str, **where: Any) -> InputError:
        return InputError(problem, remedy, file=file, key=where.pop("key", key), **where)

    others = [name for name in speed.dims if name != dimension]
    labelled = [
        name
        for name in others
        if name in speed.coords and (name == "dir" or speed[name].dtype.kind in "USOT")
    ]
    bins = [name for name in others if name not in labelled]
    if len(labelled) > 1 or len(bins) > 1:
        raise refuse(
            f"has the dimensions {', '.join(map(str, speed.dims))}",
            "give a variable over time, depth bins and components at most",
        )
    parts = [speed]
    if labelled:
        labels = [str(label) for label in speed[labelled[0]].values]
        if all(label.isdigit() for label in labels):
            raise refuse(
                "is along the beams of the instrument", "rotate it to earth or flow coordinates"
            )
        known = f"there are {', '.join(labels)}"
        taken = labels[:2] if options.component is None else [options.component]
        if options.component is None and tuple(map(str.lower, taken)) not in _HORIZONTAL:
            raise refuse("has no two horizontal components at its head", f"give component: {known}")
        if taken[0] not in labels:
            raise refuse("is no component", known, key="component", value=options.component)
        parts = [speed.isel({labelled[0]: labels.index(label)}) for label in taken]
        kind = "component" if options.component else "horizontal speed of"
        messages.append(f"{speed.name}: {kind} {' and '.join(taken)}")
    elif options.component is not None:
        raise refuse(
            "is given for a record without components",
            "leave it out",
            key="component",
            value=options.component,
        )
    if bins:
        parts = _bins(parts, bins[0], refuse, options, messages)
    elif options.bins is not None:
        raise refuse(
            "are given for a record without depth bins",
            "leave them out",
            key="bins",
            value=list(options.bins),
        )
    if sum(part.size for part in parts) > MAX_VALUES:
        raise refuse(f"has more than {MAX_VALUES:,} values to read", "take fewer bins")
    order = [dimension, *bins]
    arrays = [part.transpose(*order).values.astype(float) for part in parts]
    size = arrays[0] if len(arrays) == 1 else np.hypot(*arrays)
    return np.mean(size, axis=1) if bins else size


def _bins(
    parts: list[Any],
    name: Any,
    refuse: Callable[..., InputError],
    options: RecordOptions,
    messages: list[str],
) -> list[Any]:
    """Return the parts with the chosen bins alone."""
    if name not in parts[0].coords or parts[0][name].dtype.kind not in "iuf":
        raise refuse(f"has no distances along {name}", f"give {name} its values in metres")
    centres = parts[0][name].values.astype(float)
    if not centres.size:
        raise refuse(f"has no bin along {name}", "give a record that has some")
    known = f"{centres.size} from {np.min(centres):.4g} to {np.max(centres):.4g} m"
    if options.bins is None:
        raise refuse(
            f"has depth bins along {name}", f"give bins: [lower, upper]; there are {known}"
        )
    lower, upper = options.bins
    taken = np.flatnonzero((centres >= lower) & (centres <= upper))
    if not taken.size:
        raise refuse(
            "has no bin", f"widen it; there are {known}", key="bins", value=list(options.bins)
        )
    messages.append(
        f"average of {taken.size} bins from {np.min(centres[taken]):.4g} to "
        f"{np.max(centres[taken]):.4g} m"
    )
    return [part.isel({name: taken}) for part in parts]


def columns_from(data: Any, options: RecordOptions) -> Columns:
    """Take time and speed from a pandas DataFrame or Series, or an xarray Dataset or DataArray.

    Raises InputError if it is something else, or its columns or units are not plain.
    """
    if hasattr(data, "to_frame") and not hasattr(data, "columns"):  # a Series
        data = data.to_frame(data.name or "speed")
    if hasattr(data, "columns"):
        return _from_frame(data, "", options)
    if hasattr(data, "to_dataset") and not hasattr(data, "data_vars"):  # a DataArray
        data = data.to_dataset(name=data.name or "speed")
    if hasattr(data, "data_vars"):
        return _from_dataset(data, "", options)
    raise InputError(
        "is no record",
        "give a pandas DataFrame or an xarray Dataset",
        value=type(data).__name__,
    )
