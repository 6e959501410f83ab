"""The rotor's differential equation (paper eq. 6): flow, hydrodynamics, controller, shaft."""

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.controllers import FeedbackComp
from hkt_mdo.dynamics.inflow import InflowComp
from hkt_mdo.rotor.reynolds import LocalReynolds


class RotorODE(om.Group):
    """Speed dynamics of a rigid rotor, I dw/dt = Q - u.

    Three ways to close it, by what is unknown:
    - a feedback law: u follows from w (`law`);
    - open loop in torque: u is an input, dw/dt an output (`unknown="torque"`);
    - open loop in speed: w and its rate are inputs, u = Q - I dw/dt an output (`unknown="speed"`).
      The rotor
      is differentially flat in w, which turns a singular control into a regular one
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


class HydrodynamicsComp(om.ExplicitComponent):
    """Hydrodynamic torque and power at a phase's nodes, by the torque spline or by BEM itself.

    Q = 0.5 rho v² pi R³ Cq(tsr), tsr = w R / v, P = Q w (paper eq. 5).

    Inputs rotor_speed, inflow_speed[num_nodes], density (kg/m**3), rotor_radius (m), and either
    torque_coefficient_table[n_tsr] (spline) or chord (m), twist (rad) of shape (n_stations,) (BEM).
    Outputs tip_speed_ratio, torque_coefficient, hydrodynamic_torque (N*m), hydrodynamic_power (W),
    each [num_nodes].
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("spline", default=None, allow_none=True, recordable=False)
        self.options.declare("blade", default=None, allow_none=True, recordable=False)
        self.options.declare("polar", default=None, allow_none=True, recordable=False)
        self.options.declare("coefficients", default=None, allow_none=True, recordable=False)

    def setup(self):
        """Declare inputs and outputs."""
        n, static = self.options["num_nodes"], ["dymos.static_target"]
        self.add_input("rotor_speed", shape=(n,), units="rad/s", desc="angular speed of the rotor")
        self.add_input(
            "inflow_speed", shape=(n,), units="m/s", desc="undisturbed flow speed at the rotor"
        )
        self.add_input(
            "density", val=1000.0, units="kg/m**3", desc="density of the water", tags=static
        )
        self.add_input(
            "rotor_radius", val=1.0, units="m", desc="radius of the swept disc", tags=static
        )
        if self.options["spline"] is not None:
            shape = self.options["spline"].nodes.shape
            self.add_input(
                "torque_coefficient_table",
                shape=shape,
                desc="torque coefficient at the nodes",
                tags=static,
            )
        else:
            blade = self.options["blade"]
            self.add_input(
                "chord", val=blade.chord, units="m", desc="chord at the stations", tags=static
            )
            self.add_input(
                "twist", val=blade.twist, units="rad", desc="twist at the stations", tags=static
            )
        self.add_output("tip_speed_ratio", shape=(n,), desc="tip speed over inflow speed")
        self.add_output("torque_coefficient", shape=(n,), desc="Q / (0.5 rho V^2 pi R^3)")
        self.add_output(
            "hydrodynamic_torque", shape=(n,), units="N*m", desc="torque of the flow on the rotor"
        )
        self.add_output(
            "hydrodynamic_power", shape=(n,), units="W", desc="power captured from the flow"
        )

    def setup_partials(self):
        """Declare diagonal partials by speed and flow, full columns by what the blade sends."""
        rows = np.arange(self.options["num_nodes"])
        outputs = ["torque_coefficient", "hydrodynamic_torque", "hydrodynamic_power"]
        self.declare_partials(
            ["tip_speed_ratio", *outputs], ["rotor_speed", "inflow_speed"], rows=rows, cols=rows
        )
        self.declare_partials(outputs[1:], "density")
        self.declare_partials(["tip_speed_ratio", *outputs], "rotor_radius")
        shape = (
            ["torque_coefficient_table"]
            if self.options["spline"] is not None
            else ["chord", "twist"]
        )
        self.declare_partials(outputs, shape)

    def _coefficient(self, inputs, ratio, derivatives):
        """Return Cq, its slopes over tsr and over ln(v), and dCq/dinput by name at fixed tsr.

        Derivatives when asked for.
        """
        spline = self.options["spline"]
        if spline is not None:
            value, slope = spline.values(inputs["torque_coefficient_table"], ratio)
            by = {"torque_coefficient_table": spline.basis(ratio)} if derivatives else {}
            return value, slope, 0.0, by
        if np.any(ratio <= 0.0):  # an optimizer's trial: let it take a shorter step
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
        torque = 0.5 * np.pi * radius**3 * inputs["density"] * v**2 * coefficient
        outputs["tip_speed_ratio"] = ratio
        outputs["torque_coefficient"] = coefficient
        outputs["hydrodynamic_torque"] = torque
        outputs["hydrodynamic_power"] = torque * w

    def compute_partials(self, inputs, partials):
        """Differentiate through the coefficient."""
        w, v, radius = inputs["rotor_speed"], inputs["inflow_speed"], inputs["rotor_radius"]
        ratio, by_w, by_v = w * radius / v, radius / v, -w * radius / v**2
        coefficient, by_ratio, by_log_v, by_shape = self._coefficient(
            inputs, ratio, derivatives=True
        )
        coefficient_v = by_ratio * by_v + by_log_v / v
        scale = 0.5 * np.pi * radius**3 * inputs["density"] * v**2
        torque = scale * coefficient
        partials["tip_speed_ratio", "rotor_speed"] = by_w
        partials["tip_speed_ratio", "inflow_speed"] = by_v
        partials["torque_coefficient", "rotor_speed"] = by_ratio * by_w
        partials["torque_coefficient", "inflow_speed"] = coefficient_v
        torque_w = scale * by_ratio * by_w
        torque_v = scale * coefficient_v + 2.0 * torque / v
        partials["hydrodynamic_torque", "rotor_speed"] = torque_w
        partials["hydrodynamic_torque", "inflow_speed"] = torque_v
        partials["hydrodynamic_torque", "density"] = (torque / inputs["density"])[:, None]
        partials["hydrodynamic_power", "rotor_speed"] = torque_w * w + torque
        partials["hydrodynamic_power", "inflow_speed"] = torque_v * w
        partials["hydrodynamic_power", "density"] = (torque * w / inputs["density"])[:, None]
        # the radius moves the tip speed ratio, the torque's scale and, with BEM, the coefficient
        by_radius = (by_ratio * w / v)[:, None] + by_shape.pop("rotor_radius", 0.0)
        partials["tip_speed_ratio", "rotor_radius"] = (w / v)[:, None]
        partials["torque_coefficient", "rotor_radius"] = by_radius
        torque_radius = scale[:, None] * by_radius + (3.0 * torque / radius)[:, None]
        partials["hydrodynamic_torque", "rotor_radius"] = torque_radius
        partials["hydrodynamic_power", "rotor_radius"] = w[:, None] * torque_radius
        for name, matrix in by_shape.items():
            partials["torque_coefficient", name] = matrix
            partials["hydrodynamic_torque", name] = scale[:, None] * matrix
            partials["hydrodynamic_power", name] = (scale * w)[:, None] * matrix


class ShaftComp(om.ExplicitComponent):
    """Rigid shaft, I dw/dt = Q - u (paper eq. 6), solved for the acceleration or for the torque.

    Inputs hydrodynamic_torque, rotor_speed[num_nodes], inertia (kg*m**2) and control_torque
    (forward) or rotor_acceleration (inverse); the other of the two is an output, with
    generator_power = u w (W).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("inverse", types=bool)

    def setup(self):
        """Declare inputs and outputs."""
        n = self.options["num_nodes"]
        torque = {"shape": (n,), "units": "N*m", "desc": "generator torque on the rotor"}
        rate = {"shape": (n,), "units": "rad/s**2", "desc": "rate of the rotor's angular speed"}
        self.add_input(
            "hydrodynamic_torque", shape=(n,), units="N*m", desc="torque of the flow on the rotor"
        )
        self.add_input("rotor_speed", shape=(n,), units="rad/s", desc="angular speed of the rotor")
        self.add_input(
            "inertia", val=1.0, units="kg*m**2", desc="rotor inertia", tags=["dymos.static_target"]
        )
        if self.options["inverse"]:
            self.add_input("rotor_acceleration", **rate)
            self.add_output("control_torque", **torque)
        else:
            self.add_input("control_torque", **torque)
            self.add_output("rotor_acceleration", **rate)
        self.add_output(
            "generator_power", shape=(n,), units="W", desc="power taken by the generator"
        )

    def setup_partials(self):
        """Declare the diagonal partials and the column by inertia."""
        rows = np.arange(self.options["num_nodes"])
        diagonal = {"rows": rows, "cols": rows}
        given, found = self._names()
        sign = -1.0 if found == "rotor_acceleration" else 1.0
        self.declare_partials(found, "hydrodynamic_torque", **diagonal, val=1.0)
        self.declare_partials(found, given, **diagonal, val=sign)
        self.declare_partials(found, "inertia")
        self.declare_partials("generator_power", "rotor_speed", **diagonal)
        self.declare_partials("generator_power", given, **diagonal)
        if self.options["inverse"]:
            self.declare_partials("generator_power", "hydrodynamic_torque", **diagonal)
            self.declare_partials("generator_power", "inertia")

    def _names(self):
        if self.options["inverse"]:
            return "rotor_acceleration", "control_torque"
        return "control_torque", "rotor_acceleration"

    def compute(self, inputs, outputs):
        """Balance the shaft."""
        given, found = self._names()
        torque, inertia = inputs["hydrodynamic_torque"], inputs["inertia"]
        if self.options["inverse"]:
            outputs[found] = torque - inertia * inputs[given]
            outputs["generator_power"] = outputs[found] * inputs["rotor_speed"]
        else:
            outputs[found] = (torque - inputs[given]) / inertia
            outputs["generator_power"] = inputs[given] * inputs["rotor_speed"]

    def compute_partials(self, inputs, partials):
        """Differentiate the balance."""
        given, found = self._names()
        torque, inertia, w = inputs["hydrodynamic_torque"], inputs["inertia"], inputs["rotor_speed"]
        if self.options["inverse"]:
            rate = inputs[given]
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
