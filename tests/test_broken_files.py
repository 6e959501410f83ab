"""Broken files of every kind: `hkt check` ends with code 2 and one line that helps."""

import os
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

from hkt_mdo.cli import main
from tests.broken import blades, polars, records

FLOW = "inflow: {profile: sine}\ncontrol: {law: quadratic}\n"

WHOLE = re.compile(
    "is empty|has a header but|has [0-9]+ samples|is not (text|NetCDF)|cannot be read as|ending"
)
"""What is said of a file as a whole, where no line is to be named."""

PLACE = re.compile(r"(line|row) [0-9]+|column|[a-z_]+\.[a-z_]+|[A-Za-z]+ = |: end: |at .+ degrees")


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


def binary_records() -> records.Broken:
    if any(find_spec(name) is None for name in ("xarray", "netCDF4", "pandas", "pyarrow")):
        return {}
    return records.binary()


CORPORA = {
    "blade": (blades.BROKEN, with_blade),
    "polar": (polars.POLARS, with_polar),
    "outline": (polars.OUTLINES, with_outline),
    "record": (records.BROKEN | binary_records(), with_record),
}


def section(name: str, text: str) -> bytes:
    return f"{FLOW}{name}: {{{text}}}\n".encode()


CASES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "holds no case"),
    "remarks": (b"# nothing\n\n", "holds no case"),
    "a list": (b"- inflow\n- control\n", "must hold keys and values at its top"),
    "one word": (b"turbine\n", "must hold keys and values at its top"),
    "not UTF-8": (FLOW.encode() + b"# \xe4\n", "line 3: is not UTF-8 text"),
    "UTF-16": (FLOW.encode("utf-16"), "line 1: is not UTF-8 text"),
    "a tab": (b"rotor:\n\tradius: 1.4\n", "line 2, column 1: cannot be read as YAML"),
    "an open bracket": (b"rotor: {radius: 1.4\n", "cannot be read as YAML"),
    "a key twice": (f"{FLOW}fluid: {{}}\nfluid: {{}}\n".encode(), "is given twice"),
    "an alias": (b"inflow: &a {profile: sine}\ncontrol: *a\n", "anchors (&) and aliases (*)"),
    "a tag": (section("rotor", "radius: !!python/object:os.system 1"), "tags (!) are refused"),
    "too deep": (b"rotor: " + b"[" * 50, "nested deeper than 20 levels"),
    "no control": (b"inflow: {profile: sine}\n", "control: is missing"),
    "no inflow": (b"control: {law: linear}\n", "inflow: is missing"),
    "no law": (b"inflow: {profile: sine}\ncontrol: {}\n", "control.law: is missing"),
    "an unknown law": (FLOW.replace("quadratic", "cubic").encode(), "control.law = 'cubic'"),
    "an unknown profile": (FLOW.replace("sine", "sinus").encode(), "did you mean sine?"),
    "an unknown section": (section("rotr", "radius: 1.4"), "rotr = "),
    "an unknown key": (section("rotor", "radus: 1.4"), "did you mean radius?"),
    "a word for a number": (section("rotor", "radius: large"), "rotor.radius = 'large'"),
    "nan": (section("rotor", "radius: .nan"), "must be a finite number"),
    "a negative radius": (section("rotor", "radius: -1.4"), "must be greater than 0 m"),
    "an unknown unit": (section("rotor", "radius: 7 furlong"), "has the unknown unit furlong"),
    "a unit of another kind": (section("rotor", "radius: 7 s"), "does not convert to m"),
    "half a blade": (section("rotor", "blade_count: 2.5"), "must be a whole number"),
    "no such blade": (section("rotor", "blade: rm2"), "is neither a shipped blade nor a file"),
    "no such record": (with_record("gone.csv").encode(), "inflow.file = 'gone.csv': is not a file"),
    "chord without twist": (section("rotor", "chord: [0.1, 0.1]"), "without rotor.twist"),
    "stations that fall": (section("rotor", "stations: [0.5, 0.3, 0.9]"), "stations must rise"),
    "a station in the hub": (section("rotor", "stations: [0.1, 0.3, 0.9]"), "within the hub"),
    "stations beyond the file": (
        section("rotor", "stations: [0.13, 0.5, 0.9]"),
        "covers r/R = 0.2 … 1 but rotor.stations reach 0.13 … 0.9",
    ),
    "stations twice": (
        section("rotor", "stations: [0.3, 0.6, 0.9], station_count: 5"),
        "stands beside rotor.stations",
    ),
    "turned bounds": (section("design", "chord_bounds: [1, 0.1]"), "lower bound at or above"),
    "one bound": (section("design", "twist_bounds: [1]"), "design.twist_bounds"),
    "a fixed spline": (section("design", "blade: fixed, chord_points: 4"), "a blade that is fixed"),
    "a radius out of bounds": (
        section("rotor", "radius: 2") + b"design: {radius_bounds: [1, 1.5]}\n",
        "lies outside design.radius_bounds",
    ),
    "an even order": (section("phase", "order: 4"), "phase.order = 4"),
    "one segment": (section("phase", "segments: 1"), "must be at least 2"),
    "half a segment": (section("phase", "segments: 60.5"), "must be a whole number"),
    "another package's optimizer": (
        section("driver", "package: scipy, optimizer: IPOPT"),
        "is not provided by the package scipy",
    ),
    "a flow that turns": (
        b"inflow: {profile: sine, amplitude: 2}\ncontrol: {law: linear}\n",
        "lets the flow reach zero",
    ),
    "a tide that turns": (
        b"inflow: {profile: tide, constituents: [{name: M2, amplitude: 2}]}\n"
        b"control: {law: linear}\nphase: {duration: 6 h}\n",
        "stands still or turns back",
    ),
    "a lull below zero": (
        b"inflow: {profile: gust, amplitude: -2}\ncontrol: {law: linear}\n",
        "stands still or turns back",
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
    code = main(["check", str(case), "--no-figures"])
    out, err = capsys.readouterr()
    assert code == 2, err
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    assert "Traceback" not in err
    return err.strip()


@pytest.mark.parametrize(
    ("kind", "flaw"), [(kind, flaw) for kind, (corpus, _) in CORPORA.items() for flaw in corpus]
)
def test_broken_file(
    kind: str, flaw: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    corpus, write = CORPORA[kind]
    name, content, told = corpus[flaw]
    (tmp_path / name).write_bytes(content)
    (tmp_path / "case.yaml").write_text(write(name), encoding="utf-8")
    line = complaint(tmp_path / "case.yaml", capsys)
    assert told in line
    _, found, rest = line.partition(name)
    assert found, "names the file"
    assert PLACE.search(rest) or WHOLE.search(rest), "names the place"
    assert re.search(r"; \S", rest), "names a remedy"


@pytest.mark.parametrize("flaw", CASES)
def test_broken_case(flaw: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, told = CASES[flaw]
    (tmp_path / "case.yaml").write_bytes(content)
    line = complaint(tmp_path / "case.yaml", capsys)
    assert told in line
    assert "case.yaml" in line or "rotor.stations" in line, "names the file, or file and key"
    assert re.search(r"; \S", line)


def test_there_are_twenty_of_each_kind_with_a_place() -> None:
    for corpus, _ in CORPORA.values():
        placed = [told for *_, told in corpus.values() if not WHOLE.search(told)]
        assert len(placed) >= 20
    assert len(CASES) >= 20
