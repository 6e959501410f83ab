"""Table of a blade, the same for every file format: rows from root to tip, and their checks."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Column

FEWEST_ROWS, MOST_ROWS = 2, 100_000
"""A blade needs two ends; more rows than the latter are a file of something else."""

EDGE = 1e-9
"""A row this close to the hub or the tip, over the tip radius, lies on it."""

THINNEST, THICK_ROUNDED = 0.01, 1e-6
"""Least thickness over chord, and how far it may be rounded above 1."""


@dataclass(frozen=True, eq=False)
class SectionTable:
    """A section (airfoil) in a turbine file; values that the file does not give are None."""

    name: str
    thickness: float | None
    """Thickness over chord."""
    polars: tuple
    """Tables of type `PolarTable`, by Reynolds number."""
    outline: tuple[np.ndarray, ...] = ()
    """Its outline along and across the chord, over the chord, each of shape (n_points,)."""


@dataclass(frozen=True, eq=False)
class BladeTable:
    """The rows of a blade file, in SI units and radians; values that it does not give are None."""

    r: np.ndarray
    """Distance from the rotor's centre along the blade, m, strictly increasing, shape (n_rows,)."""
    chord: np.ndarray
    """Chord, m, shape (n_rows,)."""
    twist: np.ndarray
    """Angle of the chord to the rotor plane without a set angle, rad, shape (n_rows,)."""
    relative: bool = False
    """Whether lengths are over the tip radius."""
    thickness: np.ndarray | None = None
    """Thickness over chord, shape (n_rows,)."""
    section: tuple[str, ...] | None = None
    """Name of each row's section; AeroDyn's BlAFID as text, such as "1"."""
    sections: tuple[SectionTable, ...] = ()
    """The sections that the file itself holds."""
    section_position: tuple[tuple[str, float], ...] | None = None
    """Names of sections and their radii (as `r`), root to tip (windIO)."""
    tip_radius: float | None = None
    """Radius of the tip, m."""
    hub_radius: float | None = None
    """Radius of the blade's root, m, or over the tip radius as `r`."""
    blade_count: int | None = None
    """Number of blades."""
    cone: float | None = None
    """Angle between the blade and the rotor plane, rad."""
    messages: tuple[str, ...] = ()
    """Every conversion made and everything in the file that is ignored."""
    doubts: tuple[str, ...] = ()
    """What in the file is probably a mistake."""
    file: str = ""
    """The file, for messages."""

    def scaled(self, tip_radius: float) -> "BladeTable":
        """Return the table in metres for a tip radius.

        Parameters
        ----------
        tip_radius : float
            Radius of the tip, m.

        Returns
        -------
        BladeTable
            The table with lengths in proportion; with its own lengths if the file (CSV in metres)
            says no tip radius.

        Raises
        ------
        InputError
            If lengths are kept and the rows reach beyond the tip.
        """
        tip_radius = float(tip_radius)
        file_radius = 1.0 if self.relative else self.tip_radius
        if file_radius is None:
            last = float(self.r[-1])
            if last > tip_radius * (1.0 + EDGE):
                problem = f"reaches beyond the rotor's tip radius of {tip_radius:g} m"
                remedy = "check the unit of the radii, enlarge rotor.radius, or cut the rows"
                raise InputError(problem, remedy, file=self.file, key="outermost row", value=last)
            return replace(self, tip_radius=tip_radius)
        if file_radius == tip_radius and not self.relative:
            return self

        def scale(length):  # dividing first keeps a row that lies on the tip there, to the last bit
            return length / file_radius * tip_radius

        note = f"lengths scaled from a tip radius of {file_radius:g} m to {tip_radius:g} m"
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

    def interior(self, hub_radius: float) -> np.ndarray:
        """Return the radii of the rows strictly between hub and tip, where blade elements may lie.

        Of a table in metres, which knows the tip's radius (`scaled`).

        Parameters
        ----------
        hub_radius : float
            Radius of the hub, m.

        Returns
        -------
        numpy.ndarray
            The radii, m.
        """
        margin = EDGE * self.tip_radius
        return self.r[(self.r > hub_radius + margin) & (self.r < self.tip_radius - margin)]

    def blend(self, r: np.ndarray) -> tuple[tuple[str, str, float], ...]:
        """Return the two sections between which each station lies, of a file that names sections.

        The share of the outer one is linear in the thickness where that is known and differs, and
        in the radius where not; beyond the first and the last section these stand alone.

        Parameters
        ----------
        r : numpy.ndarray, shape (n_stations,)
            Radii in the table's unit of length.

        Returns
        -------
        tuple of (str, str, float)
            Inner section, outer section and share of the outer one at each station.
        """
        positions = self.section_position or tuple(zip(self.section, self.r, strict=True))
        names, radii = zip(*positions, strict=True)
        thicknesses = {section.name: section.thickness for section in self.sections}
        blends = []
        for radius in np.atleast_1d(np.asarray(r, dtype=float)):
            outer = int(np.searchsorted(radii, radius))
            inner = max(outer - 1, 0)
            outer = min(outer, len(names) - 1)
            share = 0.0
            if names[inner] != names[outer]:
                share = (radius - radii[inner]) / (radii[outer] - radii[inner])
                first, last = thicknesses.get(names[inner]), thicknesses.get(names[outer])
                if self.thickness is not None and first and last and first != last:
                    thickness = np.interp(radius, self.r, self.thickness)
                    share = np.clip((thickness - first) / (last - first), 0.0, 1.0)
            blends.append((names[inner], names[outer], float(share)))
        return tuple(blends)


def checked_rows(
    r: Column,
    chord: Column,
    twist: Column,
    thickness: Column | None,
    longest: float,
    twist_remedy: str = "check the unit of the twist",
) -> dict[str, Any]:
    """Return rows as `BladeTable` takes them; refuse those that cannot be a blade.

    Parameters
    ----------
    r : Column
        Radius, m or over the tip radius: not negative, strictly increasing.
    chord : Column
        Chord in the same unit: above 0, at most `longest`.
    twist : Column
        Twist, rad: within half a turn.
    thickness : Column or None
        Thickness over chord: above 0, at most 1.
    longest : float
        The outermost radius, in the unit of the chord.
    twist_remedy : str
        What to do about a twist that is too large.

    Returns
    -------
    dict of numpy.ndarray or None
        The numbers of the columns by their names here.

    Raises
    ------
    InputError
        If a value is out of its range, or there are too few or too many rows; it names the first
        wrong value.
    """
    size, every = r.values.size, np.ones(r.values.size, dtype=bool)
    only = f"is the only row: a blade has at least {FEWEST_ROWS}"
    r.refuse(every & (size < FEWEST_ROWS), only, "add the rows from hub to tip")
    many = f"is one of more than {MOST_ROWS} rows"
    r.refuse(every & (size > MOST_ROWS), many, "give a blade of usual length")
    r.check_rising("radii")
    r.refuse(r.values < 0.0, "is a negative radius", "measure radii from the rotor's axis")
    chord.refuse(chord.values <= 0.0, "is no chord", "chords must be greater than 0")
    long = f"is a chord longer than the outermost radius ({longest:g})"
    chord.refuse(chord.values > longest, long, "check the unit of the chord")
    twist.refuse(np.abs(twist.values) > np.pi * (1.0 + EDGE), "is beyond 180 degrees", twist_remedy)
    if thickness is not None:
        wrong = (thickness.values < THINNEST) | (thickness.values > 1.0 + THICK_ROUNDED)
        problem = "is no thickness over chord, which lies within 0.01 and 1 (1 and 100 %)"
        thickness.refuse(wrong, problem, "correct it; in a CSV, thickness_percent is in per cent")
    columns = {"r": r, "chord": chord, "twist": twist, "thickness": thickness}
    return {name: column and column.values for name, column in columns.items()}
