"""A sweep: one case with other values of some keys, on a grid or at random."""

import json
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, Strict

from hkt_mdo.case.document import quantities
from hkt_mdo.case.kinds import Extension
from hkt_mdo.case.schema import Case, load_case
from hkt_mdo.errors import InputError, show
from hkt_mdo.files.shipped import find_case
from hkt_mdo.files.table import read_text
from hkt_mdo.files.yaml_text import dump, parse
from hkt_mdo.messages import validated
from hkt_mdo.sections import Flaws, Section, refusal

SWEEP = "sweep.yaml"
"""Where a sweep's folder has what was asked."""
MAX_BYTES = 1024**2  # of a sweep file
MOST_VALUES = 1_000_000
_NUMBER = re.compile(r"\s*([+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(.*?)\s*")

Point = dict[str, Any]
"""What a run of a sweep has: the values of its keys."""

Place = dict[str, float]
"""Where a point is on the axis of each key: a share of its way, 0 to 1."""


class Axis(Section):
    """The values of one key: a list, or a range of numbers.

    A list may be given as it is. A range with a `count` is a part of the grid; one without is where
    random samples lie. Its ends may have a unit, the same one.
    """

    short: ClassVar[str] = "values"

    values: Annotated[tuple[Any, ...], Field(min_length=1)] | None = None
    """Values of the key, as a case has them: numbers, texts with units, names, whole sections."""
    from_: float | str | None = Field(None, alias="from")
    """First value of a range."""
    to: float | str | None = None
    """Last value of a range."""
    count: Annotated[int, Strict(), Field(ge=2, le=MOST_VALUES)] | None = None
    """Number of values of a range; null: random samples."""
    spacing: Literal["linear", "log"] = "linear"
    """Whether values of a range differ by the same amount, or by the same factor."""

    def flaws(self) -> Flaws:
        if self.values is not None:
            if (self.from_, self.to, self.count) != (None, None, None):
                yield "", "has values and a range", "give one of them"
            if len({json.dumps(value, sort_keys=True) for value in self.values}) < len(self.values):
                yield "values", "has a value twice", "give each value once"
        else:
            low, high, _ = self.ends
            if self.spacing == "log" and low * high <= 0.0:
                yield "", "has ends without a common sign", "give spacing: linear"
            if low == high:
                yield "", "begins where it ends", "give two different ends"

    @property
    def size(self) -> int:
        """Number of values on a grid; 0 of random samples."""
        return len(self.values) if self.values else self.count or 0

    @property
    def ends(self) -> tuple[float, float, str]:
        """Numbers of both ends of a range, and their unit."""
        matches = [_NUMBER.fullmatch(str(end)) for end in (self.from_, self.to)]
        try:
            (low, unit), (high, other) = ((float(x[1]), x[2]) for x in matches if x)
        except ValueError:
            remedy = "write {from: 1 m, to: 2 m, count: 5}, or a list of values"
            raise refusal("must be a list or a range of numbers", remedy) from None
        if unit != other or not math.isfinite(low + high):
            problem = "has ends of two units, or an infinite one"
            raise refusal(problem, "give both ends in one unit, as numbers")
        return low, high, unit

    def at(self, share: float) -> Any:
        """Return the value of a list, or of a range, at a share of its way, 0 to 1."""
        if self.values:
            return self.values[round(share * (len(self.values) - 1))]
        low, high, unit = self.ends
        number = low + (high - low) * share
        if self.spacing == "log":
            number = low * (high / low) ** share
        plain = json.loads(f"{number:.12g}")  # a whole one as an integer
        return f"{plain!r} {unit}" if unit else plain


class Sweep(Section):
    """Many runs of one case, in which some keys have other values."""

    case: str
    """Case file, relative to the sweep's folder, or the name of a shipped case."""
    over: Annotated[dict[str, Axis], Field(min_length=1)]
    """Values of keys of the case, such as `control.torque_limit: [500, 600]`. Each combination of
    lists and of ranges with a `count` is run, with each sample of the ranges without one."""
    set_: dict[str, Any] = Field({}, alias="set")
    """Keys of the case that have another value in all runs."""
    samples: Annotated[int, Strict(), Field(ge=1, le=MOST_VALUES)] | None = None
    """Number of random samples, by Latin hypercube, of the ranges without a `count`."""
    seed: Annotated[int, Strict(), Field(ge=0)] = 0
    """Seed of the random samples."""
    neighbours: bool = False
    """Whether each run starts a second time, from the design of the nearest verified run that has
    ended; the better verified result counts. Takes twice as long."""
    front: str | None = None
    """Column of the table, such as `mass_kg` or `stress_Pa`, which is to be small while the
    objective is to be good: the other axis of the Pareto front. null: the first key of numbers."""
    _extensions: tuple[Extension, ...] = PrivateAttr(())  # of the cases

    def flaws(self) -> Flaws:
        if self.samples is not None and not self.sampled:
            problem = "has no use where every key has a list or a count"
            yield "samples", problem, "leave it out, or leave out the count of a range"
        if self.samples is None and self.sampled:
            problem = f"is missing, and the range of {self.sampled[0]} has no count"
            yield "samples", problem, "give the range a count, or the sweep samples: 100"

    @property
    def sampled(self) -> list[str]:
        """The keys that have random samples."""
        return [key for key, axis in self.over.items() if not axis.size]

    @property
    def columns(self) -> list[str]:
        """The keys' columns in the table, in which two outcomes are called objective and start."""
        return [f"case.{key}" if key in ("objective", "start") else key for key in self.over]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each key of a grid, and of the samples last, if there are any."""
        sizes = (*(axis.size for axis in self.over.values()), self.samples)
        return tuple(size for size in sizes if size)

    @property
    def size(self) -> int:
        """Number of runs."""
        return math.prod(self.shape)

    def places(self) -> Iterator[Place]:
        """Yield the place of every point; the last key changes fastest."""
        sizes = {key: axis.size for key, axis in self.over.items() if axis.size}
        grid = [np.linspace(0.0, 1.0, size) for size in sizes.values()]
        keys, drawn = (*sizes, *self.sampled), np.empty((1, 0))
        if self.samples:
            from scipy.stats import qmc

            drawn = qmc.LatinHypercube(len(self.sampled), seed=self.seed).random(self.samples)
        for *shares, sample in product(*grid, drawn):
            place = dict(zip(keys, (*shares, *sample), strict=True))
            yield {key: place[key] for key in self.over}

    def points(self) -> Iterator[Point]:
        """Yield every point, in the order of `places`."""
        return map(self.point_at, self.places())

    def point_at(self, place: Place) -> Point:
        """Return the values of the keys at a place."""
        return {key: self.over[key].at(share) for key, share in place.items()}

    def to_yaml(self) -> str:
        """Return the sweep as YAML, without what is by default."""
        data = self.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        return dump(data | {"seed": self.seed})

    def case_at(self, point: Point) -> Case:
        """Return the case of a point. Raises InputError where that has no case."""
        changes = [f"{key}={json.dumps(value)}" for key, value in (self.set_ | point).items()]
        return load_case(self.case, changes, extensions=self._extensions)

    def row_at(self, point: Point) -> Point:
        """Return the values of a point in the table: numbers in the unit of the key, or texts."""
        row: Point = {}
        for name, (key, value) in zip(self.columns, point.items(), strict=True):
            row[name] = value if isinstance(value, str | int | float) else json.dumps(value)
            for x in quantities(key, self._extensions):
                with suppress(ValueError):  # a name, a section, or the unit of another law
                    row[name] = x.read(value.get("bound") if isinstance(value, dict) else value)
                    break
        return row

    def check(self, file: object) -> None:
        """Try values of lists and ends of ranges, each beside the first values of the others.

        Raises InputError for a key that the case does not have and for a value that it cannot have,
        with `file` and the values that were tried.
        """
        load_case(self.case, extensions=self._extensions)
        first = next(self.points())
        for key, axis in self.over.items():
            for share in np.linspace(0.0, 1.0, len(axis.values) if axis.values else 2):
                point = {key: axis.at(share)}
                try:
                    self.case_at(first | point)
                except InputError as error:
                    error.file = str(file)
                    error.remedy += f" (in the run with {show(point)})"
                    raise


def load_sweep(
    source: str | Path, extensions: Iterable[Extension] = (), check: bool = True
) -> Sweep:
    """Read a sweep file, and, with `check`, try its values (`Sweep.check`).

    `extensions` are those of `load_case`, for all cases of the sweep.

    Raises InputError, with file, key, value and remedy, if anything in it is wrong.
    """
    path = Path(source)
    data = parse(read_text(path, "sweep file in YAML", MAX_BYTES), str(path))
    if not isinstance(data, dict):
        remedy = "write case: FILE and over: {control.torque_limit: [500, 600, 700]}"
        raise InputError("must hold keys and values at its top", remedy, file=path, value=data)
    sweep = validated(Sweep, data, str(path))
    sweep._extensions = tuple(extensions)
    if not check:
        return sweep
    case = path.parent / sweep.case
    case = case if case.is_file() else find_case(sweep.case)
    if not case.is_file():
        remedy = "give a case file, relative to the sweep's folder, or the name of a shipped case"
        raise InputError("is not a file", remedy, file=path, key="case", value=sweep.case)
    sweep = sweep.model_copy(update={"case": str(case.absolute())})
    sweep.check(path)
    return sweep
