"""The command line, `hkt`: run a case, look at a result.

What takes long to import waits inside the commands, so that help comes at once.
"""

from __future__ import annotations

import io
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from hkt_mdo.results.solution import Solution

__all__ = ["app", "main"]

BAD_INPUT, NO_SUCCESS, INTERRUPTED, BUG = 2, 3, 130, 1

_EXIT_CODES = (
    "Exit codes: 0 done; 1 an error of this program; 2 bad input, or a file that cannot be read or "
    "written; 3 the run is no success (everything is written all the same); 130 interrupted by "
    "Ctrl-C."
)

_SECONDS_BETWEEN_LINES = 5.0

app = typer.Typer(
    name="hkt",
    help="Control co-design of hydrokinetic turbines: blade and controller optimized together.\n\n"
    "A case is a short YAML file; a run of it leaves a result folder; the other commands look at "
    f"either.\n\n{_EXIT_CODES}",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

_Case = Annotated[
    Path,
    typer.Argument(
        metavar="CASE", help="Case file in YAML, such as cases/sine_quadratic.yaml; see hkt schema."
    ),
]
_Result = Annotated[
    Path, typer.Argument(metavar="RESULT", help="Result folder that hkt run has written.")
]
_Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="SECTION.KEY=VALUE",
        help="Override a key of the case; may be given several times. The value is YAML, units "
        "included: --set rotor.radius=2 --set 'inflow.mean=150 cm/s' --set control.gain=null.",
    ),
]


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib import metadata

        try:
            number = metadata.version("hkt_mdo")
        except metadata.PackageNotFoundError:  # run from a source tree
            number = "(not installed)"
        typer.echo(f"hkt_mdo {number}")
        raise typer.Exit


@app.callback()
def _hkt(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=_print_version,
            help="Print the version and leave.",
        ),
    ] = False,
) -> None:
    pass


@app.command(
    short_help="Run a case and write a result folder.",
    help="Optimize a case, integrate the result independently, judge it and write a result folder."
    "\n\nThe folder gets case.yaml (every default written out), summary.json (figures of merit and "
    "checks), trajectory.csv, simulation.csv, power_curve.csv, convergence.csv, solution.db and "
    "history.db (OpenMDAO recorders), n2.html and figures/. Options override --set, --set "
    f"overrides the file.\n\n{_EXIT_CODES}",
)
def run(
    case: Annotated[
        Path | None,
        typer.Argument(
            metavar="CASE",
            help="Case file in YAML, such as cases/sine_quadratic.yaml; see hkt schema.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Result folder, made anew.",
            show_default="results/<name of the case>",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace an earlier result in the folder.")
    ] = False,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume",
            metavar="DIR",
            help="In place of CASE: go on with the interrupted or failed run in this result folder "
            "from its last recorded iterate.",
        ),
    ] = None,
    optimizer: Annotated[
        str | None,
        typer.Option(
            "--optimizer",
            metavar="NAME",
            help="IPOPT, SLSQP or SNOPT: sets driver.optimizer.",
            show_default="as the case says, else IPOPT",
        ),
    ] = None,
    package: Annotated[
        str | None,
        typer.Option(
            "--package",
            metavar="NAME",
            help="What provides the optimizer; auto, pyoptsparse, casadi (IPOPT alone) or scipy "
            "(SLSQP alone): sets driver.package.",
            show_default="as the case says, else auto",
        ),
    ] = None,
    segments: Annotated[
        int | None,
        typer.Option(
            "--segments",
            metavar="N",
            help="Number of collocation segments: sets phase.segments.",
            show_default="as the case says, else 60",
        ),
    ] = None,
    overrides: _Set = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
    no_figures: Annotated[
        bool, typer.Option("--no-figures", help="Leave the figures out; hkt plot draws them.")
    ] = False,
) -> None:
    """Run a case; the help stands above, where the exit codes can be filled in."""
    from hkt_mdo.case import load_case

    given = {"driver.optimizer": optimizer, "driver.package": package, "phase.segments": segments}
    settings = [f"{key}={value}" for key, value in given.items() if value is not None]
    changes = [*(overrides or ()), *settings]
    if resume is not None:
        if case is not None or changes or out is not None or force:
            raise typer.BadParameter("--resume goes on with a run as it is: give nothing else")
        loaded = load_case(resume / "case.yaml")
    elif case is not None:
        loaded = load_case(case, changes)
    else:
        raise typer.BadParameter("give a CASE, or --resume DIR")
    folder = resume or out or Path("results") / loaded.name

    from rich.console import Console

    console = Console(quiet=quiet, highlight=False)
    before = _stamp(folder)
    try:
        with _progress(console, loaded.name) as progress:
            if resume is not None:
                from hkt_mdo.run.run import resume_case

                solution = resume_case(folder, progress=progress, figures=not no_figures)
            else:
                from hkt_mdo.run.run import run_case

                solution = run_case(
                    loaded, folder, force=force, progress=progress, figures=not no_figures
                )
    except KeyboardInterrupt:
        _complain("interrupted", _saved(folder, before))
        raise typer.Exit(INTERRUPTED) from None
    _print_table(console, solution)
    for note in solution.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    console.print(f"Results: {folder}", markup=False, soft_wrap=True)
    if not solution.success:
        _complain("error", f"no success: {solution.message or 'the run gives no reason'}")
        if quiet:
            _complain("error", f"what was found is in {folder}")
        raise typer.Exit(NO_SUCCESS)


@app.command(
    short_help="Check a case before a long run.",
    help="Read and build all that a run of a case needs and tell what the case means: turbine, "
    "flow, control law, size, and what follows from them for the starting blade. Notes say what "
    "was done to the files, warnings what may not be meant. Nothing is optimized. Draws blade, "
    f"polar, inflow and power_curve as PNG.\n\n{_EXIT_CODES}",
)
def check(
    case: _Case,
    overrides: _Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder of the figures, made if need be.",
            show_default="check/<name of the case>",
        ),
    ] = None,
    no_figures: Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")] = False,
) -> None:
    """Check a case."""
    from rich.console import Console

    from hkt_mdo.case import load_case

    loaded = load_case(case, overrides or ())

    from hkt_mdo.run.check import check_case

    with _named(case):
        report = check_case(loaded)
    console = Console(highlight=False)
    for title, rows in report.tables.items():
        _print_rows(console, rows, title)
    for title, lines in (("Notes", report.notes), ("Warnings", report.warnings)):
        if lines:
            _print_rows(console, [("-", line) for line in lines], title)
    if not no_figures:
        from hkt_mdo.results.plots import save_check_figures

        written = save_check_figures(report.figures, out or Path("check") / report.name)
        names = ", ".join(path.name for path in written)
        console.print(f"Figures: {written[0].parent}: {names}", markup=False, soft_wrap=True)
    number = len(report.warnings)
    doubts = f", with {number} warning{'s' if number > 1 else ''}" if number else ""
    console.print(f"{report.name} can be run{doubts}.", markup=False, soft_wrap=True)


@app.command(
    short_help="Write the N2 diagram of a case.",
    help="Write the N2 diagram of a case's OpenMDAO problem: an HTML page that shows what feeds "
    f"what. Nothing is optimized.\n\n{_EXIT_CODES}",
)
def n2(
    case: _Case,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="HTML file to write, replaced if it exists.",
            show_default="<name of the case>_n2.html",
        ),
    ] = None,
    overrides: _Set = None,
) -> None:
    """Write the N2 diagram."""
    from hkt_mdo.case import load_case

    loaded = load_case(case, overrides or ())
    path = Path(f"{loaded.name}_n2.html") if out is None else out

    from hkt_mdo.run.run import write_n2

    write_n2(loaded, path)
    typer.echo(str(path))


@app.command(
    short_help="Draw the figures of a result.",
    help="Draw the figures of a result: blade, power_curve, operation and convergence, as far as "
    "the run got to their data. Prints the files that it wrote; files of the same names are "
    f"replaced.\n\n{_EXIT_CODES}",
)
def plot(
    result: _Result,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder of the figures, made if need be.",
            show_default="RESULT/figures",
        ),
    ] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help="File format, such as png, pdf or svg; may be given several times.",
            show_default="png and pdf",
        ),
    ] = None,
) -> None:
    """Draw the figures of a result."""
    from hkt_mdo.errors import InputError
    from hkt_mdo.results.solution import Solution

    solution = Solution.load(result)

    from hkt_mdo.results.plots import save_figures

    written = save_figures(solution, out or result / "figures", formats or ("png", "pdf"))
    if not written:
        raise InputError("holds no data to draw", "let the run come to its end", file=result)
    for path in written:
        typer.echo(str(path))


@app.command(
    short_help="Print the figures of merit of a result.",
    help="Print the figures of merit of a result again. Exits with 0 for a run without success "
    f"too: showing it succeeded.\n\n{_EXIT_CODES}",
)
def show(result: _Result) -> None:
    """Print the table of a result."""
    from rich.console import Console

    from hkt_mdo.results.solution import Solution

    _print_table(Console(highlight=False), Solution.load(result))


@app.command(
    short_help="Simulate a result in another flow, with sensor noise.",
    help="Simulate a finished result, blade and controller held, in another flow with direct BEM. "
    "Open loop replays its recorded torque; feedback reads a noisy, filtered speed sensor when "
    "--noise-snr is given, many times over. A rotor that stops is said to stop, and its energy is "
    f"not counted.\n\n{_EXIT_CODES}",
)
def simulate(
    result: _Result,
    flow: Annotated[
        str,
        typer.Option(
            metavar="FLOW",
            help="design: the result's own; A, B or C: the paper's uncertain flows (amplitude x "
            "1.1, frequency 0.225 rad/s, phase 0.2 pi); or an inflow section in YAML, such as "
            "'{profile: sine, mean: 1.4}'.",
        ),
    ] = "design",
    snr: Annotated[
        float | None,
        typer.Option(
            "--noise-snr", metavar="DB", help="Signal-to-noise ratio of the speed sensor."
        ),
    ] = None,
    reference: Annotated[
        str,
        typer.Option(
            "--noise-reference",
            metavar="NAME",
            help="What is the signal: the speed's fluctuation about its mean, or the total speed.",
        ),
    ] = "fluctuation",
    rate: Annotated[
        float, typer.Option("--sample-rate", metavar="HZ", help="Samples of the sensor a second.")
    ] = 100.0,
    repeats: Annotated[int, typer.Option(min=1, max=100_000, help="Noisy runs.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 1,
) -> None:
    """Simulate a result in another flow."""
    import yaml
    from pydantic import TypeAdapter, ValidationError
    from rich.console import Console

    from hkt_mdo.case import Inflow
    from hkt_mdo.errors import InputError
    from hkt_mdo.results.solution import Solution

    solution = Solution.load(result)
    for name, value in (("--noise-snr", snr or 0.0), ("--sample-rate", rate)):
        if not -200.0 <= value <= 1e6:
            raise InputError(
                "is out of range", "give a number between -200 and 1e6", key=name, value=value
            )
    from hkt_mdo.problem.flow import build_inflow
    from hkt_mdo.studies.uncertainty import REFERENCES, Design, Sensor, flow_named, fly_noisy

    if reference not in REFERENCES:
        raise InputError(
            "is unknown", "choose fluctuation or total", key="--noise-reference", value=reference
        )
    if flow.lstrip().startswith("{"):
        try:
            section = TypeAdapter(Inflow).validate_python(yaml.safe_load(flow))
        except (yaml.YAMLError, ValidationError) as error:
            reason = str(error).splitlines()[-1].strip()
            raise InputError(
                f"is no inflow section: {reason}", "see hkt schema", key="--flow", value=flow
            ) from None
    else:
        section = flow_named(flow, solution.case.inflow)
    inflow = build_inflow(section)
    design = Design.of(solution)
    console = Console(highlight=False)
    quiet = design.fly(inflow)
    console.print(f"{solution.name} in flow {section.model_dump()}")
    if quiet.stopped_at is not None:
        console.print(
            f"  without noise: rotor stops at t = {quiet.stopped_at:.2f} s, not generating; energy "
            f"n/a"
        )
    else:
        console.print(
            f"  without noise: {quiet.energy:.1f} J captured, {quiet.generator_energy:.1f} J "
            f"generated"
        )
    if snr is None or design.law is None:
        if snr is not None:
            console.print("  open loop reads no sensor: the noise changes nothing")
        return
    from rich.progress import Progress

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(f"{repeats} noisy runs", total=1.0)
        noisy = fly_noisy(
            design,
            inflow,
            Sensor(snr, reference, rate),
            repeats,
            seed,
            lambda share: bar.update(task, completed=share),
        )
    console.print(
        f"  sensor: {snr:g} dB of the {reference} speed, sigma = {noisy.noise_deviation:.4f} "
        f"rad/s, "
        f"{rate:g} Hz, seed {seed}; BEM table within {noisy.torque_error:.1e}"
    )
    console.print(f"  rotor stopped in {noisy.stalled} of {repeats} runs")
    energy = noisy.energy[noisy.energy == noisy.energy]  # without those that stopped
    if energy.size:
        spread = energy.std(ddof=1) if energy.size > 1 else 0.0
        console.print(
            f"  energy of the others: mean {energy.mean():.1f} J, standard deviation {spread:.1f} "
            f"J, "
            f"worst {energy.min():.1f} J ({100.0 * (energy.mean() / quiet.energy - 1.0):+.3f} % "
            "of the run without noise)"
        )


@app.command(
    short_help="Compare results: table and overlaid figures.",
    help="Print the figures of merit of several results side by side and draw them over each "
    f"other.\n\n{_EXIT_CODES}",
)
def compare(
    results: Annotated[
        list[Path], typer.Argument(metavar="RESULT...", help="Result folders, two or more.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder of the figures; none are drawn without it."
        ),
    ] = None,
) -> None:
    """Compare results."""
    from rich.console import Console
    from rich.table import Table

    from hkt_mdo.results.solution import Solution, summary_table

    solutions = [Solution.load(result) for result in results]
    columns = [dict(summary_table(solution)) for solution in solutions]
    names = [result.resolve().name for result in results]
    if len(set(names)) < len(names):
        names = [str(result) for result in results]
    table = Table("", *names, box=None)
    for name in columns[0] | {key: "" for column in columns for key in column}:
        table.add_row(name, *(column.get(name, "") for column in columns))
    best = max((s.summary.get("simulated_energy_J") or 0.0 for s in solutions), default=0.0)
    if best > 0.0:
        shares = [s.summary.get("simulated_energy_J") for s in solutions]
        table.add_row(
            "energy, to the best",
            *("" if e is None else f"{100.0 * (e / best - 1.0):+.4f} %" for e in shares),
        )
    Console(highlight=False).print(table)
    if out is not None:
        from hkt_mdo.results.plots import save_figures

        for path in save_figures(solutions, out):
            typer.echo(str(path))


@app.command(
    short_help="Reproduce the paper's tables and figures.",
    help="Reproduce Tables II to V and Figs. 3 to 12 of Amini et al. (ACC 2023) from the shipped "
    "cases, beside the paper's numbers: paper.json, report.md and report.html. Finished parts are "
    f"reused, so it can be interrupted.\n\n{_EXIT_CODES}",
)
def paper(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the results.")
    ] = Path("results/paper"),
    cases: Annotated[
        Path | None,
        typer.Option(
            "--cases",
            metavar="DIR",
            help="Folder of the case files.",
            show_default="the shipped ones",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=256, help="Parallel processes.", show_default="one a core"),
    ] = None,
    repeats: Annotated[
        int, typer.Option(min=2, max=10_000, help="Noisy runs of each design.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 1,
) -> None:
    """Reproduce the paper."""
    from rich.console import Console

    console = Console(highlight=False)
    began = time.perf_counter()

    def report(line: str) -> None:
        console.print(f"[{time.perf_counter() - began:6.1f} s] {line}", markup=False)

    from hkt_mdo.studies.paper import reproduce

    data = reproduce(out, cases, jobs, repeats, seed, report)
    failed = [check for check in data["checks"] if not check["passed"]]
    console.print(f"{len(data['checks']) - len(failed)} of {len(data['checks'])} checks hold")
    for check in failed:
        console.print(
            f"  not: {check['statement']} = {check['value']}, asked {check['low']} to "
            f"{check['high']}",
            markup=False,
        )
    console.print(f"Report: {out / 'report.html'}")
    if failed:
        raise typer.Exit(NO_SUCCESS)


@app.command(
    short_help="Run the verification study.",
    help="Run the verification study, or parts of it: starts (random blades, with the program's "
    "own start), blades (random blades without it), sweep (other sizes, flows, limits, polars), "
    "physics (stationarity, energy balance, refinement) and fuzz (mutilated files). It takes "
    f"hours; what is finished is reused, so it can be interrupted.\n\n{_EXIT_CODES}",
)
def verify(
    parts: Annotated[
        list[str] | None, typer.Argument(metavar="PART...", help="All of them by default.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the study.")] = Path(
        "results/verification"
    ),
    cases: Annotated[
        Path | None,
        typer.Option(
            "--cases",
            metavar="DIR",
            help="Folder of the case files.",
            show_default="the shipped ones",
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=100_000,
            help="Starts a case, random mixtures of the sweep, or examples a kind of file.",
            show_default="30, 30 or 1500",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random numbers.")] = 0,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=256, help="Parallel processes.", show_default="one a core"),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="FILE",
            help="Markdown file to write: the figures of all parts that the folder holds.",
        ),
    ] = None,
) -> None:
    """Run the verification study."""
    from rich.console import Console

    from hkt_mdo.studies import verify as study

    console = Console(highlight=False)
    number, began = 0, time.perf_counter()

    def done(folder: Path, word: str) -> None:
        nonlocal number
        number += 1
        if word != "reused":
            seconds = time.perf_counter() - began
            console.print(f"[{seconds:7.1f} s] {number}: {folder}: {word}", markup=False)

    for part in parts or study.PARTS:
        number = 0
        text = study.run_part(part, out, cases, count, seed, jobs, done)
        console.print(text, markup=False, soft_wrap=True)
    if report is not None:
        report.write_text(study.report(out), encoding="utf-8")
        console.print(f"Report: {report}", markup=False)


@app.command(
    short_help="Print every key of a case file.",
    help="Print the JSON schema of a case file: every key with its meaning, default, unit and "
    "range. An editor that is given it checks and completes cases (see docs/cases.md).",
)
def schema(
    markdown: Annotated[
        bool,
        typer.Option("--markdown", help="Print a page to read in place of the JSON schema."),
    ] = False,
) -> None:
    """Print the schema."""
    import json

    from hkt_mdo.case import case_json_schema, case_markdown

    if markdown:
        typer.echo(case_markdown(), nl=False)
    else:
        typer.echo(json.dumps(case_json_schema(), indent=2))


@app.command(
    short_help="Write a commented case to begin from.",
    help="Write a case file with the usual keys of every section, each below what it means, and "
    "beside it the sample file that it needs. It runs as it is. Kinds: paper, the turbine and the "
    "sinusoidal flow of Amini et al.; turbine, with a sample blade as CSV; river, with a sample "
    f"record of the flow as CSV.\n\n{_EXIT_CODES}",
)
def new(
    name: Annotated[
        Path,
        typer.Argument(metavar="NAME", help="Name or path of the case; .yaml is added to it."),
    ],
    kind: Annotated[
        str, typer.Option("--kind", metavar="KIND", help="paper, turbine or river.")
    ] = "paper",
    force: Annotated[
        bool, typer.Option("--force", help="Replace files that are there already.")
    ] = False,
) -> None:
    """Write a new case."""
    from hkt_mdo.cli.new_case import write_new_case

    for path in write_new_case(name, kind, force=force):
        typer.echo(str(path))


@app.command(
    short_help="Compute the polars of an outline.",
    help="Compute lift, drag and moment of a section from its outline by NeuralFoil (pip install "
    "'hkt_mdo\\[neuralfoil]') and write them as a CSV file that rotor.polar takes, with the "
    "network's confidence in every row, and as a figure. Angles of attack count from the outline's "
    f"x axis, the chord line.\n\n{_EXIT_CODES}",
)
def polar(
    outline: Annotated[
        str,
        typer.Argument(
            metavar="OUTLINE",
            help="Shipped name (naca63815) or file: CSV x_over_c,y_over_c, Selig or Lednicer.",
        ),
    ],
    reynolds: Annotated[
        str, typer.Option("--reynolds", metavar="RE,RE,...", help="Reynolds numbers by the chord.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the files.")] = Path(
        "results/polars"
    ),
    alpha: Annotated[
        str, typer.Option("--alpha", metavar="FIRST:LAST:STEP", help="Angles of attack, degrees.")
    ] = "-16:24:0.5",
    n_crit: Annotated[
        float, typer.Option("--n-crit", help="Amplification at transition; less where turbulent.")
    ] = 9.0,
    model: Annotated[
        str, typer.Option("--model", metavar="SIZE", help="Network, xxsmall to xxxlarge.")
    ] = "xlarge",
    beside: Annotated[
        list[str] | None,
        typer.Option(
            "--beside",
            metavar="POLAR",
            help="Another polar to draw, shipped or a file; may be given several times.",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace files that are there already.")
    ] = False,
) -> None:
    """Compute polars."""
    from hkt_mdo.cli.polar_report import parse_alpha, parse_reynolds, report_polars

    angles, numbers = parse_alpha(alpha), parse_reynolds(reynolds)
    for line in report_polars(
        outline,
        numbers,
        angles,
        out,
        n_crit=n_crit,
        model=model,
        beside=beside or (),
        force=force,
    ):
        typer.echo(line)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; no error ends in a traceback.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows ``hkt``; by default the arguments of the process.

    Returns
    -------
    int
        0 done, 1 an error of this program, 2 bad input, 3 no success, 130 interrupted.
    """
    # matrices here are small: threads cost more than they give; read when NumPy is imported
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    os.environ.setdefault("OPENMDAO_REPORTS", "0")

    # a path may hold what the terminal's encoding does not
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")

    from hkt_mdo.errors import InputError

    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("default", category=UserWarning, module=r"hkt_mdo\b")
            warnings.showwarning = _show_warning
            typer.main.get_command(app)(args=arguments, prog_name="hkt")
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except KeyboardInterrupt:
        _complain("interrupted", "nothing was saved")
        return INTERRUPTED
    except InputError as error:
        _complain("error", str(error))
        return BAD_INPUT
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        reason = error.strerror or str(error) or type(error).__name__
        _complain("error", f"{place}cannot be read or written ({reason})")
        return BAD_INPUT
    except MemoryError:
        _complain("error", "out of memory; give fewer phase.segments")
        return BAD_INPUT
    except Exception as error:
        if os.environ.get("HKT_TRACEBACK"):
            raise
        what = f"{type(error).__name__}: {error}"
        _complain("error", f"{what} (an error of this program; HKT_TRACEBACK=1 shows where)")
        return BUG
    return 0


# Parts --------------------------------------------------------------------------------------------


@contextmanager
def _named(case: Path) -> Iterator[None]:
    """Name the case's file in bad input that is found only when the parts of a case meet."""
    from hkt_mdo.errors import InputError

    try:
        yield
    except InputError as error:
        error.file = error.file or str(case)
        raise


def _complain(what: str, message: str) -> None:
    line = "".join(letter if letter.isprintable() else " " for letter in message)
    typer.echo(f"{what}: {line}", err=True)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: object = None,
    line: str | None = None,
) -> None:
    """Print the warnings of this package; what the libraries warn of is not for its users.

    A filter would not last: OpenMDAO sets its own when it is imported.
    """
    ours = Path(filename).is_relative_to(Path(__file__).parents[1])
    library = category.__module__.partition(".")[0] in ("openmdao", "dymos", "numpy", "scipy")
    if ours and issubclass(category, UserWarning) and not library:
        _complain("warning", str(message))


@contextmanager
def _progress(console: Console, name: str) -> Iterator[Callable[[int, float, float], None] | None]:
    """Yield what a run reports to: a live line on a terminal, else a line every few seconds."""
    if console.quiet:
        yield None
        return
    if console.is_terminal:
        with console.status(f"{name}: preparing") as status:
            yield lambda *state: status.update(f"{name}: {_state(*state)}")
        return
    last = time.monotonic()

    def report(count: int, energy: float, infeasibility: float) -> None:
        nonlocal last
        if time.monotonic() - last >= _SECONDS_BETWEEN_LINES:
            last = time.monotonic()
            typer.echo(f"{name}: {_state(count, energy, infeasibility)}")

    yield report


def _state(count: int, energy: float, infeasibility: float) -> str:
    return f"evaluation {count}, energy {energy:.0f} J, infeasibility {infeasibility:.1e}"


def _print_table(console: Console, solution: Solution) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from hkt_mdo.results.solution import summary_table

    table = Table(box=box.SIMPLE, show_header=False)
    for what, value in summary_table(solution):
        table.add_row(Text(what), Text(value))  # as text: what stands in brackets is no markup
    for check in solution.failed_checks:
        table.add_row(Text("check not passed", style="bold"), Text(check))
    console.print(table)


def _print_rows(console: Console, rows: Sequence[tuple[str, str]], title: str) -> None:
    """Print a table of words below its title."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=True, padding=(0, 1))
    for what, text in rows:
        table.add_row(Text(what, no_wrap=True), Text(text))
    console.print(Text(f"\n{title}", style="bold"))
    console.print(table)


def _stamp(folder: Path) -> tuple[int, int] | None:
    """Return what tells one summary from another; None where there is none."""
    try:
        state = (folder / "summary.json").stat()
    except OSError:
        return None
    return state.st_mtime_ns, state.st_ino


def _saved(folder: Path, before: tuple[int, int] | None) -> str:
    """Return what an interrupted run saved, and where."""
    after = _stamp(folder)
    if after is None or after == before:
        return "nothing was saved"
    names = sorted(path.name for path in folder.iterdir())
    return f"what there was is saved in {folder}: {', '.join(names)}"
