"""Give the shipped polars their smallest pressure coefficients, cpmin_upper and cpmin_lower.

python scripts/polar_suction.py

Replaces these two columns of every polar in hkt_mdo/files/data, or adds them; all others stay as
they are, letter by letter. The pressures are those of the potential flow round the shipped outline
with the circulation of the polar's own lift (`hkt_mdo.rotor.potential_flow`); the cylinder's is
that of potential flow without circulation, 1 - 4 sin² = -3.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "studies"))

from study_common import shipped_table

from hkt_mdo.files.polar_table import SURFACES
from hkt_mdo.files.shipped import POLAR_FAMILIES, locate
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.potential_flow import potential_suction

CYLINDER = -3.0
DECIMALS = 4


def pressures():
    """Return cpmin[2, n_rows] of every shipped polar by its name."""
    rows = shipped_table("cylinder", "polar")
    minima = {"cylinder": np.full((2, rows.size), CYLINDER)}
    for section, polars in POLAR_FAMILIES.items():
        outline = Outline.from_file(section)
        for polar in polars:
            table = shipped_table(polar, "polar")
            alpha = np.deg2rad(table["alpha_deg"])
            minima[polar] = -potential_suction(outline, alpha, table["cl"])
    return minima


def with_pressures(text, pressure):
    """Return a polar's CSV text with the two columns in place of those it may have."""
    header, *rows = (line.split(",") for line in text.splitlines())
    kept = [column for column, name in enumerate(header) if name not in SURFACES]
    numbers = [[f"{number + 0.0:.{DECIMALS}f}" for number in row] for row in pressure.T]
    lines = [
        [*(line[column] for column in kept), *new]
        for line, new in zip((header, *rows), (SURFACES, *numbers), strict=True)
    ]
    return "".join(",".join(line) + "\n" for line in lines)


def main():
    """Write the columns."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, help="folder (default: the package's)")
    out = parser.parse_args().out
    for name, pressure in pressures().items():
        path = locate(name, "polar")
        text = with_pressures(path.read_text(encoding="utf-8"), pressure)
        (out / path.name if out else path).write_text(text, encoding="utf-8")
        print(f"{path.name}: {pressure.min():.2f} at the lowest")


if __name__ == "__main__":
    main()
