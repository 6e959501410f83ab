"""The flow of a case as an object of physics: what `inflow` says, built and checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.dynamics import inflow
from hkt_mdo.dynamics.records import RecordOptions, read_record
from hkt_mdo.errors import InputError

__all__ = ["build_inflow", "check_flow", "flow_messages", "horizon"]

_CHECKS_PER_PERIOD = 16
_FEWEST_CHECKS = 1024
_BLOCK = 1_000_000


def build_inflow(section: Any) -> inflow.Inflow:
    """Return the flow that an inflow section describes; reads the file of a record.

    Parameters
    ----------
    section : one of the classes of `hkt_mdo.case.Inflow`

    Returns
    -------
    Inflow
        With `duration` and `cutoff`, see `horizon`, and maybe `messages`, see `flow_messages`.

    Raises
    ------
    InputError
        If a record is broken, or a flow that has a duration does not keep its direction.
    """
    flow = _BUILD[section.profile](section)
    duration, _ = horizon(flow)
    if duration is not None:
        check_flow(flow, duration)
    return flow


def flow_messages(flow: inflow.Inflow) -> tuple[str, ...]:
    """Return what was done to make the flow, such as the repairs of a record, one line each."""
    return tuple(getattr(flow, "messages", ()))


def horizon(flow: Any) -> tuple[float | None, float | None]:
    """Return how long and how finely to look at a flow, or at an inflow section, which is built.

    Returns
    -------
    duration : float or None, s
        Length of its record or realization; None: it has no end.
    cutoff : float or None, Hz
        Highest frequency that matters in it; None: it is steady.
    """
    if hasattr(flow, "profile"):
        flow = build_inflow(flow)
    return getattr(flow, "duration", None), getattr(flow, "cutoff", None)


def check_flow(flow: inflow.Inflow, duration: float) -> None:
    """Refuse a flow that ends, stands still or turns back within a time.

    Looks sixteen times in the shortest period: turbines here do not reverse.

    Parameters
    ----------
    flow : Inflow
    duration : float, s
        The flow is looked at from 0 to this time.

    Raises
    ------
    InputError
        If the record is shorter, or the speed is anywhere zero or less.
    """
    end = _end(flow)
    if duration > end * (1.0 + 1e-9):
        raise InputError(
            f"is longer than the record of the flow, {end:.6g} s",
            "give phase.duration: null for the whole record, or a shorter one",
            key="phase.duration",
            value=duration,
        )
    cutoff = getattr(flow, "cutoff", None) or 0.0
    count = max(_FEWEST_CHECKS, int(_CHECKS_PER_PERIOD * duration * cutoff)) + 1
    for first in range(0, count, _BLOCK):
        time = duration / (count - 1) * np.arange(first, min(first + _BLOCK, count))
        speed = np.asarray(flow.speed(time))
        low = int(np.argmin(speed))
        if not speed[low] > 0.0:
            raise InputError(
                f"reaches {speed[low]:.3g} m/s at t = {time[low]:.6g} s: it stands still or turns "
                "back, which the turbine does not",
                "give a larger mean, smaller fluctuations or a shorter phase.duration",
                key="inflow",
            )


def _end(flow: Any) -> float:
    """Return the time, s, beyond which a flow has no samples."""
    if isinstance(flow, inflow.SumInflow):
        return min(map(_end, flow.parts))
    ends = isinstance(flow, inflow.SampledInflow) and flow.period is None
    return flow.duration if ends else np.inf


# One entry a profile ------------------------------------------------------------------------------


def _record(section: Any) -> inflow.SampledInflow:
    try:
        state = Path(section.file).stat()
    except OSError:  # which reading it will tell
        return _read(section, None)
    return _read(section, (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=2)  # a case is built more than once, and reading takes longest
def _read(section: Any, state: Any) -> inflow.SampledInflow:
    options = {option.name: getattr(section, option.name) for option in fields(RecordOptions)}
    record = read_record(section.file, **options)
    return inflow.SampledInflow(
        record.time, record.speed, cutoff=record.cutoff, messages=record.messages
    )


def _turbulence(section: Any) -> inflow.TurbulentInflow:
    return inflow.TurbulentInflow(
        section.spectrum,
        section.mean,
        section.intensity,
        section.length_scale,
        section.seed,
        section.duration,
        section.highest_frequency,
    )


def _tide(section: Any) -> inflow.TidalInflow:
    harmonics = tuple(
        inflow.Harmonic(
            each.amplitude,
            inflow.TIDAL_PERIODS[each.name] if each.period is None else each.period,
            each.phase,
        )
        for each in section.constituents
    )
    return inflow.TidalInflow(section.mean, harmonics, section.scale)


def _sum(section: Any) -> inflow.SumInflow:
    parts = tuple(_BUILD[part.profile](part) for part in section.parts)
    means = (_mean(part, flow) for part, flow in zip(section.parts[1:], parts[1:], strict=True))
    return inflow.SumInflow(parts, sum(means))


def _mean(section: Any, flow: Any) -> float:
    """Return what a flow fluctuates about, m/s."""
    if isinstance(flow, inflow.SampledInflow):
        return float(np.mean(flow.speed_values))
    return {
        "constant": lambda: section.speed,
        "step": lambda: section.before,
        "sine": lambda: section.scale * section.mean,
        "turbulence": lambda: section.mean,
        "tide": lambda: section.scale * section.mean,
        "gust": lambda: section.mean,
    }[section.profile]()


_BUILD: dict[str, Callable[[Any], inflow.Inflow]] = {
    "constant": lambda s: inflow.ConstantInflow(s.speed),
    "step": lambda s: inflow.StepInflow(s.before, s.after, s.time, s.width),
    "sine": lambda s: inflow.SineInflow(s.mean, s.amplitude, s.angular_frequency, s.phase, s.scale),
    "record": _record,
    "turbulence": _turbulence,
    "tide": _tide,
    "gust": lambda s: inflow.GustInflow(s.mean, s.amplitude, s.time, s.width, s.shape),
    "sum": _sum,
}
