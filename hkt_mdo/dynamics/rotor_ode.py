"""The rotor's differential equation (paper eq. 6): flow, hydrodynamics, controller, shaft."""

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.formulas import STEP
from hkt_mdo.dynamics.wake import AT_ONCE, slow_time
from hkt_mdo.quantities import meta_of
from hkt_mdo.rotor.band import FACTORS, Band
from hkt_mdo.rotor.components import refuse_complex_step, refuse_values
from hkt_mdo.rotor.scales import torque_scale

WAKE_STATES = "reduced_velocity", "induced_velocity"
"""States of a wake with memory."""


class RotorODE(om.Group):
    """Speed dynamics of a rigid rotor, J dw/dt = Q - u.

    Three ways to close it, by what is unknown:
    - a feedback law: u follows from w;
    - open loop in torque: u is an input, dw/dt an output;
    - open loop in speed: w and its rate are inputs, u = Q - J dw/dt an output.
      The rotor is differentially flat in w, which turns a singular control into a regular one
      (docs/dev/numerics.md).

    `hydrodynamics` has the `spline` of the torque coefficient, or `band` and `tau1` of a wake with
    memory, or the attributes of `CoefficientComp`.
    """

    def __init__(self, num_nodes, inflow, hydrodynamics, law, generator):
        super().__init__()
        n, coefficient = num_nodes, ["torque_coefficient"]
        parts = {"flow": InflowComp(n, inflow=inflow), "ratio": RatioComp(n)}
        # only a coefficient depends on a whole table, most of the Jacobian of a long flow
        if band := hydrodynamics.get("band"):
            parts["wake"] = WakeComp(n, band=band, size=band.nodes.size)
            parts["coefficient"] = CurveComp(n, coefficient, band)
            parts["inductions"] = CurveComp(n, ("wake_induction", "place_induction"), band.spline)
            parts["filters"] = FilterComp(n, share=band.share, tau1=hydrodynamics["tau1"])
        elif spline := hydrodynamics.get("spline"):
            parts["coefficient"] = CurveComp(n, coefficient, spline)
        else:
            parts["coefficient"] = CoefficientComp(n, **hydrodynamics)
        parts["torque"] = TorqueComp(n)
        if law.is_feedback:
            parts["controller"] = FeedbackComp(n, law=law)
        parts["shaft"] = ShaftComp(n, inverse=law.chooses_speed, generator=generator)
        for name, part in parts.items():
            self.add_subsystem(name, part, promotes=["*"])


class NodeComp(om.ExplicitComponent):
    """Outputs at the nodes of a phase by a formula of inputs there, of scalars and of tables.

    `needs` names the inputs of each output; those in `fixed` do not change over time and have an
    initial value there, the others are arrays over the nodes.
    `tables` names the table, of a `size`, on which an output depends, too; `basis(**inputs)` is its
    derivative by that. `formula(**inputs)` returns the outputs by name and must accept complex
    numbers: the other derivatives are taken by complex step. What else the formula needs are
    attributes, given by name.
    """

    fixed = dict.fromkeys(("rotor_radius", "density", "inertia"), 1.0)
    tables = {}  # noqa: RUF012

    def __init__(self, num_nodes, **attributes):
        super().__init__()
        self.num_nodes = num_nodes
        vars(self).update(attributes)

    @property
    def _needed(self):
        return dict.fromkeys(name for names in self.needs.values() for name in names)

    def setup(self):
        nodal, static = {"shape": self.num_nodes}, ["dymos.static_target"]
        for name in self._needed:
            options = {"val": self.fixed[name], "tags": static} if name in self.fixed else nodal
            self.add_input(name, **options, **self._meta(name))
        for name in self.needs:
            self.add_output(name, **nodal, **self._meta(name))
        for table in self.tables.values():
            self.add_input(table, shape=self.size, tags=static, **self._meta(table))

    def _meta(self, name):
        """Return units and description of an input or output."""
        return meta_of(name)

    def setup_partials(self):
        rows = np.arange(self.num_nodes)
        for output, names in self.needs.items():
            for name in names:
                diagonal = {} if name in self.fixed else {"rows": rows, "cols": rows}
                self.declare_partials(output, name, **diagonal)
        for output, table in self.tables.items():
            self.declare_partials(output, table)

    def compute(self, inputs, outputs):
        for name, value in self.formula(**dict(inputs.items())).items():
            outputs[name] = value

    def compute_partials(self, inputs, partials):
        values = dict(inputs.items())
        for name in self._needed:
            moved = self.formula(**values | {name: values[name] + 1j * STEP})
            for output, names in self.needs.items():
                if name in names:
                    by = np.imag(moved[output]) / STEP
                    partials[output, name] = by[:, None] if name in self.fixed else by
        basis = self.basis(**values) if self.tables else None
        for pair in self.tables.items():
            partials[pair] = basis


class InflowComp(NodeComp):
    """Inflow speed at the nodes of a phase; `inflow` is the flow."""

    needs = {"inflow_speed": ("time",)}  # noqa: RUF012

    def formula(self, time):
        return {"inflow_speed": self.inflow.speed_at(time)}


class RatioComp(NodeComp):
    """Tip speed ratio, w R / v."""

    needs = {"tip_speed_ratio": ("rotor_speed", "inflow_speed", "rotor_radius")}  # noqa: RUF012

    def formula(self, rotor_speed, inflow_speed, rotor_radius):
        return {"tip_speed_ratio": rotor_speed * rotor_radius / inflow_speed}


class TorqueComp(NodeComp):
    """Torque and power from the coefficient, Q = 0.5 rho v² pi R³ Cq, P = Q w (paper eq. 5)."""

    _AT = "torque_coefficient", "inflow_speed", "density", "rotor_radius"
    needs = {"hydrodynamic_torque": _AT, "hydrodynamic_power": (*_AT, "rotor_speed")}  # noqa: RUF012

    def formula(self, torque_coefficient, inflow_speed, density, rotor_radius, rotor_speed):
        torque = torque_scale(density, rotor_radius, inflow_speed) * torque_coefficient
        return {"hydrodynamic_torque": torque, "hydrodynamic_power": torque * rotor_speed}


class CurveComp(NodeComp):
    """Coefficients at a phase's nodes by curves over the tip speed ratio.

    `curves` is the `TorqueSpline` of a <name>_table for each of `names`, or the `Band` of a
    <name>_band, which is over the tip speed ratio of the wake, too.
    """

    factors = ()
    """Other inputs of the outputs."""

    def __init__(self, num_nodes, names, curves):
        ratios, kind, size = ("tip_speed_ratio",), "table", curves.nodes.size
        if isinstance(curves, Band):
            ratios, kind, size = (*ratios, "wake_ratio"), "band", size * FACTORS.size
        super().__init__(num_nodes, curves=curves, ratios=ratios, size=size)
        self.needs = dict.fromkeys(names, (*ratios, *self.factors))
        self.tables = {name: f"{name}_{kind}" for name in names}

    def formula(self, **inputs):
        ratios = [inputs[name] for name in self.ratios]
        return {name: self.curves.curve(inputs[x])(*ratios) for name, x in self.tables.items()}

    def basis(self, **inputs):
        """Return the derivative of each output by its table, (n_nodes, size)."""
        return self.curves.basis(*(inputs[name] for name in self.ratios))


class CoefficientComp(NodeComp):
    """Torque coefficient at a phase's nodes by direct BEM.

    Inputs chord and twist are those of the stations. `blade`, `polar` and the BEM solver
    `coefficients` are attributes.
    """

    _AT = "tip_speed_ratio", "inflow_speed", "rotor_radius", "chord", "twist"
    needs = {"torque_coefficient": _AT}  # noqa: RUF012
    fixed = property(
        lambda self: NodeComp.fixed | {name: getattr(self.blade, name) for name in self._AT[3:]}
    )

    def _solve(self, inputs, derivatives):
        """Return the `Coefficients` of the blade, flow and tip speed ratio of the inputs."""
        refuse_complex_step(self)
        refuse_values(inputs)  # of a trial of the optimizer, which then takes a shorter step
        blade = self.blade.with_rotor_radius(inputs["rotor_radius"][0])
        blade = blade.with_shape(inputs["chord"], inputs["twist"])
        polar = self.polar.in_flow(inputs["inflow_speed"])
        return self.coefficients(blade, polar, inputs["tip_speed_ratio"], derivatives)

    def compute(self, inputs, outputs):
        outputs["torque_coefficient"] = self._solve(inputs, derivatives=False).torque

    def compute_partials(self, inputs, partials):
        solution = self._solve(inputs, derivatives=True)
        by = {x: getattr(solution.torque_table, f"by_{x}") for x in inputs if x != "inflow_speed"}
        by["inflow_speed"] = solution.torque_by_log_reynolds / inputs["inflow_speed"]
        for name, slope in by.items():
            partials["torque_coefficient", name] = slope


class WakeComp(NodeComp):
    """Tip speed ratio of a wake with memory, at which it would induce its mean axial velocity.

    By the wake_induction_table of `band`, over its nodes.
    """

    needs = {"wake_ratio": ("inflow_speed", "induced_velocity")}  # noqa: RUF012
    tables = {"wake_ratio": "wake_induction_table"}  # noqa: RUF012

    def _ratio_and_slope(self, inflow_speed, induced_velocity, wake_induction_table):
        """Return the ratio, and its slope by the induction."""
        induction = induced_velocity / inflow_speed
        ratio, slope = self.band.wake_ratio(wake_induction_table, induction.real)
        return ratio + slope * (induction - induction.real), slope

    def formula(self, **inputs):
        return {"wake_ratio": self._ratio_and_slope(**inputs)[0]}

    def basis(self, **inputs):
        """Return the ratio's derivative by the table, (n_nodes, size)."""
        ratio, slope = self._ratio_and_slope(**inputs)
        return -slope[:, None] * self.band.spline.basis(ratio)


class FilterComp(NodeComp):
    """Rates of the two filters of a wake's mean axial velocity w.

    With w_s = v a(tsr), the velocity that a wake in equilibrium would induce, a the mean axial
    induction,

        tau1 x' = (1 - k) w_s - x,    tau2 w' = x + k w_s - w.

    tau1 is given, or 1.1 R / ((1 - 1.3 a') v), a' the axial induction in equilibrium at 0.7 R, at
    most 0.5; tau2 is a `share` of it. The tip speed ratio of the wake, tsr_w, follows from
    v a(tsr_w) = w; the torque is a table over both ratios (`Band`, docs/studies/memory.md).
    """

    _AT = "inflow_speed", "rotor_radius", "wake_induction", "place_induction", "reduced_velocity"
    needs = {  # noqa: RUF012
        "wake_factor": ("tip_speed_ratio", "wake_ratio"),
        "reduced_velocity_rate": _AT,
        "induced_velocity_rate": (*_AT, "induced_velocity"),
    }

    def formula(self, tip_speed_ratio, wake_ratio, inflow_speed, rotor_radius, wake_induction,
                place_induction, reduced_velocity, induced_velocity):  # fmt: skip
        slow = slow_time(self.tau1, place_induction, rotor_radius, inflow_speed)
        steady = inflow_speed * wake_induction
        held = reduced_velocity + AT_ONCE * steady
        return {
            "wake_factor": tip_speed_ratio / wake_ratio,
            "reduced_velocity_rate": ((1.0 - AT_ONCE) * steady - reduced_velocity) / slow,
            "induced_velocity_rate": (held - induced_velocity) / (self.share * slow),
        }


class FeedbackComp(NodeComp):
    """A feedback law at the nodes of a phase; gain_0, gain_1, … are in the law's units.

    Outputs: the generator torque and, of each state of `law`, its rate, `<state>_rate`.
    """

    fixed = property(lambda self: dict.fromkeys(self.law.named_gains, 1.0))

    @property
    def needs(self):
        """The rotor's speed, the law's states and every gain; of rates, the flow's speed too."""
        states, arguments = self.law.states, [*self.law.states, *self.fixed]
        rates = {f"{name}_rate": ("rotor_speed", "inflow_speed", *arguments) for name in states}
        return {"control_torque": ("rotor_speed", *arguments)} | rates

    def _meta(self, name):
        state, described = name.removesuffix("_rate"), self.law.named_gains | self.law.states
        if state not in described:
            return meta_of(name)
        unit, text = described[state]
        return {"units": unit if name == state else f"{unit}/s", "desc": text}

    def formula(self, rotor_speed, inflow_speed=None, **inputs):
        law = self.law
        states = [inputs.pop(name) for name in law.states]
        gains = np.hstack([*inputs.values()])
        outputs = {"control_torque": law.torque(rotor_speed, gains, *states)}
        rates = law.rates(rotor_speed, inflow_speed, gains, *states)
        return outputs | {f"{name}_rate": x for name, x in zip(law.states, rates, strict=True)}


class ShaftComp(NodeComp):
    """Rigid shaft, J dw/dt = Q - u - F(w), solved for the acceleration or for the torque.

    That is the paper's eq. 6 with the friction F of the shaft (`Generator.friction`).

    If `inverse`, rotor_acceleration is an input and control_torque an output. The power of the
    `generator` follows from its torque and the rotor's speed.
    """

    @property
    def needs(self):
        """Inputs of the balance, and of the power, which needs the generator's torque."""
        cause, effect = "control_torque", "rotor_acceleration"
        if self.inverse:
            cause, effect = effect, cause
        balance, rubbing = ("hydrodynamic_torque", cause, "inertia"), ["rotor_speed"]
        power = ("rotor_speed", *(balance if self.inverse else [cause]))
        balance = (*rubbing * self.generator.rubs, *balance)
        return {effect: balance, "generator_power": power, "electrical_power": power}

    def formula(self, hydrodynamic_torque, rotor_speed, inertia, **cause):
        (cause,), net = cause.values(), hydrodynamic_torque - self.generator.friction(rotor_speed)
        if self.inverse:
            torque = effect = net - inertia * cause
        else:
            torque, effect = cause, (net - cause) / inertia
        electrical = self.generator.electrical_power(torque, rotor_speed)
        return dict(zip(self.needs, (effect, torque * rotor_speed, electrical), strict=True))
