"""The report in a real browser: Debian's Chromium draws every panel, and asks no network."""

import io
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from playwright.sync_api import Browser, sync_playwright
from plotly.offline import get_plotlyjs

from hkt_mdo.pages import page
from hkt_mdo.results.solution import Solution
from tests.conftest import make_result
from tests.exports.made import made
from tests.report.test_page import TWO

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium")
WEBGL = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
WITHOUT = ["--no-sandbox", "--disable-3d-apis"]
CUT_OUT = TWO.replace("torque_limit: 700", "torque_limit: 700, cut_out: 1.9")
PROJECT = (Path(__file__).parents[2] / "pyproject.toml").read_text()
OLDEST = re.search(r"plotly>=([0-9.]+)", PROJECT)[1]
ALL = {"solid", "shape", "sections", "flow", "time", "coefficients", "limits", "span"}


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, Path]:
    """Reports of one result, of two, and of one with two scenarios."""
    base = tmp_path_factory.mktemp("browser")
    one = Solution.load(make_result(base / "a"))
    other = Solution.load(make_result(base / "b", "linear", None))
    two = made(base / "c", TWO, [7.5])
    cut_out = made(base / "d", CUT_OUT, [7.5])
    chosen = {"one": [one], "both": [one, other], "two": [two], "cut_out": [cut_out]}
    return {name: page.write_report(x, base / f"{name}.html") for name, x in chosen.items()}


@pytest.fixture(scope="module")
def start() -> Iterator:
    """What starts Chromium with some options; the browsers end with the module."""
    if CHROMIUM is None:
        pytest.fail("Chromium is missing; install it with: apt-get install -y chromium")
    with sync_playwright() as playwright:
        yield partial(playwright.chromium.launch, executable_path=CHROMIUM)


@pytest.fixture(scope="module")
def browser(start) -> Browser:
    return start(args=WEBGL)


def opened(browser, path, width=1400, scheme="light", wrong=()):
    """Return a page when it has drawn all; `wrong`: what its only errors begin with."""
    tab = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    events = []
    tab.on("console", lambda x: events.append(x.text) if x.type == "error" else None)
    tab.on("pageerror", lambda error: events.append(str(error)))
    tab.on("request", lambda x: events.append(x.url) if not x.url.startswith("data:") else None)
    tab.goto(path.as_uri(), timeout=60_000)
    tab.wait_for_selector("body[data-ready]", timeout=60_000)
    assert events.pop(0) == path.as_uri()
    assert len(events) == len(wrong)
    assert all(map(str.startswith, events, wrong))
    return tab


def drawn(tab):
    """Return the charts whose own drawing is on the page, by their places in it."""
    charts = tab.locator(".chart:has(.trace), .chart:has(.point), #solid:has(canvas)").all()
    return {each.get_attribute("id") for each in charts}


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


@pytest.mark.parametrize("wanted", ["", f"=={OLDEST}", f">={OLDEST}"], ids=["set up", "old", "new"])
def test_a_cut_out_is_drawn_by_every_plotly(pages, browser, tmp_path, wanted):
    path = pages["cut_out"]
    if wanted:
        how = [sys.executable, "-m", "pip"] if find_spec("pip") else ["uv", "pip"]
        command = [*how, "install", "-q", "--no-deps", "--target", str(tmp_path), f"plotly{wanted}"]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip(f"plotly{wanted} cannot be installed: no network, or no pip")
        script = (tmp_path / "plotly/package_data/plotly.min.js").read_text("utf-8")
        text = path.read_text("utf-8").replace(get_plotlyjs(), script)
        assert script in text
        path = tmp_path / "report.html"
        path.write_text(text, "utf-8")
    tab = opened(browser, path)
    tab.select_option("#view", "fast")
    tab.wait_for_selector("#limits[data-drawn=fast]")
    assert drawn(tab) == ALL - {"span"}
    assert tab.get_by_text("cut-out 1.9 m/s").count()
    tab.close()


def test_a_chart_that_fails_is_the_only_one(pages, browser, tmp_path):
    """A layout of which plotly.js makes an error costs its own chart, and is told in its place."""
    path = tmp_path / "report.html"
    text = pages["one"].read_text("utf-8")
    path.write_text(text.replace('"shape": {"data": [', '"shape": {"data": [null, '), "utf-8")
    tab = opened(browser, path, wrong=["TypeError"])
    assert drawn(tab) == ALL - {"shape"} | {"convergence"}
    assert tab.locator("#shape").inner_text().startswith("This chart cannot be drawn")
    tab.close()


def test_a_picture_replaces_the_solid_without_webgl(pages, start):
    browser = start(args=WITHOUT)
    tab = opened(browser, pages["one"])
    assert drawn(tab) == ALL - {"solid"} | {"convergence"}
    assert tab.locator("#solid").count() == 0
    assert tab.locator("#picture").is_visible()
    assert tab.evaluate("document.getElementById('picture').naturalWidth") > 500
    browser.close()
