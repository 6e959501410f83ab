"""Pages of results agree with their data, docs/data; `scripts/page_data.py` says what these are."""

import importlib
import re
from pathlib import Path

import page_data
import pytest

ROOT = Path(__file__).parent.parent
PAGES = sorted(path.stem for path in (ROOT / "docs" / "data").glob("*.json"))
RENDERED = {"limits": "limits_study", "robust": "robust_study"}  # pages that are made of results
OTHERWISE = {
    "cases": "generated: tests/test_documents.py",
    "codesign_map": "its data are a table: tests/studies/test_codesign_map.py",
    "files": "generated: tests/files/test_public_files.py",
    "first_steps": "sizes and times of an installation",
    "install": "versions of packages",
    "openmdao": "its code is run and compared: tests/test_model_pages.py",
    "own_turbine": "values of cases, not results",
    "postprocessing": "its code is run and compared: tests/test_model_pages.py",
    "tutorials/year": "values of a case, not results",
}
"""Pages with decimal numbers but without data, and why."""


@pytest.mark.parametrize("page", PAGES)
def test_page_has_the_numbers_of_its_data(page):
    data, text = page_data.read(page), (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    assert re.fullmatch("[0-9a-f]{7,}", data["commit"])
    assert data["commands"]
    for command in data["commands"]:
        for path in re.findall(r"scripts/\w+\.py", command):
            assert (ROOT / path).is_file(), command
    if page in RENDERED:
        remedy = f"python scripts/{RENDERED[page]}.py --from-data"
        assert importlib.import_module(RENDERED[page]).from_data(data) == text, remedy
    else:
        remedy = f"after the command that computes them: python scripts/page_data.py {page}"
        assert page_data.numbers_of(text) == data["numbers"], remedy


def test_every_page_with_results_has_data():
    without = set()
    for path in (ROOT / "docs").rglob("*.md"):
        name = path.relative_to(ROOT / "docs").with_suffix("").as_posix()
        if name not in PAGES and not name.startswith("reference/"):
            numbers = str(page_data.numbers_of(path.read_text(encoding="utf-8")))
            if len(re.findall(r"\d\.\d", numbers)) > 2:
                without.add(name)
    assert without == set(OTHERWISE)


def test_a_changed_number_is_noticed():
    page = "# A\n\nIt gains 0.31 % of 3 kJ.\n\n| a | b |\n|---|---|\n| x | 2.50 |\n"
    found = {"A": {"sentences": ["0.31 %"], "rows": [["x", "2.50"]]}}
    assert page_data.numbers_of(page) == found
    assert page_data.numbers_of(page.replace("0.31", "0.32")) != found
    assert page_data.numbers_of(page.replace("2.50", "2.51")) != found
    assert page_data.numbers_of(page.replace("It gains", "That gains")) == found
