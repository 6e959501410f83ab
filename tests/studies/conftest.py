"""Designs of the paper's cases, of runs that are made once."""

import pytest


@pytest.fixture(scope="session")
def quadratic(solve):
    return solve("sine_limited_quadratic", "driver.optimizer=IPOPT").design()


@pytest.fixture(scope="session")
def open_loop(solve):
    return solve("sine_limited_oloc", "driver.optimizer=IPOPT").design()
