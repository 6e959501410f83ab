"""The documentation site is built without a warning, and its notebooks run."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
NOTEBOOKS = sorted((DOCS / "tutorials").glob("*.ipynb"))


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_rows_of_tables_are_whole(page):
    """A row that a reformatting has wrapped is no longer a row."""
    text = re.sub(r"(?ms)^```.*?^```", "", page.read_text(encoding="utf-8"))
    for table in re.findall(r"(?m)(?:^ *\|.*\n)+.*", text):
        *rows, after = table.split("\n")
        assert not after.strip() or after.startswith("<!--"), after
        cells = {len(re.findall(r"(?<!\\)\|", re.sub(r"`[^`]*`", "", row))) for row in rows if row}
        assert len(cells) == 1, rows[0]


@pytest.mark.slow
def test_site_is_built_and_shows_what_the_notebooks_print(tmp_path):
    """A cell that fails ends the build; so does a warning, such as of a link that leads nowhere."""
    words = "-m sphinx -W --keep-going -b html".split()
    command = [sys.executable, *words, DOCS, tmp_path / "site"]
    quiet = os.environ | {"PYTHONWARNINGS": "ignore"}
    done = subprocess.run(command, env=quiet, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]

    def page(name):
        return (tmp_path / "site" / f"{name}.html").read_text(encoding="utf-8")

    for path in NOTEBOOKS:
        text = page(f"tutorials/{path.stem}")
        assert "converged and verified" in text
        assert not re.search(r"&lt;Figure size|<iframe", text)
        plots = path.read_text(encoding="utf-8").count(".plot(")
        assert text.count('<img src="data:image/png;base64,') == plots
    commands = page("reference/commands")
    assert "--strict" in commands
    assert "–strict" not in commands
    assert page("dev/equations").count('<div class="math') > 20
    for path in DOCS.glob("*.md"):
        assert not re.search(r"<a [^>]*>(<span[^>]*>)*[\w/]+\.md<", page(path.stem)), path
    limits = page("tutorials/limits")
    price, gain = re.search(r"gain of one per cent: (\d+) J; found.*?: (\d+) J", limits).groups()
    assert float(gain) == pytest.approx(float(price), rel=0.1)
