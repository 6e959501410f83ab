"""Broken polars and outlines: name, content, and what the one message must say.

Most are made from the sound files of tests/data/broken, by the changes in polars.yaml there.
"""

from pathlib import Path

import yaml

DATA = Path(__file__).parents[2] / "data" / "broken"
WELL = (
    *("polar.csv", "pressure.csv", "polars.csv", "section.dat", "sections.dat", "circle.dat"),
    *("section.pol", "selig.dat", "lednicer.dat", "outline.csv"),
)
"""The files before they were spoiled: all of them are to be read; the last three are outlines."""


def _spoiled(kind):
    """Return the broken files of a kind by the names of their flaws."""
    files = {}
    for name, file, sound, old, new, message in yaml.safe_load((DATA / "polars.yaml").read_text())[
        kind
    ]:
        text = new
        if sound is not None:
            text = (DATA / sound).read_text()
            assert text.count(old) == 1, name
            text = text.replace(old, new)
        files[name] = (file, text.encode(), message)
    return files


POLARS, OUTLINES = _spoiled("polars"), _spoiled("outlines")
_XFOIL, _TABLES = ((DATA / name).read_bytes() for name in ("section.pol", "sections.dat"))
_MORE, _FEWER = (_TABLES.replace(b"25  ", count) for count in (b"26  ", b"24  "))
_NO_ROW = "line 41 = '1.000 Re': has 2 numbers where the table has 4 columns"
_SHORT = _TABLES.replace(b"25  ", b"9  ", 1)  # rows that do not reach 12 degrees
_A_ROW = "line 39 = '16.00  1.9000  0.03560  -0.0800': comes where a value with its name"
POLARS |= {
    "AeroDyn polar: NumAlf too large before a table": ("large.dat", _MORE, _NO_ROW),
    "AeroDyn polar: NumAlf too small before a table": ("small.dat", _FEWER, _A_ROW),
    "AeroDyn polar: NumAlf far too small": ("short.dat", _SHORT, "comes where a value with its"),
    "XFOIL polar: same Re twice": ("twice.pol", 2 * _XFOIL, "Reynolds number = 200000.0"),
}
_HEADER = b"x_over_c,y_over_c\n"
OUTLINES |= {
    "outline: too many points": ("too many points.dat", b"0.5 0.1\n" * 5001, "5001 points"),
    "outline: a cell missing": ("cell.csv", _HEADER + b"1,2\n3\n", "line 3 = '3': has 1 cells"),
    "outline: too large": ("large.csv", _HEADER + b"#" * 16 * 1024**2, "larger than 16 MiB"),
}
