"""How Sphinx builds the documentation site; docs/dev/site.md says why it is built like this."""

import os
import re
import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.highlighting import lexers
from typer.cli import get_docs_for_click
from typer.main import get_command

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # small matrices: more threads make the notebooks slower
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])

import hkt_mdo

project = "hkt_mdo"
copyright = "the authors of hkt_mdo, Apache License 2.0"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "numpydoc"]
exclude_patterns = ["_build", "**.ipynb_checkpoints"]
html_theme = "furo"
html_title = "hkt_mdo"

myst_heading_anchors = 4  # the anchors of headings that GitHub makes, too
myst_enable_extensions = ["amsmath", "colon_fence", "dollarmath"]
myst_dmath_allow_digits = False  # 5$ and $5 are prices
smartquotes = False  # they would make – of the -- of an option
highlight_language = "none"  # blocks without a language are output
lexers["csv"] = TextLexer()  # Pygments has none

nb_execution_mode = "force"  # every build runs the notebooks, which are committed without outputs
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_execution_in_temp = True  # results of the notebooks stay out of the checkout

autodoc_typehints = "none"  # the sections of the docstrings name the types
numpydoc_show_class_members = False

PUBLIC = {
    "Cases, runs and results": (
        "Case",
        "load_case",
        "check",
        "build_problem",
        "run_case",
        "Solution",
    ),
    "From many cases, or from a result": (
        "sweep",
        "run.batch.run_batch",
        "simulate",
        "studies.other_flows.Run",
        "dynamics.simulation.Simulation",
        "export",
        "report",
    ),
    "Groups for models of your own": ("RotorGroup", "TurbineGroup"),
    "Base classes of extensions": (
        *("FeedbackLaw", "Inflow", "Limit", "Objective", "Aggregate", "Quantity"),
    ),
    "Errors": ("InputError",),
}
"""What the page of the Python interface documents; all of `hkt_mdo.__all__` is in it."""

COLLAPSED = ("Case", "Quantity")
"""Classes whose members are on another page, or of no use to a reader."""


def commands_page():
    """Return the help of every command as a page; what all of them repeat stands once."""
    from hkt_mdo.cli import app

    command = get_command(app)
    context = command.context_class(command, info_name="hkt")
    page = get_docs_for_click(obj=command, ctx=context, title="Commands")
    return re.sub(r"(?m)^\* `-h, --help`.*\n", "", page)


def api_page():
    """Return the page of the Python interface: directives that the docstrings fill."""
    missing = set(hkt_mdo.__all__) - {name for names in PUBLIC.values() for name in names}
    if missing:
        raise ValueError(f"docs/conf.py: PUBLIC: has no {', '.join(sorted(missing))}")
    page = (
        "# Python interface\n\nFrom the docstrings. Import a name without a module, such as `Case`,"
    )
    page += " from `hkt_mdo`.\n"
    for title, names in PUBLIC.items():
        page += f"\n## {title}\n\n```{{eval-rst}}\n"
        for name in names:
            kind = "autoclass" if name.rpartition(".")[2][0].isupper() else "autofunction"
            page += f".. {kind}:: hkt_mdo.{name}\n"
            if kind == "autoclass" and name not in COLLAPSED:
                page += "   :members:\n"
            page += "\n"
        page += "```\n"
    return page


def fit_to_site(app, docname, source):
    """Change what a page needs on GitHub and a site does not have, or the other way round."""
    page = DOCS / f"{docname}.md"

    def shown(folder):
        return f"`{folder.replace('../', '')}`"

    text = source[0].replace("../hkt_mdo/files/data/README.md", "reference/data.md")
    # of a folder a site has nothing to show; a file is offered for download
    text = re.sub(
        r"\[([^]]+)\]\((\.\./[^)#]+)\)",
        lambda link: shown(link[2]) if (page.parent / link[2]).is_dir() else link[0],
        text,
    )
    # a file's name as the text of a link is its name on GitHub, and its title here
    text = re.sub(r"\[[\w/.]+\.(?:md|ipynb)\](?=\((?!http)[^)]+\.(?:md|ipynb)\b)", "[]", text)
    if docname == "index":  # a pattern of pages of which there is none would be a warning
        text = re.sub(
            r"(?m)^(\w+\*)\n", lambda x: x[0] if list(DOCS.glob(f"{x[1]}.md")) else "", text
        )
    source[0] = text


def without_signature(app, what, name, obj, options, signature, result):
    """Leave out the signature of a class whose members are not shown: it would be all of them."""
    return ("", result) if name.rpartition(".")[2] in COLLAPSED else None


def leave_out_of_search(app, doctree):
    """Leave the text of studies and of pages for developers out of the search, not their titles."""
    if app.env.docname.startswith(("studies/", "dev/")):
        app.env.metadata[app.env.docname]["nosearch"] = True


def setup(app):
    """Write the generated pages before Sphinx looks for pages."""
    folder = DOCS / "reference"
    folder.mkdir(exist_ok=True)
    (folder / "commands.md").write_text(commands_page(), encoding="utf-8")
    (folder / "api.md").write_text(api_page(), encoding="utf-8")
    app.connect("source-read", fit_to_site)
    app.connect("doctree-read", leave_out_of_search)
    app.connect("autodoc-process-signature", without_signature)
