"""What is told of the loads of a result, and of a starting blade: the largest, and their places."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.physics import physics as make_physics
from hkt_mdo.quantities import LOADS, QUANTITIES
from hkt_mdo.results.summary import LoadEntry
from hkt_mdo.rotor.blade import Blade

STATIONS = 120
"""Stations from which the loads of a blade change by less than a thousandth."""

Known = dict[str, Any]
"""Quantities and loads of a trajectory, (n_times,), and the scalars of `Physics.scalars`."""


def largest(trajectories: Iterable[Known]) -> dict[str, LoadEntry]:
    """Return the largest loads of some trajectories, and the largest power and speeds."""
    found: dict[str, LoadEntry] = {}
    for known in trajectories:
        told = {n: (known[n], QUANTITIES[n].unit) for n in LOADS if n in known}
        told["power"] = known["generator_power"], "W"
        told["rotor_speed"] = known["rotor_speed"], "rad/s"
        told["tip_speed"] = known["rotor_speed"] * known["rotor_radius"], "m/s"
        for name, (values, unit) in told.items():
            worst = int(np.argmax(values))
            value, time = float(values[worst]), float(known["time"][worst])
            before = found.get(name)
            if before is None or value > before.value:
                found[name] = LoadEntry(value=value, unit=unit or "", time_s=time)
    return found


def over_span(
    physics: Physics, blade: Blade, trajectories: Iterable[Known]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return radii (m) and values along the blade of the stress, of the suction and of the moment.

    `stress` (Pa) and `flapwise_moment` (N*m) are those of the time when the blade has its largest
    stress, `cavitation` that of the time of the largest suction, by the surface which has more;
    it is known at the stations only. What the physics does not know is left out.
    """
    found, several = {}, list(trajectories)
    for name in ("stress", "cavitation"):
        if name not in physics.loads.names:
            continue
        known = max(several, key=lambda known, name=name: np.max(known[name]))  # type: ignore[misc]
        worst = int(np.argmax(known[name]))
        flow = float(known["inflow_speed"][worst])
        ratio = max(float(known["tip_speed_ratio"][worst]), SLOWEST_RATIO)
        model, pressure = physics.rotor.at_flow(flow).loads, 0.5 * physics.density * flow**2
        load = model.coefficients(blade, ratio, names=(name,))[name]
        if name == "cavitation":
            both_surfaces = load.exact[0].reshape(2, -1)
            found[name] = blade.r, pressure * np.max(both_surfaces, axis=0)
        else:
            moment = model.flapwise_moment(blade, ratio, load.r)[0]
            found[name] = load.r, pressure * load.exact[0]
            found["flapwise_moment"] = load.r, pressure * moment
    return found


def placed(physics: Physics, blade: Blade, trajectories: Iterable[Known]) -> dict[str, LoadEntry]:
    """Return what `largest` does, with the places along the blade of what `over_span` knows."""
    several = list(trajectories)
    found = largest(several)
    for name, (r, values) in over_span(physics, blade, several).items():
        if name in found:
            place = {"r_m": float(r[np.argmax(values)])}
            found[name] = found[name].model_copy(update=place)
    return found


def resolved(physics: Physics, blade: Blade, trajectories: Iterable[Known]) -> dict[str, float]:
    """Return by which share the loads that are asked for are larger on a blade of many stations.

    Of `STATIONS`, between whose neighbours chord and twist are linear, as between the blade's own;
    each at the time of its largest. Empty where the case gives chord and twist themselves, where
    the thickness is designed, or where the blade has as many stations.
    """
    case, found, several = physics.case, {}, list(trajectories)
    names = physics.load_names
    if not names or case.rotor.chord or physics.shape.designs_thickness or blade.r.size >= STATIONS:
        return {}
    rotor = case.rotor.model_copy(update={"stations": None, "station_count": STATIONS})
    finer = make_physics(case.model_copy(update={"rotor": rotor, "start": type(case.start)()}))
    many = finer.blade.with_rotor_radius(blade.rotor_radius)
    shape = (np.interp(many.r, blade.r, values) for values in (blade.chord, blade.twist))
    many = many.with_shape(*shape, many.thickness)
    for name in names:
        known = max(several, key=lambda known, name=name: np.max(known[name]))  # type: ignore[misc]
        worst = [int(np.argmax(known[name]))]
        instant = {key: known[key][worst] for key in ("tip_speed_ratio", "inflow_speed")}
        own, other = (
            float(each.loads_along(of, instant, (name,))[name][0])
            for each, of in ((physics, blade), (finer, many))
        )
        found[name] = other / own - 1.0
    return found


def tip_deflection(physics: Physics, blade: Blade, trajectories: Iterable[Known]) -> float | None:
    """Return the largest deflection of a tip, m; None where polars follow the Reynolds number."""
    if physics.rotor.follows_reynolds:
        return None
    most = 0.0
    for known in trajectories:
        ratio, flow = known["tip_speed_ratio"], known["inflow_speed"]
        ratio = np.maximum(ratio, SLOWEST_RATIO)
        at = np.linspace(ratio.min(), ratio.max(), 201)
        found = np.interp(ratio, at, physics.loads.tip_deflection(blade, at))
        most = max(most, float(np.max(0.5 * physics.density * flow**2 * found)))
    return most
