"""What a release says of itself is the same everywhere."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import hkt_mdo
from hkt_mdo.cli import main
from hkt_mdo.errors import program_version

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_one_version_everywhere():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert citation["version"] == PROJECT["version"]
    assert re.search(r"^## (\S+)", changes, re.MULTILINE)[1] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_citation_has_what_its_format_requires():
    """Citation File Format 1.2.0, https://citation-file-format.github.io."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", citation["date-released"])
    (paper,) = citation["references"]
    assert {"type", "title", "authors"} <= set(paper)


def test_the_program_says_its_version(capsys, monkeypatch):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"hkt_mdo {program_version()}\n"
    assert hkt_mdo.__version__ == program_version()
    monkeypatch.setattr("importlib.metadata.distributions", lambda **_: iter(()))
    assert program_version() == "unknown"


@pytest.mark.parametrize("name", ["CONTRIBUTING.md", "CHANGELOG.md"])
def test_links_of_the_front_pages_lead_somewhere(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        assert target.startswith("https:") or (ROOT / target).exists(), target
    for path in re.findall(r"`((?:hkt_mdo|tests|docs|scripts)/[\w/.]+\w)`", text):
        assert (ROOT / path).exists(), path
