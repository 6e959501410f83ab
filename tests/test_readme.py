"""README: its numbers are those of the pages that it names, its output that of a run."""

import re
from pathlib import Path

import pytest

from hkt_mdo.cli import main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_its_test_commands_are_those_of_continuous_integration():
    commands = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()[-2:]
    assert commands == ["make test", "make check"]
    install = README.partition("\n## Install\n")[2].partition("\n## ")[0]
    assert all(command in install for command in commands)


def test_every_number_of_the_table_is_on_the_page_that_it_names():
    rows = re.findall(r"^\| (.*) \| (.*) \| (\[.*\)) \|$", README, re.MULTILINE)
    assert len(rows) == 6
    for what, result, link in rows:
        path = re.search(r"\(([\w/.]+)", link)[1]
        page = (ROOT / path).read_text(encoding="utf-8")
        numbers = re.findall(r"\d[\d.]*(?:e-\d+|/\d+)?", re.sub(r"\(\d{4}\)", "", result))
        assert numbers, what
        for number in numbers:
            assert re.search(rf"(?<![\d.]){re.escape(number)}(?!\d)", page), (number, path)


def test_the_numbers_below_the_picture_of_the_papers_cases_are_those_of_the_reproduction():
    page = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
    text = " ".join((ROOT / "docs" / "shipped_cases.md").read_text(encoding="utf-8").split())
    (below,) = re.findall(r"\*One flow, one torque limit(.*?)\*(?= )", text)
    numbers = re.findall(r"(\d\.\d+) %", below)
    assert len(numbers) == 2
    for number in numbers:
        assert number in page, number


@pytest.mark.slow
def test_the_output_shown_is_that_of_the_run(solve, capsys):
    """The words are the program's; the last digits of a number may differ between machines."""
    assert main(["show", str(solve("examples/first_turbine").folder)]) == 0
    printed = {}
    for line in capsys.readouterr().out.splitlines():
        name, _, value = line.strip().partition("  ")
        printed[name] = value.strip()
    (block,) = re.findall(r"^```text\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    for line in block.splitlines():
        name, _, value = line.strip().partition("  ")
        value, output = value.strip(), printed[name]
        number = re.compile(r"-?\d+(?:\.\d+)?(?:e-\d+)?")
        assert number.sub("#", output).startswith(number.sub("#", value)), line
        for first, other in zip(number.findall(value)[:1], number.findall(output), strict=False):
            assert float(other) == pytest.approx(float(first), rel=2e-3), line
