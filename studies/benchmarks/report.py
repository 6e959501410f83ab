"""Write docs/dev/performance.md and its figure from what the benchmarks measured.

python studies/benchmarks/report.py BENCHMARKS.json [DOCS]
"""

import json
import platform
import sys
from importlib.metadata import version
from pathlib import Path

HEAD = """# Performance

Written by `make bench` from its own measurements; do not edit. Ratios come first: they hold on any
machine. Both sides of each were measured in turns within one run, and are medians. Every benchmark
also checks the values that it compares (`studies/benchmarks/`).
"""


def table(header, rows):
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines) + "\n"


def seconds(value):
    """Return a time in a readable unit."""
    return f"{value:.3g} s" if value >= 1.0 else f"{1e3 * value:.3g} ms"


def whole_case(values):
    """Return the section on the whole case."""
    inside, process = values["test_optimization"], values["test_process"]
    share, start = inside["bem_share"], values["test_start_up"]["times"]
    rows = [
        (
            what,
            f"{of['ratio']:.1f}",
            *(seconds(of["times"][bem]) for bem in ("ccblade", "vectorized")),
        )
        for what, of in (("optimization", inside), ("process", process))
    ]
    energies = inside["energies"]
    return f"""
## The whole case

`sine_limited_quadratic` with each `hydrodynamics.bem`; the process is `hkt run --no-figures` from
a cold start, its check by the same BEM.

{table(("", "times faster", "CCBlade", "vectorized"), rows)}
BEM takes {100 * share["vectorized"]:.1f} % of the optimization ({100 * share["ccblade"]:.0f} %
with CCBlade). Both find {energies["vectorized"]:.1f} J; the energies differ by
{abs(energies["vectorized"] / energies["ccblade"] - 1):.0e}.

Start-up: {", ".join(f"`{name}` {seconds(value)}" for name, value in start.items())}.
"""


def parts(values):
    """Return the section on the other parts of a run, as ratios to what cannot be avoided."""
    times, cold = values["test_parts_of_a_run"]["times"], values["test_over_the_imports"]["times"]
    runs = values["test_with_limits"]["times"]
    memory = values["test_memory"]["ratios"].values()

    def over(long, short):
        long, short = runs[long], runs[short]
        return f"{long / short:.1f} times as long ({seconds(long)} against {seconds(short)})"

    rows = [
        ("search for the steady optimum and start, 60 segments", times["start"], times),
        *(
            (f"integration, {law}, {within_brackets(name)} segments", of["integration"], of)
            for name, info in values.items()
            if name.startswith("test_integration")
            for law, of in info["times"].items()
        ),
    ]
    rows = [
        (what, f"{value / of['optimization']:.2f}", seconds(value), seconds(of["optimization"]))
        for what, value, of in rows
    ]
    return f"""
## The parts of a run

Each time is compared with that of the optimization of the same case (set-up of the problem and
driver).

{table(("", "ratio", "time", "optimization"), rows)}
`hkt run cases/sine_limited_quadratic.yaml` from a cold start, figures included, takes
**{cold["run"] / cold["imports"]:.1f} times** as long as `python -c "import openmdao.api, dymos"`
({seconds(cold["run"])} against {seconds(cold["imports"])}).

A simulation in which the wake has memory takes **{min(memory):.1f} to {max(memory):.1f} times** as
long as one without (the paper's blade, Reference Model 1 and a river turbine, where they are
stable).

Limits: `hkt run cases/limits/all_oloc.yaml` (power, speed, thrust, stress, cavitation) takes
**{over("limits, process", "none, process")}** as `sine_limited_oloc` does on as many stations
(40), figures and records included; without them, in a process that has imported all,
**{over("limits", "none")}**: a search of its own, and a finer mesh.
"""


def iteration(values):
    """Return the section on one NLP iteration and its growth."""
    times = values["test_over_the_bare_phase"]["times"]
    text = f"""
## One NLP iteration

Model and totals at 60 segments, over the same phase with a straight line for its hydrodynamics and
a fixed blade: **{times["this"] / times["bare"]:.1f} times** ({seconds(times["this"])} against
{seconds(times["bare"])}). With OpenMDAO's colored linear solves instead of substitution in the
sparse Jacobian (`hkt_mdo/solve/totals.py`) it would be {times["openmdao"] / times["bare"]:.1f}
times ({seconds(times["openmdao"])}), and a coloring would come first.

## Growth

A second a segment. *evaluation*: model and totals; *iteration*: the mean of IPOPT's first twelve,
line searches and its own algebra included; *memory*: the process at its peak, imports included.
The exponent is that of the evaluation over the last step of each table.

![Growth](../images/growth.png)
"""
    for what in ("segments", "stations"):
        for limits, word in (("none", ""), ("limits", "With the limits of `limits/all_oloc`:\n\n")):
            of = values[f"test_growth[{what}-{limits}]"]
            rows = [
                (
                    row[what],
                    *(seconds(row[name]) for name in ("evaluation", "iteration", "setup")),
                    f"{row['memory_MB']:.0f} MB",
                    row["nonzeros"],
                )
                for row in of["rows"]
            ]
            header = (what, "evaluation", "iteration", "set-up", "memory", "nonzeros of the totals")
            text += f"\n{word}{table(header, rows)}\nExponent {of['slope']:.2f}.\n"
    return text


def many(values):
    """Return the section on problems of many flows."""
    text = """
## Many flows

One problem of flows of a minute (turbulence up to 0.5 Hz, 240 segments each) under limits of power,
thrust and stress, with CVaR: columns as above, in processor time.
"""
    for law in ("quadratic", "open_loop"):
        of = values.get(f"test_growth_of_flows[{law}]", {})
        if "slopes" not in of:  # it did not come to its end
            continue
        rows = [
            (
                row["flows"],
                *(seconds(row[name]) for name in ("evaluation", "iteration", "setup")),
                f"{row['memory_MB']:.0f} MB",
                row["nonzeros"],
            )
            for row in of["rows"]
        ]
        header = ("flows", "evaluation", "iteration", "set-up", "memory", "nonzeros of the totals")
        names = {"evaluation": "evaluation", "setup": "set-up", "memory_MB": "memory"}
        exponents = ", ".join(f"{word} {of['slopes'][name]:.2f}" for name, word in names.items())
        exponents = f"Exponents from {rows[1][0]} flows on: {exponents}."
        text += f"\n`{law}`:\n\n{table(header, rows)}\n{exponents}\n"
    return text


def direct(values):
    """Return the section on direct BEM against the torque curve."""
    lines = [
        (
            row["case"],
            f"{row['curve']:.1f}",
            f"{100 * (row['direct'] / row['curve'] - 1):+.1e} %",
            *(seconds(value) for value in row["seconds"]),
            " / ".join("yes" if good else "no" for good in row["success"]),
        )
        for row in values["test_direct_and_curve_agree"]["rows"]
    ]
    header = ("case", "curve / J", "direct differs by", "curve", "direct", "success of each")
    return f"""
## Torque curve or BEM at every node

`hydrodynamics.torque: curve` (the default) and `direct`, simulated energies; whole runs, several
at a time.

{table(header, lines)}"""


def year(values):
    """Return the section on the co-design of a year."""
    lines = [
        (name, speeds, f"{energy:.0f}", seconds(time), iterations)
        for name, speeds, energy, time, iterations in values["test_year"]["rows"]
    ]
    header = ("case", "speeds of the flow", "energy a year / kWh", "time", "last iterations")
    return f"""
## A year

The paper's rotor in a Weibull distribution of the flow's speed, blade and controller designed for
the energy of a year ([year.md](../year.md)); processor time of one core, checks included.

{table(header, lines)}"""


def peers(values):
    """Return the section on what else one might use."""
    rows, ratios = [], []
    for name, of in values.items():
        if not name.startswith("test_the_same_optimum"):
            continue
        segments, best = within_brackets(name), of["rows"]["CasADi"]
        ratios.append(f"{of['rows']['hkt_mdo'][2] / best[2]:.0f} at {segments}")
        for method, (energy, count, time) in of["rows"].items():
            over = f"{energy / best[0] - 1:+.0e}"
            rows.append((segments, method, f"{energy:.2f}", over, count, seconds(time)))
    crossing = []
    for name, of in values.items():
        if name.startswith("test_slsqp"):
            line = [within_brackets(name)]
            for optimizer in ("IPOPT", "SLSQP"):
                energy, count, time, good = of["rows"][optimizer]
                line += [f"{energy:.1f}", f"{count}{'' if good else ' (failed)'}", seconds(time)]
            crossing.append(line)
    smallest = values["test_the_same_optimum[30]"]["rows"]
    header = ("segments", "IPOPT / J", "iterations", "time", "SLSQP / J", "iterations", "time")
    return f"""
## Peers

Open loop at a fixed blade, 700 N m, the same torque curve, starting from a constant tip speed ratio
a fifth above the best. CasADi: rotor speed as the unknown, torque by inverse dynamics, the same
quadratic pieces, IPOPT with exact Hessians. Shooting: SciPy's SLSQP over 21 knots of torque with
LSODA inside and finite differences. Times include building the problem; the benchmark fails if
this package and CasADi differ by more than 1e-6 of the energy.

{table(("segments", "method", "energy / J", "over CasADi", "iterations", "time"), rows)}
**CasADi wins this problem.** This package takes longer by a factor of
{", ".join(ratios)} segments. The number of iterations is about the same; the
difference is OpenMDAO's set-up and its passes through the components, milliseconds in every
evaluation that a compiled graph does not need. Where the blade is fixed, CasADi is the better tool.
It has no blade design, that is no BEM with its derivatives, and no checks.

Shooting takes {smallest["shooting"][2] / smallest["hkt_mdo"][2]:.0f} times as long as this package
on the smallest problem: for every gradient it integrates the rotor, whose time constant is
hundredths of a second, once for each knot. Its torque has fewer points and captures a little less.

SLSQP's algebra is dense and grows with the cube of the segments: it needs fewer iterations and
is faster on small problems, IPOPT on large ones. Optimizations alone, quadratic feedback, blade
optimized:

{table(header, crossing)}"""


def sweeps(values):
    """Return the section on sweeps."""
    of = values["test_workers"]
    one, two = (of["rates"][workers] for workers in ("1", "2"))
    return f"""
## Sweeps

`sine_limited_quadratic` with other torque limits, on warm workers ([sweeps.md](../sweeps.md)):
a whole run, from the start to the tables, takes **{of["over_optimization"]:.1f} times** its
optimization alone (set-up of the problem and driver; {seconds(of["whole"])} against
{seconds(of["alone"])}).
Two workers do **{two / one:.2f} times** as much as one ({3600 * two:,.0f} against
{3600 * one:,.0f} runs an hour), with scheduler and client on the same two cores.
"""


def memory(values):
    """Return the section on a wake with memory."""
    rows = [
        (
            f"co-design, {within_brackets(name)}" if "[" in name else "simulation",
            f"{of['ratio']:.1f}",
            *(seconds(of["times"][model]) for model in ("quasi_steady", "oye")),
        )
        for name, of in values.items()
        if "with_memory" in name and "ratio" in of
    ]
    return f"""
## A wake with memory

The paper's rotor in the sinusoidal flow, with `inflow_dynamics: oye` and without
([memory.md](../studies/memory.md)); whole runs, checks included, and a simulation of the design of
`sine_quadratic`.

{table(("", "times longer", "without memory", "with"), rows)}"""


def within_brackets(name):
    """Return the parameters of a test's name."""
    return name.partition("[")[2].rstrip("]")


def figure(values, path):
    """Draw cost and memory over segments and stations, log-log."""
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(8.0, 3.4), layout="constrained")
    for ax, what in zip(sheet.subplots(1, 2), ("segments", "stations"), strict=True):
        rows = values[f"test_growth[{what}-none]"]["rows"]
        sizes = [row[what] for row in rows]
        for key, label, unit in (
            ("evaluation", "evaluation, ms", 1e3),
            ("iteration", "iteration, ms", 1e3),
            ("memory_MB", "memory, MB", 1.0),
        ):
            ax.loglog(sizes, [unit * row[key] for row in rows], marker="o", label=label)
        last = 1e3 * rows[-1]["iteration"]
        ax.loglog(sizes, [last * n / sizes[-1] for n in sizes], "k:", label="linear")
        ax.set_xlabel(what)
        ax.set_xticks(sizes, [str(n) for n in sizes])
        ax.minorticks_off()
    ax.legend(frameon=False, fontsize="small")
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.savefig(path, dpi=150)


def bem_alone(values):
    """Return the section on one call of BEM."""
    rows = [
        (
            within_brackets(name),
            f"{of['times_faster_than_ccblade']:.0f}",
            seconds(of["seconds"]),
            f"{1e9 * of['seconds_per_section']:.0f} ns",
        )
        for name, of in values.items()
        if "times_faster_than_ccblade" in of
    ]
    header = ("points x stations", "times faster than CCBlade", "a call", "a section and point")
    return f"""
## BEM alone

One core, the fastest of several calls. [bem.md](../studies/bem.md) says what is computed and how.

{table(header, rows)}"""


def write(values, machine, docs):
    """Write the document and the figure of what was found, by name of the benchmark."""
    packages = ("openmdao", "dymos", "numpy", "scipy", "numba", "casadi")
    sections = (whole_case, parts, iteration, many, direct, year, memory, sweeps, peers, bem_alone)
    cpu = machine.get("cpu", {})
    end = (
        f"\nMeasured with Python {platform.python_version()}, "
        f"{', '.join(f'{name} {version(name)}' for name in packages)}, "
        f"on {cpu.get('count', '?')} cores of {cpu.get('brand_raw', 'an unnamed processor')}.\n"
    )
    text = HEAD + "".join(section(values) for section in sections) + end
    (docs / "dev").mkdir(parents=True, exist_ok=True)
    (docs / "dev" / "performance.md").write_text(text, encoding="utf-8")
    figure(values, docs / "images" / "growth.png")


if __name__ == "__main__":
    data = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    write(
        {each["name"]: each["extra_info"] for each in data["benchmarks"]},
        data["machine_info"],
        Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parents[2] / "docs",
    )
