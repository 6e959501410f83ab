"""The pages on OpenMDAO: their code runs, and prints what they say that it prints."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.DOTALL | re.MULTILINE)
NUMBER = re.compile(r"-?\d+\.?\d*")


def run_page(name, capsys):
    """Run the code of a page, block by block in one namespace; compare what it prints."""
    text, namespace = (DOCS / name).read_text(encoding="utf-8"), {}
    blocks = BLOCK.findall(text)
    assert len(blocks) == text.count("```python")
    for code, shown in blocks:
        exec(compile(code, name, "exec"), namespace)
        printed = capsys.readouterr().out
        assert NUMBER.sub("#", printed) == NUMBER.sub("#", shown)
        for value, wanted in zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True):
            digit = 10.0 ** -len(wanted.partition(".")[2])  # the last one may be rounded otherwise
            assert float(value) == pytest.approx(float(wanted), abs=1.5 * digit), printed
    return namespace


@pytest.mark.slow
def test_a_cost_model_on_top(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run_page("openmdao.md", capsys)
    assert (tmp_path / "cost_of_energy.html").stat().st_size > 100_000


@pytest.mark.slow
def test_examples_of_the_rotor_group(tmp_path, monkeypatch, capsys):
    """A design of experiments, and a pile that shares the rotor's radius."""
    monkeypatch.chdir(tmp_path)
    problem = run_page("studies/openmdao_examples.md", capsys)["problem"]
    stress = problem.get_val("pile_stress", units="MPa")[0]
    assert stress == pytest.approx(150.0, rel=1e-5)
    # the optimum, by its definition: no step within the bounds lowers the cost at the same stress
    of, wrt = ["cost_of_energy", "pile_stress"], ["rotor_radius", "twist_control", "pile_diameter"]
    totals = problem.compute_totals(of=of, wrt=wrt, return_format="array")
    cost, stress = totals / abs(totals).max(axis=1, keepdims=True)
    assert cost == pytest.approx(cost[2] / stress[2] * stress, abs=2e-3)


@pytest.mark.slow
def test_databases_and_plots(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    namespace = run_page("postprocessing.md", capsys)
    folder = namespace["solution"].folder
    for name in ("solution.db", "history.db"):
        assert 0.2e6 < (folder / name).stat().st_size < 0.8e6
    text = (DOCS / "postprocessing.md").read_text(encoding="utf-8")
    plots = [code for code, _ in BLOCK.findall(text) if "savefig" in code]
    assert len(plots) == 4
    for code in plots:
        (name,) = re.findall(r'savefig\("(\w+\.png)"\)', code)
        assert (tmp_path / name).stat().st_size > 5_000
    final, last = namespace["final"], namespace["last"]
    assert final["chord_control"] == pytest.approx(last["chord_control"], rel=1e-12)
    for name in re.findall(r"^\| ([^|]*) \|", text, re.MULTILINE):
        for quantity in re.findall(r"`([a-z_]+)`", name):
            if quantity not in ("thickness_control", "rotor_radius"):  # not designed in this case
                assert final[quantity].size
