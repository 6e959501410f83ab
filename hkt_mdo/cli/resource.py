"""The command that reads a record of a flow and writes what a case takes as `resource`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option, echo

from hkt_mdo.cli import parts

_FILE = "Record of a speed or a discharge: CSV, JSON of NOAA or USGS as MHKiT saves it, NetCDF."
_KEY = "A key of the profile long_record, such as speed_column=v or rating=curve.csv."
_TIDE = "Tidal constituents, such as M2,S2,K1, or auto for those that the record separates."


def resource(
    file: Annotated[Path, Argument(metavar="FILE", help=_FILE)],
    out: parts.Folder = Path("results/resource"),
    keys: Annotated[list[str] | None, Option("--set", metavar="KEY=VALUE", help=_KEY)] = None,
    constituents: Annotated[str, Option(metavar="NAMES", help=_TIDE)] = "",
    force: parts.Force = False,
) -> None:
    """Read a long record of a flow, and write how long it has each speed.

    Writes resource.csv, the hours of each speed in a year, with case.yaml, the lines that a case
    takes, and figures. With --constituents also tide.yaml, the constituents of the tide, and what
    they explain of the record; their prediction is drawn beside it.
    """
    from hkt_mdo.cli.resource_report import report_resource

    for line in report_resource(file, out, keys or (), constituents, force):
        echo(line)
