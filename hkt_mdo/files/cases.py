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
        ``limits/all_oloc``; a file of that name comes first.

    Returns
    -------
    pathlib.Path
        The shipped case if there is one of that name, else `path`.
    """
    path = Path(path)
    if path.parent.as_posix() in _FOLDERS and not path.exists():
        inside = _FOLDERS if path.parent == Path() else (path.parent,)
        for folder in (shipped_cases() / each for each in inside):
            for name in (path.name, f"{path.name}.yaml"):
                if name.endswith(".yaml") and (folder / name).is_file():
                    return folder / name
    return path
