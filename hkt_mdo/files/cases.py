"""The case files that come with the program."""

from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_FOLDERS = ".", "examples", "limits"


def shipped_cases() -> Path:
    """Return the folder of the shipped case files: in an installed package, or in the checkout.

    Returns
    -------
    pathlib.Path
        The folder.
    """
    installed = _PACKAGE / "cases"
    return installed if installed.is_dir() else _PACKAGE.parent / "cases"


def find_case(path: str | Path) -> Path:
    """Return the path of a case file.

    Parameters
    ----------
    path : str or pathlib.Path
        A path, or the name of a shipped case such as ``sine_oloc``, ``river_gust.yaml`` or
        ``cases/limits/all_oloc.yaml``; a file of that name comes first.

    Returns
    -------
    pathlib.Path
        The shipped case if there is one of that name, else `path`.
    """
    path = Path(path)
    name = path.relative_to("cases") if path.parts[:1] == ("cases",) else path
    if name.parent.as_posix() in _FOLDERS and not path.is_file():
        inside = _FOLDERS if name == path and name.parent == Path() else (name.parent,)
        for folder in (shipped_cases() / each for each in inside):
            for file in (name.name, f"{name.name}.yaml"):
                if file.endswith(".yaml") and (folder / file).is_file():
                    return folder / file
    return path
