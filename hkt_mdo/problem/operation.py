"""The time in which a turbine operates: a scenario for each interval below the cut-out speed."""

from dataclasses import replace

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.problem.scenario import Scenario

MOST_INTERVALS = 200  # each is a phase of the problem and adds to the time of setup


def in_operation(
    whole: Scenario, cut_out: float | None, diameter: float
) -> tuple[tuple[Scenario, ...], tuple[str, ...]]:
    """Return the scenarios of a flow in which a turbine operates, and messages about them.

    `whole` has the flow over the whole time. Above the speed `cut_out` (m/s) the machine stands
    still. Each interval in which the flow is slower is a scenario, of segments as long as those of
    the case. One that is shorter than a segment, or than the flow takes to pass the rotor's
    `diameter` (m), is standstill too: a rotor and its wake need that long to come into balance. A
    flow that is nowhere faster is left as it is. Raises InputError if no time of operation is left.
    """
    if cut_out is None or whole.steady:
        return (whole,), ()
    mesh, total = whole.mesh, whole.duration
    spans = whole.inflow.spans_below(cut_out, total)
    lengths, segment = np.diff(spans).ravel(), total / mesh.segments
    if np.sum(lengths) == total:
        return (whole,), (f"control.cut_out = {cut_out:g} m/s has no effect: no flow is faster",)
    shortest = max(segment, diameter / cut_out)
    kept = lengths >= shortest
    count, longest = int(np.sum(kept)), float(np.max(lengths, initial=0.0))
    place = {"key": "control.cut_out", "value": cut_out}
    if not count:
        slowest = float(np.min(whole.speeds))
        problem = f"leaves no time for operation: the flow has at least {slowest:.4g} m/s, and is "
        problem += f"slower than this for {longest:.3g} s at a time, at most, while the rotor "
        problem += f"needs {shortest:.3g} s"
        raise InputError(problem, "give a larger one, or null for none", **place)
    if count > MOST_INTERVALS:
        problem = f"divides the operation into {count} intervals, and {MOST_INTERVALS} are the most"
        remedy = "give another one, a lower cutoff of the flow or a shorter phase.duration"
        raise InputError(problem, remedy, **place)
    prefix = "" if whole.name == "phase" else f"{whole.name}_"
    still = total - float(np.sum(lengths[kept]))
    text = (
        f"control.cut_out = {cut_out:g} m/s: standstill for {still:.4g} s of {total:.6g} s "
        f"({100.0 * still / total:.3g} %), intervals of operation: {count}; "
        f"{kept.size - count} more, of {np.sum(lengths[~kept]):.3g} s together, are shorter than "
        f"the {shortest:.3g} s that the rotor needs"
    )
    scenarios = (
        replace(
            whole,
            name=f"{prefix}interval_{number}",
            interval_of=whole.name,
            edges=np.linspace(begin, end, max(int(np.ceil((end - begin) / segment - 1e-9)), 2) + 1),
        )
        for number, (begin, end) in enumerate(spans[kept], start=1)
    )
    return tuple(each.resolved() for each in scenarios), (text,)
