"""Closed bodies and section coordinates of a result, held to trimesh and OpenCASCADE."""

import io
import re

import numpy as np
import pytest
from scipy.interpolate import BSpline

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import chosen
from hkt_mdo.rotor.following import over_thickness
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.outline import FRACTIONS, Outline
from tests.conftest import CASES
from tests.exports.made import made

FILES = [CASES / "examples" / "files" / f"naca{number}" for number in (4412, 4418, 4424)]
FOUR = ", ".join(f"{{outline: {path}.csv, polar: {path}_polars.csv}}" for path in FILES)
ROTORS = {
    "one outline, coned": "rotor: {cone: 5}",
    "cylinder to section": "rotor: {blade: rm1, set_angle: 3}",
    "stretched": "rotor: {blade: rm1, outline: naca63424, polar: naca63424_Re3e6, cone: -4}",
    "designed thickness": f"""rotor: {{station_count: 12, sections: [{FOUR}]}}
design: {{chord_points: 9, twist_points: 9, thickness_points: 9}}""",
}


def make_design(folder, text, **entries):
    """Return the design of a result: the blade with which a case begins; `entries`: its summary."""
    case = f"name: made\ninflow: sine\ncontrol: quadratic\n{text}\n"
    if "station_count: 12" in text:
        entries["thickness_over_chord"] = np.linspace(0.22, 0.13, 12)
    return made(folder / "result", case, [11.0], **entries).design()


QUICK, *OTHERS = ROTORS


@pytest.fixture(
    scope="module", params=[QUICK, *(pytest.param(each, marks=pytest.mark.slow) for each in OTHERS)]
)
def design(request, tmp_path_factory):
    return make_design(tmp_path_factory.mktemp("solids"), ROTORS[request.param])


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    return make_design(tmp_path_factory.mktemp("paper"), "rotor: {blade: bahaj2007}")


def files(design, name, *options):
    (made,) = chosen([name], [f"{name}.{option}" for option in options])
    return {n: x if isinstance(x, bytes) else x.encode() for n, x in made.files(design).items()}


def mesh(content):
    import trimesh  # 2 s

    return trimesh.load(io.BytesIO(content), file_type="stl")


def expected_outlines(design):
    """Return the outline of each station over its chord, at 101 fractions of it."""
    sides = np.array([each.resampled(FRACTIONS[::2]) for each in design.turbine.outlines])
    if design.blade.thickness is not None:
        thicknesses = [each.thickness for each in design.turbine.outlines]
        sides = over_thickness(thicknesses, sides)(design.blade.thickness)
    sides = np.broadcast_to(sides, (design.blade.r.size, *sides.shape[1:]))
    return [Outline.of_sides(*each) for each in sides]


def slice_at(body, blade, r):
    """Return the polygon (y, x) in which a plane across the first blade's axis cuts a body."""
    sine, cosine = np.sin(blade.cone), np.cos(blade.cone)
    axis, across = np.array([-sine, 0.0, cosine]), np.array([cosine, 0.0, sine])
    (loop,) = body.section(plane_normal=axis, plane_origin=r * axis).discrete
    return Outline(loop[:-1, 1], loop[:-1] @ across)


def volume_of(design):
    """Return the integral of the section area of a blade, m³."""
    mass = mass_and_inertia(design.blade, design.turbine.structure.section_area, 1.0).mass
    return mass / design.blade.blade_count


def principal_angle(outline):
    xx, yy, xy = outline.second_moments
    return 0.5 * np.arctan2(2.0 * xy, yy - xx)


@pytest.mark.parametrize("hub", ["none", "cylinder"])
def test_blade_rotor_and_hub_are_closed_bodies(design, hub):
    made = files(design, "stl", f"hub={hub}", "points=100", "spanwise=40")
    one, rotor = mesh(made["blade.stl"]), mesh(made["rotor.stl"])
    assert one.is_volume
    assert rotor.is_volume
    bodies = rotor.split(only_watertight=False)
    blades = design.blade.blade_count
    assert len(bodies) == blades + (hub == "cylinder")
    assert all(body.is_volume for body in bodies)
    if hub == "none":
        assert rotor.volume == pytest.approx(blades * one.volume, rel=1e-6)
    else:
        radius = design.blade.hub_radius * np.cos(design.blade.cone)
        reach = min(np.min(np.hypot(*body.vertices[:, 1:].T)) for body in bodies[:-1])
        assert reach < radius  # the blades leave no gap
        (length, *width) = bodies[-1].extents
        assert width == pytest.approx([2.0 * radius] * 2, rel=1e-3)
        assert bodies[-1].volume == pytest.approx(np.pi * radius**2 * length, rel=1e-3)


def test_volume_is_the_integral_of_the_section_area(design):
    expected = volume_of(design)
    sharp = mesh(files(design, "stl", "trailing_edge=0")["blade.stl"])
    assert sharp.is_volume
    assert sharp.volume == pytest.approx(expected, rel=1e-3)
    made = files(design, "stl")
    assert expected < mesh(made["blade.stl"]).volume < 1.01 * expected
    (volume,) = re.findall(rb"integral of the outlines along the span: (\S+) m", made["stl.txt"])
    assert float(volume) == pytest.approx(expected, rel=1e-4)


def test_slices_of_the_blade_give_its_chord_and_twist(design):
    blade = design.blade
    body = mesh(files(design, "stl", "trailing_edge=0")["blade.stl"])
    outlines = expected_outlines(design)
    step = 1e-5 * blade.tip_radius  # beyond the rounding of the file: cuts are extrapolated
    for r, chord, twist, outline in zip(blade.r, blade.chord, blade.twist, outlines, strict=True):
        near, far = (slice_at(body, blade, r + each * step) for each in (1.0, 2.0))
        lengths = [np.sqrt(cut.area / outline.area) for cut in (near, far)]
        assert 2.0 * lengths[0] - lengths[1] == pytest.approx(chord, abs=1e-6)
        if outline.thickness < 0.9:  # a circle has no direction
            one, two = (principal_angle(cut) - principal_angle(outline) for cut in (near, far))
            assert np.sin(2.0 * one - two - twist) == pytest.approx(0.0, abs=2e-6)


@pytest.mark.parametrize(("rotation", "sense"), [("clockwise", 1.0), ("anticlockwise", -1.0)])
def test_leading_edges_lead_and_the_lift_drives(paper, rotation, sense):
    body = mesh(files(paper, "stl", f"rotation={rotation}")["rotor.stl"])
    assert body.is_volume
    for n, turn in enumerate(2.0 * np.pi * np.arange(3) / 3):
        axis = np.array([0.0, -np.sin(turn), np.cos(turn)])
        velocity = np.cross([sense, 0.0, 0.0], axis)
        section = body.section(plane_normal=axis, plane_origin=0.3 * axis).discrete
        (loop,) = [each for each in section if abs(np.mean(each @ axis) - 0.3) < 1e-3][:1]
        flat = np.column_stack((loop[:, 0], loop @ velocity))  # along the flow and the motion
        apart = np.linalg.norm(flat[:, None] - flat, axis=2)
        ends = flat[list(np.unravel_index(np.argmax(apart), apart.shape))]
        centroid = np.array(Outline(*flat[:-1].T).centroid)
        leading, trailing = sorted(ends, key=lambda end: np.linalg.norm(end - centroid))
        chord = leading - trailing
        assert chord[1] > 0.0, f"blade {n}"
        assert chord[0] < 0.0  # twisted towards the flow: upstream
        # the suction side, to which the section is cambered, faces downstream and forwards
        off = centroid - np.mean(ends, axis=0)
        assert np.all(off - (off @ chord) * chord / (chord @ chord) > 0.0)


def test_trailing_edge_has_its_thickness(paper):
    def across(option):
        made = files(paper, "sections", f"trailing_edge={option}", "points=100").values()
        rows = [np.loadtxt(io.BytesIO(x), delimiter=",", comments=["#", "x"]) for x in made]
        return [(each[:, 3], each[:51, 4][::-1] - each[50:, 4]) for each in rows]

    for (_, before), (_, after) in zip(across("0"), across("0.4 mm"), strict=True):
        thickest = np.argmax(before)
        assert after[:thickest] == pytest.approx(before[:thickest], abs=1e-9)
        assert after[thickest:] == pytest.approx(np.maximum(before[thickest:], 4e-4), abs=1e-9)
    with pytest.raises(InputError, match="more than half of the section's") as error:
        files(paper, "stl", "trailing_edge=20 mm")
    assert (error.value.key, error.value.value) == ("stl.trailing_edge", "20 mm")


def test_sections_have_the_blade_in_their_comments(design):
    made, blade = files(design, "sections", "stacking=0.4"), design.blade
    assert len(made) == blade.r.size
    for n, content in enumerate(made.values()):
        lines = content.decode().splitlines()
        remarks = [line for line in lines if line.startswith("#")]
        assert lines[0].startswith("# written by hkt_mdo")
        twist, chord = np.rad2deg(blade.twist[n]), blade.chord[n]
        said = f"r = {blade.r[n]:.9g} m, chord = {chord:.9g} m, twist = {twist:.9g} deg"
        assert any(said in line for line in remarks)
        x, y, z, chordwise, across = np.loadtxt(lines[len(remarks) + 1 :], delimiter=",").T
        assert np.ptp(chordwise) == pytest.approx(chord, rel=5e-3)
        assert np.min(chordwise) == pytest.approx(-0.4 * chord, abs=5e-3 * chord)
        turn, cone = blade.twist[n], blade.cone
        axial = chordwise * np.sin(turn) + across * np.cos(turn)
        assert y == pytest.approx(chordwise * np.cos(turn) - across * np.sin(turn), abs=1e-7)
        assert x == pytest.approx(axial * np.cos(cone) - blade.r[n] * np.sin(cone), abs=1e-7)
        assert z == pytest.approx(axial * np.sin(cone) + blade.r[n] * np.cos(cone), abs=1e-7)


def test_files_of_a_failed_run_are_marked(tmp_path):
    failed = make_design(tmp_path, "rotor: {radius: 1}", success=False, message="stalled")
    mark = b"THE RUN WAS NO SUCCESS"
    made = files(failed, "stl", "spanwise=3", "points=20")
    assert mark in made["rotor.stl"][:80]
    for content in (made["stl.txt"], files(failed, "step", "points=20")["rotor.step"]):
        assert mark + b": stalled" in content
    assert all(mark in each for each in files(failed, "sections").values())


def test_polars_without_outlines_are_refused(tmp_path):
    polar = CASES / "examples/files/naca4412_polars.csv"
    blade = tmp_path / "blade.csv"
    blade.write_text("r_m,chord_m,twist_deg\n0.2,0.1,20\n0.5,0.08,8\n0.8,0.06,4\n1,0.05,2\n")
    rotor = f"blade: {blade}, polar: {polar}, radius: 1.05, hub_radius_fraction: 0.1"
    one = make_design(tmp_path / "one", f"rotor: {{{rotor}}}")
    for name in ("stl", "step", "sections"):
        with pytest.raises(InputError, match="stl, step and sections need it") as error:
            files(one, name)
        assert error.value.key == "rotor.outline"
    sections = f"[{FOUR}, {{polar: {polar}, thickness: 0.3}}]"
    design = "design: {chord_points: 9, twist_points: 9, thickness_points: 9}"
    several = make_design(tmp_path / "several", f"rotor: {{sections: {sections}}}\n{design}")
    with pytest.raises(InputError, match="give the outline in the case") as error:
        files(several, "stl")
    assert error.value.key == "rotor.sections[3].outline"


def read_step(content, folder):
    """Return the volumes of the solids that a STEP file holds, m**3; all of it is valid."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    from hkt_mdo.exports.step import solid_volume

    (folder / "read.step").write_bytes(content)
    reader = STEPControl_Reader()
    reader.ReadFile(str(folder / "read.step"))
    reader.TransferRoots()
    shape = reader.OneShape()
    assert BRepCheck_Analyzer(shape).IsValid()
    explorer, volumes = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID), []
    while explorer.More():
        volumes.append(solid_volume(explorer.Current()))
        explorer.Next()
    return volumes


def test_step_has_valid_solids_of_the_same_volume(design, tmp_path):
    made = files(design, "step", "trailing_edge=0.01 mm", "points=40")
    (one,) = read_step(made["blade.step"], tmp_path)
    assert one == pytest.approx(volume_of(design), rel=0.01)
    rotor = read_step(made["rotor.step"], tmp_path)
    assert rotor == pytest.approx([one] * design.blade.blade_count, rel=1e-5)


def test_step_unites_blades_and_hub(paper, tmp_path, capfd):
    made = files(paper, "step", "hub=cylinder", "points=40")
    blade = paper.blade
    (one,) = read_step(made["blade.step"], tmp_path)
    (rotor,) = read_step(made["rotor.step"], tmp_path)
    bodies = mesh(files(paper, "stl", "hub=cylinder")["rotor.stl"]).split(only_watertight=False)
    assert rotor == pytest.approx(bodies[-1].volume + blade.blade_count * one, rel=0.01)
    text = made["rotor.step"].decode("ascii")
    assert "SI_UNIT($,.METRE.)" in text
    for part in ("written by hkt_mdo", "case made", "seen from upstream"):
        assert part in text[: text.index("ENDSEC")]
    assert capfd.readouterr() == ("", "")


def test_loft_goes_through_the_sections(design):
    from hkt_mdo.exports.step import DEGREE, lofted

    (step,) = chosen(["step"])
    r = step.radii(design)
    points = step.stations(design, r)
    poles, (around, along) = lofted(points, r)
    surface = BSpline(along, np.moveaxis(poles, 1, 0), DEGREE)(r)
    assert np.max(np.linalg.norm(points[:, [0, -1]] - surface[:, [0, -1]], axis=-1)) < 1e-9
    fine = BSpline(around, np.moveaxis(surface, 1, 0), DEGREE)(np.linspace(0.0, 1.0, 20001))
    for row, section in zip(np.moveaxis(fine, 1, 0), points, strict=True):
        chord = np.linalg.norm(section[0] - section[section.shape[0] // 2])
        nearest = np.min(np.linalg.norm(section[::10, None] - row, axis=2), axis=1)
        assert np.max(nearest) < 1e-4 * chord
