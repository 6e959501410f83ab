"""A result folder is replaced file by file, and only where a run has marked it."""

import pytest

from hkt_mdo.errors import InputError
from hkt_mdo.results.charts import FIGURES
from hkt_mdo.results.folder import MARKER, check_folder, claim

OWN = [
    *("case.yaml", "summary.json", "iterate.json", "trajectory.csv", "simulation.csv"),
    *("coefficients.csv", "loads.csv", "blade.csv", "convergence.csv", "solution.db", "history.db"),
    *("history_2.db", "history.db-journal", "n2.html", "summary.json.part", ".hkt_result.part"),
    *(f"figures/{name}.{form}" for name in FIGURES for form in ("png", "pdf")),
]
FOREIGN = [
    *("notes.txt", ".git/config", "trajectory_mine.csv", "history_mine.db", "data/case.yaml"),
    *("figures/mine.png", "my case.yaml", "summary.json.bak"),
]


def fill(folder, names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("x")


def files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_a_result_is_deleted_by_name(tmp_path):
    claim(tmp_path)
    fill(tmp_path, [*OWN, *FOREIGN])
    check_folder(tmp_path, force=True)
    claim(tmp_path)
    assert files(tmp_path) - {".hkt_result.part"} == {MARKER, *FOREIGN}


def test_files_by_scenario_are_deleted_where_the_mark_names_them(tmp_path):
    """Also by a run with other scenarios; a name that no run has given is a user's."""
    names = [f"{table}_fast.csv" for table in ("trajectory", "simulation", "loads")]
    names += ["figures/operation_fast.png", "figures/limits_fast.pdf"]
    claim(tmp_path, ("slow", "fast"))
    fill(tmp_path, [*names, "trajectory_mine.csv"])
    claim(tmp_path, ("slow",))
    assert files(tmp_path) == {MARKER, "trajectory_mine.csv"}
    fill(tmp_path, ["loads_slow.csv", "loads_fast.csv"])
    claim(tmp_path)
    assert files(tmp_path) == {MARKER, "trajectory_mine.csv", "loads_fast.csv"}


def test_a_folder_of_figures_alone_goes(tmp_path):
    claim(tmp_path)
    fill(tmp_path, ["figures/blade.png"])
    claim(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [MARKER]


def test_what_a_link_leads_to_stays(tmp_path):
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    fill(elsewhere, ["blade.png"])
    out.mkdir()
    (out / "figures").symlink_to(elsewhere)
    claim(out)
    assert files(elsewhere) == {"blade.png"}


@pytest.mark.parametrize("names", [["case.yaml"], ["case.yaml", "summary.json"], ["notes.txt"]])
def test_a_folder_without_a_mark_is_refused(tmp_path, names):
    fill(tmp_path, names)
    with pytest.raises(InputError, match=r"no earlier result .*\.hkt_result.*delete this one"):
        check_folder(tmp_path, force=True)


def test_a_killed_run_is_replaced(tmp_path):
    """Killed before it wrote its case, and after."""
    fill(tmp_path, ["lock", "lock-journal", ".hkt_result.part"])
    check_folder(tmp_path, force=False)
    (tmp_path / MARKER).touch()
    fill(tmp_path, ["case.yaml.part"])
    check_folder(tmp_path, force=False)
    fill(tmp_path, ["case.yaml"])
    with pytest.raises(InputError, match="give --force"):
        check_folder(tmp_path, force=False)
    check_folder(tmp_path, force=True)
