"""Long records and tidal constituents, held to MHKiT's own numbers and to known tides.

tests/data/mhkit has files of MHKiT-Python (examples/data/river, commit 9fa9f9c, BSD 3-clause).
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import rv_histogram, sem

from hkt_mdo.case import load_case
from hkt_mdo.cli import main
from hkt_mdo.dynamics.flows import TidalInflow
from hkt_mdo.dynamics.harmonics import constituents
from hkt_mdo.dynamics.long_record import FlowSamples, RecordResource
from hkt_mdo.dynamics.resource import TidalResource, in_bins
from hkt_mdo.errors import InputError
from hkt_mdo.messages import validated

DATA = Path(__file__).parents[1] / "data" / "mhkit"
DETERMINATION = 0.9971199490337135  # printed by MHKiT's examples/river_example.ipynb
TANANA = {
    "file": str(DATA / "tanana_discharge_data.csv"),
    "speed_column": "Tanana",
    "speed_unit": "m3/s",
    "rating": str(DATA / "tanana_DV_curve.csv"),
    "rating_degree": 2,
}
ENERGY = 5.30  # kWh a year, as printed there
DAY = 86400.0


def test_the_tanana_has_the_rating_curve_and_the_energy_of_mhkit():
    """As its river example computes them: turbine power a polynomial of the velocity."""
    file = str(DATA / "usgs_discharge_TRTS_20090801_20190801_daily.csv")
    record = RecordResource(**TANANA | {"file": file, "speed_column": None, "speed_unit": None})
    discharge, speed, curve = record.rating_curve
    correlation = np.corrcoef(curve(discharge), speed)[0, 1]  # of a fit by least squares
    assert correlation**2 == pytest.approx(DETERMINATION, rel=1e-12)
    speed = record.samples.speed
    assert speed.size == 3653
    turbine = np.genfromtxt(DATA / "tanana_VP_curve.csv", delimiter=",", skip_header=1)
    power = np.polynomial.Polynomial.fit(*turbine.T, 2)
    low, high = turbine[[0, -1], 0]

    def of(v):
        return np.where((v >= low) & (v <= high), power(v), 0.0)

    # MHKiT integrates a histogram of the power, whose first bin counts standstill as some power
    histogram = rv_histogram(np.histogram(of(speed), 100))
    at = np.linspace(0.0, np.max(of(speed)), 1000)
    assert 8.76 * np.trapezoid(at * histogram.pdf(at), at) == pytest.approx(ENERGY, abs=5e-3)
    mean, share = record.occurrence()
    assert share @ of(mean) == pytest.approx(np.mean(of(speed)), rel=0.02)  # at 0.1 m/s
    assert share @ mean**3 == pytest.approx(np.mean(speed**3), rel=1e-12)
    assert "IEC TS 62600-301 asks for 15 points" in " ".join(record.messages)


def test_the_scatter_of_years_is_that_of_their_bootstrap():
    """Of the Tanana's mean cubed speed: means of its ten years, drawn with replacement."""
    file = str(DATA / "usgs_discharge_TRTS_20090801_20190801_daily.csv")
    record = RecordResource(file=file, rating=TANANA["rating"])
    cubes = record.samples.speed**3
    years = [np.mean(part) for part in np.array_split(cubes, 10)]
    drawn = np.random.default_rng(1).choice(years, (9999, 10)).mean(axis=1)
    expected = np.std(drawn, ddof=1) * np.sqrt(10.0 / 9.0) / np.mean(cubes)
    assert record.samples.scatter(cubes) == pytest.approx(expected, rel=0.02)


def test_a_short_record_has_blocks_of_spring_and_neap_or_no_uncertainty(sampled_tide):
    samples, _ = sampled_tide
    assert samples.scatter(samples.speed**2) is None  # 30 days
    blocks = np.random.default_rng(2).normal(5.0, 1.0, 6)
    time = np.arange(6 * 1000) * 14.765 * DAY / 1000
    scatter = FlowSamples(time, np.ones(time.size)).scatter(np.repeat(blocks, 1000))
    assert scatter == pytest.approx(sem(blocks) / np.mean(blocks), rel=1e-12)


def test_the_usgs_file_has_its_days():
    data = json.loads((DATA / "USGS_08313000_Jan2019_daily.json").read_text())
    values = data["value"]["timeSeries"][0]["values"][0]["value"]
    file = str(DATA / "USGS_08313000_Jan2019_daily.json")
    whole = RecordResource(file=file, area=30.0)
    assert whole.scatter({}) == {"record": None}  # a month, which is told
    record = whole.samples
    expected = [0.3048**3 * float(each["value"]) / 30.0 for each in values]
    np.testing.assert_allclose(record.speed, expected, rtol=1e-12)
    np.testing.assert_allclose(np.diff(record.time), DAY)


def test_currents_of_noaa_are_signed_along_their_axis(tmp_path):
    time = np.arange(0, 3 * DAY, 600.0)
    along = 1.2 * np.cos(2.0 * np.pi * time / (12.42 * 3600.0)) + 0.2
    degrees = np.where(along > 0.0, 30.0, 210.0)
    keys = [str(int(1e3 * t) + 1_500_000_000_000) for t in time]
    columns = {
        "s": dict(zip(keys, 100.0 * np.abs(along), strict=True)),
        "d": dict(zip(keys, degrees, strict=True)),
        "metadata": {"id": "x"},
    }
    (tmp_path / "noaa.json").write_text(json.dumps(columns))
    samples = RecordResource(file=str(tmp_path / "noaa.json"), direction_column="d").samples
    np.testing.assert_allclose(samples.speed, along, atol=1e-12)
    assert "principal axis 30.0 deg" in " ".join(samples.messages)


def test_what_does_not_go_with_a_rating_is_refused():
    for keys in ({**TANANA, "area": 40}, {"file": TANANA["file"], "rating_degree": 2}):
        with pytest.raises(InputError, match="does not go with"):
            validated(RecordResource, keys, "resource")


def test_a_direction_is_in_radians_by_its_name(tmp_path):
    rows = "".join(f"{600 * i},1,{0.5 + np.pi * (i > 15)}\n" for i in range(20))
    (tmp_path / "v.csv").write_text(f"time_s,v_m_s,dir_rad\n{rows}")
    keys = {"speed_column": "v_m_s", "direction_column": "dir_rad"}
    samples = RecordResource(file=str(tmp_path / "v.csv"), **keys).samples
    assert "principal axis 28.6 deg" in " ".join(samples.messages)
    assert np.min(samples.speed) == pytest.approx(-1.0)


def test_gaps_are_left_out_and_nonsense_is_refused(tmp_path):
    path = tmp_path / "v.csv"
    rows = [f"{3600 * i},{1.0 + 0.01 * i if i % 5 else ''}" for i in range(50)]
    path.write_text("time_s,speed_m_s\n" + "\n".join(rows))
    record = RecordResource(file=str(path))
    assert record.samples.speed.size == 40
    assert "10 missing" in record.messages[0]
    assert "gaps are 19 % of the time, the longest 60 minutes" in record.messages[0]
    path.write_text("time_s,speed_m_s\n" + "\n".join([*rows, "10,1"]))
    with pytest.raises(InputError, match="give dates with their zone"):
        RecordResource(file=str(path)).messages  # noqa: B018


@pytest.mark.parametrize(
    ("wrong", "value", "words"),
    [
        (slice(None, None, 100), 9.99, "differs from its neighbours like a spike, and 43 more do"),
        (slice(40, 90), 99.0, "is faster than any river"),
        (slice(1000, 2600), 0.0, "begins 11.1 days of exactly 0"),
    ],
)
def test_wrong_samples_of_a_month_are_refused_or_left_out(tmp_path, wrong, value, words):
    time = np.arange(0.0, 30.5 * DAY, 600.0)
    speed = 1.3 + 0.9 * np.sin(2.0 * np.pi * time / (12.42 * 3600.0))
    speed[wrong] = value
    right = np.mean(speed[speed != value] ** 3)
    file = str(tmp_path / "v.csv")
    table = np.column_stack((time, speed))
    np.savetxt(file, table, delimiter=",", header="time_s,speed_m_s", comments="")
    with pytest.raises(InputError, match=words):
        RecordResource(file=file).messages  # noqa: B018
    resource = RecordResource(file=file, spikes="replace")
    assert resource.mean_cube == pytest.approx(right, rel=1e-9)
    assert resource.samples.speed.size == np.sum(speed != value)
    if value < 20.0:
        kept = RecordResource(file=file, spikes="keep")
        assert kept.mean_cube == pytest.approx(np.mean(speed**3), rel=1e-9)
    table = np.column_stack((table, np.where(speed == value, value, 0.0)))  # turns the axis
    np.savetxt(file, table, delimiter=",", header="time_s,u_m_s,v_m_s", comments="")
    keys = {"speed_column": "u_m_s", "second_column": "v_m_s", "spikes": "replace"}
    resource = RecordResource(file=file, **keys)
    assert resource.mean_cube == pytest.approx(right, rel=1e-9)
    assert value < 20.0 or "50 samples above 20 m/s left out" in resource.messages


@pytest.mark.parametrize("form", ["component", "columns"])
def test_two_components_give_the_speed_along_their_axis(tmp_path, form):
    xr = pytest.importorskip("xarray")
    time = np.arange(0, 30_000, 60)
    along = 1.2 * np.cos(2.0 * np.pi * time / 30_000.0) + 0.2
    parts = np.stack((0.6 * along, 0.8 * along))
    units, times = {"units": "m/s"}, {"time": ("time", time, {"units": "s"})}
    if form == "component":
        velocity = (("dir", "time"), parts, units)
        data = xr.Dataset({"vel": velocity}, {**times, "dir": ["E", "N"]})
        keys = {"component": "E,N"}
    else:
        data = xr.Dataset({n: ("time", p, units) for n, p in zip("uv", parts, strict=True)}, times)
        keys = {"speed_column": "u", "second_column": "v"}
    data.to_netcdf(tmp_path / "a.nc")
    samples = RecordResource(file=str(tmp_path / "a.nc"), **keys).samples
    np.testing.assert_allclose(samples.speed, along, atol=1e-12)
    degrees = np.rad2deg(np.arctan2(0.6, 0.8))
    assert f"principal axis {degrees:.1f} deg" in " ".join(samples.messages)


def test_samples_count_by_the_time_of_their_step(tmp_path):
    """Ten days every six minutes, then ten days every hour, in which one sample is missing."""
    time = np.append(np.arange(2400) * 360.0, 864000.0 + np.delete(np.arange(240), 99) * 3600.0)
    table, file = np.column_stack((time, 1.0 + (time >= 864000.0))), str(tmp_path / "v.csv")
    np.savetxt(file, table, delimiter=",", header="time_s,speed_m_s", comments="")
    record = RecordResource(file=file)
    np.testing.assert_allclose(in_bins(*record.occurrence(), 0.1)[1], 0.5, rtol=5e-3)
    assert "gaps are 0.21 % of the time, the longest 60 minutes" in record.messages[0]


@pytest.fixture(scope="module")
def sampled_tide():
    parts = [
        {"name": "M2", "amplitude": 2.0, "phase": 0.5},
        {"name": "S2", "amplitude": 0.6, "phase": 1.0},
        {"name": "K1", "amplitude": 0.3, "phase": 2.0},
    ]
    tide = TidalInflow(mean=0.1, constituents=parts)
    time = np.arange(0.0, 30.0 * DAY, 1200.0)
    return FlowSamples(time, tide.speed_at(time)), tide


def test_constituents_of_a_known_tide_come_back(sampled_tide):
    samples, tide = sampled_tide
    result = constituents(samples, ["M2", "S2", "K1"])
    waves = [(wave.amplitude, wave.phase) for wave in result.flow.constituents]
    np.testing.assert_allclose(waves, [(2.0, 0.5), (0.6, 1.0), (0.3, 2.0)], rtol=1e-6)
    assert result.flow.mean == pytest.approx(0.1, rel=1e-5)
    assert result.explained == pytest.approx(1.0, abs=1e-12)
    later = np.linspace(0.0, 100.0 * DAY, 500)
    again = TidalResource(**result.section)
    assert [part.name for part in again.constituents] == ["M2", "S2", "K1"]
    np.testing.assert_allclose(result.flow.speed_at(later), tide.speed_at(later), atol=1e-5)


def test_a_record_too_short_is_refused_with_the_length_it_needs(sampled_tide):
    """K2 and S2 differ by one cycle in 182.6 days."""
    samples, _ = sampled_tide
    with pytest.raises(InputError, match=r"182\.6 days"):
        constituents(samples, ["M2", "S2", "K2"])
    assert "K2" not in constituents(samples).names
    with pytest.raises(InputError, match="no constituent"):
        constituents(samples, ["M99"])


def test_a_short_record_is_told_in_readable_units(tmp_path, capsys):
    rows = "".join(f"{60 * i},{1.0 + 0.01 * i}\n" for i in range(20))
    (tmp_path / "v.csv").write_text(f"time_s,speed_m_s\n{rows}")
    assert main(["resource", str(tmp_path / "v.csv"), "--out", str(tmp_path / "out")]) == 0
    assert "20 samples over 19 minutes" in capsys.readouterr().out
    assert (tmp_path / "out" / "case.yaml").read_text().startswith("# The record has 19 minutes")


def test_hkt_resource_writes_what_a_case_reads(tmp_path, capsys):
    options = TANANA | {"cut_in": 0.7}
    keys = [f"--set={key}={value}" for key, value in options.items() if key != "file"]
    assert main(["resource", TANANA["file"], "--out", str(tmp_path / "out"), *keys]) == 0
    output = capsys.readouterr().out
    assert "3649 samples over 9.99 years" in output
    assert "by the scatter of blocks of 365.25 days" in output
    case = (tmp_path / "out" / "case.yaml").read_text() + "control: {law: quadratic}\n"
    (tmp_path / "out" / "case.yaml").write_text(case)
    inflow = load_case(tmp_path / "out" / "case.yaml").inflow
    record = RecordResource(**TANANA)
    mean, share = in_bins(*record.occurrence(), record.bin_width)
    assert record.speeds.speed[-1] == np.max(record.samples.speed)
    again, hours = inflow.occurrence()
    assert inflow.cut_in == 0.7
    np.testing.assert_allclose(again, mean, rtol=1e-9)
    np.testing.assert_allclose(hours, share, rtol=1e-8)
    figure = tmp_path / "out" / "resource.png"
    assert figure.stat().st_size > 10_000
    for name in ("resource.csv", "case.yaml"):
        (tmp_path / "out" / name).unlink()  # nothing is left to be replaced but the figure
    assert main(["resource", TANANA["file"], "--out", str(tmp_path / "out"), *keys]) == 2
