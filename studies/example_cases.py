"""Run the cases of cases/examples and others; writes the tables of docs/studies/examples.md.

python studies/example_cases.py [--hour] [--only NAME ...] [--out results/examples]

Draws the figures and writes the tables of the page, with their data, unless only some cases are
run. Results that are there already are used again. The files of cases/examples/files are made by
`--files`, from the package's data and a seed; nothing in them was measured.
"""

import argparse
import io
import sys
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import page_data
import study_plots as plots
from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console
from study_common import markdown_table

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.sampled import TurbulentInflow
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.outline import read_outline
from hkt_mdo.files.polar import read_polars
from hkt_mdo.results import style
from hkt_mdo.run.batch import run_batch

ROOT = Path(__file__).parent.parent
CASES = ROOT / "cases" / "examples"
IMAGES = ROOT / "docs" / "images"
DPI = 110
LARGEST = 120_000  # bytes of a figure
GEARED = f"rotor.hub_inertia={79.6 + 139.5 * 53**2:.1f}"
"""RM1's hub and its generator (kg m2) behind the gear, as in OpenFAST's model of it."""

RUNS = {
    "rm1_turbulent": ("rm1_turbulent",),
    "rm1_turbulent_kept": ("rm1_turbulent", "design={blade: fixed}"),
    "rm1_turbulent_geared": ("rm1_turbulent", GEARED),
    "rm1_turbulent_kept_geared": ("rm1_turbulent", "design={blade: fixed}", GEARED),
    "rm1_set_angle": ("rm1_set_angle",),
    "rm1_set_angle_zero": ("rm1_set_angle", "design={blade: fixed}"),
    "rm1_set_angle_unlimited": ("rm1_set_angle", "control.torque_limit=null"),
    "rm1_set_angle_unlimited_zero": (
        "rm1_set_angle",
        "control.torque_limit=null",
        "design={blade: fixed}",
    ),
    "river_gust": ("river_gust",),
    "river_gust_quadratic": ("river_gust", "control.law=quadratic"),
    "river_gust_unlimited": ("river_gust", "control.torque_limit=null"),
    "river_gust_unlimited_quadratic": ("river_gust", "control={law: quadratic}"),
    "river_gust_kept": ("river_gust", "design={blade: fixed}"),
    "river_gust_kept_quadratic": ("river_gust", "design={blade: fixed}", "control.law=quadratic"),
    "river_resized": ("river_resized",),
    "river_resized_wide": ("river_resized", "design.radius_bounds=[0.6, 1.4]"),
    "river_resized_kept": ("river_resized", "design.radius_bounds=null"),
    "own_files": ("own_files",),
    "own_files_kept": ("own_files", "design={blade: fixed}"),
    "two_flows": ("two_flows",),
    "two_flows_open_loop": ("two_flows", "control.law=open_loop"),
    "two_flows_unlimited": (
        "two_flows",
        "rotor.station_count=40",
        "scenarios=[{name: slow, weight: 0.75},"
        " {name: fast, weight: 0.25, inflow: {profile: sine, mean: 1.5}}]",
    ),
    "designed_thickness": ("designed_thickness",),
    "designed_thickness_bahaj": ("designed_thickness", "design.thickness_points=null"),
    **{
        f"designed_thickness_{name}": (
            "designed_thickness",
            "design.thickness_points=null",
            "rotor.sections=null",
            f"rotor.polar={polar}",
            f"rotor.outline={outline}",
        )
        for name, polar, outline in (
            ("15", "naca4415_Re1e6", "naca4415"),
            *(
                (x, f"files/naca44{x}_polars.csv", f"files/naca44{x}.csv")
                for x in ("18", "12", "24")
            ),
        )
    },
}
"""By the name of the result: the case, and what is set otherwise in it."""

HOUR = {
    name: (name,) for name in (f"turbulent_hour_{law}" for law in ("oloc", "linear", "quadratic"))
}


def main():
    """Run, draw, print the table; exit with 3 unless every run succeeded."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "examples")
    parser.add_argument("--images", type=Path, default=IMAGES)
    parser.add_argument("--only", nargs="+", choices=(*RUNS, *HOUR), metavar="NAME")
    parser.add_argument("--hour", action="store_true", help="the turbulent hour too: minutes")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--files", action="store_true", help="make cases/examples/files, no run")
    arguments = parser.parse_args()
    if arguments.files:
        write_files(CASES / "files")
        return

    runs = RUNS | HOUR if arguments.hour else RUNS
    if arguments.only:
        runs = {name: (RUNS | HOUR)[name] for name in arguments.only}
    cases = {
        arguments.out / name: load_case(CASES / f"{case}.yaml", [f"name={name}", *overrides])
        for name, (case, *overrides) in runs.items()
    }
    console = Console(width=230)
    outcomes = run_batch(
        cases,
        arguments.jobs,
        lambda folder, word: console.print(f"  {folder.name}: {word}"),
        records=False,
    )
    solutions = {folder.name: solution for folder, solution in outcomes.items() if solution}
    arguments.images.mkdir(parents=True, exist_ok=True)
    for image, (draw, *names) in FIGURES.items():
        if all(name in solutions for name in names):
            path = arguments.images / f"example_{image}.png"
            save(draw([solutions[name] for name in names]), path)
            if path.stat().st_size > LARGEST:
                console.print(f"  {path.name}: {path.stat().st_size} bytes, more than {LARGEST}")
    for name, solution in solutions.items():
        for line in (*solution.failed_checks, *(solution.summary.notes or ())):
            console.print(f"  {name}: {line}")
    if set(RUNS) <= set(solutions):
        results = {name: figures_of_merit(solutions[name]) for name in RUNS}
        page_data.page_from("examples", from_data, results=results)
    sys.exit(0 if all(s is not None and s.success for s in outcomes.values()) else 3)


# Tables -------------------------------------------------------------------------------------------


def figures_of_merit(solution):
    """Return the numbers of a result that the tables may show."""
    summary, ratio = solution.summary, solution.summary.tip_speed_ratio
    fastest = max(one.simulation["rotor_speed_rad_s"].max() for one in solution.by_scenario)
    turned = np.subtract(summary.twist_deg, summary.start_twist_deg)
    return {
        "success": solution.success,
        "energy_J": summary.simulated_energy_J,
        "energy_bound_J": summary.energy_bound_J,
        "gain": summary.gain,
        "tip_speed_ratio": [ratio.min, ratio.mean, ratio.max],
        "power_coefficient": summary.power_coefficient_max,
        "best_tip_speed_ratio": summary.tip_speed_ratio_at_power_coefficient_max,
        "tip_speed_m_s": float(fastest * summary.rotor_radius_m),
        "radius_m": summary.tip_radius_m,
        "set_angle_deg": float(turned[0]) if np.ptp(turned) < 1e-9 else None,
        "inertia_kg_m2": summary.inertia_kg_m2,
        "mass_kg": summary.mass_kg,
        "mean_power_W": {name: x.mean_power_W for name, x in summary.scenarios.items()},
        "thrust_N": summary.loads["thrust"].value if "thrust" in (summary.loads or {}) else None,
    }


def grouped(value, digits=5):
    """Return a number with so many significant digits, in groups of three where it is large."""
    if value is None:
        return ""
    if value < 1e4:
        return f"{value:#.{digits - 1}g}"
    return f"{float(f'{value:.{digits}g}'):,.0f}".replace(",", " ")


COLUMNS = {
    "energy / MJ": lambda x: f"{x['energy_J'] / 1e6:.2f}",
    "energy / kJ": lambda x: f"{x['energy_J'] / 1e3:.2f}",
    "of bound": lambda x: f"{100.0 * x['energy_J'] / x['energy_bound_J']:.2f} %",
    "gain": lambda x: grouped(x["gain"]),
    "gain K2 / N m s²": lambda x: grouped(x["gain"]),
    "tip speed ratio": lambda x: "{0:.2f} to {2:.2f}".format(*x["tip_speed_ratio"]),
    "tip speed ratio, mean": lambda x: f"{x['tip_speed_ratio'][1]:.2f}",
    "C_P, largest, at": lambda x: f"{x['power_coefficient']:.4f}, {x['best_tip_speed_ratio']:.2f}",
    "fastest tip / m/s": lambda x: f"{x['tip_speed_m_s']:.1f}",
    "inertia / kg m²": lambda x: grouped(x["inertia_kg_m2"]),
    "found / m": lambda x: f"{x['radius_m']:.3f}",
    "set angle / deg": lambda x: f"{x['set_angle_deg'] or 0.0:+.2f}",
    "mass / kg": lambda x: f"{x['mass_kg']:.1f}",
    "largest thrust / kN": lambda x: f"{x['thrust_N'] / 1e3:.2f}",
    "slow: mean power / W": lambda x: f"{x['mean_power_W']['slow']:.1f}",
    "fast: mean power / W": lambda x: f"{x['mean_power_W']['fast']:.1f}",
}
"""By the head of a column: the cell of a run."""

COEFFICIENT = "tip speed ratio, mean", "C_P, largest, at"
TABLES = {
    "rm1_turbulent": (
        (
            "run",
            "energy / MJ",
            "of bound",
            "gain K2 / N m s²",
            *COEFFICIENT,
            "fastest tip / m/s",
            "inertia / kg m²",
        ),
        ("blade designed", "rm1_turbulent"),
        ("blade designed, with the generator", "rm1_turbulent_geared"),
        ("blade kept", "rm1_turbulent_kept"),
        ("blade kept, with the generator", "rm1_turbulent_kept_geared"),
    ),
    "rm1_set_angle": (
        (
            "run",
            "set angle / deg",
            "energy / MJ",
            "of bound",
            "gain K2 / N m s²",
            "tip speed ratio",
        ),
        ("torque limit 415 kN m", "rm1_set_angle"),
        ("the same, set angle 0", "rm1_set_angle_zero"),
        ("no torque limit", "rm1_set_angle_unlimited"),
        ("the same, set angle 0", "rm1_set_angle_unlimited_zero"),
    ),
    "river_gust": (
        ("run (gain in N m s, or N m s²)", "energy / kJ", "of bound", "gain", "tip speed ratio"),
        ("linear, limit 140 N m", "river_gust"),
        ("quadratic, limit 140 N m", "river_gust_quadratic"),
        ("linear, no limit", "river_gust_unlimited"),
        ("quadratic, no limit", "river_gust_unlimited_quadratic"),
        ("linear, limit 140 N m, blade kept", "river_gust_kept"),
        ("quadratic, limit 140 N m, blade kept", "river_gust_kept_quadratic"),
    ),
    "river_resized": (
        (
            "radius allowed / m",
            "found / m",
            "energy / kJ",
            "of bound",
            "tip speed ratio",
            "C_P, largest, at",
            "fastest tip / m/s",
        ),
        ("0.8", "river_resized_kept"),
        ("0.6 to 1.0", "river_resized"),
        ("0.6 to 1.4", "river_resized_wide"),
    ),
    "own_files": (
        ("run", "energy / kJ", "of bound", "gain K2 / N m s²", *COEFFICIENT),
        ("blade designed", "own_files"),
        ("blade kept", "own_files_kept"),
    ),
    "designed_thickness": (
        ("thickness", "energy / kJ", "to the designed one", "of bound", "mass / kg"),
        ("designed", "designed_thickness"),
        ("Bahaj's, 24 % to 12.6 %", "designed_thickness_bahaj"),
        ("15 % throughout", "designed_thickness_15"),
        ("18 % throughout", "designed_thickness_18"),
        ("12 % throughout", "designed_thickness_12"),
        ("24 % throughout", "designed_thickness_24"),
    ),
    "two_flows": (
        (
            "run",
            "energy / kJ",
            "of bound",
            "slow: mean power / W",
            "fast: mean power / W",
            "gain K2 / N m s²",
            "tip speed ratio",
            "largest thrust / kN",
        ),
        ("quadratic feedback", "two_flows"),
        ("open loop", "two_flows_open_loop"),
        ("quadratic feedback, no limit on the thrust (40 stations, too)", "two_flows_unlimited"),
    ),
}
"""By the mark in the page: the heads of a table, then the name of each row and its run."""


def from_data(data):
    """Return the page with the tables of its data."""
    results = data["results"]
    page = page_data.text_of("examples")
    for name, (heads, *rows) in TABLES.items():
        best, lines = results[rows[0][1]]["energy_J"], []
        for label, run in rows:
            less = 100.0 * (results[run]["energy_J"] / best - 1.0)
            columns = COLUMNS | {"to the designed one": lambda x, less=less: f"{less:+.3f} %"}
            mark = "" if results[run]["success"] else " (no success)"
            lines.append((label + mark, *(columns[head](results[run]) for head in heads[1:])))
        begin = f"<!-- {name}, by studies/example_cases.py -->\n"
        table = "\n".join(markdown_table(heads, lines)) + "\n"
        page = page_data.between(page, begin, "<!-- end -->", table)
    return page


# Figures ------------------------------------------------------------------------------------------


def panels(solutions, *draws):
    """Return a figure of two columns, one panel a function of (solutions, ax), one legend."""
    figure = Figure(figsize=(9.6, 2.75 * ((len(draws) + 1) // 2)), layout="constrained")
    axes = figure.subplots((len(draws) + 1) // 2, 2).ravel()
    for draw, ax in zip(draws, axes, strict=True):
        draw(solutions, ax)
    look = {"ncols": 4, "fontsize": 8, "frameon": False}
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", **look)
    return figure


def save(figure, path):
    """Write a figure with few colours: small files."""
    memory = io.BytesIO()
    figure.savefig(memory, dpi=DPI)
    Image.open(memory).convert("RGB").quantize(96).save(path, optimize=True)


def over(column, label, *, scale=1.0, hours=False, across=None, ends=None):
    """Return a function that draws a column of the simulation over time or another column."""

    def draw(solutions, ax):
        for index, solution in enumerate(solutions):
            data = solution.simulation
            x = data[across or "time_s"] / (3600.0 if hours else 1.0)
            part = slice(None) if ends is None else (x >= ends[0]) & (x <= ends[1])
            ax.plot(x[part], scale * data[column][part], label=solution.name, **plots.line(index))
        words = "inflow speed (m/s)" if across else "time (h)" if hours else "time (s)"
        style.finish(ax, words, label)

    return draw


RATIO, TORQUE = "tip speed ratio (-)", "generator torque (N m)"
speed = partial(over, "rotor_speed_rad_s", "rotor speed (rpm)", scale=30.0 / np.pi)
power = partial(over, "hydrodynamic_power_W", "rotor power (kW)", scale=1e-3)
FIGURES = {
    "rm1_turbulent": (
        lambda solutions: panels(
            solutions,
            plots.plot_chord,
            plots.plot_twist,
            plots.plot_power_coefficient,
            speed(ends=(0.0, 200.0)),
        ),
        "rm1_turbulent",
        "rm1_turbulent_kept",
    ),
    "rm1_set_angle": (
        lambda solutions: panels(
            solutions,
            over("inflow_speed_m_s", "inflow speed (m/s)", hours=True),
            speed(hours=True),
            over("tip_speed_ratio", RATIO, across="inflow_speed_m_s"),
            power(across="inflow_speed_m_s"),
        ),
        "rm1_set_angle",
        "rm1_set_angle_zero",
    ),
    "river_gust": (
        lambda solutions: panels(
            solutions,
            over("inflow_speed_m_s", "inflow speed (m/s)", ends=(15.0, 35.0)),
            speed(ends=(15.0, 35.0)),
            over("tip_speed_ratio", RATIO, ends=(15.0, 35.0)),
            over("control_torque_Nm", TORQUE, ends=(15.0, 35.0)),
        ),
        "river_gust",
        "river_gust_quadratic",
        "river_gust_kept",
        "river_gust_kept_quadratic",
    ),
    "river_resized": (
        lambda solutions: panels(
            solutions,
            plots.plot_chord,
            plots.plot_twist,
            plots.plot_power_coefficient,
            over("control_torque_Nm", TORQUE),
        ),
        "river_resized",
        "river_resized_kept",
    ),
    "own_files": (
        lambda solutions: panels(
            solutions,
            over("inflow_speed_m_s", "inflow speed (m/s)"),
            plots.plot_chord,
            over("tip_speed_ratio", RATIO, ends=(200.0, 300.0)),
            over("control_torque_Nm", TORQUE, ends=(200.0, 300.0)),
        ),
        "own_files",
        "own_files_kept",
    ),
}
"""By the name of the figure: what draws it, and the runs that it shows."""


# Files --------------------------------------------------------------------------------------------

BEGIN = datetime(2024, 5, 1, 12)
EMPTY, ABSENT = (45, 46, 301), (150, 151, 152, 153, 420)  # s: cells without a number, rows left out


def write_files(folder):
    """Write the files that cases/examples/own_files.yaml reads: blade, section, outline, record."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, lines in files().items():
        (folder / name).write_text("\n".join((*lines, "")), encoding="utf-8")


def files():
    """Return the lines of each file by its name."""
    hub, blade = 0.12, read_blade("river")
    rows = [(hub, blade.chord[0], blade.twist[0])]  # continued unchanged to the root
    rows += zip(blade.r, blade.chord, blade.twist, strict=True)
    dat = [
        "! AeroDyn 15 blade file: the shipped river turbine, a design on paper, in another format",
        "! made by studies/example_cases.py; span counted from the root at 0.12 m",
        f"{len(rows)} NumBlNds - number of blade nodes",
        "BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID",
        "(m) (m) (m) (deg) (deg) (m) (-)",
        *(f"{r - hub:.3f} 0 0 0 {np.rad2deg(t):.2f} {c:.4f} 1" for r, c, t in rows),
    ]
    polars = [each for number in ("2e5", "5e5") for each in read_polars(f"naca4415_Re{number}")]
    airfoil = [
        "! ------------ AirfoilInfo v1.01.x Input File ----------",
        "! NACA 4415, computed by NeuralFoil (hkt_mdo/files/data/README.md), not measured",
        "! made by studies/example_cases.py",
        '"DEFAULT" InterpOrd ! interpolation',
        "1 NonDimArea ! not used",
        "0 NumCoords ! shape: see outline.dat",
        '"unused" BL_file ! not used',
        f"{len(polars)} NumTabs ! tables, one a Reynolds number",
    ]
    for polar, millions in zip(polars, (0.2, 0.5), strict=True):
        airfoil += [
            f"{millions} Re ! Reynolds number in millions",
            "0 UserProp ! not used",
            "False InclUAdata ! no unsteady data",
            f"{polar.alpha.size} NumAlf ! rows",
            "! Alpha Cl Cd Cm",
            "! (deg) (-) (-) (-)",
        ]
        columns = (np.rad2deg(polar.alpha), polar.lift, polar.drag, polar.moment)
        airfoil += [
            f"{a:.1f} {left:.4f} {d:.5f} {m:.4f}" for a, left, d, m in zip(*columns, strict=True)
        ]
    outline = [
        "NACA 4415, closed form, by studies/example_cases.py",
        *(f"{x:.5f} {y:.5f}" for x, y in zip(*read_outline("naca4415"), strict=True)),
    ]
    section = TurbulentInflow(
        mean=1.4, intensity=0.12, length_scale=4.0, seed=11, duration=600.0, cutoff=0.2
    )
    time = np.arange(601)
    speed = section.speed_at(time.astype(float))
    record = [
        "# Synthetic: turbulence of 12 %, seed 11; not measured; eight samples are missing",
        "# made by studies/example_cases.py",
        "time,Stream velocity [m/s]",
    ]
    for t, v in zip(time, speed, strict=True):
        if t not in ABSENT:
            stamp = (BEGIN + timedelta(seconds=int(t))).isoformat()
            record.append(f"{stamp}Z,{'' if t in EMPTY else format(v, '.3f')}")
    return {"blade.dat": dat, "airfoil.dat": airfoil, "outline.dat": outline, "record.csv": record}


if __name__ == "__main__":
    main()
