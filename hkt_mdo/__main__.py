"""`python -m hkt_mdo` is `hkt`."""

import sys

from hkt_mdo.cli import main

sys.exit(main())
