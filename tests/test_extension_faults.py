"""Faults of a user's own kinds: the message names the class, its file, its method and the fault."""

import re

import pytest

from hkt_mdo.cli import main

HEAD = """
from typing import Annotated, ClassVar, Literal
import numpy as np
from hkt_mdo import Aggregate, FeedbackLaw, Inflow, Limit, Objective, Quantity
"""
KINDS = {
    "limit": (
        "class Own(Limit):\n"
        '    name: ClassVar[str] = "own"\n'
        '    unit: ClassVar[str] = "{unit}"\n'
        '    inputs: ClassVar[tuple[str, ...]] = ("rotor_speed", "rotor_radius")\n'
        '    bound: Annotated[float, Quantity("m/s**2")] = 95.0\n'
        "    def value(self, rotor_speed, rotor_radius):\n"
        "        {fault}\n"
        "        return rotor_speed**2 * rotor_radius * factor\n",
        "m/s**2",
        "limits: {own: 95}",
        "value",
    ),
    "limit of the design": (
        "class Own(Limit):\n"
        '    name: ClassVar[str] = "own"\n'
        '    unit: ClassVar[str] = "{unit}"\n'
        '    inputs: ClassVar[tuple[str, ...]] = ("mass",)\n'
        '    bound: Annotated[float, Quantity("kg")] = 95.0\n'
        "    def value(self, mass):\n"
        "        {fault}\n"
        "        return mass * factor\n",
        "kg",
        "limits: {own: 95}",
        "value",
    ),
    "objective": (
        "class Own(Objective):\n"
        '    kind: ClassVar[str] = "own"\n'
        '    unit: ClassVar[str] = "{unit}"\n'
        '    inputs: ClassVar[tuple[str, ...]] = ("generator_power",)\n'
        "    def rate(self, generator_power):\n"
        "        {fault}\n"
        "        return generator_power * factor\n",
        "J",
        "objective: own",
        "rate",
    ),
    "objective of the design": (
        "class Own(Objective):\n"
        '    kind: ClassVar[str] = "own"\n'
        '    unit: ClassVar[str] = "{unit}"\n'
        "    maximize: ClassVar[bool] = False\n"
        '    inputs: ClassVar[tuple[str, ...]] = ("mass",)\n'
        "    def value(self, mass):\n"
        "        {fault}\n"
        "        return mass * factor\n",
        "kg",
        "objective: own",
        "value",
    ),
    "law": (
        "class Own(FeedbackLaw):\n"
        '    law: Literal["own"] = "own"\n'
        '    gain_units: ClassVar[tuple[str, ...]] = ("{unit}",)\n'
        "    def demand(self, speed, gains):\n"
        "        {fault}\n"
        "        return gains[0] * speed * factor\n",
        "N*m*s/rad",
        "control: own",
        "demand",
    ),
    "flow": (
        "class Own(Inflow):\n"
        '    profile: Literal["own"] = "own"\n'
        '    mean: Annotated[float, Quantity("{unit}")] = 1.4\n'
        "    highest_frequency: ClassVar[float] = 0.1\n"
        "    def speed_at(self, time):\n"
        "        {fault}\n"
        "        return (self.mean + 0.1 * np.sin(0.2 * np.asarray(time))) * factor\n",
        "m/s",
        "inflow: own",
        "speed_at",
    ),
    "aggregate": (
        "class Own(Aggregate):\n"
        '    measure: ClassVar[str] = "own"\n'
        '    weight: Annotated[float, Quantity("{unit}")] = 1.0\n'
        "    def value(self, rates, shares, unknowns):\n"
        "        {fault}\n"
        "        return np.min(rates.real) * factor\n",
        "W",
        "robustness: own\nscenarios: [{inflow: {profile: sine, mean: 1.3}}, {inflow: sine}]",
        "value",
    ),
}
FAULTS = {
    "raises": ("factor = 1.0; dict()['key']", r"raises KeyError: 'key' in line \d+"),
    "is nan": ("factor = np.nan", "returns nan"),
    "has a wrong shape": ("factor = np.ones((3, 2))[:, 0]", r"(shape|raises ValueError)"),
    "is none": ("return None", "returns null, which is no number"),
}
CASE = """
inflow: sine
control: {law: linear}
design: {blade: fixed}
start: {method: blade}
phase: {duration: 5, segments: 5}
"""


def written(folder, kind, *, fault="factor = 1.0", unit=None):
    """Return the arguments of a command line with an extension and a case that names its kind."""
    text, own_unit, case, method = KINDS[kind]
    text = text.replace("{fault}", fault).replace("{unit}", unit or own_unit)
    (folder / "own.py").write_text(HEAD + text)
    key = case.partition(":")[0]
    lines = [line for line in CASE.splitlines() if not line.startswith(f"{key}:")]
    (folder / "case.yaml").write_text("\n".join([*lines, case]))
    return ["--extend", str(folder / "own.py")], str(folder / "case.yaml"), method


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_is_told_with_its_place(tmp_path, capsys, kind, fault):
    code, words = FAULTS[fault]
    if (kind, fault) == ("limit of the design", "has a wrong shape"):
        pytest.skip("a value of the design may be an array of any size")
    extend, case, method = written(tmp_path, kind, fault=code)
    out = str(tmp_path / "out")
    assert main([*extend, "run", case, "--out", out, "--no-figures"]) == 2
    error = capsys.readouterr().err
    assert re.search(words, error), error
    assert f"{tmp_path / 'own.py'}: Own.{method}: " in error
    assert "error of this program" not in error


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_unit_is_told(tmp_path, capsys, kind):
    extend, case, _ = written(tmp_path, kind, unit="furlong")
    assert main([*extend, "check", case, "--no-figures"]) == 2
    error = capsys.readouterr().err
    assert f"{tmp_path / 'own.py'}: Own: has the unknown unit 'furlong'" in error
