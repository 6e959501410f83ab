"""Broken files of every kind: `hkt check` ends with code 2 and one line that helps."""

import os
import re
from pathlib import Path

import pytest

from hkt_mdo.cli import main
from tests.files.broken import blades, polars, records

FLOW = "inflow: {profile: sine}\ncontrol: {law: quadratic}\n"


def with_blade(name: str) -> str:
    if name.endswith(".yaml"):
        return f"rotor: {{blade: {name}}}\n{FLOW}"
    besides = "radius: 1.4, hub_radius_fraction: 0.125, polar: naca63815_Re2e5"
    return f"rotor: {{blade: {name}, {besides}}}\n{FLOW}"


def with_polar(name: str) -> str:
    return f"rotor: {{polar: '{name}'}}\n{FLOW}"


def with_outline(name: str) -> str:
    return f"rotor: {{outline: '{name}'}}\n{FLOW}"


def with_record(name: str) -> str:
    return f"inflow: {{profile: record, file: '{name}'}}\ncontrol: {{law: quadratic}}\n"


FILES = {
    "blade": (blades.BROKEN, with_blade, ("csv: falling radius", "dat: no units", "yaml: no hub")),
    "polar": (polars.POLARS, with_polar, ("CSV polar: nan", "XFOIL polar: Re varies")),
    "outline": (polars.OUTLINES, with_outline, ("outline: nan", "outline: flat")),
    "record": (records.BROKEN, with_record, ("CSV: a word", "CSV: a spike")),
}


def section(name: str, text: str) -> bytes:
    return f"{FLOW}{name}: {{{text}}}\n".encode()


CASES: dict[str, tuple[bytes, str]] = {
    "remarks": (b"# nothing\n\n", "contains no case"),
    "UTF-16": (FLOW.encode("utf-16"), "line 1: is not UTF-8 text"),
    "no control": (b"inflow: {profile: sine}\n", "control: is missing"),
    "no law": (b"inflow: {profile: sine}\ncontrol: {}\n", "control.law: is missing"),
    "an unknown profile": (FLOW.replace("sine", "sinus").encode(), "did you mean sine?"),
    "an unknown section": (section("rotr", "radius: 1.4"), "rotr = "),
    "a unit of another kind": (section("rotor", "radius: 7 s"), "does not convert to m"),
    "half a blade": (section("rotor", "blade_count: 2.5"), "must be a whole number"),
    "no such blade": (section("rotor", "blade: rm2"), "is neither a shipped blade nor a file"),
    "no such record": (with_record("gone.csv").encode(), "inflow.file = 'gone.csv': is not a file"),
    "a station in the hub": (section("rotor", "stations: [0.1, 0.3, 0.9]"), "within the hub"),
    "stations beyond the file": (
        section("rotor", "stations: [0.13, 0.5, 0.9]"),
        "covers r/R = 0.2 … 1 but rotor.stations reach 0.13 … 0.9",
    ),
    "one segment": (section("phase", "segments: 1"), "must be at least 2"),
    "a flow that turns": (
        b"inflow: {profile: sine, amplitude: 2}\ncontrol: {law: linear}\n",
        "lets the flow reach zero",
    ),
    "a tide that turns": (
        b"inflow: {profile: tide, constituents: [{name: M2, amplitude: 2}]}\n"
        b"control: {law: linear}\nphase: {duration: 6 h}\n",
        "the flow stops or reverses",
    ),
    "a lull below zero": (
        b"inflow: {profile: gust, amplitude: -2}\ncontrol: {law: linear}\n",
        "the flow stops or reverses",
    ),
    "a polar of many": (
        section("rotor", "polar: naca4415"),
        "rotor.reynolds_number: is needed to choose from polars",
    ),
    "local Reynolds numbers of one polar": (
        section("rotor", "reynolds: local"),
        "needs polars at two or more Reynolds numbers",
    ),
    "two sections of no thickness": (
        section("rotor", "blade: river, sections: [{polar: cylinder}, {polar: naca4415_Re2e5}]"),
        "gives neither outline nor thickness",
    ),
}


@pytest.fixture(autouse=True)
def _own_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "environ", os.environ.copy())


def complaint(case: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line with which a check of a case ends."""
    code = main(["check", str(case)])
    out, err = capsys.readouterr()
    assert code == 2, err
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    assert "Traceback" not in err
    return err.strip()


@pytest.mark.parametrize(
    ("kind", "flaw"), [(kind, flaw) for kind, (*_, flaws) in FILES.items() for flaw in flaws]
)
def test_broken_file(
    kind: str, flaw: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    corpus, write, _ = FILES[kind]
    name, content, told = corpus[flaw]
    (tmp_path / name).write_bytes(content)
    (tmp_path / "case.yaml").write_text(write(name), encoding="utf-8")
    line = complaint(tmp_path / "case.yaml", capsys)
    assert told in line
    assert name in line, "names the file"
    assert re.search(r"; \S", line), "names a remedy"


@pytest.mark.parametrize("flaw", CASES)
def test_broken_case(flaw: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, told = CASES[flaw]
    (tmp_path / "case.yaml").write_bytes(content)
    line = complaint(tmp_path / "case.yaml", capsys)
    assert told in line
    assert "case.yaml" in line or "rotor.stations" in line, "names the file, or file and key"
    assert re.search(r"; \S", line)
