"""The commands that help to write a case: new, check, n2, schema, polar, resource."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option, echo

from hkt_mdo.cli import parts
from hkt_mdo.errors import InputError


def new(
    name: Annotated[Path, Argument(metavar="NAME")],
    kind: Annotated[str, Option(metavar="KIND")] = "paper",
    force: parts.Force = False,
) -> None:
    """Write a commented case to begin from.

    It has the usual keys of every section, each with its meaning in a comment, and can be run as it
    is. Kinds: paper, the turbine and the sinusoidal flow of Amini et al.; turbine, with a sample
    blade as CSV beside it; river, with a sample record of the flow as CSV.

    Parameters
    ----------
    name
        Name or path of the case; .yaml is added to it.
    kind
        paper, turbine or river.
    """
    from hkt_mdo.cli.new_case import write_new_case

    parts.print_lines(write_new_case(name, kind, force=force))


def check(
    case: parts.CaseFile,
    overrides: parts.Overrides = None,
    out: Annotated[Path | None, Option(metavar="DIR")] = None,
    no_figures: Annotated[bool, Option("--no-figures", hidden=True)] = False,
    as_json: parts.Json = False,
    as_csv: parts.AsCsv = False,
) -> None:
    """Check a case before a long run.

    Reads and builds all that a run of the case needs and prints what the case means: turbine, flow,
    control law and size, and how the starting blade would operate: its loads, and by how much it
    keeps or breaks each limit. Notes say what was converted or repaired in the files, warnings what
    is probably a mistake. Nothing is optimized, and nothing is written unless
    --out names a folder for the figures of blade, polar, inflow and power curve.

    Parameters
    ----------
    out
        Folder for figures (PNG), made if need be; without it nothing is written.
    """
    for_program = parts.one_form(as_json, as_csv)
    loaded = parts.read_case(case, overrides)

    from hkt_mdo.run.check import check_case

    try:
        report = check_case(loaded)
    except InputError as error:  # found only when the parts of the case meet
        error.file = error.file or str(case)
        raise
    tables = report.tables | {"Notes": report.notes, "Warnings": report.warnings}
    parts.print_tables(tables, as_json, as_csv)
    if out and not no_figures:
        from hkt_mdo.run.check_figures import save_check_figures

        written = save_check_figures(report, out)
        names = ", ".join(path.name for path in written)
        echo(f"Figures: {written[0].parent}: {names}", err=for_program)
    number = len(report.warnings)
    doubts = f", with {number} warning{'s' if number > 1 else ''}" if number else ""
    echo(f"{loaded.name} can be run{doubts}.", err=for_program)


def schema(markdown: Annotated[bool, Option("--markdown")] = False) -> None:
    """Print every key of a case file.

    The output is a JSON schema: every key with its meaning, default, unit and range. An editor that
    uses it checks and completes cases (see docs/cases.md).

    Parameters
    ----------
    markdown
        Print a page to read in place of the JSON schema.
    """
    import json

    from hkt_mdo.case.document import case_json_schema, case_markdown

    if markdown:
        echo(case_markdown(extensions=parts.EXTENSIONS.get()), nl=False)
    else:
        echo(json.dumps(case_json_schema(extensions=parts.EXTENSIONS.get()), indent=2))


def n2(
    case: parts.CaseFile,
    out: Annotated[Path | None, Option(metavar="FILE")] = None,
    overrides: parts.Overrides = None,
) -> None:
    """Write the N2 diagram of a case.

    The diagram is an HTML page, NAME_n2.html unless --out is given, where NAME is the name of the
    case. It shows which component of the case's OpenMDAO problem feeds which. Nothing is optimized.

    Parameters
    ----------
    out
        HTML file to write.
    """
    loaded = parts.read_case(case, overrides)
    path = out or Path(f"{loaded.name}_n2.html")

    from hkt_mdo.run.run import write_n2

    write_n2(loaded, path)
    echo(str(path))


def polar(
    outline: Annotated[str, Argument(metavar="OUTLINE")],
    reynolds: Annotated[str, Option(metavar="RE,RE,...")],
    out: parts.Folder = Path("results/polars"),
    alpha: Annotated[str, Option(metavar="FIRST:LAST:STEP")] = "-16:24:0.5",
    n_crit: Annotated[float, Option()] = 9.0,
    model: Annotated[str, Option(metavar="SIZE")] = "xlarge",
    beside: Annotated[list[str] | None, Option(metavar="POLAR")] = None,
    force: parts.Force = False,
) -> None:
    """Compute the polars of an outline.

    NeuralFoil (the extra `neuralfoil` of hkt_mdo) computes lift, drag and moment of the section;
    potential flow with this lift gives the smallest pressure (cpmin) of either surface. They are
    written as a CSV file that rotor.polar takes, with the network's confidence in every row, and as
    a figure. Angles of attack count from the outline's x axis, the chord line.

    Parameters
    ----------
    outline
        Shipped name (naca63815) or file: CSV x_over_c,y_over_c, Selig or Lednicer.
    reynolds
        Reynolds numbers by the chord.
    alpha
        Angles of attack, degrees.
    n_crit
        Critical exponent of the e^n method for transition; less in turbulent flow.
    model
        Network, xxsmall to xxxlarge.
    beside
        Another polar to draw in the figure, shipped or a file; may be given several times.
    """
    from hkt_mdo.cli.polar_report import parse_alpha, parse_reynolds, report_polars

    inputs = outline, parse_reynolds(reynolds), parse_alpha(alpha), out, n_crit, model
    parts.print_lines(report_polars(*inputs, beside or (), force))


def resource(
    file: Annotated[Path, Argument(metavar="FILE")],
    out: parts.Folder = Path("results/resource"),
    keys: Annotated[list[str] | None, Option("--set", metavar="KEY=VALUE")] = None,
    constituents: Annotated[str, Option(metavar="NAMES")] = "",
    force: parts.Force = False,
) -> None:
    """Read a long record of a flow, and write how long it has each speed.

    Writes resource.csv, the hours of each speed in a year, with case.yaml, the lines that a case
    takes, and figures. With --constituents also tide.yaml, the constituents of the tide, and what
    they explain of the record; their prediction is drawn beside it.

    Parameters
    ----------
    file
        Record of a speed or a discharge: CSV, JSON of NOAA or USGS as MHKiT saves it, NetCDF.
    keys
        A key of the profile long_record, such as speed_column=v or rating=curve.csv.
    constituents
        Tidal constituents, such as M2,S2,K1, or auto for those that the record separates.
    """
    from hkt_mdo.cli.resource_report import report_resource

    parts.print_lines(report_resource(file, out, keys or (), constituents, force))
