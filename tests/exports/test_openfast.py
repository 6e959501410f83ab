"""The rotor in OpenFAST's files: read back by `openfast_io`, and run by the real AeroDyn.

`tests/data/openfast` keeps what AeroDyn 5.0.0 computed from the exported files. AeroDyn's search
for the inflow angle ends where two angles are within 1e-6 rad of each other (a constant of its
source), so that its loads are those of an angle that is wrong by about that: `APART`. At the very
same angle both programs have the same loads to the last digits: `SAME`.
"""

import shutil
import subprocess
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import export
from hkt_mdo.exports.openfast import reynolds_numbers
from hkt_mdo.files.table import parse_number
from hkt_mdo.rotor import bem
from tests.dynamics.aerodyn_runs import DATA, design_of, solution
from tests.exports.made import made

PROGRAM = shutil.which("aerodyn_driver")
NAMES = ("paper", "rm1", pytest.param("river", marks=pytest.mark.slow))
RATIOS = [f"openfast.tip_speed_ratio.{each}" for each in ("lowest=3", "highest=10", "count=8")]
# m/s, at which AeroDyn was run
FLOWS = {"paper": 1.5236273733509285, "rm1": 1.6073333807600794, "river": 1.999876421521097}
APART = 4e-6  # rad, four of the steps with which AeroDyn's search ends
SAME = 1e-10
MOST_SWIRL = 1.0  # tangential induction to which AeroDyn limits what it finds


def rotor_of(design):
    return design.physics.rotor


def columns(path):
    return np.genfromtxt(path, delimiter=",", names=True)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Return the folder of the files of a kept result, written once."""

    @cache
    def of(name):
        out = tmp_path_factory.mktemp(name)
        flow = f"openfast.flow_speed={FLOWS[name]}"
        export(solution(name), ["openfast"], out, options=(*RATIOS, flow))
        return out / "openfast"

    return of


def points(name, kept):
    """Yield the operating points of a kept output of AeroDyn in both programs.

    angle (rad) and loads over 0.5 rho V² (m, normal and tangential, at the stations) are AeroDyn's,
    own_angle and own_loads this program's, and at_angle its loads at AeroDyn's angle. apart (rad)
    is how far that angle is from the root of this program's residual there; where limited, AeroDyn
    limits the tangential induction, and so the loads.
    """
    design = design_of(name)
    blade, rotor = design.blade, rotor_of(design)
    flow = FLOWS[name]
    pressure = 0.5 * design.physics.density * flow**2
    for ratio in np.unique(np.round(kept["tip_speed_ratio"], 9)):
        rows = kept[np.isclose(kept["tip_speed_ratio"], ratio)][1:-1]  # without hub and tip
        loads = np.array([rows["normal_load_N_m"], rows["tangential_load_N_m"]]) / pressure
        angle = np.deg2rad(rows["phi_deg"])
        sections, polars = bem.sections(blade, rotor.polar, [ratio]), rotor.polar.stations(blade)
        at, apart = [], []
        for j, phi in enumerate(angle):
            station = (blade.chord[j], blade.twist[j], blade.r[j], blade.hub_radius)
            station += (blade.tip_radius, blade.blade_count, polars[j][0].coefficients)
            (s, c, by_s, by_c), (tangential, normal, *_), _ = bem._terms(phi, *station)
            local = ratio * blade.r[j] / blade.tip_radius
            apart.append((s - c / local) / (by_s - by_c / local))
            # by the relative speed that AeroDyn has there
            speed = rows["relative_speed_m_s"][j] / flow
            at.append(np.array([normal, tangential]) * blade.chord[j] * speed**2)
        yield SimpleNamespace(
            ratio=ratio,
            angle=angle,
            loads=loads,
            own_angle=sections.inflow_angle[0],
            own_loads=np.array([sections.normal_load[0], sections.tangential_load[0]]),
            at_angle=np.array(at).T,
            apart=np.array(apart),
            limited=sections.tangential_induction[0] > MOST_SWIRL,
        )


def check(name, kept, rotor):
    """Hold this program's direct BEM to an output of AeroDyn."""
    design = design_of(name)
    for point, row in zip(points(name, kept), rotor, strict=True):
        size = np.linalg.norm(point.loads, axis=0)
        assert np.max(np.abs(point.loads - point.at_angle) / size) < SAME
        same = ~point.limited
        assert np.count_nonzero(point.limited) == ((name, point.ratio) == ("river", 3.0))
        assert np.max(np.abs(point.apart[same])) < APART
        assert np.max(np.abs(point.angle - point.own_angle)[same]) < APART
        largest = np.max(np.linalg.norm(point.own_loads, axis=0))
        assert np.max(np.abs(point.loads - point.own_loads)[:, same]) < 1e-5 * largest
        assert np.quantile(np.rad2deg(np.abs(point.angle - point.own_angle))[same], 0.9) < 1e-4
        # the sum over the span: AeroDyn's is exact for linear loads, this program's by trapezoids
        blade = design.blade
        coefficients = rotor_of(design).coefficients(blade, [point.ratio])
        assert row["power_coefficient"] == pytest.approx(_by_linear_loads(blade, point), abs=1e-9)
        trapezoids = point.ratio * bem.torque_weights(blade) @ point.loads[1]
        if same.all():
            assert trapezoids == pytest.approx(coefficients.power[0], abs=1e-6)


def _by_linear_loads(blade, point):
    """Return the power coefficient of loads that are linear between the stations, exactly."""
    r, load = blade.edges, np.concatenate(([0.0], point.loads[1], [0.0]))
    inner = load[:-1] * (2.0 * r[:-1] + r[1:]) + load[1:] * (r[:-1] + 2.0 * r[1:])
    moment = blade.blade_count * np.sum(np.diff(r) / 6.0 * inner)
    return point.ratio * moment / (np.pi * blade.tip_radius**3)


@pytest.mark.parametrize("name", NAMES)
def test_kept_output_of_aerodyn_has_the_loads_of_direct_bem(name):
    kept, rotor = (columns(DATA / name / "aerodyn" / f"{part}.csv") for part in ("loads", "rotor"))
    check(name, kept, rotor)


@pytest.mark.parametrize("name", NAMES)
def test_exported_input_is_what_aerodyn_was_given(exported, name):
    """Line by line, numbers to nine digits; the second line says from where it comes."""
    folders = exported(name), DATA / name / "aerodyn"
    for file in ("aerodyn_driver.dvr", "aerodyn.dat", "aerodyn_blade.dat"):
        lines, kept = ((folder / file).read_text().splitlines() for folder in folders)
        assert len(lines) == len(kept)
        for index, (one, other) in enumerate(zip(lines, kept, strict=True)):
            if index == 1:
                continue
            for word, expected in zip(one.split(), other.split(), strict=True):
                number = parse_number(word)
                same = word if number is None else pytest.approx(number, rel=1e-9)
                assert (expected if number is None else parse_number(expected)) == same


@pytest.mark.parametrize("name", NAMES)
def test_openfast_io_reads_the_rotor_back(exported, name):
    folder, design = exported(name), design_of(name)
    blade, data = design.blade, read_back(folder)
    rows = {key: np.array(each) for key, each in data["AeroDynBlade"].items() if key != "NumBlNds"}
    inner = slice(1, -1)
    np.testing.assert_allclose(rows["BlSpn"][inner] + blade.hub_radius, blade.r, rtol=1e-9)
    np.testing.assert_allclose(rows["BlChord"][inner], blade.chord, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(rows["BlTwist"][inner], np.rad2deg(blade.twist), atol=1e-6)
    assert rows["BlSpn"][0] == 0.0
    assert rows["BlSpn"][-1] == pytest.approx(blade.tip_radius - blade.hub_radius, rel=1e-12)
    aerodyn, elastic = data["AeroDyn"], data["ElastoDyn"]
    assert (aerodyn["BEM_Mod"], aerodyn["UA_Mod"], aerodyn["DBEMT_Mod"]) == (1, 0, 0)
    angles = np.deg2rad(np.linspace(-10.0, 20.0, 121))  # knots: every quarter of a degree
    for station, number in enumerate(rows["BlAFID"][inner].astype(int)):
        (table,) = aerodyn["af_data"][number - 1]
        polar = rotor_of(design).polar.stations(blade)[station][0]
        read = [np.interp(np.rad2deg(angles), table["Alpha"], table[each]) for each in ("Cl", "Cd")]
        np.testing.assert_allclose(read, polar.evaluate(angles), atol=1e-12)
        lowest = -np.max(polar.suction_at(angles)[0], axis=0)
        pressure = np.interp(np.rad2deg(angles), table["Alpha"], table["Cpmin"])
        np.testing.assert_allclose(pressure, lowest, atol=1e-12)
    for end in (0, -1):  # no load at hub and tip
        (table,) = aerodyn["af_data"][int(rows["BlAFID"][end]) - 1]
        assert not np.any([table["Cl"], table["Cd"]])
    assert elastic["NumBl"] == blade.blade_count
    assert (elastic["TipRad"], elastic["HubRad"]) == (blade.tip_radius, blade.hub_radius)
    assert elastic["GenDOF"]
    assert not elastic["FlapDOF1"]
    assert not elastic["PtfmSgDOF"]
    assert inertia(data) == pytest.approx(design.inertia, rel=1e-5)


def read_back(folder):
    """Return what `openfast_io` reads of the exported files."""
    from openfast_io.FAST_reader import InputReader_OpenFAST  # 12 s

    reader = InputReader_OpenFAST()
    reader.FAST_directory = str(folder)
    reader.fst_vt["Fst"] |= {"AeroFile": "aerodyn.dat", "AeroFile_path": ""}
    reader.read_ElastoDyn(str(folder / "elastodyn.dat"))
    reader.read_ElastoDynBlade(str(folder / "elastodyn_blade.dat"))
    reader.read_ElastoDynTower(str(folder / "elastodyn_tower.dat"))
    reader.read_AeroDyn()
    return reader.fst_vt


def inertia(data):
    """Return the inertia about the axis of what ElastoDyn is told, kg m²; no cone."""
    rows, whole = data["ElastoDynBlade"][0], data["ElastoDyn"]
    share, mass = np.array(rows["BlFract"]), np.array(rows["BMassDen"])
    r = whole["HubRad"] + share * (whole["TipRad"] - whole["HubRad"])
    middle = 0.5 * (mass[1:] + mass[:-1]) * (0.5 * (r[1:] + r[:-1])) ** 2
    ends = mass * r**2  # Simpson's rule is exact for what is linear times r²
    blade = np.sum(np.diff(r) / 6.0 * (ends[1:] + ends[:-1] + 4.0 * middle))
    return whole["NumBl"] * blade + whole["HubIner"]


def test_mhk_2_and_a_given_depth_count_heights_from_the_surface(tmp_path):
    options = [*RATIOS, "openfast.mhk=2", "openfast.water_depth=20 m", "openfast.hub_volume=0.2"]
    export(solution("river"), ["openfast"], tmp_path, options=options)
    driver = (tmp_path / "openfast" / "aerodyn_driver.dvr").read_text()
    values = {line.split()[1]: line.split()[0] for line in driver.splitlines() if line.split()[1:]}
    assert (values["MHK"], values["HubHt(1)"], values["WtrDpth"]) == ("2", "-3.2", "20.0")
    (depth,) = [line for line in driver.splitlines() if "WtrDpth" in line]
    assert "FILL IN" not in depth
    rows = (tmp_path / "openfast" / "aerodyn_blade.dat").read_text().splitlines()[6:]
    table = np.array([row.split() for row in rows], dtype=float)
    outlines = design_of("river").turbine.outlines
    areas = [outline.area * 4.0 / np.pi for outline in outlines]  # over that of a circle
    np.testing.assert_allclose(table[1:-1, 8], areas, rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "key"),
    [
        (["openfast.water_depth=3 m"], "openfast.water_depth"),
        (["openfast.tip_speed_ratio.lowest=12", *RATIOS[1:]], "openfast.tip_speed_ratio.highest"),
        (["openfast.mhk=3"], "openfast.mhk"),
        (["openfast.tip_speed_ratio.count=0"], "openfast.tip_speed_ratio.count"),
    ],
)
def test_bad_options_are_reported_with_their_key(tmp_path, options, key):
    with pytest.raises(InputError) as caught:
        export(solution("paper"), ["openfast"], tmp_path / "out", options=options)
    assert caught.value.key == key
    assert not (tmp_path / "out").exists()


def test_the_reynolds_number_is_that_of_the_only_polar_that_says_one(tmp_path):
    text = "alpha_deg,cl,cd\n" + "".join(f"{n},{0.1 * n:g},0.01\n" for n in range(-6, 16))
    (tmp_path / "none.csv").write_text(text)
    thick = {"polar": str(tmp_path / "none.csv"), "thickness": 0.2}
    sections = [{"polar": "naca4415_Re1e6", "outline": "naca4415"}, thick]
    case = f"inflow: sine\ncontrol: quadratic\nrotor: {{blade: rm1, sections: {sections}}}\n"
    assert reynolds_numbers(made(tmp_path / "result", case, [1e4]).design()) == [1e6]


def test_more_blades_than_elastodyn_takes_are_refused(tmp_path):
    text = "inflow: sine\ncontrol: quadratic\nrotor: {blade_count: 4}\n"
    with pytest.raises(InputError, match="takes 3 blades, and the rotor has 4"):
        export(made(tmp_path / "result", text, [11.0]), ["openfast"], tmp_path / "out")


@pytest.mark.slow
@pytest.mark.skipif(not PROGRAM, reason="aerodyn_driver is not on PATH (docs/exports.md)")
@pytest.mark.parametrize("name", NAMES)
def test_aerodyn_itself_has_the_loads_of_direct_bem(exported, name, tmp_path):
    folder = tmp_path / name
    shutil.copytree(exported(name), folder)
    command = [PROGRAM, "aerodyn_driver.dvr"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=120)
    loads, rotor = [], []
    for number in range(1, 9):
        row = _last_row(folder / f"aerodyn_driver.{number}.out")
        rotor.append((row["RtTSR"], row["RtFldCp"]))
        for node in range(1, design_of(name).blade.r.size + 3):
            keys = (f"AB1N{node:03d}{each}" for each in ("Phi", "VRel", "Fx", "Fy"))
            loads.append((row["RtTSR"], *map(row.__getitem__, keys)))
    names = ["tip_speed_ratio", "phi_deg", "relative_speed_m_s"]
    names += ["normal_load_N_m", "tangential_load_N_m"]
    kept = np.array(loads, dtype=[(each, float) for each in names])
    check(name, kept, np.array(rotor, dtype=[(names[0], float), ("power_coefficient", float)]))


def _last_row(path):
    """Return the last row of an output of AeroDyn's driver by its channels."""
    lines = path.read_text().splitlines()
    names = next(line.split() for line in lines if line.split()[:1] == ["Time"])
    return dict(zip(names, map(float, lines[-1].split()), strict=True))
