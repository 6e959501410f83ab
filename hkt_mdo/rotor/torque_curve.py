"""Torque coefficient over tip speed ratio: a table of a blade's, and a spline over it."""

from functools import cached_property

import numpy as np
import openmdao.api as om
from scipy.interpolate import CubicSpline, PPoly


class TorqueSpline:
    """Natural cubic spline over fixed tip speed ratios, linear beyond them: a C² function.

    Its value is linear in the table, q(tsr) = basis(tsr) @ table, so both partials are exact and
    cost a small matrix product; the basis does not change during an optimization.

    Parameters
    ----------
    nodes : array, shape (n_nodes,)
        Tip speed ratios, increasing.
    """

    def __init__(self, nodes):
        self.nodes = np.asarray(nodes, dtype=float)

    @cached_property
    def _cardinal(self):
        return CubicSpline(self.nodes, np.eye(self.nodes.size), bc_type="natural")

    def basis(self, tip_speed_ratio, derivative=0):
        """Return the matrix (n_points, n_nodes) from a table to spline values or derivatives."""
        points = np.asarray(tip_speed_ratio)
        inside = np.clip(points.real, self.nodes[0], self.nodes[-1])
        if derivative == 0:
            value, beyond = self._cardinal(inside), points - inside
            if np.any(beyond):
                value = value + self._cardinal(inside, 1) * beyond[:, None]
            return value
        if derivative == 1:
            return self._cardinal(inside, 1)
        return self._cardinal(inside, derivative) * (points.real == inside)[:, None]

    def values(self, table, tip_speed_ratio):
        """Return the spline's values and slopes (n_points,) for a table, without the matrices."""
        points = np.asarray(tip_speed_ratio)
        inside = np.clip(points.real, self.nodes[0], self.nodes[-1])
        curve = PPoly.construct_fast(self._cardinal.c @ table, self.nodes)
        slope = curve(inside, 1)
        return curve(inside) + slope * (points - inside), slope


class TorqueTable(om.ExplicitComponent):
    """Torque coefficient of a blade at the nodes of a `TorqueSpline`, by BEM.

    Inputs chord[n_stations] (m), twist[n_stations] (rad), rotor_radius (m), with which hub,
    stations and tip move; output torque_coefficient_table[n_nodes]. Q = 0.5 rho V² pi R³ Cq.
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare(
            "blade", desc="the start `Blade`: stations, hub, tip, count", recordable=False
        )
        self.options.declare("polar", desc="section `Polar`", recordable=False)
        self.options.declare("nodes", types=np.ndarray, desc="tip speed ratios of the table")
        self.options.declare(
            "coefficients", desc="BEM: rotor_coefficients of bem or ccblade", recordable=False
        )

    def setup(self):
        """Declare inputs and outputs."""
        blade, nodes = self.options["blade"], self.options["nodes"]
        self.add_input("chord", val=blade.chord, units="m", desc="chord at the stations")
        self.add_input(
            "twist", val=blade.twist, units="rad", desc="twist at the stations, set angle included"
        )
        self.add_input(
            "rotor_radius", val=blade.rotor_radius, units="m", desc="radius of the swept disc"
        )
        self.add_output(
            "torque_coefficient_table",
            shape=nodes.shape,
            desc="Q / (0.5 rho V^2 pi R^3) at the nodes",
        )

    def setup_partials(self):
        """Declare the dense partials."""
        self.declare_partials("torque_coefficient_table", ["chord", "twist", "rotor_radius"])

    def compute(self, inputs, outputs):
        """Evaluate BEM at the nodes."""
        outputs["torque_coefficient_table"] = self._solve(inputs, derivatives=False).torque

    def compute_partials(self, inputs, partials):
        """Evaluate BEM's implicit derivatives at the nodes."""
        found = self._solve(inputs, derivatives=True)
        partials["torque_coefficient_table", "chord"] = found.torque_by_chord
        partials["torque_coefficient_table", "twist"] = found.torque_by_twist
        partials["torque_coefficient_table", "rotor_radius"] = found.torque_by_rotor_radius

    def _solve(self, inputs, derivatives):
        options = self.options
        blade = (
            options["blade"]
            .with_rotor_radius(inputs["rotor_radius"][0])
            .with_shape(inputs["chord"], inputs["twist"])
        )
        return options["coefficients"](blade, options["polar"], options["nodes"], derivatives)
