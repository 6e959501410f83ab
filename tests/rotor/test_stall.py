"""Which sections must stay attached, and the angle of attack that is held for it."""

from pathlib import Path

import numpy as np
import openmdao.api as om

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.components import AngleComp
from hkt_mdo.rotor.hydrodynamics import Hydrodynamics
from hkt_mdo.rotor.stall import DISTANCE, stall_fence

BLADE = Path(__file__).parents[1] / "data" / "blades" / "iea3_4.yaml"


def world():
    rotor = {"blade": str(BLADE), "station_count": 14, "radius": 8.0}
    return physics(load_case({"rotor": rotor, "inflow": "sine", "control": "quadratic"}))


def test_attached_stations_keep_a_degree_from_stall_and_cylinders_are_free():
    real = world()
    stall = np.array([polar.stall for polar in real.polar])
    assert np.isinf(stall[0])
    assert np.all((stall[-5:] > np.deg2rad(8.0)) & (stall[-5:] < np.deg2rad(15.0)))
    fence = stall_fence(Hydrodynamics(real.polar), real.shape, real.blade, 9.0)
    assert {10, 11, 12} <= set(fence.stations)
    assert 0 not in fence.stations
    np.testing.assert_allclose(fence.highest, stall[fence.stations] - DISTANCE)
    one_section = real.polar[-1]
    assert not stall_fence(Hydrodynamics(one_section), real.shape, real.blade, 9.0).stations.size


def test_angles_have_the_derivatives_of_finite_differences():
    real = world()
    problem = om.Problem(reports=False)
    about = {"blade": real.blade, "rotor": real.rotor, "stations": np.arange(4, 14)}
    problem.model.add_subsystem("angle", AngleComp(**about, slowed=0.97), promotes=["*"])
    problem.setup()
    problem.set_val("lowest_ratio", 9.0)
    problem.run_model()
    found = problem.check_partials(out_stream=None, method="fd", form="central", step=1e-6)
    for (_, name), check in found["angle"].items():
        np.testing.assert_allclose(
            check["J_fwd"], check["J_fd"], rtol=1e-5, atol=1e-7, err_msg=name
        )
