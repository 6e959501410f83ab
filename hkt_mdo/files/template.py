"""Templates of texts by Jinja: of pages, of exported files, of the reference of a case's keys."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


@cache
def templates(*folders: Path, html: bool = False, **filters: Callable[..., Any]) -> Any:
    """Return the templates in some folders, which may extend and include one another.

    Parameters
    ----------
    *folders : pathlib.Path
        Where they are; the first one that has a name counts.
    html : bool
        Whether texts are escaped for HTML.
    **filters : callable
        Functions that a template may apply to a value, beside those of Jinja.

    Returns
    -------
    jinja2.Environment
        ``get_template(name).render(...)`` returns a text; a value that is missing is an error.
    """
    import jinja2  # takes long to import

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folders),
        autoescape=html,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= filters
    return environment
