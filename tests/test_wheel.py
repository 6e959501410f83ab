"""An installed package, without the checkout beside it, does all that `hkt` offers."""

import json
import os
import shutil
import site
import subprocess
import sys
import tarfile
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FILES = [path for path in (ROOT / "cases").rglob("*") if path.is_file()]
CASES = sorted(path.relative_to(ROOT) for path in FILES if path.suffix != ".pyc")

pytestmark = pytest.mark.slow
of_the_wheel = pytest.mark.parametrize("installed", ["*.whl"], ids=["wheel"], indirect=True)


PAGES = "CHANGELOG.md CITATION.cff CONTRIBUTING.md LICENSE MANIFEST.in Makefile README.md"
SAMPLE = ("rotor/test_airfoil.py", "files/test_polar_files.py", "case/test_quantity.py")
"""Tests that are run against what is installed."""
CLEAN = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Return the folder with the source distribution, and the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("built")
    source = folder / "source"
    folders = "hkt_mdo", "cases", "docs", "requirements", "scripts", "studies", "tests"
    for name in folders:  # a copy: building leaves files
        ignored = shutil.ignore_patterns("__pycache__", "images")
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    for name in ("pyproject.toml", "environment.yml", *PAGES.split()):
        shutil.copy(ROOT / name, source)
    command = [sys.executable, "-m", "build", "--outdir", folder / "dist", source]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return folder / "dist"


@pytest.fixture(scope="module", params=["*.whl", "*.tar.gz"], ids=["wheel", "source"])
def installed(request, built, tmp_path_factory):
    """The programs of a fresh environment that has the package and sees this one's dependencies."""
    (file,) = built.glob(request.param)
    environment = tmp_path_factory.mktemp("environment")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    venv.create(environment, symlinks=os.name != "nt")
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    python = programs / "python"
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    library = Path(subprocess.check_output([python, "-c", code], text=True).strip())
    # after the package's own folder on the search path
    (library / "dependencies.pth").write_text("\n".join(site.getsitepackages()), encoding="utf-8")
    subprocess.run([*pip, "--python", python, "install", "--no-deps", file], check=True)
    return programs, library


@pytest.fixture
def hkt(installed, tmp_path):
    """Return a function that runs the installed command in an empty folder."""
    programs, _ = installed

    def run(*arguments):
        how = {"cwd": tmp_path, "env": CLEAN, "capture_output": True, "text": True}
        done = subprocess.run([programs / "hkt", *arguments], check=False, **how)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


def test_it_has_its_types_and_every_case_with_its_files(installed):
    _, library = installed
    assert (library / "hkt_mdo" / "py.typed").is_file()  # type checkers read its annotations
    for path in CASES:
        assert (library / "hkt_mdo" / path).read_bytes() == (ROOT / path).read_bytes()


def test_the_tests_of_the_source_pass_with_what_is_installed(installed, built, tmp_path):
    programs, library = installed
    (archive,) = built.glob("*.tar.gz")
    safe = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # from Python 3.11.4
    shutil.unpack_archive(archive, tmp_path, **safe)
    (source,) = tmp_path.iterdir()
    shutil.rmtree(source / "hkt_mdo")  # what is tested is the installed package
    code = "import hkt_mdo; print(hkt_mdo.__file__, hkt_mdo.__version__)"
    command = [programs / "python", "-c", code]
    output = subprocess.check_output(command, cwd=source, env=CLEAN, text=True)
    version = archive.name.removeprefix("hkt_mdo-").removesuffix(".tar.gz")
    assert output.split() == [str(library / "hkt_mdo" / "__init__.py"), version]
    tests = [f"tests/{name}" for name in SAMPLE]
    command = [programs / "python", "-m", "pytest", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(command, cwd=source, env=CLEAN, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout.decode()


@of_the_wheel
def test_new_case_is_checked(hkt, tmp_path):
    hkt("new", "mine", "--kind", "river")
    assert {path.name for path in tmp_path.iterdir()} == {"mine.yaml", "mine_record.csv"}
    assert "mine can be run." in hkt("check", "mine.yaml")


@of_the_wheel
def test_shipped_case_runs_by_its_bare_name(hkt, tmp_path):
    short = "--set", "phase={duration: 20, segments: 20}"
    hkt("run", "sine_oloc", *short, "--quiet", "--no-figures")
    summary = json.loads((tmp_path / "results" / "sine_oloc" / "summary.json").read_text())
    assert summary["success"]
    assert hkt("report", "results/sine_oloc", "--out", "report.html") == "report.html\n"
    assert hkt("schema", "--markdown").startswith("# The case file")
