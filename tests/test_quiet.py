"""What libraries say to programmers does not reach a user; what a message advises works."""

import os
import subprocess
import sys
from pathlib import Path

from hkt_mdo.errors import install

ROOT = Path(__file__).parent.parent


def test_a_program_of_the_user_meets_no_warning_of_a_library():
    code = "from hkt_mdo import build_problem, load_case, run_case, TurbineGroup"
    usual = {key: value for key, value in os.environ.items() if key != "PYTHONWARNINGS"}
    about = {"env": usual | {"PYTHONPATH": str(ROOT)}, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, "-c", code], check=True, **about)
    assert done.stderr == ""


def test_the_line_that_installs_an_extra_is_of_the_checkout(monkeypatch, tmp_path):
    assert install("cad") == f"pip install -e '{ROOT}[cad]'"
    monkeypatch.setattr("hkt_mdo.errors.__file__", str(tmp_path / "hkt_mdo" / "errors.py"))
    assert install("cad") == "pip install 'hkt_mdo[cad]'"
