"""What a release says of itself is the same everywhere."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import hkt_mdo
from hkt_mdo.cli import main
from hkt_mdo.errors import install, program_version

ROOT = Path(__file__).parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = SETTINGS["project"]
PINNED = {"run": {"report"}, "dev": set(PROJECT["optional-dependencies"]) - {"neuralfoil"}}
"""The extras whose versions each file of `requirements` pins."""


def test_one_version_everywhere():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert citation["version"] == PROJECT["version"]
    assert re.search(r"^## (?!Unreleased)(\S+)", changes, re.MULTILINE)[1] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_the_program_says_its_version(capsys, monkeypatch):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"hkt_mdo {program_version()}\n"
    assert hkt_mdo.__version__ == program_version()
    monkeypatch.setattr("importlib.metadata.distributions", lambda **_: iter(()))
    assert program_version() == "unknown"


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_links_of_the_front_pages_lead_to_files_and_headings(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    for path, anchor in re.findall(r"\]\((?!https:)([^)#]+)#?([^)]*)\)", text):
        assert (ROOT / path).exists(), path
        if anchor:
            headings = re.findall(r"(?m)^#+ (.*)$", (ROOT / path).read_text(encoding="utf-8"))
            slugs = [re.sub(r"[^\w\- ]", "", each.lower()).replace(" ", "-") for each in headings]
            assert anchor in slugs, (path, anchor)
    for path in re.findall(r"`((?:hkt_mdo|tests|docs|scripts|studies)/[\w/.]+\w)`", text):
        assert (ROOT / path).exists(), path


def pins(name):
    """Return the version of each package that a file of `requirements` pins on this machine."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    assert "://" not in text  # a file for every index
    assert "--" not in text
    read = [Requirement(line) for line in re.findall(r"^\w[^#\n]*", text, re.MULTILINE)]
    here = [each for each in read if each.marker is None or each.marker.evaluate()]
    return {each.name: str(each.specifier).removeprefix("==") for each in here}


@pytest.mark.parametrize("name", PINNED)
def test_the_pinned_versions_are_those_that_the_package_allows(name):
    """`make lock` renews them, such as after a change of the requirements."""
    asked = [*PROJECT["dependencies"], *SETTINGS["dependency-groups"]["build"]]
    for extra in PINNED[name]:
        asked += PROJECT["optional-dependencies"][extra]
    versions = pins(name)
    for package in map(Requirement, asked):
        if package.name != PROJECT["name"]:
            assert package.specifier.contains(versions[canonicalize_name(package.name)]), package
    assert versions.items() <= pins("dev").items()


def test_the_packages_of_the_build_are_pinned_too():
    assert SETTINGS["dependency-groups"]["build"] == SETTINGS["build-system"]["requires"]


def test_every_requirement_names_a_lowest_version():
    """`make oldest` runs the tests with these."""
    optional = [each for extra in PROJECT["optional-dependencies"].values() for each in extra]
    for package in map(Requirement, [*PROJECT["dependencies"], *optional]):
        assert package.name == PROJECT["name"] or ">=" in str(package.specifier), package


def test_the_line_that_installs_an_extra_is_of_the_checkout(monkeypatch, tmp_path):
    assert install("cad") == f"pip install -e '{ROOT}[cad]'"
    monkeypatch.setattr("hkt_mdo.errors.__file__", str(tmp_path / "hkt_mdo" / "errors.py"))
    assert install("cad") == "pip install 'hkt_mdo[cad]'"
