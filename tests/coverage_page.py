"""Write docs/coverage.md from coverage's JSON report; `make coverage`."""

import json
import sys
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "coverage.md"
ENOUGH = 90.0  # %

KERNELS = "kernels compiled by numba run as machine code, which coverage does not see"
FOREIGN = "needs a package that the tests do not install: NeuralFoil or pyoptsparse"
REASONS = {
    "compiled": "the choice between numba with and without its cache is made once, at import",
    "rotor/bem": KERNELS,
    "rotor/best_section": KERNELS,
    "rotor/strength": KERNELS,
    "rotor/neuralfoil": FOREIGN,
    "rotor/ccblade": FOREIGN,
    "solve/drivers": FOREIGN,
    "solve/totals": KERNELS,
    "studies/uncertainty": KERNELS,
    "__main__": "runs in processes of its own",
}
"""Why a module may stay below; a module without a reason is one that lacks tests."""


def page(report: dict, command: str) -> str:
    """Return the page of a report of `coverage json`."""
    rows, reasons = [], []
    for file, found in sorted(report["files"].items()):
        name, total = file.removeprefix("hkt_mdo/").removesuffix(".py"), found["summary"]
        share = total["percent_covered"]
        missed = f"{total['missing_lines']} | {total['missing_branches']}"
        rows.append(f"| `{name}` | {share:.0f} | {missed} |")
        if share < ENOUGH:
            reasons.append(f"- `{name}`, {share:.0f} %: {REASONS.get(name, '**lacks tests**')}")
    lines = [
        "# Coverage\n",
        f"Written by `make coverage` from `{command}`: statements and branches of each module that "
        f"the tests run, {report['totals']['percent_covered']:.0f} % of all. "
        "Processes that the tests start are counted, too.\n",
        f"## Below {ENOUGH:.0f} %\n",
        *(reasons or ["None."]),
        "\n## All modules\n",
        "| module | covered (%) | statements missed | branches missed |",
        "|---|---|---|---|",
        *rows,
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    source, command = sys.argv[1:]
    report = json.loads(Path(source).read_text(encoding="utf-8"))
    PAGE.write_text(page(report, command), encoding="utf-8")
