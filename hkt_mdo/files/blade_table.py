"""What a blade table is: rows from root to tip, whichever format they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Column

__all__ = ["BladeTable", "SectionTable", "check_rows"]

FEWEST_ROWS, MOST_ROWS = 2, 100_000
EDGE = 1e-9
"""A row this close to the hub or the tip, over the tip radius, lies on it."""

THICK_ROUNDED = 1e-6
"""How far a thickness over chord may be rounded above 1."""


@dataclass(frozen=True, eq=False)
class SectionTable:
    """A section (airfoil) that comes inside a turbine file, its polars by Reynolds number.

    The outline is over the chord; what the file does not say is None.
    """

    name: str
    thickness: float | None
    polars: tuple
    outline_x: np.ndarray | None = None
    outline_y: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class BladeTable:
    """The rows of a blade file, in SI units and radians; what the file does not say is None."""

    r: np.ndarray
    """Distance from the rotor's centre along the blade, m, strictly increasing, shape (n_rows,)."""
    chord: np.ndarray
    twist: np.ndarray
    """Angle between the section's chord and the rotor plane, rad, without a set angle."""
    relative: bool = False
    """Whether lengths are over the tip radius."""
    thickness: np.ndarray | None = None
    """Thickness over chord."""
    section: tuple[str, ...] | None = None
    """Name of each row's section; AeroDyn's BlAFID as text, such as "1"."""
    sections: tuple[SectionTable, ...] = ()
    """The sections that the file itself holds."""
    section_position: tuple[tuple[str, float], ...] | None = None
    """Names of sections and the radii (as `r`) where they stand, root to tip (windIO)."""
    tip_radius: float | None = None
    hub_radius: float | None = None
    blade_count: int | None = None
    cone: float | None = None
    """Angle between the blade and the rotor plane, rad."""
    messages: tuple[str, ...] = ()
    """Every conversion made and everything passed over."""
    file: str = ""

    def scaled(self, tip_radius: float) -> BladeTable:
        """Return the table in metres for a tip radius (m).

        A table in metres whose file says no tip radius (CSV) keeps its lengths; InputError is
        raised if its rows reach beyond this one.
        """
        tip_radius = float(tip_radius)
        own = 1.0 if self.relative else self.tip_radius
        if own is None:
            last, key = float(self.r[-1]), "outermost row"
            if last > tip_radius * (1.0 + EDGE):
                problem = f"reaches beyond the rotor's tip radius of {tip_radius:g} m"
                remedy = "enlarge rotor.radius, cut the rows, or give r_over_R and chord_over_R"
                raise InputError(problem, remedy, file=self.file, key=key, value=last)
            return replace(self, tip_radius=tip_radius)
        if own == tip_radius and not self.relative:
            return self

        def scale(length):  # dividing first keeps a row that lies on the tip there, to the last bit
            return length / own * tip_radius

        note = f"lengths scaled from a tip radius of {own:g} m to {tip_radius:g} m"
        return replace(
            self,
            r=scale(self.r),
            chord=scale(self.chord),
            relative=False,
            section_position=self.section_position
            and tuple((name, scale(radius)) for name, radius in self.section_position),
            tip_radius=tip_radius,
            hub_radius=None if self.hub_radius is None else scale(self.hub_radius),
            messages=self.messages if self.relative else (*self.messages, note),
        )

    def interior(self, hub_radius: float | None = None) -> BladeTable:
        """Return the rows strictly between hub and tip, where blade elements may lie.

        The hub radius is in the table's unit of length, by default the file's own. Raises
        InputError if no row is left, or no hub radius is known.
        """
        hub = self.hub_radius if hub_radius is None else float(hub_radius)
        if hub is None:
            raise InputError("says no hub radius", "give one", file=self.file)
        tip = 1.0 if self.relative else self.tip_radius
        margin = EDGE * (self.r[-1] if tip is None else tip)
        keep = (self.r > hub + margin) & (self.r < (np.inf if tip is None else tip - margin))
        if not np.any(keep):
            problem = f"has no row between the hub ({hub:g}) and the tip"
            raise InputError(problem, "add rows there, or lessen the hub radius", file=self.file)
        return replace(
            self,
            r=self.r[keep],
            chord=self.chord[keep],
            twist=self.twist[keep],
            thickness=None if self.thickness is None else self.thickness[keep],
            section=self.section and tuple(compress(self.section, keep)),
            hub_radius=hub,
        )

    def blend(self, r: np.ndarray) -> tuple[tuple[str, str, float], ...]:
        """Return inner section, outer section and the share of the outer at each radius.

        Radii r[n_stations] are in the table's unit of length. The share is linear in the thickness
        where it is known and differs, and in the radius where not; beyond the first and the last
        section they stand alone. Raises InputError if the file names no sections.
        """
        if self.section_position is None and self.section is None:
            raise InputError("names no sections", "add a column section", file=self.file)
        stands = self.section_position or tuple(zip(self.section, self.r, strict=True))
        names, places = zip(*stands, strict=True)
        thick = {section.name: section.thickness for section in self.sections}
        blends = []
        for radius in np.atleast_1d(np.asarray(r, dtype=float)):
            outer = int(np.searchsorted(places, radius))
            inner = max(outer - 1, 0)
            outer = min(outer, len(names) - 1)
            share = 0.0
            if names[inner] != names[outer]:
                share = (radius - places[inner]) / (places[outer] - places[inner])
                first, last = thick.get(names[inner]), thick.get(names[outer])
                if self.thickness is not None and first and last and first != last:
                    here = np.interp(radius, self.r, self.thickness)
                    share = np.clip((here - first) / (last - first), 0.0, 1.0)
            blends.append((names[inner], names[outer], float(share)))
        return tuple(blends)


def check_rows(
    r: Column,
    chord: Column,
    twist: Column,
    thickness: Column | None,
    longest: float,
    twist_remedy: str = "check the unit of the twist",
) -> None:
    """Refuse rows that are no blade, by the first value that is wrong.

    Radii (from zero) must increase strictly, chords lie within 0 and `longest`, the outermost
    radius, twists (rad) within half a turn and thicknesses within 0 and 1. Lengths are in metres or
    all over the tip radius.
    """
    count = np.full(r.values.size, r.values.size)
    only = f"is the only row: a blade has at least {FEWEST_ROWS}"
    r.refuse(count < FEWEST_ROWS, only, "add the rows from hub to tip")
    many = f"is one of more than {MOST_ROWS} rows"
    r.refuse(count > MOST_ROWS, many, "give a blade of usual length")
    r.check_rising("radii")
    r.refuse(r.values < 0.0, "is a negative radius", "count radii from the rotor's centre")
    chord.refuse(chord.values <= 0.0, "is no chord", "chords must be greater than 0")
    long = f"is a chord longer than the outermost radius ({longest:g})"
    chord.refuse(chord.values > longest, long, "check the unit of the chord")
    turned = np.abs(twist.values) > np.pi * (1.0 + EDGE)
    twist.refuse(turned, "is beyond 180 degrees", twist_remedy)
    if thickness is not None:
        wrong = (thickness.values <= 0.0) | (thickness.values > 1.0 + THICK_ROUNDED)
        problem = "is no thickness over chord, which lies within 0 and 1 (0 and 100 %)"
        thickness.refuse(wrong, problem, "correct it; in a CSV, thickness_percent is in per cent")
