"""A control law that the package does not have, added as docs/controllers.md says."""

from typing import Annotated, ClassVar, Literal

import pytest
import yaml
from pydantic import Field

from hkt_mdo import case as case_module
from hkt_mdo.dynamics import controllers
from hkt_mdo.run.run import run_case


class MixedLaw(controllers.FeedbackLaw):
    """u = K1 w + K2 w²."""

    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad", "N*m*s**2/rad**2")

    def demand(self, speed, gains):
        return gains[0] * speed + gains[1] * speed**2


class MixedFeedback(case_module.Feedback):
    """The schema entry."""

    law: Literal["mixed"] = "mixed"


class CaseWithMixed(case_module.Case):
    """A case that knows the fourth law."""

    control: Annotated[MixedFeedback | case_module.OpenLoop, Field(discriminator="law")]


def test_a_law_of_two_gains_runs_and_is_at_least_as_good_as_its_parts(tmp_path, monkeypatch):
    monkeypatch.setitem(controllers.LAWS, "mixed", MixedLaw)
    # the real package would have the entry in its own schema, and read results back with it
    monkeypatch.setattr(
        "hkt_mdo.results.solution.load_case",
        lambda path, **_: CaseWithMixed.model_validate(yaml.safe_load(path.read_text())),
    )

    def run(control):
        case = CaseWithMixed.model_validate(
            {
                "name": control["law"],
                "inflow": {"profile": "sine"},
                "control": control,
                "phase": {"segments": 30, "duration": 30},
            }
        )
        return run_case(case, tmp_path / control["law"], figures=False)

    mixed = run({"law": "mixed", "torque_limit": 700.0})
    assert mixed.summary["success"], mixed.summary["message"]
    assert len(mixed.summary["gain"]) == 2
    loop = run({"law": "open_loop", "torque_limit": 700.0})
    assert mixed.summary["simulated_energy_J"] == pytest.approx(
        loop.summary["simulated_energy_J"], rel=2e-4
    )
    assert mixed.summary["simulated_energy_J"] <= loop.summary["simulated_energy_J"] * (1.0 + 2e-5)
