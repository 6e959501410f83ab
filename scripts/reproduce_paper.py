"""Reproduce the paper's tables and figures: the same as `hkt paper`, with the same arguments."""

import sys

from hkt_mdo.cli import main

if __name__ == "__main__":
    sys.exit(main(["paper", *sys.argv[1:]]))
