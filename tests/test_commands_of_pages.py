"""The commands of README and docs: those of code blocks are run, or a reason says why they are not.

Commands within a sentence, and commands with a place to fill in such as RESULT, are checked for the
existence of command and options.
"""

import json
import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command

from hkt_mdo.cli import app, main

ROOT = Path(__file__).parent.parent
GENERATED = {"commands.md", "api.md"}  # what docs/conf.py writes
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name not in GENERATED),
    *sorted((ROOT / "docs" / "tutorials").glob("*.ipynb")),
]
PROGRAMS = r"(?:hkt|make|python3?|pip|conda|openmdao|aerodyn_driver|\.venv/bin/\w+) "

NOT_RUN = {
    r"make (run|test|check|docs|fuzz|lint|newest)": "the commands below, or longer tests",
    r"python3 -m venv|\.venv/bin/": "what `make` does; tests/test_wheel.py installs and runs",
    r"python studies/not_modelled.py": "needs results of the study of limits, which takes an hour",
    r"hkt polar": "needs tens of MB; tests/cli/test_hkt_polar.py has an invented network",
    r"hkt run cases/examples/rm1_turbulent.yaml": "half a minute; studies/example_cases.py runs it",
    r"hkt \w+ (cases/examples|results)/river_year": "a minute; the tests of years run shorter ones",
    r"hkt resource (usgs_discharge.csv|s08010.json)": "tests/dynamics/test_long_record.py does",
    r"hkt report results/mine results/other": "tests/report/test_page.py compares results",
    r"python studies/example_cases.py": "minutes; it writes the tables of docs/studies/examples.md",
    r"hkt (sweep|plot results/torque)": "tests/run/test_sweep.py, tests/report/test_sweep_page.py",
    r"aerodyn_driver": "is not on PyPI; tests/exports/test_openfast.py runs it if it is installed",
    r"hkt simulate results/mine .*(seed: 3|--strict)": "tests/studies/test_other_flows.py does",
}
"""Commands of code blocks that no test of this file runs, and why."""

SHORTER = ["--set", "phase={duration: 20, segments: 20}", "--no-figures", "--no-records"]
ROLLED = "inflow={profile: turbulence, mean: 1.4, seed: 3}"  # an hour of turbulence in a small test


def test_every_command_is_in_a_fenced_block():
    """Indented blocks are for equations; the tests below do not look for commands there."""
    for page in PAGES:
        text = re.sub(r"(?ms)^```.*?^```", "", text_of(page))
        assert not re.findall(rf"(?m)^ {{4,}}{PROGRAMS}.*", text), page


def text_of(page):
    """Return the text of a page; of a notebook, that of its cells of text."""
    text = page.read_text(encoding="utf-8")
    if page.suffix != ".ipynb":
        return text
    cells = json.loads(text)["cells"]
    return "\n\n".join("".join(x["source"]) for x in cells if x["cell_type"] == "markdown")


def commands_of_blocks(page):
    """Return the commands of a page's code blocks, without their comments."""
    fences = re.findall(r"^```([^\n]*)\n(.*?)^```$", text_of(page), re.DOTALL | re.MULTILINE)
    blocks = "\n".join(block for kind, block in fences if kind in ("", "sh", "console"))
    lines = re.sub(r" *\\\n *", " ", blocks).splitlines()
    return [line.partition("  #")[0].rstrip() for line in lines if re.match(PROGRAMS, line)]


def commands_within_sentences(page):
    """Return the commands of a page's sentences."""
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.DOTALL | re.MULTILINE)
    return [code for code in re.findall(r"`([^`\n]+)`", text) if re.match(PROGRAMS, f"{code} ")]


def reason(command):
    """Return why a command of a code block is not run, or None."""
    return next((why for start, why in NOT_RUN.items() if re.match(start, command)), None)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_exist_with_their_options(page):
    commands = get_command(app).commands
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for line in [*commands_of_blocks(page), *commands_within_sentences(page)]:
        line = re.sub("^hkt --extend [^ ]+", "hkt", line)
        words = line.split()
        if words[0] == "hkt" and len(words) > 1 and not words[1].startswith("-"):
            options = {name for option in commands[words[1]].params for name in option.opts}
            options |= {"--help"}
            assert set(re.findall(r"(?<= )--[a-z0-9-]+", line)) <= options, line
        elif words[0] == "make" and len(words) > 1:
            assert words[1] in targets, line
        elif words[0] == "python" and words[1:] and words[1].startswith(("scripts/", "studies/")):
            assert (ROOT / words[1]).is_file(), line


def test_every_reason_is_needed():
    commands = [command for page in PAGES for command in commands_of_blocks(page)]
    assert len(commands) > 30
    for start in NOT_RUN:
        assert any(re.match(start, command) for command in commands), start


def run(command):
    """Run one command of hkt in the present folder, a run for less than a minute."""
    command, _, output = command.partition(" > ")
    words = shlex.split(command)
    assert words.pop(0) == "hkt", command
    if "run" in words:
        words = [word for word in words if word != ROLLED]
        words = words[:-1] if words[-1] == "--set" else words
        words += SHORTER if "creek.yaml" not in command else ["--no-records"]
    if "check" in words and "--no-figures" not in words:
        words.append("--no-figures")
    assert main(words) == 0, command
    return output


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if set(map(reason, commands_of_blocks(page))) & {None}],
    ids=lambda page: page.name,
)
def test_commands_of_code_blocks_work(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    commands = commands_of_blocks(page)
    if "results/mine" in " ".join(commands) and "hkt new mine" not in " ".join(commands):
        commands = ["hkt new mine", "hkt run mine.yaml", *commands]
    if "offset.py" in " ".join(commands):  # the page's own law and a case of it
        (law,) = re.findall(r"^```python\n(.*?)^```$", text_of(page), re.DOTALL | re.MULTILINE)
        Path("offset.py").write_text(law, encoding="utf-8")
        case = "inflow: sine\ncontrol: {law: offset_quadratic, torque_limit: 700}\n"
        Path("case.yaml").write_text(case, encoding="utf-8")
    for command in commands:
        if reason(command) is None:
            output = run(command)
            printed = capsys.readouterr().out
            assert not output or json.loads(printed)
