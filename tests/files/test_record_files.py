"""Measured records: readers against each other, what is repaired, flaws told."""

import json
import re
import sys
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from hkt_mdo.dynamics import records
from hkt_mdo.dynamics.records import RecordInflow, low_pass, read_record
from hkt_mdo.errors import InputError, install
from hkt_mdo.files import record_table
from tests.conftest import DATA, refused
from tests.files.broken.records import ROWS
from tests.properties import examples

STEP = 0.25
TIME = STEP * np.arange(2400)
NOISE = 0.02 * np.random.default_rng(5).standard_normal(TIME.size)
SLOW = 1.5 + 0.2 * np.sin(0.25 * TIME)
SPEED = SLOW + NOISE
OPTIONS = yaml.safe_load((DATA / "broken" / "record_options.yaml").read_text())


def csv(folder, time=TIME, speed=SPEED, header="time_s,speed_m_s", name="record.csv"):
    """Write two columns of numbers or texts; NaN as an empty cell."""
    rows = [
        f"{t},{v if isinstance(v, str) else '' if np.isnan(v) else repr(float(v))}"
        for t, v in zip(time, speed, strict=True)
    ]
    path = folder / name
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


def says(record, *words):
    """Return whether one of the messages has all words."""
    return any(all(word in message for word in words) for message in record.messages)


# CSV ----------------------------------------------------------------------------------------------


def test_a_record_is_its_samples_low_passed(tmp_path):
    record = read_record(path := csv(tmp_path))
    # half of Nyquist's 2 Hz, by the step of 0.25 s
    assert RecordInflow(file=str(path)).highest_frequency == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_allclose(record.speed, low_pass(SPEED, STEP, 1.0), rtol=1e-12)
    scaled = RecordInflow(file=str(path), scale=1.3)
    np.testing.assert_allclose(scaled.speed_at(TIME), 1.3 * record.speed, rtol=1e-12)
    removed = 100.0 * (1.0 - np.var(record.speed) / np.var(SPEED))
    assert len(record.messages) == 2
    assert says(record, "record.csv: 2400 samples every 0.25 s, mean 1.5")
    assert says(record, f"low-passed at 1 Hz, which removed {removed:.2g} % of the variance")


def test_what_may_stand_in_a_csv_file(tmp_path):
    path = tmp_path / "record.txt"
    rows = [f'"{v:.4f}", calm ,{t * 1000.0:.0f}' for t, v in zip(TIME, SPEED, strict=True)]
    lines = ["# source", "% site", "", 'v [m/s],"note, remark",t [ms]', *rows[:40], "", *rows[40:]]
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join(lines).encode())
    record = read_record(path, time_column="t [ms]", speed_column="v [m/s]")
    np.testing.assert_allclose(record.speed, low_pass(np.round(SPEED, 4), STEP, 1.0), rtol=1e-12)


@pytest.mark.parametrize(
    ("header", "options", "factor"),
    [
        ("time_s,speed_m_s", {}, 1.0),
        ("t [s],v [m/s]", {}, 1.0),
        ("t (s),Velocity (m s-1)", {}, 1.0),
        ("t (s),Velocity (m·s^-1)", {}, 1.0),
        ("seconds,speed_mps", {}, 1.0),
        ("time,speed", {"time_unit": "s", "speed_unit": "m/s"}, 1.0),
        ("time_s,speed_cm_s", {}, 0.01),
        ("time_s,speed mm/s", {}, 0.001),
        ('time_s,"Stream velocity, feet per second"', {}, 0.3048),
        ("time_s,speed_knots", {}, 1852.0 / 3600.0),
        ("time_s,speed", {"speed_unit": "km/h"}, 1.0 / 3.6),
        ("time_s,speed", {"speed_unit": "mph"}, 0.44704),
        ('time_s,"Discharge, cubic feet per second"', {"area": 40.0}, 0.3048**3 / 40.0),
        ("time_s,Q [m³/s]", {"area": 40.0}, 1.0 / 40.0),
        ("time_s,flow", {"speed_unit": "L/s", "area": 40.0}, 0.001 / 40.0),
    ],
)
def test_units_are_converted_and_reported(tmp_path, header, options, factor):
    record = read_record(csv(tmp_path, speed=SPEED / factor, header=header), **options)
    np.testing.assert_allclose(record.speed, low_pass(SPEED, STEP, 1.0), rtol=1e-9)
    assert len(record.messages) == (2 if factor == 1.0 else 3)
    if "area" in options:
        assert says(record, "discharge in", "over the area of 40 m2")
    elif factor != 1.0:
        assert says(record, "speed converted from", f"to m/s, times {factor:.6g}")


@pytest.mark.parametrize(
    ("unit", "seconds"), [("s", 1.0), ("ms", 1e-3), ("min", 60.0), ("h", 3600.0), ("days", 86400.0)]
)
def test_times_in_other_units(tmp_path, unit, seconds):
    first = 738000 * 86400.0 if unit == "s" else 7.0  # since the year 0
    record = read_record(csv(tmp_path, time=(first + TIME) / seconds, header=f"t_{unit},v_m_s"))
    np.testing.assert_allclose(record.time, TIME, atol=1e-6)


@pytest.mark.parametrize(
    "form", ["%Y-%m-%dT%H:%M:%S.%f", "%Y-%m-%d %H:%M:%S.%f+00:00", "%Y-%m-%dT%H:%M:%S.%fZ"]
)
def test_dates(tmp_path, form):
    first = datetime(2024, 2, 28, 23, 58, tzinfo=UTC)  # over midnight, into a leap day
    dates = [(first + timedelta(seconds=t)).strftime(form) for t in TIME.tolist()]
    path = csv(tmp_path, time=dates, header="time,speed_m_s")
    np.testing.assert_allclose(read_record(path).time, TIME, atol=1e-9)
    assert "leave time_unit out" in refused(read_record, path, time_unit="s")


def test_a_clock_that_was_changed_counts_on_if_zones_say_so(tmp_path):
    first, changed = datetime(2024, 10, 27, 2, 50), TIME >= 300.0
    clock = TIME - 3600.0 * changed
    dates = [(first + timedelta(seconds=t)).isoformat() for t in clock.tolist()]
    zones = np.where(changed, "+01:00", "+02:00")
    zoned = [date + zone for date, zone in zip(dates, zones, strict=True)]
    record = read_record(csv(tmp_path, time=zoned, header="time,speed_m_s"))
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    path = csv(tmp_path, time=dates, header="time,speed_m_s")
    assert "if the clock was changed, give dates with their zone" in refused(read_record, path)


# Columns, units and parts that do not fit ---------------------------------------------------------


@pytest.mark.parametrize(("options", "message"), OPTIONS)
def test_options_that_do_not_fit_the_file(tmp_path, options, message):
    assert message in refused(read_record, csv(tmp_path), **options)


def test_a_part_is_taken(tmp_path):
    record = read_record(csv(tmp_path, time=1000.0 + TIME), start=100.0, duration=60.0)
    part = slice(400, 641)
    np.testing.assert_allclose(record.time, TIME[:241], atol=1e-9)
    np.testing.assert_allclose(record.speed, low_pass(SPEED[part], STEP, 1.0), rtol=1e-12)
    assert says(record, "taken from 100 s to 160 s of the record")
    assert read_record(csv(tmp_path), duration=599.75).time.size == TIME.size


# Gaps, spikes, uneven samples ---------------------------------------------------------------------


def test_gaps_are_interpolated_where_allowed(tmp_path):
    cells, rows = SLOW.copy(), np.ones(TIME.size, dtype=bool)
    cells[[100, 300, 301, 302]] = np.nan
    rows[[500, 501]] = False
    path = csv(tmp_path, TIME[rows], cells[rows])
    message = refused(read_record, path)
    assert message.startswith("line 102, column speed_m_s: is at a gap of 0.25 s; give gaps: int")
    record = read_record(path, gaps="interpolate")
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_allclose(record.speed, low_pass(SLOW, STEP, 1.0), atol=1e-3)
    # 6 of 2400
    assert says(record, "3 gaps interpolated, 6 samples (0.25 %), the longest 0.75 s, at t = 25,")
    rows[[502, 503]] = False
    path = csv(tmp_path, TIME[rows], cells[rows])
    message = refused(read_record, path, gaps="interpolate")
    assert "is at a gap of 1 s, and no more than 0.75 s may be interpolated" in message
    assert "give a longest_gap of up to an hour" in message
    longer = read_record(path, gaps="interpolate", longest_gap=1.0)
    np.testing.assert_allclose(longer.speed, low_pass(SLOW, STEP, 1.0), atol=2e-3)


def test_gaps_at_the_ends_are_left_to_start_and_duration(tmp_path):
    cells = SPEED.copy()
    cells[[0, -1]] = np.nan
    path = csv(tmp_path, speed=cells)
    message = refused(read_record, path, gaps="interpolate")
    assert message.startswith("line 2, column speed_m_s: is missing at an end")
    record = read_record(path, gaps="interpolate", start=STEP, duration=599.25)
    assert record.time.size == TIME.size - 2
    assert "leave it out by duration" in refused(read_record, path, gaps="interpolate", start=STEP)


def test_spikes_are_replaced_or_kept(tmp_path):
    speed = SLOW + 0.1 * NOISE
    speed[[400, 900, 901]] = 0.2, 4.0, 4.1
    speed[0] = 3.0
    path = csv(tmp_path, speed=speed)
    message = refused(read_record, path)
    assert message.startswith("line 2, column speed_m_s = '3 m/s': differs from its neighbours")
    assert "and 3 more do; give spikes: replace" in message
    record = read_record(path, spikes="replace")
    assert says(record, "4 spikes replaced (0.17 %), at t = 0, 100, 225, 225.25 s")
    np.testing.assert_allclose(record.speed, SLOW, atol=0.02)
    assert np.max(read_record(path, spikes="keep").speed) > 3.0


def test_a_record_that_needs_several_repairs_is_refused_with_all_of_them(tmp_path):
    time, speed = TIME.copy(), SPEED.copy()
    time[50] += 0.4 * STEP
    speed[[400, 900]] = 4.0, np.nan
    path = csv(tmp_path, time, speed)
    both, also = "gaps: interpolate, uneven: resample", "; the whole record needs "
    assert refused(read_record, path).endswith(f"{also}spikes: replace, {both}")
    assert refused(read_record, path, spikes="keep").endswith(also + both)
    assert also not in refused(read_record, path, spikes="keep", uneven="resample")
    speed[0] = np.nan  # which no option repairs
    assert also not in refused(read_record, csv(tmp_path, time, speed))


def test_uneven_samples_are_resampled_where_allowed(tmp_path):
    time = TIME + 0.3 * STEP * np.sin(np.arange(TIME.size))
    slow = 1.5 + 0.2 * np.sin(0.25 * time)
    path = csv(tmp_path, time, slow)
    assert "give uneven: resample to interpolate at even times" in refused(read_record, path)
    record = read_record(path, uneven="resample")
    assert says(record, f"resampled every {np.median(np.diff(time)):.6g} s")
    expected = 1.5 + 0.2 * np.sin(0.25 * (record.time + time[0]))
    short = int(np.argmin(np.diff(time, n=2)))
    lost = csv(tmp_path, time, np.where(np.arange(TIME.size) == short + 1, np.nan, slow))
    assert "give gaps: interpolate" in refused(read_record, lost, uneven="resample")
    np.testing.assert_allclose(record.speed, expected, atol=2e-4)
    hole = np.delete(np.arange(TIME.size), slice(800, 820))
    path = csv(tmp_path, time[hole], slow[hole])
    assert "is at a gap of " in refused(read_record, path, uneven="resample")


def test_rounded_and_drifting_times_are_even(tmp_path):
    # 30 Hz in hundredths of a second is a sixth of a step off: too much; in thousandths it is not
    time = np.arange(3000) / 30.0
    speed = 1.5 + 0.2 * np.sin(0.25 * time)
    message = refused(read_record, csv(tmp_path, np.round(time, 2), speed))
    assert "off an even spacing of 0.03333" in message
    record = read_record(csv(tmp_path, np.round(time, 3), speed))
    assert record.time[1] == pytest.approx(1.0 / 30.0, rel=1e-5)
    assert says(record, "times taken as even", "% of a step off")
    gap = np.delete(np.arange(3000), [1000, 1001])
    whole = read_record(csv(tmp_path, np.round(time, 3)[gap], speed[gap]), gaps="interpolate")
    assert (whole.time.size, whole.time[1]) == (3000, record.time[1])
    assert says(whole, "1 gap interpolated, 2 samples")


# Other files --------------------------------------------------------------------------------------


def saved(folder, data, **options):
    """Return the record of a pandas or xarray object that is saved as a file."""
    if hasattr(data, "to_parquet"):
        pytest.importorskip("pyarrow")
        data.to_parquet(folder / "a.parquet")
        return read_record(folder / "a.parquet", **options)
    pytest.importorskip("netCDF4")
    data.to_netcdf(folder / "a.nc")
    return read_record(folder / "a.nc", **options)


def usgs():
    """Return data as `mhkit.river.io.usgs.request_usgs_data` does: columns by their description."""
    pd = pytest.importorskip("pandas")
    index = pd.date_range("2019-01-01T07:00:00", periods=TIME.size, freq="15min", name="dateTime")
    columns = {DISCHARGE: SPEED * 60.0 / 0.3048**3, VELOCITY: SPEED / 0.3048}
    return pd.DataFrame(columns, index=index)


DISCHARGE = "Discharge, cubic feet per second"
VELOCITY = "Mean water velocity for discharge computation, feet per second"
SMOOTH = low_pass(SPEED, STEP, 1.0)


@pytest.mark.parametrize(
    "options", [{"speed_column": DISCHARGE, "area": 60.0}, {"speed_column": VELOCITY}]
)
@pytest.mark.parametrize("form", ["frame", "zone", "column", "dataset", "csv"])
def test_usgs_data(tmp_path, form, options):
    data, path = usgs(), tmp_path / "usgs.csv"
    match form:
        case "zone":
            data = data.tz_localize("UTC").tz_convert("America/Denver")
        case "column":
            data = data.reset_index()
        case "dataset":
            pytest.importorskip("xarray")
            data = data.to_xarray()
        case "csv":
            data.to_csv(path)
    record = read_record(path, **options) if path.exists() else saved(tmp_path, data, **options)
    assert record.time[1] == 900.0
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-9)


def test_one_column_needs_no_name(tmp_path):
    data = usgs()
    np.testing.assert_allclose(saved(tmp_path, data[[VELOCITY]]).speed, SMOOTH, rtol=1e-9)
    with pytest.raises(InputError, match="give speed_column: of 'Discharge, cubic feet"):
        saved(tmp_path, data)


def adcp():
    """Return data as `mhkit.dolfyn.read` does: velocity over direction, range and time."""
    xr = pytest.importorskip("xarray")
    shear = np.array([0.8, 0.9, 1.0, 1.1, 1.2])[:, None]
    east, north = 0.6 * shear * SPEED, -0.8 * shear * SPEED
    return xr.Dataset(
        {
            "vel": (("dir", "range", "time"), [east, north, 0 * east], {"units": "m s-1"}),
            "U_mag": (("range", "time"), shear * SPEED, {"units": "m s-1"}),
            "pressure": ("time", SPEED, {"units": "dbar"}),
            "c_sound": ("time", 1500.0 + SPEED, {"units": "m s-1"}),
        },
        {
            "time": np.datetime64("2020-08-15T00:20:00.5", "ns") + (TIME * 1e9).astype("m8[ns]"),
            "range": ("range", [1.0, 2.0, 3.0, 4.0, 5.0], {"units": "m"}),
            "dir": ("dir", ["E", "N", "U"]),
        },
    )


@pytest.mark.parametrize(
    ("options", "factor", "message"),
    [
        ({"speed_column": "vel", "bins": (2.5, 3.5)}, 1.0, "vel: horizontal speed of E and N"),
        ({"speed_column": "vel", "bins": (3.5, 9.0)}, 1.15, "average of 2 bins from 4 to 5 m"),
        ({"speed_column": "vel", "bins": (1.0, 5.0), "component": "E"}, 0.6, "vel: component E"),
        ({"speed_column": "vel", "bins": (2, 4), "component": "N,U"}, 0.8, "vel: speed of N and U"),
        ({"speed_column": "U_mag", "bins": (1.0, 2.0)}, 0.85, "average of 2 bins from 1 to 2 m"),
    ],
)
@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_64BIT"])
def test_profiles(tmp_path, form, options, factor, message):
    pytest.importorskip("netCDF4")
    adcp().to_netcdf(tmp_path / "adcp.nc", format=form)
    record = read_record(tmp_path / "adcp.nc", **options)
    np.testing.assert_allclose(record.speed, factor * SMOOTH, rtol=1e-9)
    np.testing.assert_allclose(record.time, TIME, atol=1e-6)
    assert says(record, message)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "give speed_column: of vel, U_mag, c_sound, pressure"),
        ({"speed_column": "U_mag"}, "has depth bins along range; give bins: [lower, upper]; there"),
        ({"speed_column": "U_mag", "bins": (8.0, 9.0)}, "bins = [8.0, 9.0]: has no bin; widen it"),
        ({"speed_column": "vel", "bins": (1, 2), "component": "W"}, "there are E, N, U"),
        ({"speed_column": "vel", "bins": (1, 2), "component": "N"}, "correct the sign"),
        ({"speed_column": "pressure"}, "column pressure: has no unit that is known"),
        ({"speed_column": "c_sound"}, "is faster than any river"),
        ({"speed_column": "c_sound", "bins": (1, 2)}, "is given for a record without depth bins"),
        ({"speed_column": "c_sound", "component": "E"}, "for a record without components"),
        ({"speed_column": "vel", "time_column": "range"}, "has no distances along time"),
        ({"speed_column": "vel", "time_column": "times"}, "did you mean time?"),
        ({"dir": ["U", "E", "N"]}, "give component: there are U, E, N"),
        (
            {"range": ("range", TIME[:5], {"units": "bin"})},
            "along range in bin; give them in metres",
        ),
        ({"dir": [1, 2, 3]}, "is along the beams of the instrument; rotate it to earth"),
    ],
)
def test_profiles_that_are_not_plain(tmp_path, options, message):
    """Also of components that are not those of the horizontal speed."""
    data = adcp()
    if {"dir", "range"} & {*options}:
        data, options = data.assign_coords(options), {"speed_column": "vel", "bins": (3.0, 3.5)}
    with pytest.raises(InputError, match=re.escape(message)):
        saved(tmp_path, data, **options)


@pytest.mark.parametrize(("unit", "metre"), [("ft below", 1.0 / 0.3048), ("cm", 100.0), ("", 1.0)])
def test_depths_are_in_their_unit(tmp_path, unit, metre):
    data = adcp()
    data["range"] = ("range", metre * data["range"].values, {"units": unit})
    record = saved(tmp_path, data, speed_column="U_mag", bins=(0.99, 2.01))
    np.testing.assert_allclose(record.speed, 0.85 * SMOOTH, rtol=1e-9)


def test_two_components_that_turn_round_are_refused(tmp_path):
    rows = [f"{np.cos(0.02 * t)},{0.3 * np.sin(0.02 * t)}" for t in TIME]
    path = csv(tmp_path, speed=rows, header="time_s,e_m_s,n_m_s")
    both = {"speed_column": "e_m_s", "second_column": "n_m_s"}
    assert "along its mean direction when low-passed" in refused(read_record, path, **both)
    assert read_record(path, **both, duration=70.0).time.size == 281
    one = read_record(path, speed_column="n_m_s", start=10.0, duration=50.0)
    assert says(one, "n_m_s alone is the speed", "give second_column: e_m_s")


@pytest.mark.parametrize("labels", [["streamwise", "x-stream", "vert"], ["X", "Y", "Z"]])
def test_the_horizontal_speed_is_of_horizontal_components(tmp_path, labels):
    data = adcp().assign_coords(dir=labels)
    record = saved(tmp_path, data, speed_column="vel", bins=(3.0, 3.5))
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-9)


def test_times_of_a_netcdf_file_may_be_numbers(tmp_path):
    pytest.importorskip("netCDF4")
    data = adcp()[["pressure"]].assign_coords(time=("time", TIME / 60.0, {"units": "minutes"}))
    data.to_netcdf(tmp_path / "a.nc")
    record = read_record(tmp_path / "a.nc", speed_unit="m/s")
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-12)


def test_a_variable_may_have_a_time_and_a_range_of_its_own(tmp_path):
    pytest.importorskip("netCDF4")
    data = adcp()
    later = data["time"].values + np.timedelta64(7, "s")
    beam = (("range_b5", "time_b5"), np.stack((SPEED, 3.0 * SPEED)), {"units": "m s-1"})
    data = data.assign(vel_b5=beam, when=("time_b5", later))
    data = data.assign_coords(time_b5=later, range_b5=[1.5, 2.5])
    data.to_netcdf(tmp_path / "a.nc")
    record = read_record(tmp_path / "a.nc", speed_column="vel_b5", bins=(1.0, 2.0))
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-9)
    with pytest.raises(InputError, match=r"of vel, U_mag, vel_b5, c_sound, pressure$"):
        read_record(tmp_path / "a.nc")


MILLISECONDS = [1_478_606_640_000 + round(1000 * time) for time in TIME.tolist()]
DATES = [datetime.fromtimestamp(time / 1e3, UTC).isoformat() for time in MILLISECONDS]


def usgs_series(factor, site="1 A RIVER", method="[old]", name="Velocity, feet per second"):
    """Return a series of USGS' answer, of one site and sensor."""
    samples = [
        {"value": str(factor * speed), "dateTime": date, "qualifiers": ["A"]}
        for speed, date in zip(SPEED.tolist(), DATES, strict=True)
    ]
    number, _, label = site.partition(" ")
    methods = [{"methodDescription": method, "methodID": 1}]
    return {
        "sourceInfo": {"siteName": label, "siteCode": [{"value": number}]},
        "variable": {"variableDescription": name, "noDataValue": -999999.0},
        "values": [{"value": samples, "method": methods}],
    }


JSON = {
    "MHKiT": {
        "s": dict(zip(map(str, MILLISECONDS), (100 * SPEED).tolist(), strict=True)),
        "d": dict.fromkeys(map(str, MILLISECONDS), 358),
        "metadata": {"id": "s08010", "lat": "37.9"},
    },
    "unsorted": {
        "s": dict(zip(map(str, MILLISECONDS[::-1]), (100 * SPEED[::-1]).tolist(), strict=True))
    },
    "split": {
        "columns": ["s", "d"],
        "index": DATES,
        "data": [[100 * speed, 358] for speed in SPEED.tolist()],
        "metadata": {},
    },
    "USGS": {"value": {"timeSeries": [usgs_series(100.0, name="s")]}},
}


@pytest.mark.parametrize("form", JSON)
def test_json_of_noaa_and_usgs(put, form):
    path = put("a.json", json.dumps(JSON[form]))
    record = read_record(path, speed_column="s", speed_unit="cm/s")
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-9)
    np.testing.assert_allclose(record.time, TIME, atol=1e-3)
    assert says(record, "rows sorted by time") == (form == "unsorted")


def test_json_with_more_times_than_rows_is_refused(put):
    path = put("a.json", json.dumps(JSON["split"] | {"index": [*DATES, "2030-01-01"]}))
    assert "times and" in refused(read_record, path, speed_column="s", speed_unit="cm/s")
    assert "leave time_column out" in refused(read_record, path, time_column="d")


@pytest.mark.parametrize(("unit", "seconds"), [("s", 1.0), ("us", 1e-6), ("ns", 1e-9)])
def test_json_times_are_in_the_unit_of_a_plausible_year(put, unit, seconds):
    """As pandas' to_json writes them by its option date_unit."""
    times = [round((1_478_606_640 + 60 * row) / seconds) for row in range(TIME.size)]
    path = put("a.json", json.dumps({"v": dict(zip(times, SPEED.tolist(), strict=True))}))
    record = read_record(path, speed_unit="m/s")
    assert record.time[1] == pytest.approx(60.0, rel=1e-6)
    chosen = read_record(path, speed_unit="m/s", time_unit=unit)
    np.testing.assert_allclose(chosen.time, record.time, atol=1e-3)
    times = [60_000 * row for row in range(TIME.size)]  # of no plausible year
    path = put("a.json", json.dumps({"v": dict(zip(times, SPEED.tolist(), strict=True))}))
    with pytest.raises(InputError, match=r"column time: has no unit that is known.*give time_unit"):
        read_record(path, speed_unit="m/s")
    assert read_record(path, speed_unit="m/s", time_unit="ms").time[1] == pytest.approx(60.0)


def test_one_of_several_sensors_or_sites_of_usgs_is_chosen_by_name(put):
    name, first = "Velocity, feet per second", usgs_series(1.0)
    del first["values"][0]["value"][40:]
    first["values"] += usgs_series(2.0, method="[new]")["values"]
    old, new = (f"{name}, site 1 A RIVER, method 1 [{age}]" for age in ("old", "new"))
    path = put("a.json", json.dumps({"value": {"timeSeries": [first]}}))
    assert f"give speed_column: of '{old}', '{new}'" in refused(read_record, path)
    record = read_record(path, speed_column=new)
    np.testing.assert_allclose(record.speed, 2.0 * 0.3048 * SMOOTH, rtol=1e-9)
    first["values"][0]["value"] = []  # the only one with samples needs no name
    path = put("a.json", json.dumps({"value": {"timeSeries": [first]}}))
    record = read_record(path)
    assert record.time.size == TIME.size
    assert says(record, f"{old}: no samples")
    two = [usgs_series(1.0), usgs_series(2.0, "2 A CREEK")]
    put("a.json", json.dumps({"value": {"timeSeries": two}}))
    assert f"'{name}, site 1 A RIVER', '{name}, site 2 A CREEK'" in refused(read_record, path)
    record = read_record(path, speed_column=f"{name}, site 2 A CREEK")
    np.testing.assert_allclose(record.speed, 2.0 * 0.3048 * SMOOTH, rtol=1e-9)


def test_times_and_sizes_of_netcdf_files_of_epic_and_stglib(tmp_path):
    """A Julian day beside milliseconds of the day, also left over beside a time that is known."""
    xr = pytest.importorskip("xarray")
    milliseconds = np.round(1000.0 * TIME).astype(int) + 86_340_000
    day, rest = 2_458_636 + milliseconds // 86_400_000, milliseconds % 86_400_000
    point = ("time", "depth", "lat", "lon"), 100.0 * SPEED[:, None, None, None]
    coordinates = {"depth": [10.0], "lat": [41.0], "lon": [-70.0]}
    data = xr.Dataset({"CS_300": (*point, {"units": "cm/s"})}, coordinates)
    later = {"units": "msec since 0:00 GMT"}
    epic = data.assign(time2=("time", rest, later))
    epic = epic.assign_coords(time=("time", day, {"units": "True Julian Day"}))
    epic.to_netcdf(tmp_path / "a.nc")
    record = read_record(tmp_path / "a.nc", speed_column="CS_300")
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-9)
    np.testing.assert_allclose(record.time, TIME, atol=1e-3)
    dates = np.datetime64("2019-06-01T23:59", "ns") + np.round(1e9 * TIME).astype("m8[ns]")
    left = data.assign(epic_time2=("time", rest, later)).assign_coords(time=dates)
    left.to_netcdf(tmp_path / "b.nc")
    record = read_record(tmp_path / "b.nc", speed_column="CS_300")
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-9)
    with pytest.raises(InputError, match=r"column epic_time2: has no unit .* msec since 0:00 GMT"):
        read_record(tmp_path / "b.nc", speed_column="CS_300", time_column="epic_time2")


def test_two_columns_are_the_components_of_a_speed(tmp_path):
    """Noise of 0.3 m/s in each component adds 0.3²/(2 v²) to the mean speed (Rice), 2.9 %."""
    pd = pytest.importorskip("pandas")
    data = pd.DataFrame({"time_s": TIME, "u [m/s]": -0.6 * SPEED, "v [m/s]": 0.8 * SPEED})
    keys = {"speed_column": "u [m/s]", "second_column": "v [m/s]"}
    record = saved(tmp_path, data, **keys)
    np.testing.assert_allclose(record.speed, SMOOTH, rtol=1e-9)
    assert not says(record, "single pings")
    noise = 0.3 * np.random.default_rng(3).standard_normal((2, TIME.size))
    data.iloc[:, 1:] += noise.T
    record = saved(tmp_path, data, **keys, spikes="keep")
    above = next(text for text in record.messages if "single pings" in text)
    share = float(above.partition(" on average ")[2].partition(" %")[0])
    assert share == pytest.approx(100.0 * np.mean(0.045 / SPEED**2), rel=0.2)


@pytest.mark.parametrize(
    ("name", "package"), [("a.nc", "xarray"), ("a.parquet", "pyarrow"), ("a.parquet", "pandas")]
)
def test_missing_packages_are_reported(tmp_path, monkeypatch, name, package):
    pytest.importorskip("pyarrow.parquet" if package == "pandas" else package)
    (tmp_path / name).write_bytes(b"CDF")
    monkeypatch.setitem(sys.modules, "pyarrow.parquet" if package == "pyarrow" else package, None)
    message = refused(read_record, tmp_path / name)
    assert f"needs the package {package}, which is not installed" in message
    assert f"{install('records')}, or save the record as CSV" in message


# What is refused ----------------------------------------------------------------------------------


def test_limits(tmp_path, monkeypatch):
    path = csv(tmp_path)
    monkeypatch.setattr(record_table, "MAX_RECORD_BYTES", 1024)
    assert "is larger than 0.000976562 MiB" in refused(read_record, path)
    monkeypatch.undo()
    monkeypatch.setattr(records, "MAX_ROWS", 2402)
    gap = csv(tmp_path, np.where(TIME > 300.0, TIME + 1.0, TIME))
    message = refused(read_record, gap, gaps="interpolate", longest_gap=2.0)
    assert "has 2,404 even samples, and 2,402 are the most" in message
    with pytest.raises(InputError, match="does not exist; give the path of a record"):
        read_record(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("time", "line", "problem"),
    [
        (np.append(TIME, 1e308), 2402, "= '1e+308 s since the first': is more than 1e+10 s"),
        (1e307 * np.arange(17), 3, "= '1e+307 s since the first': is more than 1e+10 s"),
        (5e-324 * np.arange(17), 2, "is where steps of 4.94e-324 s begin"),
        (np.append(1e-9 * np.arange(16), 9e9), 2, "is where steps of 1e-09 s begin"),
    ],
)
def test_times_that_no_record_has_are_refused(tmp_path, time, line, problem):
    message = refused(read_record, csv(tmp_path, time, np.full(time.size, 1.5)), uneven="resample")
    assert message.startswith(f"line {line}, column time_s")
    assert problem in message
    assert "time_unit" in message


CELLS = st.sampled_from(
    ["1.5", "0", "-1", "", "nan", "1e5", "1e308", "-1e308", "x", '"', "2024-01-01", "1,2", "#", "٣"]
)


@examples(150)
@example([(39, 0, "1e308")], "interpolate", "replace", "resample")  # overflows over the usual step
@given(
    st.lists(st.tuples(st.integers(0, 40), st.sampled_from([0, 1]), CELLS), max_size=6),
    st.sampled_from(["refuse", "interpolate"]),
    st.sampled_from(["refuse", "replace", "keep"]),
    st.sampled_from(["refuse", "resample"]),
)
def test_any_table_is_a_record_or_an_input_error(tmp_path_factory, changes, gaps, spikes, uneven):
    rows = [row.split(",") for row in ROWS[:40]]
    for row, column, cell in changes:
        if row < len(rows):
            rows[row][column] = cell
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_text("time_s,speed_m_s\n" + "\n".join(map(",".join, rows)), encoding="utf-8")
    try:
        record = read_record(path, gaps=gaps, spikes=spikes, uneven=uneven)
    except InputError:
        return
    assert np.all(record.speed > 0.0)
    assert np.all(np.isfinite(record.speed))
