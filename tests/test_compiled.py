"""Compiled functions work where numba's cache cannot be written."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core import caching

import hkt_mdo
from hkt_mdo.compiled import compiled


def twice(x):
    return 2.0 * x


def test_no_place_for_a_cache(monkeypatch):
    """Neither the installation nor the user's home can be written, as in a container."""
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    assert compiled(error_model="numpy")(twice)(3.0) == 6.0


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EFBIG, errno.EROFS])
def test_a_cache_that_cannot_be_written(monkeypatch, number):
    def full(*_):
        raise OSError(number, "no room")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    assert compiled()(twice)(3.0) == 6.0


def test_the_cache_of_a_function_ends_with_the_files_whose_functions_it_contains(tmp_path):
    """numba alone would go on with the old function of the other file, without a word."""
    package = tmp_path / "hkt_mdo"
    (package / "rotor").mkdir(parents=True)
    for name in ("__init__.py", "rotor/__init__.py"):
        (package / name).touch()
    shutil.copy(Path(hkt_mdo.__file__).parent / "compiled.py", package)
    text = "from hkt_mdo.compiled import compiled\n{}\n@compiled()\ndef {}(x):\n    return {}\n"
    inner, outer = package / "rotor" / "inner.py", package / "rotor" / "outer.py"
    outer.write_text(text.format("from hkt_mdo.rotor.inner import inner", "outer", "inner(x)"))
    command = [sys.executable, "-c", "from hkt_mdo.rotor.outer import outer; print(outer(3.0))"]
    for factor in ("2.0", "5.0"):
        inner.write_text(text.format("", "inner", f"{factor} * x"))
        environment = os.environ | {"PYTHONPATH": str(tmp_path)}
        run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert float(run.stdout) == 3.0 * float(factor), run.stderr
