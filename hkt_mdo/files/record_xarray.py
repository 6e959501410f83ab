"""Records of NetCDF and Parquet files and of pandas and xarray objects, as MHKiT saves them."""

from __future__ import annotations

import importlib
import importlib.util
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
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


def _need(name: str, file: object) -> Any:
    """Return a module of the extra `records`."""
    try:
        return importlib.import_module(name)
    except ImportError:
        problem = f"needs the package {name.partition('.')[0]}, which is not installed"
        remedy = "pip install 'hkt_mdo[records]', or save the record as CSV"
        raise InputError(problem, remedy, file=file) from None


@contextmanager
def _reading(kind: str, path: Path) -> Iterator[None]:
    """Turn whatever a broken file makes a library raise into an InputError."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        reason = re.sub(r"\s+", " ", str(error))[:120] or type(error).__name__
        problem = f"cannot be read as {kind} ({reason})"
        raise InputError(problem, "write the file anew, or as CSV", file=path) from None


def _check_kind(column: Any, name: str, kinds: str, file: str) -> None:
    """Refuse a column whose type is none of NumPy's kinds: i, u, f for numbers, M for dates."""
    if column.dtype.kind not in kinds:
        problem = "holds no numbers" + (" and no dates" if "M" in kinds else "")
        remedy = "write it as numbers, or choose another"
        raise InputError(problem, remedy, file=file, key=Name(name).place)


def _columns(
    file: str,
    time: np.ndarray,
    speed: np.ndarray,
    names: tuple[Name, Name],
    options: RecordOptions,
    messages: Sequence[str] = (),
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
    if dated:
        dates = time.astype("datetime64[ns]")
        since = (dates - dates[:1]).astype(np.int64) * 1e-9
        time = np.where(np.isnat(dates), np.nan, since)
    places = names[0].place, names[1].place
    raw = Columns(file, places, time, speed, lambda row: f"row {row + 1}", tuple(messages))
    return in_si(raw, names, dated, options)


# Parquet, pandas ----------------------------------------------------------------------------------


def read_parquet(path: Path, options: RecordOptions) -> Columns:
    """Read two columns of a Parquet file."""
    parquet = _need("pyarrow.parquet", path)
    _need("pandas", path)
    content = read_bytes(path, MAX_BYTES, "record")
    with _reading("Parquet", path):
        file = parquet.ParquetFile(io.BytesIO(content))
        check_length(file.metadata.num_rows, str(path))
        empty = file.schema_arrow.empty_table().to_pandas()
        wanted = _frame_columns(empty, str(path), options)
        columns = [name for name in empty.columns if str(name) in wanted]
        frame = file.read(columns=columns, use_pandas_metadata=True).to_pandas()
        return _from_frame(frame, str(path), options)


def _frame_columns(frame: Any, file: str, options: RecordOptions) -> tuple[str, str]:
    """Return the names of the time, which may be the index, and of the speed."""
    names = [str(name) for name in frame.columns]
    default = names[0] if names else None
    if frame.index.nlevels == 1 and (frame.index.name or frame.index.dtype.kind == "M"):
        default = str(frame.index.name or "index")
        names.insert(0, default)
    return choose(names, default, options, file)


def _from_frame(frame: Any, file: str, options: RecordOptions) -> Columns:
    """Take two columns of a DataFrame."""
    check_length(len(frame), file)
    names = _frame_columns(frame, file, options)
    known = {str(name): frame.iloc[:, at] for at, name in enumerate(frame.columns)}
    time, speed = (known[name] if name in known else frame.index.to_series() for name in names)
    _check_kind(time, names[0], "iufM", file)
    _check_kind(speed, names[1], "iuf", file)
    if hasattr(time.dtype, "tz"):
        time = time.dt.tz_convert(None)
    times = time.to_numpy() if time.dtype.kind == "M" else time.to_numpy(float, na_value=np.nan)
    speeds = speed.to_numpy(dtype=float, na_value=np.nan)
    return _columns(file, times, speeds, (Name(names[0]), Name(names[1])), options)


# NetCDF, xarray -----------------------------------------------------------------------------------


def read_netcdf(path: Path, options: RecordOptions) -> Columns:
    """Read a variable over time of a NetCDF file."""
    xarray = _need("xarray", path)
    head = read_bytes(path, MAX_BYTES, "record")[:8]
    further = {}
    if head.startswith(b"CDF"):
        engine, further = "scipy", {"mmap": False}
    elif head.startswith(b"\x89HDF\r\n\x1a\n"):
        engine = "netcdf4" if importlib.util.find_spec("netCDF4") else "h5netcdf"
        if engine == "h5netcdf" and not importlib.util.find_spec("h5netcdf"):
            _need("netCDF4", path)
    else:
        raise InputError("is not NetCDF", "write the file anew, or as CSV", file=path)
    with (
        _reading("NetCDF", path),
        xarray.open_dataset(path, engine=engine, decode_timedelta=False, **further) as dataset,
    ):
        return _from_dataset(dataset, str(path), options)


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
    # messages name the variables with a unit of speed first
    names.sort(key=lambda name: named_unit(str(data[name].attrs.get("units")), SPEEDS) is None)
    names = [*([str(chosen)] if chosen in lines else lines), *names]
    two = choose(names, None if default is None else str(default), options, file)
    time, speed = data[two[0]], data[two[1]]
    _check_kind(time, two[0], "iufM", file)
    _check_kind(speed, two[1], "iuf", file)
    check_length(time.size, file)
    messages: list[str] = []
    speeds = _profile(speed, dimension, file, options, messages)
    units = [str(variable.attrs.get("units", "")) for variable in (time, speed)]
    times = time.values if time.dtype.kind == "M" else time.values.astype(float)
    named = Name(two[0], units[0]), Name(two[1], units[1])
    return _columns(file, times, speeds, named, options, messages)


_HORIZONTAL = {("e", "n"), ("x", "y"), ("u", "v"), ("streamwise", "x-stream")}


@dataclass(frozen=True)
class _Refusals:
    """The errors of a variable, and of an option that does not fit it."""

    file: str
    variable: str
    options: RecordOptions

    def here(self, problem: str, remedy: str) -> InputError:
        return InputError(problem, remedy, file=self.file, key=Name(self.variable).place)

    def option(self, key: str, problem: str, remedy: str) -> InputError:
        return self.options.refuse(key, problem, remedy, self.file)


def _profile(
    speed: Any, dimension: Any, file: str, options: RecordOptions, messages: list[str]
) -> np.ndarray:
    """Return the speed over time: of the chosen component or horizontal, averaged over bins."""
    refuse = _Refusals(file, str(speed.name), options)
    others = [name for name in speed.dims if name != dimension]
    labelled = [
        name
        for name in others
        if name in speed.coords and (name == "dir" or speed[name].dtype.kind in "USOT")
    ]
    bins = [name for name in others if name not in labelled]
    if len(labelled) > 1 or len(bins) > 1:
        remedy = "give a variable over time, depth bins and components at most"
        raise refuse.here(f"has the dimensions {', '.join(map(str, speed.dims))}", remedy)
    parts = [speed]
    if labelled:
        labels = [str(label) for label in speed[labelled[0]].values]
        taken = _components(labels, refuse)
        parts = [speed.isel({labelled[0]: labels.index(label)}) for label in taken]
        kind = "component" if options.component else "horizontal speed of"
        messages.append(f"{speed.name}: {kind} {' and '.join(taken)}")
    elif options.component is not None:
        problem = "is given for a record without components"
        raise refuse.option("component", problem, "leave it out")
    if bins:
        taken_bins, said = _bins(speed, bins[0], refuse)
        parts = [part.isel({bins[0]: taken_bins}) for part in parts]
        messages.append(said)
    elif options.bins is not None:
        problem = "are given for a record without depth bins"
        raise refuse.option("bins", problem, "leave them out")
    if sum(part.size for part in parts) > MAX_VALUES:
        raise refuse.here(f"has more than {MAX_VALUES:,} values to read", "take fewer bins")
    order = [dimension, *bins]
    arrays = [part.transpose(*order).values.astype(float) for part in parts]
    size = arrays[0] if len(arrays) == 1 else np.hypot(*arrays)
    return np.mean(size, axis=1) if bins else size


def _components(labels: list[str], refuse: _Refusals) -> list[str]:
    """Return the labels of the chosen component, or of the two horizontal ones."""
    if all(label.isdigit() for label in labels):
        problem = "is along the beams of the instrument"
        raise refuse.here(problem, "rotate it to earth or flow coordinates")
    known, chosen = f"there are {', '.join(labels)}", refuse.options.component
    if chosen is not None and chosen not in labels:
        raise refuse.option("component", "is no component", known)
    if chosen is None and tuple(map(str.lower, labels[:2])) not in _HORIZONTAL:
        problem = "has no two horizontal components at its head"
        raise refuse.here(problem, f"give component: {known}")
    return labels[:2] if chosen is None else [chosen]


def _bins(speed: Any, name: Any, refuse: _Refusals) -> tuple[np.ndarray, str]:
    """Return the places of the chosen depth bins, and what is to be said of them."""
    if name not in speed.coords or speed[name].dtype.kind not in "iuf":
        raise refuse.here(f"has no distances along {name}", f"give {name} its values in metres")
    centres = speed[name].values.astype(float)
    if not centres.size:
        raise refuse.here(f"has no bin along {name}", "give a record that has some")
    known = f"there are {centres.size} from {np.min(centres):.4g} to {np.max(centres):.4g} m"
    if refuse.options.bins is None:
        remedy = f"give bins: [lower, upper]; {known}"
        raise refuse.here(f"has depth bins along {name}", remedy)
    lower, upper = refuse.options.bins
    taken = np.flatnonzero((centres >= lower) & (centres <= upper))
    if not taken.size:
        raise refuse.option("bins", "has no bin", f"widen it; {known}")
    span = f"{np.min(centres[taken]):.4g} to {np.max(centres[taken]):.4g} m"
    return taken, f"average of {taken.size} bins from {span}"


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
    remedy = "give a pandas DataFrame or an xarray Dataset"
    raise InputError("is no record", remedy, value=type(data).__name__)
