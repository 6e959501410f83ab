"""Designs of the paper's cases, of runs that are made once."""

import pytest

from hkt_mdo.studies.uncertainty import Design


@pytest.fixture(scope="session")
def quadratic(solve):
    return Design.of(solve("sine_limited_quadratic", "driver.optimizer=IPOPT"))


@pytest.fixture(scope="session")
def open_loop(solve):
    return Design.of(solve("sine_limited_oloc", "driver.optimizer=IPOPT"))
