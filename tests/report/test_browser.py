"""The report in a real browser: Debian's Chromium draws every panel, and asks no network."""

import io
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from playwright.sync_api import Browser, sync_playwright

from hkt_mdo.pages import page
from hkt_mdo.results.solution import ScenarioTables, Solution
from tests.conftest import make_result, operate
from tests.exports.made import made
from tests.report.test_page import TWO

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium")
WEBGL = "--use-angle=swiftshader", "--enable-unsafe-swiftshader"
WITHOUT = ("--disable-3d-apis",)
ALL = {"solid", "shape", "sections", "flow", "time", "coefficients", "limits", "span"}


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, Path]:
    """Reports of one result, of two, and of one with two scenarios."""
    base = tmp_path_factory.mktemp("browser")
    one = Solution.load(make_result(base / "a"))
    other = Solution.load(make_result(base / "b", "linear", None))
    two = made(base / "c", TWO, [7.5])
    chosen = {"one": [one], "both": [one, other], "two": [two]}
    return {name: page.write_report(x, base / f"{name}.html") for name, x in chosen.items()}


@pytest.fixture(scope="module")
def start() -> Iterator:
    """What starts Chromium with some options; the browsers end with the module."""
    if CHROMIUM is None:
        pytest.fail("Chromium is missing; install it with: apt-get install -y chromium")
    with sync_playwright() as playwright:
        yield lambda *options: playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", *options]
        )


@pytest.fixture(scope="module")
def browser(start) -> Browser:
    return start(*WEBGL)


def opened(browser, path, width=1400, scheme="light"):
    """Return a page when it has drawn all, with the errors and the requests that it made."""
    tab = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    seen = []
    tab.on("console", lambda x: seen.append(x.text) if x.type == "error" else None)
    tab.on("pageerror", lambda error: seen.append(str(error)))
    tab.on("request", lambda x: seen.append(x.url) if not x.url.startswith("data:") else None)
    tab.goto(path.as_uri(), timeout=60_000)
    tab.wait_for_selector("body[data-ready]", timeout=60_000)
    assert seen == [path.as_uri()]
    return tab


def drawn(tab):
    """Return the charts whose own drawing is on the page, by their places in it."""
    found = tab.locator(".chart:has(.trace), .chart:has(.point), #solid:has(canvas)").all()
    return {each.get_attribute("id") for each in found}


@pytest.mark.parametrize(
    ("name", "width", "scheme"),
    [("one", 1400, "light"), ("both", 400, "dark"), ("two", 1400, "dark")],
)
def test_every_panel_is_drawn(pages, browser, name, width, scheme):
    tab = opened(browser, pages[name], width, scheme)
    wanted = ALL | {"convergence"} if name != "two" else ALL - {"span"}
    assert drawn(tab) == wanted
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    ground = tab.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (ground == "rgb(255, 255, 255)") == (scheme == "light")
    # the blade is there, and lighted: many shades
    picture = imread(io.BytesIO(tab.locator("#solid").screenshot()))
    assert len(np.unique(np.round(picture.reshape(-1, picture.shape[-1]), 2), axis=0)) > 30
    if name == "two":
        choose_a_scenario(tab)
    tab.close()


def choose_a_scenario(tab):
    """Hold what stands over time to the scenario that is chosen."""
    names = "[...document.getElementById('time').data].map(x => x.name)"
    assert "smallest margin" in tab.evaluate(names)
    tab.select_option("#view", "fast")
    tab.wait_for_selector("#time[data-drawn=fast]")
    assert "margin: thrust" in tab.evaluate(names)
    axes = tab.evaluate("[...new Set(document.getElementById('time').data.map(x => x.xaxis))]")
    assert axes == ["x"]  # the panels zoom together


def test_a_picture_replaces_the_solid_without_webgl(pages, start):
    browser = start(*WITHOUT)
    tab = opened(browser, pages["one"])
    assert drawn(tab) == ALL - {"solid"} | {"convergence"}
    assert tab.locator("#solid").count() == 0
    assert tab.locator("#picture").is_visible()
    assert tab.evaluate("document.getElementById('picture').naturalWidth") > 500
    browser.close()


def test_an_hour_has_room(pages, tmp_path):
    solution = Solution.load(make_result(tmp_path / "hour"))
    table = operate(np.linspace(0.0, 3600.0, 144_001), 700.0, "quadratic")
    rng = np.random.default_rng(1)
    table |= {key: x * rng.uniform(0.9, 1.1, x.size) for key, x in table.items() if key != "time_s"}
    tables = {"phase": ScenarioTables(table, table, solution.loads)}
    written = page.write_report([replace(solution, tables=tables)] * 3, tmp_path / "hour.html")
    assert 5e6 < written.stat().st_size < 8e6
