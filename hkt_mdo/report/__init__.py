"""The report: one self-contained HTML page of one result or several, for people."""

from pathlib import Path


def style() -> str:
    """Return the style sheet of every page that the package writes: light and dark, any width.

    Returns
    -------
    str
        Cascading style sheet.
    """
    return (Path(__file__).parent / "templates" / "report.css").read_text(encoding="utf-8")
