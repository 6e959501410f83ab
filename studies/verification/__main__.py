"""The verification study or parts of it, and its page: `make verify PART=limits COUNT=20`.

The page is docs/studies/verification.md, and report.html in the study's folder.
"""

import argparse
import time
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import write_files
from studies.study_common import text_page
from studies.verification.study import PARTS, report, run_part

ROOT = Path(__file__).parents[2]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run parts of the study, print their figures and write the page."""
    parser = argparse.ArgumentParser(prog="python -m studies.verification", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; or all")
    parser.add_argument("--count", type=int, help="runs or examples; by default the part's own")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, help="parallel processes; by default one a core")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "verification")
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "studies" / "verification.md")
    args = parser.parse_args(arguments)
    began, number = time.perf_counter(), count(1)

    def done(folder: Path, word: str) -> None:
        index = next(number)
        if word != "reused":
            print(f"[{time.perf_counter() - began:7.1f} s] {index}: {folder}: {word}", flush=True)

    try:
        for part in args.parts or PARTS:
            print(run_part(part, args.out, args.count, args.seed, args.jobs, done), flush=True)
            page = args.page.read_text(encoding="utf-8") if args.page.exists() else ""
            text = report(args.out, page)
            args.page.write_text(text, encoding="utf-8")
            write_files({args.out / "report.html": text_page("Verification", text, args.out)})
    except InputError as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
