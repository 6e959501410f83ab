"""Write the tables of tests/data/public/README.md from the public files there.

python studies/files_page.py
"""

from pathlib import Path

import numpy as np
import yaml

from hkt_mdo.dynamics.records import read_record
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.polar import read_polars
from hkt_mdo.rotor.outline import Outline

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "tests" / "data" / "public"
PAGE = FOLDER / "README.md"
MARK = "<!-- From here on written by python studies/files_page.py -->\n"


def listed() -> dict:
    """Return the list of files and their sources."""
    return yaml.safe_load((FOLDER / "sources.yaml").read_text(encoding="utf-8"))


def span(values, scale=1.0, digits=4) -> str:
    """Return the range of some numbers."""
    low, high = (f"{scale * end(values):.{digits}g}" for end in (np.min, np.max))
    return low if low == high else f"{low} to {high}"


def blade(entry: dict) -> str:
    """Read a blade and say what it is."""
    table = read_blade(FOLDER / entry["file"])
    chord = f"{table.r.size} rows, chord {span(table.chord)} m, twist"
    text = f"{chord} {span(table.twist, 180.0 / np.pi)}°"
    return f"{text}, {len(table.sections)} sections with polars" if table.sections else text


def polar(entry: dict) -> str:
    """Read polars and say what they are."""
    tables = read_polars(FOLDER / entry["file"])
    degrees = np.concatenate([table.alpha for table in tables])
    number = f"{len(tables)} tables" if len(tables) > 1 else "1 table"
    pressure = " with Cpmin" if tables[0].smallest_pressure is not None else ""
    reynolds = span([table.reynolds for table in tables], digits=3)
    return f"{number}{pressure}, Re {reynolds}, {span(degrees, 180.0 / np.pi)}°"


def outline(entry: dict) -> str:
    """Read an outline and say what it is."""
    shape = Outline.from_file(FOLDER / entry["file"])
    return f"{shape.x.size} points, {100 * shape.thickness:.4g} % thick, area {shape.area:.4f} c²"


def record(entry: dict) -> str:
    """Read a record and say what it is."""
    columns = read_record(FOLDER / entry["file"], **entry["options"])
    text = f"{columns.speed.size} samples every {columns.time[1]:.4g} s"
    return f"{text}, mean {np.mean(columns.speed):.4g} m/s, {span(columns.speed)} m/s low-passed"


READERS = {"blades": blade, "polars": polar, "outlines": outline, "records": record}


def tables() -> str:
    """Return the tables of the page."""
    listing = listed()
    sources = listing["sources"]
    lines = ["\n## How many\n", "| | here, read by the tests | also read | refused |"]
    lines.append("|---|---|---|---|")
    for kind in READERS:
        others = [entry for entry in listing["listed"] if f"{entry['kind']}s" == kind]
        counts = [sum(entry.get(key, 0) for entry in others) for key in ("read", "refused")]
        lines.append(f"| {kind} | {len(listing[kind])} | {counts[0]} | {counts[1]} |")
    for kind, read in READERS.items():
        lines += [
            f"\n## {kind.capitalize()}\n",
            "| file | what | source | read as |",
            "|---|---|---|---|",
        ]
        for entry in listing[kind]:
            name, what = entry["file"].rpartition("/")[2], entry["what"]
            options = ", ".join(
                f"`{key}: {value}`" for key, value in entry.get("options", {}).items()
            )
            text = read(entry) + (f"; by {options}" if options else "")
            lines.append(f"| `{name}` | {what} | {sources[entry['source']]['name']} | {text} |")
        others = [entry for entry in listing["listed"] if f"{entry['kind']}s" == kind]
        lines += ["\nNot shipped:\n", "| file | source | found |", "|---|---|---|"]
        for entry in others:
            lines.append(
                f"| {entry['file']} | {sources[entry['source']]['name']} | {entry['found']} |"
            )
    lines += ["\n## Sources\n", "| source | where | licence |", "|---|---|---|"]
    lines += [
        f"| {item['name']} | {item['place']} | {item['licence']} |" for item in sources.values()
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    head = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    PAGE.write_text(head + MARK + tables(), encoding="utf-8")
