"""Run the cases of cases/examples and what they are compared with, draw figures, print a table.

python scripts/example_cases.py [--hour] [--only NAME ...] [--out results/examples]

Results that are there already are used again. The files of cases/examples/files are made by
`--files`, from the package's data and a seed; nothing in them was measured.
"""

import argparse
import io
import os
import sys
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console
from rich.table import Table

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.sampled import TurbulentInflow
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.outline import read_outline
from hkt_mdo.files.polar import read_polars
from hkt_mdo.results import plots, style
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
    "river_gust_kept_quadratic": (
        "river_gust",
        "design={blade: fixed}",
        "control.law=quadratic",
    ),
    "river_resized": ("river_resized",),
    "river_resized_wide": ("river_resized", "design.radius_bounds=[0.6, 1.4]"),
    "river_resized_kept": ("river_resized", "design.radius_bounds=null"),
    "own_files": ("own_files",),
    "own_files_kept": ("own_files", "design={blade: fixed}"),
    "two_flows": ("two_flows",),
    "two_flows_open_loop": ("two_flows", "control.law=open_loop"),
    "two_flows_unlimited": (
        "two_flows",
        "scenarios=[{name: slow, weight: 0.75},"
        " {name: fast, weight: 0.25, inflow: {profile: sine, mean: 1.5}}]",
    ),
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
    found = run_batch(
        cases,
        arguments.jobs,
        lambda folder, word: console.print(f"  {folder.name}: {word}"),
        records=False,
    )
    solutions = {folder.name: solution for folder, solution in found.items() if solution}
    arguments.images.mkdir(parents=True, exist_ok=True)
    for image, (draw, *names) in FIGURES.items():
        if all(name in solutions for name in names):
            path = arguments.images / f"example_{image}.png"
            save(draw([solutions[name] for name in names]), path)
            if path.stat().st_size > LARGEST:
                console.print(f"  {path.name}: {path.stat().st_size} bytes, more than {LARGEST}")
    console.print(table(solutions))
    for name, solution in solutions.items():
        for line in (*solution.failed_checks, *solution.summary.get("notes", ())):
            console.print(f"  {name}: {line}")
    sys.exit(0 if all(s is not None and s.success for s in found.values()) else 3)


def table(solutions):
    """Return the figures of merit of every run."""
    columns = ("energy / kJ", "of bound", "gain", "tip speed ratio", "C_P, at", "torque / N m")
    columns += ("tip / m/s", "radius / m", "set angle / deg", "inertia", "s")
    rows = Table("run", "success", *columns)
    for name, solution in solutions.items():
        get, ratio = solution.summary.get, solution.summary.get("tip_speed_ratio") or {}
        if get("simulated_energy_J") is None:
            rows.add_row(name, "no", solution.message)
            continue
        turned = np.subtract(get("twist_deg"), get("start_twist_deg"))
        speeds = (one.simulation["rotor_speed_rad_s"].max() for one in solution.by_scenario)
        fastest = max(speeds) * get("rotor_radius_m")
        rows.add_row(
            name,
            "yes" if solution.success else "no",
            f"{get('simulated_energy_J') / 1e3:.2f}",
            f"{100.0 * get('simulated_energy_J') / get('energy_bound_J'):.2f} %",
            "" if (gain := solution.summary.gain) is None else f"{gain:.5g}",
            f"{ratio['min']:.2f} to {ratio['max']:.2f}, {ratio['mean']:.2f}",
            f"{get('power_coefficient_max'):.4f}, "
            f"{get('tip_speed_ratio_at_power_coefficient_max'):.2f}",
            f"{get('control_torque_max_Nm'):.5g}",
            f"{fastest:.1f}",
            f"{get('tip_radius_m'):.3f}",
            f"{turned[0]:+.2f}" if np.ptp(turned) < 1e-9 else "twist designed",
            f"{get('inertia_kg_m2'):.4g}",
            f"{get('wall_seconds') or 0.0:.0f}",
        )
    return rows


# Figures ------------------------------------------------------------------------------------------


def panels(solutions, *draws):
    """Return a figure of two columns, one panel a function of (solutions, ax), one legend."""
    figure = Figure(figsize=(9.6, 2.75 * ((len(draws) + 1) // 2)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots((len(draws) + 1) // 2, 2).ravel()
    for draw, ax in zip(draws, axes, strict=True):
        draw(solutions, ax)
        if ax is not axes[0] and ax.get_legend():
            ax.get_legend().remove()
    handles = axes[0].get_legend().legend_handles  # without what is told beside its line
    axes[0].get_legend().remove()
    figure.legend(handles=handles, loc="outside upper center", ncols=4, fontsize=8, frameon=False)
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
            ax.plot(x[part], scale * data[column][part], label=solution.name, **style.line(index))
        words = "inflow speed (m/s)" if across else "time (h)" if hours else "time (s)"
        style.finish(ax, words, label)

    return draw


RATIO, TORQUE = "tip speed ratio (-)", "generator torque (N m)"
speed = partial(over, "rotor_speed_rad_s", "rotor speed (rpm)", scale=30.0 / np.pi)
power = partial(over, "hydrodynamic_power_W", "rotor power (kW)", scale=1e-3)
FIGURES = {
    "rm1_turbulent": (
        lambda found: panels(
            found,
            plots.plot_chord,
            plots.plot_twist,
            plots.plot_power_curve,
            speed(ends=(0.0, 200.0)),
        ),
        "rm1_turbulent",
        "rm1_turbulent_kept",
    ),
    "rm1_set_angle": (
        lambda found: panels(
            found,
            over("inflow_speed_m_s", "inflow speed (m/s)", hours=True),
            speed(hours=True),
            over("tip_speed_ratio", RATIO, across="inflow_speed_m_s"),
            power(across="inflow_speed_m_s"),
        ),
        "rm1_set_angle",
        "rm1_set_angle_zero",
    ),
    "river_gust": (
        lambda found: panels(
            found,
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
        lambda found: panels(
            found,
            plots.plot_chord,
            plots.plot_twist,
            plots.plot_power_curve,
            over("control_torque_Nm", TORQUE),
        ),
        "river_resized",
        "river_resized_kept",
    ),
    "own_files": (
        lambda found: panels(
            found,
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
    rows = [(hub, blade.chord[0], blade.twist[0])]  # carried on unchanged to the root
    rows += zip(blade.r, blade.chord, blade.twist, strict=True)
    dat = [
        "! AeroDyn 15 blade file: the shipped river turbine, a design on paper, in another format",
        "! made by scripts/example_cases.py; span counted from the root at 0.12 m",
        f"{len(rows)} NumBlNds - number of blade nodes",
        "BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID",
        "(m) (m) (m) (deg) (deg) (m) (-)",
        *(f"{r - hub:.3f} 0 0 0 {np.rad2deg(t):.2f} {c:.4f} 1" for r, c, t in rows),
    ]
    polars = [each for number in ("2e5", "5e5") for each in read_polars(f"naca4415_Re{number}")]
    airfoil = [
        "! ------------ AirfoilInfo v1.01.x Input File ----------",
        "! NACA 4415, computed by NeuralFoil (hkt_mdo/files/data/README.md), not measured",
        "! made by scripts/example_cases.py",
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
        "NACA 4415, closed form, by scripts/example_cases.py",
        *(f"{x:.5f} {y:.5f}" for x, y in zip(*read_outline("naca4415"), strict=True)),
    ]
    section = TurbulentInflow(
        mean=1.4, intensity=0.12, length_scale=4.0, seed=11, duration=600.0, cutoff=0.2
    )
    time = np.arange(601)
    speed = section.speed_at(time.astype(float))
    record = [
        "# Synthetic: turbulence of 12 %, seed 11; not measured; eight samples are missing",
        "# made by scripts/example_cases.py",
        "time,Stream velocity [m/s]",
    ]
    for t, v in zip(time, speed, strict=True):
        if t not in ABSENT:
            stamp = (BEGIN + timedelta(seconds=int(t))).isoformat()
            record.append(f"{stamp}Z,{'' if t in EMPTY else format(v, '.3f')}")
    return {"blade.dat": dat, "airfoil.dat": airfoil, "outline.dat": outline, "record.csv": record}


if __name__ == "__main__":
    main()
