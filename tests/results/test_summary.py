"""The summary: written, read and printed through one class."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.results.folder import to_json
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import Summary
from hkt_mdo.results.words import per_cent, texts
from tests.conftest import edit_summary


def table(solution: Solution) -> list[tuple[str, str]]:
    return list(texts(solution.summary.rows(solution.case)).items())


def edit(folder: Path, **changes: object) -> Solution:
    """Change keys of a summary and return the solution."""
    edit_summary(folder, **changes)
    return Solution.load(folder)


def test_what_is_written_is_read(result_folder: Path) -> None:
    data = json.loads((result_folder / "summary.json").read_text())
    summary = Solution.load(result_folder).summary
    assert summary.model_dump(exclude_unset=True) == data
    assert Summary.parse(to_json(data)) == summary


def test_a_run_writes_arrays_and_drops_what_json_lacks() -> None:
    values = {
        "success": np.bool_(True),
        "mass_kg": np.float64(3.0),
        "surrogate_error": np.inf,
        "r_m": np.array([1.0]),
        "chord_m": [np.float64(0.5)],
        "tip_speed_ratio": {"min": np.nan},
    }
    plain = {"surrogate_error": None, "r_m": [1.0], "tip_speed_ratio": {"min": None}}
    assert Summary.parse(to_json(values)).model_dump(exclude_unset=True) == values | plain


def test_a_newer_summary_is_refused(result_folder: Path) -> None:
    assert edit(result_folder, version=1).summary.version == 1
    message = "version = 2: was written by a newer hkt_mdo; update hkt_mdo, which reads version 1"
    with pytest.raises(InputError, match=message):
        edit(result_folder, version=2, energy_J="of another type")


def test_the_verdict_counts_the_warnings(result_folder: Path) -> None:
    loads = {"stress": {"unit": "Pa", "value": 3.5e9}, "tip_speed": {"unit": "m/s", "value": 12.0}}
    solution = edit(result_folder, loads=loads)
    breaks = "the blade would break"
    assert solution.summary.verdict(solution.case) == f"verified, but {breaks}, 1 warning"
    (warning,) = solution.summary.warnings(solution.case)
    assert warning == "the largest stress in a blade, 3.5 GPa, is above its material's, 240 MPa"
    bent = edit(result_folder, success=False, loads=None, tip_deflection_m=0.15, doubts=["x"])
    bends = "the blade bends too far for its loads to hold"
    assert bent.summary.verdict(bent.case) == f"not verified, and {bends}, 2 warnings"
    deflection, doubt = bent.summary.warnings(bent.case)
    assert deflection == "the largest deflection of a tip is 10.7 % of the radius, above 10 %"
    assert doubt == "x"
    # the other branch is better without time, but was not taken
    objectives = {"overspeed": 1e5, "underspeed": 1.014e5}
    branches = [{"name": x, "objective_J": y, "kept": True} for x, y in objectives.items()]
    branches[0]["taken"] = True
    result = edit(result_folder, loads=None, tip_deflection_m=None, doubts=None, branches=branches)
    (warning,) = result.summary.warnings(result.case)
    assert warning.startswith("without time, branch underspeed is better by 1.4 %")
    branches[1]["objective_J"] = 1.0001e5
    assert not edit(result_folder, branches=branches).summary.warnings(result.case)
    # a limit of one scenario does not hide the larger load of another
    limits = {"stress": {"unit": "Pa", "value": 6e7, "limit": 1e8, "scenario": "slow"}}
    loads["stress"] |= {"r_m": 0.4, "scenario": "fast"}
    both = edit(result_folder, loads=loads, limits=limits, branches=None)
    assert both.summary.verdict(both.case) == f"not verified, and {breaks}, 1 warning"
    rows = dict(table(both))
    assert rows["largest stress"] == "60 MPa, limit 100 MPa, margin 40.00 %, in slow"
    assert rows["largest stress of all"].endswith("allows: fast has no limits.stress")
    least = {"slowest": {"unit": "rad/s", "value": 6.0, "limit": 5.0, "lower": True}}
    assert edit(result_folder, limits=least).summary.used == {"slowest": pytest.approx(80.0)}
    at_limit = {"stress": {"unit": "Pa", "value": 240.01e6}}  # as a limit may be kept
    changes = {"limits": None, "loads": at_limit, "tip_deflection_m": 0.13, "doubts": None}
    kept = edit(result_folder, success=True, **changes)
    assert kept.summary.verdict(kept.case) == "verified"
    refused = edit(result_folder, success=False)
    assert refused.summary.verdict(refused.case) == "not verified"


def test_a_share_of_next_to_nothing_is_not_told() -> None:
    """Such as the change of an objective that no optimization has had before."""
    assert [per_cent(1.0, 8.0), per_cent(-3.0, 3.0)] == ["12 %", "-100 %"]
    assert {per_cent(1.0, np.inf), per_cent(5.0, 1e-10), per_cent(0.0, 0.0)} == {""}


ROWS = yaml.safe_load((Path(__file__).parents[1] / "data" / "summary_rows.yaml").read_text())


@pytest.mark.parametrize(("changes", "label", "text"), ROWS)
def test_a_row_of_the_table(result_folder: Path, changes: dict, label: str, text: str) -> None:
    assert dict(table(edit(result_folder, **changes))).get(label) == text


def test_text_of_others_does_not_command_the_terminal(result_folder: Path) -> None:
    check = {"name": "a\x1b]0;b\x07", "value": 2.0, "limit": None, "passed": False, "detail": "c\n"}
    solution = edit(
        result_folder, message="\x1b[2Jgone\nsecond line", checks=[check], optimizer="\x1b[1m"
    )
    texts = [*(value for _, value in table(solution)), *solution.failed_checks]
    assert all(text.isprintable() for text in texts)
    assert solution.failed_checks[0].endswith("2, at most -. c")
