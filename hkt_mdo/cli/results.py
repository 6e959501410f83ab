"""The commands that work on results: show, plot, report, compare, simulate, export."""

from math import inf
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.table import Table
from rich.text import Text
from typer import Argument, Option, echo

from hkt_mdo.cli import parts
from hkt_mdo.cli.parts import AsCsv, Json, OutFolder, ResultFolder, read_result
from hkt_mdo.errors import InputError
from hkt_mdo.exports import FORMATS

_TO = f"{', '.join(FORMATS)}; several with commas between, or one each time."


def show(result: ResultFolder, as_json: Json = False, as_csv: AsCsv = False) -> None:
    """Print the figures of merit of a result.

    Exits with 0 for a run that did not succeed, too. --json and --csv print each quantity with its
    value, the upper end if it is a range, unit and note.
    """
    parts.print_tables(read_result(result).overview, as_json, as_csv)


def plot(
    result: ResultFolder,
    out: OutFolder = None,
    formats: Annotated[list[str] | None, Option("--format", metavar="NAME")] = None,
) -> None:
    """Draw the figures of a result, or of a sweep.

    They are blade, coefficients (over the tip speed ratio), operation (over time), power_curve
    (power, speed, torque and thrust over the speed of the flow), limits (largest values over their
    limits), loads (along the blade) and convergence, as far as the result has their data, in
    RESULT/figures unless --out is given; files of the same names are replaced. With several
    scenarios, operation_NAME and limits_NAME show each of them, and power_curve and loads have a
    line for each. Those of a sweep are front (the objective over a limit or a load), map (over two
    keys) and parallel (all keys and outcomes).

    Parameters
    ----------
    formats
        File format, such as pdf or svg; may be given several times. Default: png.
    """
    from hkt_mdo.results import charts, style
    from hkt_mdo.results.sweep import TABLE, SweepTable
    from hkt_mdo.results.sweep_plots import sweep_figures

    if (result / TABLE).is_file():
        drawn = sweep_figures(SweepTable.load(result))
    else:
        drawn = charts.figures(read_result(result))
    if not drawn:
        raise InputError("holds no data to draw", "let the run finish", file=result)
    parts.print_lines(style.save(drawn, out or result / "figures", formats or ["png"]))


def report(
    results: Annotated[list[Path], Argument(metavar="RESULT...")],
    out: Annotated[Path, Option("--out", metavar="FILE")] = Path("report.html"),
    force: parts.Force = False,
) -> None:
    """Write a report of one result, or of several side by side, as one HTML page (docs/report.md).

    A browser opens it from disk, without a network. It has the verdict with every check, figures of
    merit, the blade as a solid that can be turned, operation over the flow speed and over time,
    limits, convergence, and what is not modelled. It needs the extra report:
    pip install 'hkt_mdo[report]'.

    For the folder of a sweep, report.html is written into that folder. It shows front and map; a
    click on a point opens the report of that run, which is written into the folder of the run.

    Parameters
    ----------
    results
        Result folders.
    out
        The HTML file to write.
    """
    from hkt_mdo.files.table import refuse_existing
    from hkt_mdo.pages.page import write_report, write_sweep_report
    from hkt_mdo.results.sweep import TABLE, SweepTable

    if len(results) == 1 and (results[0] / TABLE).is_file():
        echo(str(write_sweep_report(SweepTable.load(results[0]), echo, parts.EXTENSIONS.get())))
        return
    refuse_existing([out], force)
    echo(str(write_report([read_result(result) for result in results], out)))


def compare(
    results: Annotated[list[Path], Argument(metavar="RESULT...")],
    out: OutFolder = None,
    as_json: Json = False,
    as_csv: AsCsv = False,
) -> None:
    """Compare results in a table and, with --out, in overlaid figures.

    The table has the figures of merit side by side, the best objective first, over the duration
    where durations differ: successful results, then results that failed a check, then those of
    interrupted runs, which are not in the figures. Notes below the table name interrupted runs, and
    results to which another result of the same turbine in the same flow is superior: it keeps the
    limits of their case and has a better objective.

    Parameters
    ----------
    results
        Result folders.
    """
    from hkt_mdo.results.nesting import ranked, remarks
    from hkt_mdo.results.words import aligned, texts

    for_program = parts.one_form(as_json, as_csv)
    solutions, behind = ranked(read_result(result) for result in results)
    rows = [solution.summary.rows(solution.case) for solution in solutions]
    for merits, differences in zip(rows, behind, strict=True):
        merits[3:3] = differences  # below case, verdict and message
    names = [str(solution.folder) for solution in solutions]
    if for_program:
        parts.print_records(parts.plain_rows(zip(names, rows, strict=True), "result"), as_json)
    else:
        _print_beside(names, aligned([texts(each) for each in rows]))
    finished = [solution for solution in solutions if solution.finished]
    parts.print_lines((f"note: {line}" for line in remarks(finished)), err=for_program)
    for solution in solutions:
        if not solution.finished:
            why = f"{solution.message or 'did not end'}; it is not ranked and not in the figures"
            echo(f"note: {solution.folder}: {why}", err=True)
    if out is not None and finished:
        from hkt_mdo.results import charts, style

        parts.print_lines(style.save(charts.figures(finished), out), err=for_program)


_WIDEST = 44  # characters of a column; longer texts take more lines


def _print_beside(names: list[str], rows: list[tuple[str, list[str]]]) -> None:
    """Print rows with a cell for each name, in several tables where a terminal is narrow."""
    longest = max(len(cell) for _, cells in rows for cell in cells)
    widest = max(max(map(len, names)), min(_WIDEST, longest))
    first, console = max(len(label) for label, _ in rows), Console(highlight=False)
    if not console.is_terminal:  # a file or a pipe has no width
        console = Console(highlight=False, width=first + (widest + 2) * len(names) + 4)
    room = console.width - first - 4
    widest = min(widest, max(20, room - 2))
    count = max(1, room // (widest + 2))
    for columns in (slice(begin, begin + count) for begin in range(0, len(names), count)):
        table = Table(box=None)
        table.add_column("", width=first, no_wrap=True)
        for name in names[columns]:
            table.add_column(Text(name), width=widest, overflow="fold")
        for label, cells in rows:
            table.add_row(Text(label), *map(Text, cells[columns]))
        console.print(table)


def export(
    result: ResultFolder,
    to: Annotated[list[str], Option("--to", metavar="FORMAT", help=_TO)],
    out: Annotated[Path, Option(metavar="DIR")],
    options: Annotated[list[str] | None, Option("--set", metavar="OPTION")] = None,
    force: Annotated[bool, Option("--force")] = False,
) -> None:
    """Write a result in files for other programs (docs/exports.md).

    The files contain the result and the case that they come from. If an option is wrong, a package
    is missing or a file already exists, nothing is written.

    Parameters
    ----------
    out
        Folder for the files; created if needed.
    options
        Option of a format, such as stl.trailing_edge='2 mm'; may be given several times.
    force
        Replace existing files; also export a result of a run that did not succeed.
    """
    from hkt_mdo.exports.base import export

    formats = [name.strip() for each in to for name in each.split(",")]
    parts.print_lines(export(read_result(result), formats, out, options=options or (), force=force))


def simulate(
    result: ResultFolder,
    flow: Annotated[str, Option(metavar="FLOW")] = "design",
    snr: Annotated[float | None, Option("--noise-snr", metavar="DB")] = None,
    reference: Annotated[str, Option("--noise-reference", metavar="NAME")] = "fluctuation",
    rate: Annotated[float, Option("--sample-rate", metavar="HZ")] = 100.0,
    cutoff: Annotated[float, Option("--filter-cutoff", metavar="HZ")] = 0.5,
    repeats: Annotated[int, Option(min=1, max=100_000)] = 20,
    seed: Annotated[int, Option(min=0)] = 1,
    flow_seeds: Annotated[str | None, Option(metavar="SEEDS")] = None,
    scenario: Annotated[str | None, Option(metavar="NAME")] = None,
    condition: Annotated[str | None, Option(metavar="CONDITION")] = None,
    cut_out: Annotated[float | None, Option(metavar="M/S")] = None,
    start: Annotated[bool, Option("--start-up")] = False,
    stop: Annotated[float | None, Option("--shut-down", metavar="SECONDS")] = None,
    inflow_dynamics: Annotated[str | None, Option(metavar="NAME")] = None,
    tau1: Annotated[float | None, Option(metavar="SECONDS")] = None,
    out: Annotated[Path | None, Option(metavar="DIR")] = None,
    strict: Annotated[bool, Option("--strict")] = False,
    as_json: Json = False,
    as_csv: AsCsv = False,
) -> None:
    """Simulate a result in another flow, with sensor noise, or from standstill.

    Blade and controller of a finished result are held and simulated with direct BEM. Open loop
    replays its recorded torque, with a feedback that holds the speed where the rotor is unstable
    under that torque; with --noise-snr feedback reads a noisy, filtered speed sensor, in many
    repeated runs. In a resource, such as {profile: distribution, scale: 1.4, shape: 2}, the command
    prints the energy of a year in the equilibria of a feedback design. The rotor begins at the
    design's first tip speed ratio; that of a year, in the equilibrium of its law. If it stops or
    stalls, that is reported; if it stops, its energy is not counted. The command prints the largest
    value of each limit over time, without noise and with it, and of the loads that have no limit;
    with several scenarios and seeds, the largest of all. --json and --csv print those of each
    simulation, as --out writes them. With --inflow-dynamics oye the wake needs time to change: the
    command prints what that changes, and whether the rotor runs away.

    Parameters
    ----------
    flow
        design: the result's own; A, B or C: the paper's uncertain flows (speeds x 1.1, frequency
        0.225 rad/s, phase 0.2 pi); or an inflow section in YAML, such as {profile: sine, mean:
        1.4}.
    snr
        Signal-to-noise ratio of the speed sensor.
    reference
        Which speed is the signal of that ratio: fluctuation (about its mean) or total.
    rate
        Samples of the sensor per second.
    cutoff
        Frequency of the second-order Butterworth low-pass behind the sensor; 0: no filter. It
        delays the torque, at 0.5 Hz by half a second, which alone may stop a rotor.
    repeats
        Number of noisy runs.
    seed
        Seed of the random numbers.
    flow_seeds
        Seeds of a turbulent flow, such as 1..20 or 3,5,9: each is simulated.
    scenario
        Simulate the operation of this scenario only, of a result with several.
    condition
        Fouling in place of the case's condition, such as {lift: 0.9, drag: 1.5}.
    cut_out
        Flow speed (m/s) above which the machine stands still, in place of control.cut_out.
    start
        Start from standstill, without torque, and let the law take over in operation.
    stop
        With --start-up: the time (s) from which the torque is at its limit, to stop the rotor.
    inflow_dynamics
        quasi_steady: the wake is in equilibrium at every instant; oye: it has memory, by Oye's two
        filters at every station; see docs/dynamic_inflow.md.
    tau1
        With --inflow-dynamics oye: the slow filters' time constant (s). Default: by the induction
        at 0.7 R, 1.1 R / ((1 - 1.3 a) V).
    out
        Folder for simulations.json and simulations.csv; files of these names are replaced.
    strict
        Exit with 3 if a limit is broken, or the rotor stops, with noise or without, stalls or runs
        away.
    """
    from hkt_mdo.results.words import flow_words, limit_words
    from hkt_mdo.studies.other_flows import largest, records, simulations, write
    from hkt_mdo.studies.uncertainty import Sensor

    for_program, solution = parts.one_form(as_json, as_csv), read_result(result)
    sensor = Sensor(inf if snr is None else snr, reference, rate, cutoff or None)
    noise = None if snr is None else (sensor, repeats, seed)
    only = solution if scenario is None else solution.scenario(scenario)
    more = inflow_dynamics, tau1, start, stop, noise
    runs = simulations(only, flow, flow_seeds, condition, cut_out, *more)
    several_runs = len(runs) > 1
    words = f"{flow}: {len(runs)} simulations" if several_runs else flow_words(runs[0].inflow)
    words += f"; condition {condition}" if condition else ""
    echo(f"{solution.folder}, {solution.case.control.law}, in flow {words}", err=for_program)
    for run in runs:
        with Console(stderr=True).status("simulating"):
            lines = run.lines(several_runs)
        echo("  " + "\n  ".join(lines), err=for_program)
    operating = [run for run in runs if not run.start or run.began.operation]
    if for_program:
        parts.print_records(records(operating), as_json)
    elif rows := [entry.row(name) for name, entry in largest(operating).items()]:
        over = f" of {len(operating)} simulations" if several_runs else ""
        parts.print_tables({f"Largest values{over}": rows})
    if out is not None:
        parts.print_lines(write(out, operating), err=for_program)
    broken = [limit_words(name) for name, x in largest(operating).items() if x.kept is False]
    if strict and broken:
        raise parts.failed(f"not kept: {', '.join(broken)}")
