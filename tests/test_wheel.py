"""An installed package, without the checkout beside it, does all that `hkt` offers."""

import json
import os
import shutil
import site
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
CASES = sorted(path.relative_to(ROOT) for path in (ROOT / "cases").rglob("*") if path.is_file())

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The program of a fresh environment that has the wheel and sees this one's dependencies."""
    place = tmp_path_factory.mktemp("wheel")
    source, environment = place / "source", place / "environment"
    for name in ("hkt_mdo", "cases"):  # a copy: building leaves files behind
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "-w", place, source], check=True)
    (wheel,) = place.glob("*.whl")
    venv.create(environment, symlinks=os.name != "nt")
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    python = programs / "python"
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    library = Path(subprocess.check_output([python, "-c", code], text=True).strip())
    # after the wheel's own folder on the search path
    (library / "dependencies.pth").write_text("\n".join(site.getsitepackages()), encoding="utf-8")
    subprocess.run([*pip, "--python", python, "install", "--no-deps", wheel], check=True)
    return programs, library


@pytest.fixture
def hkt(installed, tmp_path):
    """Return a function that runs the installed command in an empty folder."""
    programs, _ = installed
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}

    def run(*arguments):
        done = subprocess.run(
            [programs / "hkt", *map(str, arguments)],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


def test_it_has_every_case_and_its_files(installed):
    _, library = installed
    for path in CASES:
        assert (library / "hkt_mdo" / path).read_bytes() == (ROOT / path).read_bytes()


def test_new_case_is_checked(hkt, tmp_path):
    hkt("new", "mine", "--kind", "river")
    assert {path.name for path in tmp_path.iterdir()} == {"mine.yaml", "mine_record.csv"}
    assert "mine can be run." in hkt("check", "mine.yaml")


def test_shipped_case_runs_by_its_bare_name(hkt, tmp_path):
    hkt("run", "sine_oloc", "--set", "phase={duration: 20, segments: 20}", "--quiet")
    summary = json.loads((tmp_path / "results" / "sine_oloc" / "summary.json").read_text())
    assert summary["success"]
    assert hkt("report", "results/sine_oloc", "--out", "report.html") == "report.html\n"
    assert "own_files" in hkt("check", "own_files")


def test_page_and_paper(hkt):
    assert hkt("schema", "--markdown").startswith("# The case file")
    assert "--cases" in hkt("paper", "--help")
