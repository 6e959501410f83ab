"""One blade as CSV, AeroDyn 15 blade file and windIO turbine: one power curve, also by WISDEM."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.polar_table import polar_table
from hkt_mdo.files.table import array_columns, csv_text
from hkt_mdo.rotor import bem, ccblade
from hkt_mdo.rotor.airfoil import Polar, PolarFamily
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import ByStation

TIP, HUB, BLADES = 1.4, 0.175, 3
TIP_SPEED_RATIOS = np.linspace(2.0, 9.0, 15)
REYNOLDS = 5e5

# Sections root to tip: thickness and shipped polar. WISDEM wants two thicknesses at least.
ROTORS = {
    "one polar": {"inner": (0.18, "naca63815_Re5e5"), "outer": (0.15, "naca63815_Re5e5")},
    "three sections": {
        "root": (0.20, "naca63815_Re5e5"),
        "middle": (0.17, "naca63815_Re1e6"),
        "tip": (0.15, "naca63815_Re2e6"),
    },
}


def full_circle(name):
    """Return angle (deg), lift and drag of a shipped polar, Viterna's extension written out."""
    alpha = np.r_[-180.0:-30.0:5.0, -30.0:30.0:0.5, 30.0:181.0:5.0]
    lift, drag = PolarFamily.from_file(name).polars[0].evaluate(np.deg2rad(alpha))
    lift[-1], drag[-1] = lift[0], drag[0]
    return alpha, lift, drag


class Source:
    """The arrays that every file is written from: smooth, and close rows where the load falls."""

    def __init__(self, sections, n_rows=101):
        self.sections = sections
        self.s = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, n_rows)))
        self.s[-1] = 1.0
        self.span = self.s * (TIP - HUB)
        self.r = HUB + self.span
        x = self.r / TIP
        self.chord = 0.21 * (1.0 - 0.9 * x + 0.3 * x**2)
        self.twist = np.deg2rad(32.0 * np.exp(-2.6 * x) + 1.0)
        self.names = list(sections)
        self.polars = {name: full_circle(polar) for name, (_, polar) in sections.items()}
        self.number = np.minimum((self.s * len(sections)).astype(int), len(sections) - 1)
        self.section = [self.names[number] for number in self.number]
        self.thickness = np.array([sections[name][0] for name in self.section])

    def csv(self, path):
        names = "r_m", "chord_m", "twist_rad", "thickness_over_chord", "section"
        columns = self.r, self.chord, self.twist, self.thickness, self.section
        path.write_text(csv_text(names, zip(*columns, strict=True), ["The same blade"]))

    def aerodyn(self, path):
        columns = self.span, np.rad2deg(self.twist), self.chord, self.number + 1
        rows = "\n".join(
            f"{span!r} 0 0 0 {twist!r} {chord!r} {number}"
            for span, twist, chord, number in zip(*(x.tolist() for x in columns), strict=True)
        )
        path.write_text(
            "------- AERODYN v15.00.* BLADE DEFINITION INPUT FILE -------\nThe same blade\n"
            "======  Blade Properties ======\n"
            f"{self.r.size} NumBlNds - Number of blade nodes used in the analysis (-)\n"
            "BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID\n"
            f"(m) (m) (m) (deg) (deg) (m) (-)\n{rows}\n",
            encoding="utf-8",
        )

    def windio(self, path, version):
        """Write windIO; version 2 with all that WISDEM's schema of a blade asks for."""

        def along(values, grid=self.s):
            return {"grid": list(map(float, grid)), "values": list(map(float, values))}

        ends = np.flatnonzero(np.diff(self.number))
        rows = np.unique(np.concatenate(([0], ends, ends + 1, [self.r.size - 1])))
        labels = [self.section[row] for row in rows]
        lengths = {"x": 0.0, "y": 0.0, "z": TIP - HUB}
        axis = {name: along([0.0, length], [0.0, 1.0]) for name, length in lengths.items()}
        shape = {"chord": along(self.chord), "rthick": along(self.thickness)}
        airfoils = [self.airfoil(name, version) for name in self.names]
        hub = {"diameter": 2.0 * HUB, "cone_angle": 0.0, "cd": 0.5}
        if version == 1:
            shape |= {"twist": along(self.twist), "reference_axis": axis}
            shape["airfoil_position"] = {"grid": self.s[rows].tolist(), "labels": labels}
            blade = {"outer_shape_bem": shape}
        else:
            shape |= {"twist": along(np.rad2deg(self.twist))}
            shape |= {"section_offset_y": along(0.3 * self.chord)}
            clean = {"configuration": ["clean"], "weight": [1.0]}
            shape["airfoils"] = [
                {"name": name, "spanwise_position": float(s)} | clean
                for name, s in zip(labels, self.s[rows], strict=True)
            ]
            nothing = {"anchors": [], "layers": [], "webs": []}
            blade = {"reference_axis": axis, "outer_shape": shape, "structure": nothing}
        turbine = {
            "windIO_version": f"{version}.0",
            "name": "The same blade",
            "assembly": {"number_of_blades": BLADES, "rotor_diameter": 2.0 * TIP},
            "components": {"blade": blade, "hub": hub},
            "airfoils": airfoils,
            "materials": [],
        }
        path.write_text(yaml.safe_dump(turbine), encoding="utf-8")

    def airfoil(self, name, version):
        thickness, _ = self.sections[name]
        alpha, lift, drag = self.polars[name]
        grid = alpha.tolist() if version == 2 else np.deg2rad(alpha).tolist()
        tables = {"l": lift, "d": drag, "m": np.zeros(alpha.size)}
        turn = np.linspace(0.0, 2.0 * np.pi, 81)
        x, y = 0.5 * (1.0 + np.cos(turn)), 0.5 * thickness * np.sin(turn)
        coordinates = {"x": x.tolist(), "y": y.tolist()}
        prefix, thick = ("c_", "relative_thickness") if version == 1 else ("c", "rthick")
        polar = {prefix + key: {"grid": grid, "values": v.tolist()} for key, v in tables.items()}
        polar["re"] = REYNOLDS
        polars = {"configuration": "clean"} | (polar if version == 1 else {"re_sets": [polar]})
        entry = {"name": name, "aerodynamic_center": 0.25, thick: thickness}
        return entry | {"coordinates": coordinates, "polars": [polars]}

    def polar_of(self, name):
        alpha, lift, drag = self.polars[name]
        return Polar.from_polar_table(polar_table(array_columns(alpha_deg=alpha, cl=lift, cd=drag)))


@pytest.fixture(scope="module", params=ROTORS)
def source(request):
    return Source(ROTORS[request.param])


def rotor(table, polar_of):
    """Return blade and polars at the rows between hub and tip of a file."""
    r = table.interior(HUB)
    blends, keep = table.blend(r), np.isin(table.r, r)
    polars = {name: polar_of(name) for name in {n for pair in blends for n in pair[:2]}}
    sections = [
        polars[inner] if share == 0.0 else polars[outer] if share == 1.0 else None
        for inner, outer, share in blends
    ]
    assert None not in sections  # rows lie in one section each
    return Blade(r, table.chord[keep], table.twist[keep], HUB, TIP, BLADES), ByStation.of(sections)


@pytest.fixture(scope="module")
def read(source, tmp_path_factory):
    """Return {format: (blade, polars)} as read from the files, and the folder of the files."""
    folder = tmp_path_factory.mktemp("same")
    source.csv(folder / "blade.csv")
    source.aerodyn(folder / "blade.dat")
    source.windio(folder / "version1.yaml", 1)
    source.windio(folder / "version2.yaml", 2)
    table = read_blade(folder / "blade.dat")  # from the root
    table = replace(table, r=table.r + HUB, tip_radius=table.tip_radius + HUB)
    rotors = {
        "csv": rotor(read_blade(folder / "blade.csv").scaled(TIP), source.polar_of),
        "aerodyn": rotor(table, lambda n: source.polar_of(source.names[int(n) - 1])),
    }
    for version in (1, 2):
        table = read_blade(folder / f"version{version}.yaml")
        assert table.tip_radius == pytest.approx(TIP, rel=1e-15)
        assert (table.hub_radius, table.blade_count, table.cone) == (HUB, BLADES, 0.0)
        held = {section.name: section for section in table.sections}
        thickness = {name: each.thickness for name, each in held.items()}
        assert thickness == {name: each for name, (each, _) in source.sections.items()}
        rotors[f"windIO {version}"] = rotor(
            table, lambda name, held=held: Polar.from_polar_table(held[name].polars[0])
        )
    return rotors, folder


def power(blade, polars):
    return bem.rotor_coefficients(blade, polars, TIP_SPEED_RATIOS).power


def test_every_format_gives_one_power_curve(read, source):
    rotors, _ = read
    inner = slice(1, -1)
    direct = Blade(source.r[inner], source.chord[inner], source.twist[inner], HUB, TIP, BLADES)
    polars = {name: source.polar_of(name) for name in source.names}
    sections = [polars[source.names[number]] for number in source.number[inner]]
    expected = power(direct, ByStation.of(sections))
    assert 0.35 < expected.max() < 0.5926
    for name, (blade, sections) in rotors.items():
        assert blade.r.size == source.r.size - 2, name
        np.testing.assert_allclose(power(blade, sections), expected, rtol=1e-10, err_msg=name)


def test_ccblade_agrees_on_the_same_arrays(read):
    pytest.importorskip("wisdem")
    rotors, _ = read
    for blade, sections in rotors.values():
        theirs = ccblade.rotor_coefficients(blade, sections, TIP_SPEED_RATIOS).power
        np.testing.assert_allclose(power(blade, sections), theirs, rtol=1e-6)


N_SPAN = 400


def wisdem_blade(path):
    """Return r, chord, twist (deg), angles of attack (deg), lift and drag as WISDEM reads them.

    Its own schema, its own even grid along the span, PCHIP for chord, twist and thickness, and
    polars blended over the thickness by PCHIP (`wisdem.glue_code`).
    """
    import openmdao.api as om
    from wisdem.glue_code.gc_WT_DataStruc import Blade_Interp_Airfoils
    from wisdem.glue_code.gc_WT_InitModel import assign_airfoil_values, assign_outer_shape_values
    from wisdem.inputs import load_geometry_yaml

    turbine = load_geometry_yaml(str(path))
    shape = turbine["components"]["blade"]["outer_shape"]
    names = [airfoil["name"] for airfoil in shape["airfoils"]]
    # gc_LoadInputs: half of the angles within 30 degrees
    parts = np.linspace(-180, -30, 51), np.linspace(-30, 30, 100), np.linspace(30, 180, 51)
    aoa = np.unique(np.concatenate(parts))
    options = {
        "n_span": N_SPAN,
        "nd_span": np.linspace(0.0, 1.0, N_SPAN),
        "n_af_master": len(names),
        "af_master": names,
        "n_af_database": len(turbine["airfoils"]),
        "n_aoa": aoa.size,
        "aoa": aoa,
        "n_Re": 1,
        "Re": np.array([REYNOLDS]),
        "n_xy": 100,
    }
    modeling = {"WISDEM": {"RotorSE": options}}
    places = "blade.outer_shape.af_position", "blade.opt_var.af_position"
    values = {name: np.zeros(len(names)) for name in places}
    assign_outer_shape_values(values, modeling, {"af_positions": {"flag": False}}, shape)
    assign_airfoil_values(values, modeling, shape["airfoils"], turbine["airfoils"])
    sections = Blade_Interp_Airfoils(rotorse_options=options)
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("sections", sections, promotes=["*"])
    problem.setup()
    for name in ("cl", "cd", "cm", "aoa", "ac", "coord_xy", "rthick_master"):
        problem[name] = values[f"airfoils.{name}"]
    for name in ("af_position", "s", "rthick_yaml"):
        problem[name] = values[f"blade.outer_shape.{name}"]
    problem.run_model()
    r = HUB + options["nd_span"] * (TIP - HUB)
    chord, twist = (values[f"blade.outer_shape.{name}"] for name in ("chord", "twist"))
    return r, chord, twist, aoa, *(problem[name][:, :, 0] for name in ("cl_interp", "cd_interp"))


@pytest.mark.slow
def test_wisdem_reading_the_file_in_its_own_way_agrees(read):
    """Its schema, grid, interpolation, blending and CCBlade; of ours only the polars' curve.

    WISDEM's CCAirfoil would smooth every polar (s = 0.01 in lift, 0.001 in drag) where our curve
    goes through its rows, which moves the power of these rotors by 4.2 % at a tip speed ratio of 9
    and by 0.5 % at the best: a choice of its solver, not of its reading.
    """
    pytest.importorskip("wisdem")
    rotors, folder = read
    r, chord, twist, aoa, lift, drag = wisdem_blade(folder / "version2.yaml")
    sections = ByStation.of(
        Polar.from_polar_table(polar_table(array_columns(alpha_deg=aoa, cl=cl, cd=cd)))
        for cl, cd in zip(lift, drag, strict=True)
    )
    # 4.8e-4 at the lowest tip speed ratios; 2.1e-4 with 800 stations in place of 400
    blade = Blade(r, chord, np.deg2rad(twist), HUB, TIP, BLADES)
    theirs = ccblade.rotor_coefficients(blade, sections, TIP_SPEED_RATIOS).power
    np.testing.assert_allclose(power(*rotors["windIO 2"]), theirs, rtol=1e-3)
