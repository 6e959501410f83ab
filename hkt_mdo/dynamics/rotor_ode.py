"""The rotor's differential equation (paper eq. 6): flow, hydrodynamics, controller, shaft."""

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.dynamics.trajectory import QUANTITIES
from hkt_mdo.rotor.reynolds import LocalReynolds
from hkt_mdo.rotor.scales import torque_scale

OVER_TIME = QUANTITIES | {
    "rotor_acceleration": ("rad/s**2", "rate of the rotor's angular speed"),
    "torque_coefficient": (None, "Q / (0.5 rho V^2 pi R^3)"),
}
FIXED = {
    "density": ("kg/m**3", "density of the water"),
    "rotor_radius": ("m", "radius of the swept disc"),
    "inertia": ("kg*m**2", "moment of inertia about the shaft"),
    "torque_coefficient_table": (None, "torque coefficient at the nodes of the curve"),
    "chord": ("m", "chord at the stations"),
    "twist": ("rad", "twist at the stations"),
}


class RotorODE(om.Group):
    """Speed dynamics of a rigid rotor, I dw/dt = Q - u.

    Three ways to close it, by what is unknown:
    - a feedback law: u follows from w (`law`);
    - open loop in torque: u is an input, dw/dt an output (`unknown="torque"`);
    - open loop in speed: w and its rate are inputs, u = Q - I dw/dt an output (`unknown="speed"`).
      The rotor is differentially flat in w, which turns a singular control into a regular one
      (docs/theory.md).

    Inputs, at num_nodes unless scalar: time, rotor_speed, density, inertia, and either
    torque_coefficient_table[n_tsr] or chord, twist[n_stations]; by variant gain_i, control_torque
    or rotor_acceleration. Outputs: inflow_speed, tip_speed_ratio, hydrodynamic_torque,
    hydrodynamic_power, generator_power and, by variant, control_torque or rotor_acceleration.
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("inflow", recordable=False)
        self.options.declare(
            "hydrodynamics", desc="callable num_nodes -> component", recordable=False
        )
        self.options.declare("law", default=None, allow_none=True, recordable=False)
        self.options.declare("unknown", values=("speed", "torque"), default="speed")

    def setup(self):
        """Assemble the four subsystems."""
        options, n = self.options, self.options["num_nodes"]
        everything = {"promotes": ["*"]}
        self.add_subsystem("flow", InflowComp(num_nodes=n, inflow=options["inflow"]), **everything)
        self.add_subsystem("hydrodynamics", options["hydrodynamics"](n), **everything)
        if options["law"] is not None:
            self.add_subsystem(
                "controller", FeedbackComp(num_nodes=n, law=options["law"]), **everything
            )
        inverse = options["law"] is None and options["unknown"] == "speed"
        self.add_subsystem("shaft", ShaftComp(num_nodes=n, inverse=inverse), **everything)


class _NodeComp(om.ExplicitComponent):
    """A component of quantities at the nodes of a phase."""

    def initialize(self):
        """Declare the number of nodes."""
        self.options.declare("num_nodes", types=int)

    @property
    def _shape(self):
        return (self.options["num_nodes"],)

    def _add_series(self, add, *names, **options):
        """Add quantities over time by `add`: self.add_input or self.add_output."""
        for name in names:
            units, text = OVER_TIME[name]
            add(name, shape=self._shape, units=units, desc=text, **options)

    def _add_fixed(self, name, val=1.0):
        """Add an input that does not vary over time."""
        units, text = FIXED[name]
        self.add_input(name, val=val, units=units, desc=text, tags=["dymos.static_target"])

    def _declare_diagonal(self, of, wrt, **options):
        rows = np.arange(self.options["num_nodes"])
        self.declare_partials(of, wrt, rows=rows, cols=rows, **options)


class InflowComp(_NodeComp):
    """Inflow speed at the nodes of a phase.

    Input time[num_nodes] (s); output inflow_speed[num_nodes] (m/s).
    """

    def initialize(self):
        """Declare the options."""
        super().initialize()
        self.options.declare("inflow", desc="the flow, an `Inflow`", recordable=False)

    def setup(self):
        """Declare input and output."""
        self._add_series(self.add_input, "time", tags=["dymos.targets:time"])
        self._add_series(self.add_output, "inflow_speed")

    def setup_partials(self):
        """Declare the diagonal partial."""
        self._declare_diagonal("inflow_speed", "time")

    def compute(self, inputs, outputs):
        """Evaluate the flow."""
        outputs["inflow_speed"] = self.options["inflow"].speed_at(inputs["time"])

    def compute_partials(self, inputs, partials):
        """Evaluate its rate."""
        partials["inflow_speed", "time"] = self.options["inflow"].rate_at(inputs["time"])


class HydrodynamicsComp(_NodeComp):
    """Hydrodynamic torque and power at a phase's nodes, by the torque spline or by BEM itself.

    Q = 0.5 rho v² pi R³ Cq(tsr), tsr = w R / v, P = Q w (paper eq. 5).

    Inputs rotor_speed, inflow_speed[num_nodes], density (kg/m**3), rotor_radius (m) and, with a
    `spline`, torque_coefficient_table[n_tsr], else chord, twist[n_stations]. Outputs
    tip_speed_ratio, torque_coefficient, hydrodynamic_torque (N*m), hydrodynamic_power (W), all at
    num_nodes.
    """

    def initialize(self):
        """Declare the options."""
        super().initialize()
        self.options.declare("spline", default=None, desc="TorqueSpline; None: direct BEM")
        self.options.declare("blade", default=None, desc="Blade for direct BEM", recordable=False)
        self.options.declare("polar", default=None, desc="Polar for direct BEM", recordable=False)
        self.options.declare("coefficients", default=None, desc="BEM solver", recordable=False)

    @property
    def _designed(self):
        """What the blade sends: the table of its torque curve, or its shape."""
        spline = self.options["spline"]
        return ["torque_coefficient_table"] if spline is not None else ["chord", "twist"]

    def setup(self):
        """Declare inputs and outputs."""
        self._add_series(self.add_input, "rotor_speed", "inflow_speed")
        self._add_fixed("density", 1000.0)
        self._add_fixed("rotor_radius")
        for name in self._designed:
            spline, blade = self.options["spline"], self.options["blade"]
            value = np.ones(spline.nodes.shape) if spline is not None else getattr(blade, name)
            self._add_fixed(name, value)
        self._add_series(
            self.add_output,
            "tip_speed_ratio",
            "torque_coefficient",
            "hydrodynamic_torque",
            "hydrodynamic_power",
        )

    def setup_partials(self):
        """Declare diagonal partials by speed and flow, full columns by what the blade sends."""
        outputs = ["torque_coefficient", "hydrodynamic_torque", "hydrodynamic_power"]
        self._declare_diagonal(["tip_speed_ratio", *outputs], ["rotor_speed", "inflow_speed"])
        self.declare_partials(outputs[1:], "density")
        self.declare_partials(["tip_speed_ratio", *outputs], "rotor_radius")
        self.declare_partials(outputs, self._designed)

    def _coefficient(self, inputs, ratio, derivatives):
        """Return Cq, its slopes over tsr and over ln(v), and dCq/dinput by name at fixed tsr."""
        spline = self.options["spline"]
        if spline is not None:
            value, slope = spline.values(inputs["torque_coefficient_table"], ratio)
            by = {"torque_coefficient_table": spline.basis(ratio)} if derivatives else {}
            return value, slope, 0.0, by
        if np.any(ratio <= 0.0):  # at a trial of the optimizer, which then takes a shorter step
            raise om.AnalysisError("the rotor turns backwards")
        polar = self.options["polar"]
        if isinstance(polar, LocalReynolds):
            polar = polar.at_speed(inputs["inflow_speed"])
        blade = (
            self.options["blade"]
            .with_rotor_radius(inputs["rotor_radius"][0])
            .with_shape(inputs["chord"], inputs["twist"])
        )
        found = self.options["coefficients"](blade, polar, ratio, derivatives)
        by = {
            "chord": found.torque_by_chord,
            "twist": found.torque_by_twist,
            "rotor_radius": found.torque_by_rotor_radius[:, None],
        }
        return found.torque, found.torque_by_tip_speed_ratio, found.torque_by_log_reynolds, by

    def compute(self, inputs, outputs):
        """Evaluate the torque and power."""
        w, v, radius = inputs["rotor_speed"], inputs["inflow_speed"], inputs["rotor_radius"]
        ratio = w * radius / v
        coefficient, *_ = self._coefficient(inputs, ratio, derivatives=False)
        torque = torque_scale(inputs["density"], radius, v) * coefficient
        outputs["tip_speed_ratio"] = ratio
        outputs["torque_coefficient"] = coefficient
        outputs["hydrodynamic_torque"] = torque
        outputs["hydrodynamic_power"] = torque * w

    def compute_partials(self, inputs, partials):
        """Differentiate through the coefficient."""
        w, v, radius = inputs["rotor_speed"], inputs["inflow_speed"], inputs["rotor_radius"]
        density = inputs["density"]
        ratio, by_w, by_v = w * radius / v, radius / v, -w * radius / v**2
        coefficient, by_ratio, by_log_v, by_shape = self._coefficient(inputs, ratio, True)
        coefficient_v = by_ratio * by_v + by_log_v / v
        scale = torque_scale(density, radius, v)
        torque = scale * coefficient
        # the radius moves the tip speed ratio, the torque's scale and, with BEM, the coefficient
        by_radius = (by_ratio * w / v)[:, None] + by_shape.pop("rotor_radius", 0.0)
        columns = {
            "rotor_speed": (by_ratio * by_w, scale * by_ratio * by_w),
            "inflow_speed": (coefficient_v, scale * coefficient_v + 2.0 * torque / v),
            "rotor_radius": (
                by_radius,
                scale[:, None] * by_radius + (3.0 * torque / radius)[:, None],
            ),
        }
        columns |= {name: (by, scale[:, None] * by) for name, by in by_shape.items()}
        for name, (of_coefficient, of_torque) in columns.items():
            partials["torque_coefficient", name] = of_coefficient
            partials["hydrodynamic_torque", name] = of_torque
            turned = w if of_torque.ndim == 1 else w[:, None]
            partials["hydrodynamic_power", name] = turned * of_torque
        partials["hydrodynamic_power", "rotor_speed"] = scale * by_ratio * by_w * w + torque
        partials["tip_speed_ratio", "rotor_speed"] = by_w
        partials["tip_speed_ratio", "inflow_speed"] = by_v
        partials["tip_speed_ratio", "rotor_radius"] = (w / v)[:, None]
        partials["hydrodynamic_torque", "density"] = (torque / density)[:, None]
        partials["hydrodynamic_power", "density"] = (torque * w / density)[:, None]


class FeedbackComp(_NodeComp):
    """A feedback law at the nodes of a phase.

    Inputs rotor_speed[num_nodes] (rad/s) and one scalar gain_0, gain_1, … in the law's units;
    output control_torque[num_nodes] (N*m).
    """

    def initialize(self):
        """Declare the options."""
        super().initialize()
        self.options.declare("law", types=FeedbackLaw, recordable=False)

    def setup(self):
        """Declare inputs and output."""
        self._add_series(self.add_input, "rotor_speed")
        for i, units in enumerate(self.options["law"].gain_units):
            tags = ["dymos.static_target"]
            self.add_input(f"gain_{i}", val=1.0, units=units, desc="feedback gain", tags=tags)
        self._add_series(self.add_output, "control_torque")

    def setup_partials(self):
        """Declare the diagonal partial by speed and the column by each gain."""
        self._declare_diagonal("control_torque", "rotor_speed")
        self.declare_partials("control_torque", "gain_*")

    def _gains(self, inputs):
        return np.array(
            [inputs[f"gain_{i}"][0] for i in range(len(self.options["law"].gain_units))]
        )

    def compute(self, inputs, outputs):
        """Evaluate the law."""
        law = self.options["law"]
        outputs["control_torque"] = law.torque(inputs["rotor_speed"], self._gains(inputs))

    def compute_partials(self, inputs, partials):
        """Differentiate the law."""
        law, speed, gains = self.options["law"], inputs["rotor_speed"], self._gains(inputs)
        partials["control_torque", "rotor_speed"] = law.torque_by_speed(speed, gains)
        for i, column in enumerate(law.torque_by_gain(speed, gains)):
            partials["control_torque", f"gain_{i}"] = column[:, None]


class ShaftComp(_NodeComp):
    """Rigid shaft, I dw/dt = Q - u (paper eq. 6), solved for the acceleration or for the torque.

    Inputs hydrodynamic_torque, rotor_speed[num_nodes], inertia (kg*m**2) and control_torque
    (forward) or rotor_acceleration (inverse); the other of the two is an output, with
    generator_power = u w (W).
    """

    def initialize(self):
        """Declare the options."""
        super().initialize()
        self.options.declare("inverse", types=bool)

    @property
    def _given_and_found(self):
        names = "control_torque", "rotor_acceleration"
        return names[::-1] if self.options["inverse"] else names

    def setup(self):
        """Declare inputs and outputs."""
        given, found = self._given_and_found
        self._add_series(self.add_input, "hydrodynamic_torque", "rotor_speed", given)
        self._add_fixed("inertia")
        self._add_series(self.add_output, found, "generator_power")

    def setup_partials(self):
        """Declare the diagonal partials and the column by inertia."""
        given, found = self._given_and_found
        self._declare_diagonal(found, ["hydrodynamic_torque", given])
        self._declare_diagonal("generator_power", ["rotor_speed", given])
        self.declare_partials(found, "inertia")
        if self.options["inverse"]:
            self._declare_diagonal("generator_power", "hydrodynamic_torque")
            self.declare_partials("generator_power", "inertia")

    def compute(self, inputs, outputs):
        """Balance the shaft."""
        given, found = self._given_and_found
        torque, inertia = inputs["hydrodynamic_torque"], inputs["inertia"]
        if self.options["inverse"]:
            outputs[found] = torque - inertia * inputs[given]
            outputs["generator_power"] = outputs[found] * inputs["rotor_speed"]
        else:
            outputs[found] = (torque - inputs[given]) / inertia
            outputs["generator_power"] = inputs[given] * inputs["rotor_speed"]

    def compute_partials(self, inputs, partials):
        """Differentiate the balance."""
        given, found = self._given_and_found
        torque, inertia, w = inputs["hydrodynamic_torque"], inputs["inertia"], inputs["rotor_speed"]
        if self.options["inverse"]:
            rate = inputs[given]
            partials[found, "hydrodynamic_torque"] = 1.0
            partials[found, given] = -inertia
            partials[found, "inertia"] = -rate[:, None]
            partials["generator_power", "rotor_speed"] = torque - inertia * rate
            partials["generator_power", "hydrodynamic_torque"] = w
            partials["generator_power", given] = -inertia * w
            partials["generator_power", "inertia"] = -(rate * w)[:, None]
        else:
            partials[found, "hydrodynamic_torque"] = 1.0 / inertia
            partials[found, given] = -1.0 / inertia
            partials[found, "inertia"] = (-(torque - inputs[given]) / inertia**2)[:, None]
            partials["generator_power", "rotor_speed"] = inputs[given]
            partials["generator_power", given] = w
