"""Data of the pages of results in docs/data, with which `make test` compares the pages.

python studies/page_data.py PAGE ...    # record the numbers of pages that were just written
python studies/page_data.py --write PAGE ...    # write pages in RENDERED from their data
python studies/page_data.py    # print when and by which source the numbers of all pages were made

The data of a page name its commands, and the commit and the versions that computed its numbers.
Pages in RENDERED are written from results in their data, in SI units, by the function `from_data`
of a script: the whole page, or the part of it that the script writes. The data of pages with
sentences that no script writes also have the cells of the tables and the numbers of the sentences,
by heading. A page that is edited by hand no longer agrees with its data; record it again only after
the command that computes its numbers.
"""

import json
import re
import subprocess
import sys
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

from hkt_mdo.results.summary import Summary
from hkt_mdo.run.engine import versions

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"
FOLDERS = ("", "studies", "dev")  # of docs, in which pages of results are
RENDERED = {  # pages that are written from the results in their data, and by which script
    "ablation": "ablation",
    "annual_energy": "annual_energy",
    "bem": "compare_ccblade",
    "cost": "cost_of_energy",
    "examples": "example_cases",
    "hour": "turbulent_hour",
    "laws": "laws_study",
    "limits": "limits_study",
    "reynolds": "reynolds_study",
    "robust": "robust_study",
    "sensitivity": "sensitivity",
    "stations": "station_study",
    "tracking": "tracking_table",
}
SENTENCE = 60  # characters from which a cell of a table is a sentence
LINE = 100  # characters of a list that is written in one line
NUMBER = r"(?<![\w.])[-+−]?\d+(?:[.\u202f]\d+)*(?:e[-+]?\d+| ?·10[⁻⁰¹²³⁴-⁹]+)?(?: %)?"
RESULT = re.compile(r"[.e%·\u202f]")  # of a sentence's numbers, those that are no mere counts
APART = re.compile(r"`[^`\n]*`|<!--.*?-->|\]\([^)]*\)", re.DOTALL)  # what holds no results
COMMAND = re.compile(r"`((?:python )?(?:scripts/|studies/|-m )[^`\n]*|make \w+[^`\n]*)`")


def numbers_of(page):
    """Return the numbers of the sentences, and the rows of the tables, by the page's headings."""
    sections = {}
    page = re.sub(r"(?ms)^```.*?^```|^\$\$$.*?^\$\$$|^ {4,}[^|\n]*$", "", page)
    for part in re.split(r"(?m)^(?=#+ )", page):
        title, _, body = part.partition("\n")
        lines = body.splitlines()
        rows = [
            [cell_of(cell.strip()) for cell in line.strip().strip("|").split(" | ")]
            for line in lines
            if line.startswith("|") and RESULT.search(" ".join(re.findall(NUMBER, bare(line))))
        ]
        text = bare("\n".join(line for line in lines if not line.startswith("|")))
        numbers = [each for each in re.findall(NUMBER, text) if RESULT.search(each)]
        section = {"sentences": numbers, "rows": rows}
        if numbers or rows:
            sections[title.lstrip("# ")] = {key: each for key, each in section.items() if each}
    return sections


def bare(text):
    """Return a text without code, comments and targets of links."""
    return APART.sub("", text)


def cell_of(text):
    """Return what is kept of a cell of a table: of a sentence, its numbers alone."""
    return text if len(text) <= SENTENCE else ", ".join(re.findall(NUMBER, bare(text)))


def record(page, **results):
    """Write the data of a page: its numbers, its commands, and what made new numbers.

    `results` are those of which the page was written; without them, those recorded earlier stay.
    """
    text = text_of(page)
    earlier = read(page) if (DATA / f"{page}.json").exists() else {}
    numbers = numbers_of(text)
    same = [*earlier.get("numbers", {}).values()] == [*numbers.values()]  # maybe under new headings
    data = {"commands": earlier.get("commands") or sorted(set(COMMAND.findall(text)))}
    written = {name: earlier[name] for name in earlier if name not in ("numbers", *STAMP, *data)}
    old = not results and (same or written)
    data |= {name: earlier[name] for name in STAMP} if old else stamp()
    write(page, {**data, **written, **results, "numbers": numbers})


STAMP = ("commit", "date", "computed_by")


def stamp():
    """Return what computes results now: commit, date, and versions with a digest of the source."""
    today = datetime.now(UTC).date().isoformat()
    return dict(zip(STAMP, (head(), today, versions()), strict=True))


def page_from(name, render, **results):
    """Write a page from results, by `render`, and its data."""
    path_of(name).write_text(render(results), encoding="utf-8")
    record(name, **results)


def path_of(name):
    """Return the path of a page of the checkout: in docs, or in a folder of FOLDERS there."""
    paths = [ROOT / "docs" / folder / f"{name}.md" for folder in FOLDERS]
    return next((path for path in paths if path.is_file()), paths[0])


def text_of(name):
    """Return the text of a page of the checkout."""
    return path_of(name).read_text(encoding="utf-8")


def between(page, begin, end, text):
    """Return a page with another text between two lines of it."""
    first, rest = page.split(begin)
    return first + begin + text + end + rest.partition(end)[2]


def head():
    """Return the commit of the checkout."""
    command = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def write(page, data):
    """Write the data of a page, short lists in one line each."""
    DATA.mkdir(exist_ok=True)
    (DATA / f"{page}.json").write_text(f"{as_text(data)}\n", encoding="utf-8")


def as_text(value, indent=""):
    """Return JSON, in which what fits is on one line."""
    line = json.dumps(value, ensure_ascii=False)
    if len(indent) + len(line) <= LINE or not isinstance(value, dict | list):
        return line
    inner = indent + " "
    if isinstance(value, dict):
        pairs = (f"{json.dumps(key)}: {as_text(each, inner)}" for key, each in value.items())
        return "{\n" + ",\n".join(f"{inner}{pair}" for pair in pairs) + f"\n{indent}}}"
    return "[\n" + ",\n".join(f"{inner}{as_text(each, inner)}" for each in value) + f"\n{indent}]"


def read(page):
    """Return the data of a page."""
    return json.loads((DATA / f"{page}.json").read_text(encoding="utf-8"))


# Results as data ----------------------------------------------------------------------------------


def of_result(solution, names):
    """Return outcome, message, notes and some entries of a result's summary; None for no result."""
    if solution is None:
        return None
    summary = solution.summary.model_dump(mode="json", include=set(names), exclude_none=True)
    message, notes = str(solution.message), [*solution.notes]
    return {"success": solution.success, "message": message, "notes": notes, "summary": summary}


def result_of(data):
    """Return what `of_result` kept, with the names of a `Solution`."""
    if data is None:
        return None
    summary = Summary.model_validate(data["summary"] | {"success": data["success"]})
    return SimpleNamespace(**data | {"summary": summary})


def main(words):
    """Record pages, write pages from their data, or print the age of all data."""
    for name in (Path(word).stem for word in words if word != "--write"):
        if "--write" not in words:
            record(name)
            continue
        from_data = import_module(RENDERED[name]).from_data
        path_of(name).write_text(from_data(read(name)), encoding="utf-8")
    for path in () if words else sorted(DATA.glob("*.json")):
        data = read(path.stem)
        same = data["computed_by"]["hkt_mdo"] == versions()["hkt_mdo"]
        made = "by the present source" if same else f"by the source of commit {data['commit']}"
        print(f"{path.stem:15} {data['date']}  {made}: {data['commands'][0]}")


if __name__ == "__main__":
    main(sys.argv[1:])
