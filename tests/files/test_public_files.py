"""Files that others made (tests/data/public) are read as they are meant."""

import numpy as np
import pytest
from files_page import FOLDER, MARK, PAGE, READERS, listed, tables

from hkt_mdo.dynamics.records import low_pass, read_record
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.record_table import TIME_UNITS
from hkt_mdo.rotor.outline import Outline


@pytest.mark.slow
def test_the_page_is_what_the_command_writes():
    pytest.importorskip("netCDF4")
    assert PAGE.read_text(encoding="utf-8").partition(MARK)[2] == tables()


def test_every_file_has_a_source_with_a_licence():
    listing = listed()
    entries = [entry for kind in READERS for entry in listing[kind]]
    assert all(listing["sources"][entry["source"]]["licence"] for entry in entries)
    here = {entry["file"] for entry in entries if not entry["file"].startswith("..")}
    files = {path.relative_to(FOLDER).as_posix() for path in FOLDER.glob("*/*.*")}
    assert files - here == {"records/LICENSE_MHKiT.md"}


def test_one_section_in_two_formats_is_one_section():
    """RM1's section by NREL: of AeroDyn 13 with HARP_Opt, of AeroDyn 15 with ROSCO."""
    old = read_polars(FOLDER / "polars" / "harp_opt_NACA6_0240.dat")
    new = read_polars(FOLDER / "polars" / "NACA6_0240.dat")
    assert [table.reynolds for table in old] == [table.reynolds for table in new]
    for one, other in zip(old, new, strict=True):
        for name in ("alpha", "lift", "drag", "smallest_pressure"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_polar_by_xfoil_is_its_columns():
    path = FOLDER / "polars" / "xf-n0012-il-500000-n5.txt"
    (table,) = read_polars(path)
    rows = np.loadtxt(path, skiprows=12)
    for name, column in (("lift", 1), ("drag", 2), ("moment", 4)):
        np.testing.assert_array_equal(getattr(table, name), rows[:, column])
    np.testing.assert_allclose(table.alpha, np.deg2rad(rows[:, 0]), rtol=1e-12)
    assert table.reynolds == 5e5


def test_rm1_is_the_blade_that_is_shipped():
    """WT_Perf's RM1 is shipped, OpenFAST's is here; they differ at the ends (data/README.md)."""
    openfast = read_blade(FOLDER / "blades" / "MHK_RM1_AeroDyn15_Blade.dat")
    ours = read_blade("rm1")
    inner = slice(1, -1)
    np.testing.assert_allclose(1.0 + openfast.r[inner], ours.r[inner], atol=1e-9)
    np.testing.assert_array_equal(openfast.chord[inner], ours.chord[inner])
    np.testing.assert_allclose(openfast.twist[inner], ours.twist[inner], rtol=1e-12)


def test_an_aerodyn_section_has_the_outline_that_it_names():
    table = Outline.from_file(FOLDER / "polars" / "NACA6_0240.dat")
    named = Outline.from_file(FOLDER / "polars" / "NACA6_0240_coords.txt")
    assert table.x.tolist() == named.x.tolist()
    ours = Outline.from_file("naca63424")
    assert named.thickness == pytest.approx(ours.thickness, abs=0.005)
    assert named.area == pytest.approx(ours.area, rel=0.02)
    assert named.centroid == pytest.approx(ours.centroid, abs=0.01)


def test_a_tidal_record_in_milliseconds_is_its_numbers():
    entry = next(entry for entry in listed()["records"] if "s08010" in entry["file"])
    pandas = pytest.importorskip("pandas")
    data = pandas.read_json(FOLDER / entry["file"])["s"].dropna()  # as MHKiT reads it
    data.index = pandas.to_datetime(data.index.astype("int64"), unit="ms")
    part = data.sort_index()
    part = part[part.index >= part.index[0] + pandas.Timedelta("2h")]
    part = part[part.index <= part.index[0] + pandas.Timedelta("21240s")]
    record = read_record(FOLDER / entry["file"], **entry["options"])
    assert record.time[-1] == (part.index[-1] - part.index[0]).total_seconds()
    index = ((part.index - part.index[0]).total_seconds() / record.time[1]).astype(int)
    assert np.max(np.abs(record.speed[index] - part.to_numpy() / 100.0)) < 0.1  # low-passed
    assert np.mean(record.speed) == pytest.approx(np.mean(part) / 100.0, abs=0.02)
    assert TIME_UNITS["min"] * 6 == record.time[1]


def test_a_velocimeter_measures_a_horizontal_speed():
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("netCDF4")
    path = FOLDER / "records" / "vector_data01.nc"
    record = read_record(path, speed_column="vel")
    with xarray.open_dataset(path, decode_timedelta=False) as data:
        speed = np.hypot(*data["vel"].values[:2].astype(float))
    step = record.time[1]
    np.testing.assert_allclose(record.speed, low_pass(speed, step, 0.25 / step), rtol=1e-9)
