"""Run one case: the arguments of `hkt run`, such as `cases/sine_quadratic.yaml --out results/a`."""

import sys

from hkt_mdo.cli import main

sys.exit(main(["run", *sys.argv[1:]]))
