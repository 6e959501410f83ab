"""Compiled functions work where numba's cache cannot be written."""

import errno

import pytest
from numba.core import caching

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
