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
    found = {}
    for name, file, sound, old, new, told in yaml.safe_load((DATA / "polars.yaml").read_text())[
        kind
    ]:
        text = new
        if sound is not None:
            text = (DATA / sound).read_text()
            assert text.count(old) == 1, name
            text = text.replace(old, new)
        found[name] = (file, text.encode(), told)
    return found


POLARS, OUTLINES = _spoiled("polars"), _spoiled("outlines")
_TABLES = (DATA / "sections.dat").read_bytes()
POLARS |= {
    "AeroDyn polar: NumAlf too large before a table": (
        "NumAlf_too_large_before_a_table.dat",
        _TABLES.replace(b"25  ", b"26  "),
        "line 41 = '1.000 Re': has 2 numbers where the table has 4 columns",
    ),
    "AeroDyn polar: NumAlf too small before a table": (
        "NumAlf_too_small_before_a_table.dat",
        _TABLES.replace(b"25  ", b"24  "),
        "line 39 = '16.00  1.9000  0.03560  -0.0800': comes where a value with its name",
    ),
    "XFOIL polar: same Re twice": (
        "same_Re_twice.pol",
        2 * (DATA / "section.pol").read_bytes(),
        "Reynolds number = 200000.0",
    ),
}
OUTLINES["outline: too many points"] = ("too many points.dat", b"0.5 0.1\n" * 5001, "5001 points")
