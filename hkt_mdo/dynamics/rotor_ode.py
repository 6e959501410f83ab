"""The rotor's differential equation (paper eq. 6): flow, hydrodynamics, controller, shaft."""

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.formulas import STEP
from hkt_mdo.dynamics.wake import AT_ONCE, slow_time
from hkt_mdo.quantities import QUANTITIES, TRAJECTORY
from hkt_mdo.rotor.components import refuse_complex_step
from hkt_mdo.rotor.reynolds import polar_in_flow
from hkt_mdo.rotor.scales import torque_scale

_INNER = {
    "rotor_acceleration": ("rad/s**2", "rate of the rotor's angular speed"),
    "torque_coefficient": (None, "Q / (0.5 rho V^2 pi R^3)"),
    "torque_coefficient_table": (None, "torque coefficient at the nodes of the curve"),
    "wake_ratio": (None, "tip speed ratio of the wake"),
    "wake_factor": (None, "tip speed ratio of the rotor over that of the wake"),
}
"""Unit and description of what the equation has besides the quantities of the registry."""

WAKE_STATES = {
    "reduced_velocity": ("m/s", "state of the slow filter of the wake's mean axial velocity"),
    "induced_velocity": ("m/s", "mean axial velocity that the wake induces"),
}
"""Unit and description of the states of a wake with memory, by their names."""


class RotorODE(om.Group):
    """Speed dynamics of a rigid rotor, J dw/dt = Q - u.

    Three ways to close it, by what is unknown:
    - a feedback law: u follows from w;
    - open loop in torque: u is an input, dw/dt an output;
    - open loop in speed: w and its rate are inputs, u = Q - J dw/dt an output.
      The rotor is differentially flat in w, which turns a singular control into a regular one
      (docs/dev/numerics.md).

    `hydrodynamics` has the attributes of `CoefficientComp`, or of `RememberingComp`.
    """

    def __init__(self, num_nodes, inflow, hydrodynamics, law, generator):
        super().__init__()
        n, parts = num_nodes, {"flow": InflowComp(num_nodes, inflow=inflow)}
        if "band" in hydrodynamics:
            parts["hydrodynamics"] = RememberingComp(n, **hydrodynamics)
        else:
            # only the coefficient depends on the whole table, most of the Jacobian of a long flow
            parts["coefficient"] = CoefficientComp(n, **hydrodynamics)
            parts["torque"] = TorqueComp(n)
        if law.is_feedback:
            parts["controller"] = FeedbackComp(n, law=law)
        parts["shaft"] = ShaftComp(n, inverse=law.chooses_speed, generator=generator)
        for name, part in parts.items():
            self.add_subsystem(name, part, promotes=["*"])


class _NodeComp(om.ExplicitComponent):
    """Outputs at the nodes of a phase by a formula of inputs there and of scalars.

    `needs` names the inputs of each output; those in `over_time` are arrays. `states` has the unit
    and description of each state whose rate, `<state>_rate`, is an output.
    `formula(**inputs)` returns the outputs by name and must accept complex numbers: its derivatives
    are taken by complex step. What else the formula needs are attributes, given by name.
    """

    states = {}  # noqa: RUF012

    def __init__(self, num_nodes, **known):
        super().__init__()
        self.num_nodes = num_nodes
        vars(self).update(known)

    @property
    def over_time(self):
        """Names of what changes over time."""
        return (*TRAJECTORY, "rotor_acceleration", "torque_coefficient", *self.states)

    @property
    def _needed(self):
        return dict.fromkeys(name for names in self.needs.values() for name in names)

    def setup(self):
        shape = (self.num_nodes,)
        for name in self._needed:
            if name in self.over_time:
                tags = ["dymos.targets:time"] if name == "time" else None
                self.add_input(name, shape=shape, tags=tags, **self._meta(name))
            else:
                self._add_fixed(name)
        for name in self.needs:
            self.add_output(name, shape=shape, **self._meta(name))

    def _meta(self, name):
        state, known = name.removesuffix("_rate"), _INNER | self.states
        if state not in known:
            return QUANTITIES[name].meta
        unit, text = known[state]
        return {"units": unit if name == state else f"{unit}/s", "desc": text}

    def _add_fixed(self, name, val=1.0):
        self.add_input(name, val=val, tags=["dymos.static_target"], **self._meta(name))

    def setup_partials(self):
        rows = np.arange(self.num_nodes)
        for output, names in self.needs.items():
            for name in names:
                diagonal = {"rows": rows, "cols": rows} if name in self.over_time else {}
                self.declare_partials(output, name, **diagonal)

    def compute(self, inputs, outputs):
        for name, value in self.formula(**dict(inputs.items())).items():
            outputs[name] = value

    def compute_partials(self, inputs, partials):
        given = dict(inputs.items())
        for name in self._needed:
            moved = self.formula(**given | {name: given[name] + 1j * STEP})
            for output, names in self.needs.items():
                if name in names:
                    by = np.imag(moved[output]) / STEP
                    partials[output, name] = by if name in self.over_time else by[:, None]


class InflowComp(_NodeComp):
    """Inflow speed at the nodes of a phase; `inflow` is the flow."""

    needs = {"inflow_speed": ("time",)}  # noqa: RUF012

    def formula(self, time):
        return {"inflow_speed": self.inflow.speed_at(time)}


class TorqueComp(_NodeComp):
    """Torque and power from the coefficient, Q = 0.5 rho v² pi R³ Cq, P = Q w (paper eq. 5)."""

    _AT = "torque_coefficient", "inflow_speed", "density", "rotor_radius"
    needs = {"hydrodynamic_torque": _AT, "hydrodynamic_power": (*_AT, "rotor_speed")}  # noqa: RUF012

    def formula(self, torque_coefficient, inflow_speed, density, rotor_radius, rotor_speed):
        torque = torque_scale(density, rotor_radius, inflow_speed) * torque_coefficient
        return {"hydrodynamic_torque": torque, "hydrodynamic_power": torque * rotor_speed}


class CoefficientComp(_NodeComp):
    """Tip speed ratio w R / v and torque coefficient at a phase's nodes, by spline or by BEM.

    Besides the inputs of `needs`, with a `spline`, torque_coefficient_table[n_tsr], else chord and
    twist[n_stations]. `blade`, `polar` and the BEM solver `coefficients` are for direct BEM.
    """

    spline = blade = polar = coefficients = None

    needs = {  # noqa: RUF012
        "tip_speed_ratio": ("rotor_speed", "inflow_speed", "rotor_radius"),
        "torque_coefficient": ("rotor_speed", "inflow_speed", "rotor_radius"),
    }

    def setup(self):
        super().setup()
        if self.spline is not None:
            self._designed = {"torque_coefficient_table": np.ones(self.spline.nodes.shape)}
        else:
            self._designed = {"chord": self.blade.chord, "twist": self.blade.twist}
        for name, value in self._designed.items():
            self._add_fixed(name, value)

    def setup_partials(self):
        super().setup_partials()
        self.declare_partials("torque_coefficient", list(self._designed))

    def _coefficient(self, inputs, derivatives):
        """Return Cq(tsr, v, R) near the inputs, and by name dCq/dshape at fixed tsr."""
        radius, flow, spline = inputs["rotor_radius"], inputs["inflow_speed"], self.spline
        here = inputs["rotor_speed"] * radius / flow
        if spline is not None:
            table = inputs["torque_coefficient_table"]
            by = {"torque_coefficient_table": spline.basis(here)} if derivatives else {}
            curve = spline.curve(table)
            return lambda ratio, *_: curve(ratio), by
        if np.any(here <= 0.0):  # at a trial of the optimizer, which then takes a shorter step
            raise om.AnalysisError("the rotor turns backwards")
        refuse_complex_step(self)
        blade = self.blade.with_rotor_radius(radius[0])
        blade = blade.with_shape(inputs["chord"], inputs["twist"])
        found = self.coefficients(blade, polar_in_flow(self.polar, flow), here, derivatives)
        table = found.torque_table
        if not derivatives:
            return lambda *_: table.values, {}

        def near(ratio, flow, radius):
            along = table.by_tip_speed_ratio * (ratio - ratio.real)
            along = along + found.torque_by_log_reynolds * (flow / flow.real - 1.0)
            return table.values + along + table.by_rotor_radius * (radius - radius.real)

        return near, {"chord": table.by_chord, "twist": table.by_twist}

    def formula(self, rotor_speed, inflow_speed, rotor_radius, **_):
        ratio = rotor_speed * rotor_radius / inflow_speed
        coefficient = self._near(ratio, inflow_speed, rotor_radius)
        return {"tip_speed_ratio": ratio, "torque_coefficient": coefficient}

    def compute(self, inputs, outputs):
        self._near, _ = self._coefficient(inputs, derivatives=False)
        super().compute(inputs, outputs)

    def compute_partials(self, inputs, partials):
        self._near, by_shape = self._coefficient(inputs, derivatives=True)
        super().compute_partials(inputs, partials)
        for name, by in by_shape.items():
            partials["torque_coefficient", name] = by


class RememberingComp(_NodeComp):
    """Torque and power under a wake that has memory, by two filters of its mean axial velocity w.

    With w_s = v a(tsr), the velocity that a wake in equilibrium would induce, a the mean axial
    induction,

        tau1 x' = (1 - k) w_s - x,    tau2 w' = x + k w_s - w;

    The tip speed ratio of the wake, tsr_w, follows from v a(tsr_w) = w; the torque is a table over
    both ratios (`Band`, docs/studies/memory.md). tau1 is given, or 1.1 R / ((1 - 1.3 a') v), a' the
    axial induction in equilibrium at 0.7 R, at most 0.5; tau2 is a share of it.

    Inputs are those of `needs` and the tables of `band`, over both ratios.
    """

    _AT = ("rotor_speed", "inflow_speed", "rotor_radius")
    needs = {  # noqa: RUF012
        "tip_speed_ratio": _AT,
        "wake_ratio": ("inflow_speed", "induced_velocity"),
        "wake_factor": (*_AT, "induced_velocity"),
        "torque_coefficient": (*_AT, "induced_velocity"),
        "hydrodynamic_torque": (*_AT, "density", "induced_velocity"),
        "hydrodynamic_power": (*_AT, "density", "induced_velocity"),
        "reduced_velocity_rate": (*_AT, "reduced_velocity"),
        "induced_velocity_rate": (*_AT, *WAKE_STATES),
    }
    states = WAKE_STATES
    _TORQUES = "torque_coefficient", "hydrodynamic_torque", "hydrodynamic_power"
    _RATES = "reduced_velocity_rate", "induced_velocity_rate"
    _BY_TABLES = {  # noqa: RUF012
        "wake_ratio": ("wake_induction_table", ("wake_ratio", "wake_factor", *_TORQUES)),
        "coefficient": ("torque_coefficient_band", _TORQUES),
        "steady": ("wake_induction_table", _RATES),
        "place": ("place_induction_table", _RATES),
    }
    """By what is read from a table: the table, and the outputs that depend on it."""

    def setup(self):
        super().setup()
        self._shift = {}
        for name, shape in self.band.outputs(()).items():
            self.add_input(name, val=np.ones(shape), tags=["dymos.static_target"])

    def setup_partials(self):
        super().setup_partials()
        for table, outputs in self._BY_TABLES.values():
            self.declare_partials(outputs, table)

    def _read(self, name, value):
        """Return a value from a table, with a complex step if the derivative by it is taken."""
        return value + self._shift.get(name, 0.0)

    def formula(self, rotor_speed, inflow_speed, density, rotor_radius, reduced_velocity,
                induced_velocity, **tables):  # fmt: skip
        band, read = self.band, self._read
        ratio = rotor_speed * rotor_radius / inflow_speed
        induction, wake_ratio, slope = self._found
        wake_ratio = wake_ratio + slope * (induced_velocity / inflow_speed - induction)
        wake_ratio = read("wake_ratio", wake_ratio)
        coefficient = band.curve(tables["torque_coefficient_band"])(ratio, wake_ratio)
        coefficient = read("coefficient", coefficient)
        torque = torque_scale(density, rotor_radius, inflow_speed) * coefficient
        steady, place = (
            read(each, band.spline.curve(tables[self._BY_TABLES[each][0]])(ratio))
            for each in ("steady", "place")
        )
        steady = inflow_speed * steady
        slow = slow_time(self.tau1, place, rotor_radius, inflow_speed)
        fast = band.share * slow
        held = reduced_velocity + AT_ONCE * steady
        return {
            "tip_speed_ratio": ratio,
            "wake_ratio": wake_ratio,
            "wake_factor": ratio / wake_ratio,
            "torque_coefficient": coefficient,
            "hydrodynamic_torque": torque,
            "hydrodynamic_power": torque * rotor_speed,
            "reduced_velocity_rate": ((1.0 - AT_ONCE) * steady - reduced_velocity) / slow,
            "induced_velocity_rate": (held - induced_velocity) / fast,
        }

    def _find_wake(self, inputs):
        """Store the wake's induction, its tip speed ratio and the slope of that for the formula."""
        induction = inputs["induced_velocity"] / inputs["inflow_speed"]
        table = inputs["wake_induction_table"]
        self._found = induction, *self.band.wake_ratio(table, induction)

    def compute(self, inputs, outputs):
        self._find_wake(inputs)
        super().compute(inputs, outputs)

    def compute_partials(self, inputs, partials):
        """Take derivatives by a table as those by what is read from it, times its basis."""
        self._find_wake(inputs)
        super().compute_partials(inputs, partials)
        band, (_, wake_ratio, slope) = self.band, self._found
        ratio = inputs["rotor_speed"] * inputs["rotor_radius"] / inputs["inflow_speed"]
        along = band.spline.basis(ratio)
        bases = {
            "wake_ratio": -slope[:, None] * band.spline.basis(wake_ratio),
            "coefficient": band.basis(ratio, wake_ratio),
            "steady": along,
            "place": along,
        }
        for name, (table, outputs) in self._BY_TABLES.items():
            self._shift = {name: 1j * STEP}
            moved = self.formula(**dict(inputs.items()))
            for output in outputs:
                by = np.imag(moved[output]) / STEP
                partials[output, table] = by[:, None] * bases[name]
        self._shift = {}


class FeedbackComp(_NodeComp):
    """A feedback law at the nodes of a phase; gain_0, gain_1, … are in the law's units.

    Outputs: the generator torque and, of each state of `law`, its rate, `<state>_rate`.
    """

    states = property(lambda self: self.law.states)

    @property
    def needs(self):
        """The rotor's speed, the law's states and every gain; of rates, the flow's speed too."""
        law = self.law
        given = *law.states, *(f"gain_{i}" for i in range(len(law.gain_units)))
        rates = {f"{name}_rate": ("rotor_speed", "inflow_speed", *given) for name in law.states}
        return {"control_torque": ("rotor_speed", *given)} | rates

    def _add_fixed(self, name, val=1.0):
        units = self.law.gain_units[int(name.removeprefix("gain_"))]
        tags = ["dymos.static_target"]
        self.add_input(name, val=val, units=units, desc="feedback gain", tags=tags)

    def formula(self, rotor_speed, inflow_speed=None, **given):
        law = self.law
        states = [given.pop(name) for name in law.states]
        gains = np.array([gain[0] for gain in given.values()])
        found = {"control_torque": law.torque(rotor_speed, gains, *states)}
        rates = law.rates(rotor_speed, inflow_speed, gains, *states)
        return found | {f"{name}_rate": x for name, x in zip(law.states, rates, strict=True)}


class ShaftComp(_NodeComp):
    """Rigid shaft, J dw/dt = Q - u - F(w), solved for the acceleration or for the torque.

    That is the paper's eq. 6 with the friction F of the shaft (`Generator.friction`).

    If `inverse`, rotor_acceleration is an input and control_torque an output. The power of the
    `generator` follows from its torque and the rotor's speed.
    """

    @property
    def needs(self):
        """Inputs of the balance, and of the power, which needs the generator's torque."""
        rubbing = ("rotor_speed",) if self.generator.rubs else ()
        if self.inverse:
            torque = ("hydrodynamic_torque", "rotor_acceleration", "inertia")
            found, power = {"control_torque": (*rubbing, *torque)}, ("rotor_speed", *torque)
        else:
            torque = (*rubbing, "hydrodynamic_torque", "control_torque", "inertia")
            found, power = {"rotor_acceleration": torque}, ("rotor_speed", "control_torque")
        return found | {"generator_power": power, "electrical_power": power}

    def formula(self, hydrodynamic_torque, rotor_speed, inertia, **given):
        (given,) = given.values()
        net = hydrodynamic_torque - self.generator.friction(rotor_speed)
        if self.inverse:
            torque = net - inertia * given
            found = {"control_torque": torque}
        else:
            torque, acceleration = given, (net - given) / inertia
            found = {"rotor_acceleration": acceleration}
        electrical = self.generator.electrical_power(torque, rotor_speed)
        return found | {"generator_power": torque * rotor_speed, "electrical_power": electrical}
