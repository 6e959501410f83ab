"""The page of the cost of energy says what its command computes."""

import importlib
import re
from pathlib import Path

import page_data
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def script():
    return importlib.import_module("cost_of_energy")


def test_the_cost_is_that_of_its_formula_by_hand(script):
    """NRWAL's rm1.yaml: (capital × 0.108 + yearly) / energy; RM1's ten devices of 1.1 MW."""
    n = 11.0
    device = (284245 * n + 785137) + (1527017 * n + 505548) + (437091 * n + 433518)
    plant = 3197591 * n**0.49 + 850744 * n**0.5649 + 2805302 * n**0.66
    electrical = (4.40 * n + 162.81) * script.CABLE + 1e5 * n + 47966.16 * n + 665841.0
    capital = (device + plant + electrical) * (1 + 0.016 + 0.011 + 0.05 + 0.01 + 0.03)
    yearly = (31250.0 * n + 879282.0) + (116803.0 * n + 317719.0)
    expected = (0.108 * capital + yearly) / (20 * 1.5e6)
    assert script.cost_of_energy(1.5e6, 4000.0, 0.55, 4000.0) == pytest.approx(expected, rel=1e-12)
    heavier = script.cost_of_energy(1.5e6, 4100.0, 0.55, 4000.0)
    assert heavier - expected == pytest.approx(0.108 * 1.117 * 20 * 1460 / 3e7, rel=1e-9)


@pytest.mark.slow
def test_the_designs_of_the_data_are_those_that_the_command_finds(script):
    designs, recorded = script.found(), page_data.read("cost")["designs"]
    assert designs.keys() == recorded.keys()
    for name, design in designs.items():
        assert design == pytest.approx(recorded[name], rel=2e-3), name


@pytest.mark.slow
def test_a_year_of_a_case_costs_what_the_table_says(script, tmp_path, monkeypatch, capsys):
    """Another way to the same: a resource, its checks and losses, of RM1's own blade."""
    page = (ROOT / "docs" / "studies" / "cost.md").read_text(encoding="utf-8")
    codes = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (code,) = (text for text in codes if "year" in text)
    monkeypatch.chdir(tmp_path)
    exec(code, {"cost_of_energy": script.cost_of_energy})
    energy, cost = re.search(r"(.*) GWh, .*\n(.*) USD", capsys.readouterr().out).groups()
    assert f"prints {energy} GWh and {cost} USD/kWh" in page
    row = re.search(r"\| RM1's blade \|(.*)\|", page)[1].split("|")
    assert float(energy) == pytest.approx(float(row[1]), rel=2e-3)
    assert float(cost) == pytest.approx(float(row[-1]), rel=2e-3)
