"""Pages for people: a report of one result or several."""

from pathlib import Path
from typing import Any

from hkt_mdo.errors import install, needed
from hkt_mdo.files.template import templates
from hkt_mdo.results.words import printable

_TEMPLATES = Path(__file__).parent / "templates"


def rendered(template: str | Path, **values: Any) -> str:
    """Return a template with its values; in HTML, texts are escaped.

    Parameters
    ----------
    template : str or Path
        Name of a template of this package, or a file, which may extend or include those.
    **values
        What the template names; a missing value is an error.

    Returns
    -------
    str
        The filled template.
    """
    path = _TEMPLATES / template
    html = path.suffix == ".html"
    environment = templates(path.parent, _TEMPLATES, html=html, printable=printable)
    return str(environment.get_template(path.name).render(**values))


def plotly_script() -> str:
    """Return plotly.js, which draws the charts of a page.

    Returns
    -------
    str
        Some megabytes of JavaScript.

    Raises
    ------
    InputError
        If the package that has it is not installed.
    """
    remedy = f"install it with: {install('report')}"
    return str(needed("plotly.offline", remedy, "a report ").get_plotlyjs())
