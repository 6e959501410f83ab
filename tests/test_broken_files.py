"""Broken files of every kind: `hkt check` ends with code 2 and one line that helps."""

import re

import pytest

from hkt_mdo.cli import main
from tests.files.broken import blades, polars, records

CONTROL, SINE = "control: {law: quadratic}\n", "inflow: {profile: sine}\n"
OF_CSV = "radius: 1.4, hub_radius_fraction: 0.125, polar: naca63815_Re2e5"
FILES = {
    "csv: falling radius": (blades.BROKEN, f"rotor: {{blade: FILE, {OF_CSV}}}\n{SINE}"),
    "dat: no units": (blades.BROKEN, f"rotor: {{blade: FILE, {OF_CSV}}}\n{SINE}"),
    "yaml: no hub": (blades.BROKEN, f"rotor: {{blade: FILE}}\n{SINE}"),
    "CSV polar: nan": (polars.POLARS, f"rotor: {{polar: 'FILE'}}\n{SINE}"),
    "XFOIL polar: Re varies": (polars.POLARS, f"rotor: {{polar: 'FILE'}}\n{SINE}"),
    "outline: flat": (polars.OUTLINES, f"rotor: {{outline: 'FILE'}}\n{SINE}"),
    "CSV: a word": (records.BROKEN, "inflow: {profile: record, file: 'FILE'}\n"),
    "CSV: a spike": (records.BROKEN, "inflow: {profile: record, file: 'FILE'}\n"),
}
"""Flaws by their names: those of a kind of file, and a case that names such a file."""

TWO = "{polar: cylinder}, {polar: naca4415_Re2e5}"
TIDE = "{profile: tide, constituents: [{name: M2, amplitude: 2}]}\nphase: {duration: 6 h}"
TURNS = "the flow stops or reverses"
CASES = [
    (f"{SINE}control: {{}}\n", "control.law: is missing"),
    (f"{SINE}{CONTROL}rotor: {{blade: rm2}}", "is neither a shipped blade nor a file"),
    (f"{SINE}{CONTROL}rotor: {{stations: [0.13, 0.5, 0.9]}}", "covers r/R = 0.2 … 1 but"),
    (f"{SINE}{CONTROL}rotor: {{polar: naca4415}}", "is needed to choose from polars"),
    (f"{SINE}{CONTROL}rotor: {{reynolds: local}}", "polars at two or more Reynolds numbers"),
    (f"{SINE}{CONTROL}rotor: {{blade: river, sections: [{TWO}]}}", "neither outline nor thickness"),
    (f"inflow: {{profile: sine, amplitude: 2}}\n{CONTROL}", "lets the flow reach zero"),
    (f"inflow: {{profile: gust, amplitude: -2}}\n{CONTROL}", TURNS),
    (f"inflow: {TIDE}\n{CONTROL}", TURNS),
]


def complaint(case, capsys):
    """Return the one line with which a check of a case ends."""
    code = main(["check", str(case)])
    out, err = capsys.readouterr()
    assert code == 2, err
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    assert re.search(r"; \S", err), "names a remedy"
    return err


@pytest.mark.parametrize("flaw", FILES)
def test_broken_file(flaw, tmp_path, capsys, own_environment):
    corpus, text = FILES[flaw]
    name, content, told = corpus[flaw]
    (tmp_path / name).write_bytes(content)
    (tmp_path / "case.yaml").write_text(text.replace("FILE", name) + CONTROL, encoding="utf-8")
    line = complaint(tmp_path / "case.yaml", capsys)
    assert told in line
    assert name in line, "names the file"


@pytest.mark.parametrize(("text", "told"), CASES)
def test_broken_case(text, told, tmp_path, capsys, own_environment):
    (tmp_path / "case.yaml").write_text(text, encoding="utf-8")
    line = complaint(tmp_path / "case.yaml", capsys)
    assert told in line
    assert "case.yaml" in line or "rotor.stations" in line, "names the file, or file and key"
