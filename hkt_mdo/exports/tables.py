"""The blade and the tables of a result as CSV."""

from __future__ import annotations

import io

import numpy as np

from hkt_mdo.exports.base import Format, Source


class Csv(Format):
    """The blade as CSV."""

    name = "csv"

    def files(self, source: Source) -> dict[str, bytes]:
        blade, text = source.design.blade, io.StringIO()
        columns = {"r_m": blade.r, "chord_m": blade.chord, "twist_deg": np.rad2deg(blade.twist)}
        for line in source.provenance:
            text.write(f"# {line}\n")
        text.write(",".join(columns) + "\n")
        for row in zip(*columns.values(), strict=True):
            text.write(",".join(repr(float(value)) for value in row) + "\n")
        return {"blade.csv": text.getvalue().encode()}
