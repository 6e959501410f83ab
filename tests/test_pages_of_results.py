"""Pages of results agree with their data, docs/data; `studies/page_data.py` says what these are."""

import importlib
import math
import re
from pathlib import Path

import page_data
import pytest

ROOT = Path(__file__).parent.parent
PAGES = sorted(path.stem for path in (ROOT / "docs" / "data").glob("*.json"))
OTHERWISE = {
    "cases": "generated: tests/test_documents.py",
    "studies/codesign_map": "its data are a table: tests/studies_code/test_codesign_map.py",
    "install": "versions of packages",
    "exports": "options, and versions of other programs",
    "tutorials/year": "values of a case, not results",
}
"""Pages with decimal numbers but without data, and why."""


@pytest.mark.parametrize("page", PAGES)
def test_page_has_the_numbers_of_its_data(page):
    data, text = page_data.read(page), page_data.text_of(page)
    assert re.fullmatch("[0-9a-f]{7,}", data["commit"])
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", data["date"])
    assert re.fullmatch(r"[\d.]+, source [0-9a-f]{12}", data["computed_by"]["hkt_mdo"])
    assert data["commands"]
    for command in data["commands"]:
        for path in re.findall(r"(?:scripts|studies)/\w+\.py", command):
            assert (ROOT / path).is_file(), command
    remedy = f"after the command that computes them: python studies/page_data.py {page}"
    assert page in page_data.RENDERED or "numbers" in data
    assert page_data.numbers_of(text) == data.get("numbers", page_data.numbers_of(text)), remedy
    if page in page_data.RENDERED:
        from_data = importlib.import_module(page_data.RENDERED[page]).from_data
        assert text == from_data(data), f"python studies/page_data.py --write {page}"


def test_sizes_of_what_is_not_modelled_are_computed_again():
    script, data = importlib.import_module("not_modelled"), page_data.read("not_modelled")
    assert script.of_formulas() == pytest.approx(data["formulas"], rel=1e-9)


@pytest.mark.parametrize(
    ("script", "pages"),
    [("not_modelled", ["not_modelled"]), ("reproduction_page", ["reproduction", "validation"])],
)
def test_pages_that_are_written_by_hand_have_the_words_of_their_data(script, pages):
    """The data are those of the first page."""
    text = " ".join(" ".join(map(page_data.text_of, pages)).split())
    for words in importlib.import_module(script).shown(page_data.read(pages[0])):
        assert words in text


def test_certificates_are_those_of_the_runs():
    script, data = importlib.import_module("reproduction_page"), page_data.read("reproduction")
    assert all(row in page_data.text_of("checks") for row in script.certificates(data))


def test_the_horizon_follows_from_the_flows_as_the_page_says():
    script, page = importlib.import_module("infer_horizon"), page_data.text_of("reproduction")
    errors = {}
    for horizon in (59, 60, 61):
        base = script.content(script.SineInflow(), horizon)
        ratio = {name: script.content(script.FLOWS[name], horizon) / base for name in "BC"}
        errors[horizon] = math.hypot(*(ratio[x] / script.PAPER[x] - 1.0 for x in "BC"))
        if horizon == 60:
            assert f"give {ratio['B']:.4f} and {ratio['C']:.4f} at 60 s" in page
    assert [round(errors[each] / errors[60]) for each in (59, 61)] == [5, 8]
    assert "at 59 and 61 s the error is five and eight times as large" in page


def test_every_page_with_results_has_data():
    without, paths = set(), {page_data.path_of(page) for page in PAGES}
    for path in (ROOT / "docs").rglob("*.md"):
        name = path.relative_to(ROOT / "docs").with_suffix("").as_posix()
        if path not in paths and not name.startswith("reference/"):
            numbers = str(page_data.numbers_of(path.read_text(encoding="utf-8")))
            if len(re.findall(r"\d\.\d", numbers)) > 2:
                without.add(name)
    assert without == set(OTHERWISE)
