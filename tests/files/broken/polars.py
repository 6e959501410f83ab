"""Broken polars and outlines: name, content, and what the one message must say.

Every content is made here by spoiling a file that is well. `POLARS` holds polars (CSV, AeroDyn,
XFOIL), `OUTLINES` outlines.
"""

import math

Broken = dict[str, tuple[str, bytes, str]]


def _coefficients(alpha: float) -> tuple[str, str, str]:
    return f"{0.3 + 0.1 * alpha:.4f}", f"{0.01 + 1e-4 * alpha * alpha:.5f}", f"{-0.08:.4f}"


def _replace(text: str, *changes: tuple[str, str]) -> bytes:
    """Return the text with every change made, each of which must find its place once or more."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text.encode()


# CSV: the header is line 1, the row of angle alpha line alpha + 10 -----------------------------

_CSV_ROWS = [f"{alpha},{','.join(_coefficients(alpha))}" for alpha in range(-8, 17)]
_CSV = "\n".join(["alpha_deg,cl,cd,cm", *_CSV_ROWS]) + "\n"
_BOTH = [f"{row},{reynolds}" for reynolds in ("2e5", "1e6") for row in _CSV_ROWS]
_CSV_REYNOLDS = "\n".join(["alpha_deg,cl,cd,cm,reynolds", *_BOTH]) + "\n"


def _csv(*rows: str, header: str = "alpha_deg,cl,cd") -> bytes:
    return "\n".join([header, *rows, ""]).encode()


def _plain(angles, cl="0.1", cd="0.02") -> list[str]:
    return [f"{alpha:.6g},{cl},{cd}" for alpha in angles]


def _row(alpha: int, new: str) -> tuple[str, str]:
    return f"\n{_CSV_ROWS[alpha + 8]}\n", f"\n{new}\n"


_PRESSURE = _CSV.replace("cm\n", "cm,cpmin\n").replace("-0.0800\n", "-0.0800,-1.2\n")
_PRESSURE_ROW = f"\n{_CSV_ROWS[11]},-1.2\n"


def _pressure(value: str) -> tuple[str, str]:
    """Return the row of 3 degrees, line 13, and the same with another smallest pressure."""
    return _PRESSURE_ROW, _PRESSURE_ROW.replace("-1.2", value)


_RADIANS = [row.split(",", 1) for row in _CSV_ROWS]
_IN_RADIANS = [f"{math.radians(float(angle)):.6f},{rest}" for angle, rest in _RADIANS]

_BROKEN_CSV: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty"),
    "angle not named": (_replace(_CSV, ("alpha_deg", "alpha")), "name it alpha_deg or alpha_rad"),
    "angle named twice": (_replace(_CSV, ("cm", "alpha_rad")), "two columns for the angle of"),
    "cut after few rows": (_csv(*_CSV_ROWS[:5], header="alpha_deg,cl,cd,cm"), "at least 8"),
    "begins above -5 degrees": (_csv(*_plain(range(-2, 20))), "from -5 or less"),
    "beyond 90 degrees": (_csv(*_plain(range(-95, 25, 5))), "within -90 and 90"),
    "from 0 to 360 degrees": (_csv(*_plain(range(0, 365, 5))), "beyond the full circle"),
    "unordered angles": (
        _replace(_CSV, _row(3, "4,0.7,0.01,0"), _row(4, "3,0.6,0.01,0")),
        "line 14, column alpha_deg = 3.0: does not exceed",
    ),
    "nan": (_replace(_CSV, _row(3, "3,nan,0.01,0")), "line 13, column cl = 'nan'"),
    "negative drag": (_replace(_CSV, _row(3, "3,0.6,-0.01,0")), "line 13, column cd = -0.01"),
    "drag in counts": (_replace(_CSV, _row(3, "3,0.6,109,0")), "line 13, column cd = 109"),
    "radians for degrees": (_csv(*_IN_RADIANS, header="alpha_deg,cl,cd,cm"), "are radians"),
    "degrees for radians": (_replace(_CSV, ("alpha_deg", "alpha_rad")), "are degrees"),
    "Reynolds number in millions": (_replace(_CSV_REYNOLDS, ("2e5", "0.2")), "column reynolds"),
    "one Reynolds number too short": (
        "\n".join(_CSV_REYNOLDS.splitlines()[:30]).encode(),
        "reynolds = 1e+06, alpha_deg",
    ),
    "suction for pressure": (_replace(_PRESSURE, _pressure("1.2")), "line 13, column cpmin = 1.2"),
    "pressure in pascal": (_replace(_PRESSURE, _pressure("-1200")), "line 13, column cpmin"),
    "pressure not a number": (_replace(_PRESSURE, _pressure("nan")), "line 13, column cpmin"),
    "pressure of one surface": (
        _replace(_PRESSURE, ("cpmin", "cpmin_lower")),
        "cpmin_lower: is of one surface alone",
    ),
    "web page": (b"<!DOCTYPE html>\n<html><body>404</body></html>\n", "is no header"),
}

# AeroDyn: NumTabs is line 6, Re 8, NumAlf 12, the row of angle alpha line alpha + 23 ------------


def _aerodyn_table(reynolds: str) -> list[str]:
    return [
        "! data of a table",
        f"  {reynolds}  Re          ! in millions",
        "  0         UserProp    ! user property",
        "False       InclUAdata  ! unsteady data?",
        "! coefficients",
        "  25        NumAlf      ! rows",
        "!  Alpha  Cl  Cd  Cm",
        "!  (deg)  (-) (-) (-)",
        *(f"  {alpha:.2f}  {'  '.join(_coefficients(alpha))}" for alpha in range(-8, 17)),
    ]


_AERODYN_LINES = [
    "! ------------ AirfoilInfo v1.01.x Input File ------------",
    '"DEFAULT"  InterpOrd   ! order',
    "  1        NonDimArea  ! area",
    '@"x.txt"   NumCoords   ! shape',
    '"unused"   BL_file     ! boundary layer',
    "  1        NumTabs     ! tables",
    *_aerodyn_table("0.200"),
]
_AERODYN = "\n".join(_AERODYN_LINES) + "\n"
_AERODYN_TWO = _AERODYN.replace("1        NumTabs", "2        NumTabs") + "\n".join(
    [*_aerodyn_table("1.000"), ""]
)
_A3 = "  3.00  0.6000  0.01090  -0.0800"
_CIRCLE = [f" {alpha} 0.1 0.02" for alpha in range(-180, 190, 10)]


def _aerodyn(rows: list[str], count: int | None = None) -> bytes:
    head = "\n".join(_AERODYN_LINES[:14]).replace("25 ", f"{count or len(rows)} ")
    return (head + "\n" + "\n".join(rows) + "\n").encode()


_14 = b"AeroDyn airfoil file\n %d   Number of airfoil tables in this file\n%s"
_TABLE = b" 0   Table ID parameter\n -8 0.1 0.02\nEOT\n"
_ROWS_14 = "\n".join(f"{angle} 0.1 0.02" for angle in range(-9, 16)).encode()
_CIRCLE_IN_RADIANS = [f" {math.radians(a):.5f} 0.1 0.02" for a in range(-180, 190, 10)]

_BROKEN_AERODYN: dict[str, tuple[bytes, str]] = {
    "no rows": (
        "\n".join(_AERODYN_LINES[:14]).encode(),
        "line 12, NumAlf = '25': announces more rows than the 0",
    ),
    "NumTabs missing": (_replace(_AERODYN, (_AERODYN_LINES[5], "!")), "NumTabs = '': is missing"),
    "NumTabs too many": (
        _replace(_AERODYN, ("1        NumTabs", "2  NumTabs")),
        "line 6, NumTabs = 2: is not the number of tables, 1",
    ),
    "Re not in millions": (_replace(_AERODYN, ("0.200", "200000")), "give it in millions"),
    "NumAlf a fraction": (_replace(_AERODYN, ("25  ", "25.5  ")), "line 12, NumAlf = '25.5'"),
    "NumAlf too large before a table": (
        _replace(_AERODYN_TWO, ("25  ", "26  ")),
        "line 41 = '1.000 Re': has 2 numbers where the table has 4 columns",
    ),
    "NumAlf too small before a table": (
        _replace(_AERODYN_TWO, ("25  ", "24  ")),
        "line 39 = '16.00  1.9000  0.03560  -0.0800': comes where a value with its name",
    ),
    "NumCoords lies": (
        _replace(_AERODYN, ('@"x.txt"   NumCoords', "3  NumCoords")),
        "line 12, NumAlf: comes without a line Re",
    ),
    "tables elsewhere": (("\n".join(_AERODYN_LINES[:6]) + '\n@"t.dat"\n').encode(), "line 7"),
    "columns swapped": (_replace(_AERODYN, ("Alpha  Cl  Cd", "Alpha  Cd  Cl")), "Alpha, Cl, Cd"),
    "two columns": (_aerodyn([f" {a} 0.1" for a in range(-8, 17)]), "fewer than three columns"),
    "nan": (_replace(_AERODYN, (_A3, "  3.00 nan 0.01 0.0")), "line 26, column cl = 'nan'"),
    "radians": (_aerodyn(_CIRCLE_IN_RADIANS), "are radians"),
    "AeroDyn 14": (_14 % (1, _TABLE), "the polar has 1 rows, at least 8 are needed"),
    "AeroDyn 14 without numbers": (_14 % (2, _TABLE * 2), "line 3, Re = '0': is no Reynolds"),
    "AeroDyn 12": (
        _14 % (2, b" 1.0 2.0 Table ID parameter\n -8 0.1 0.02 0.1 0.02\n"),
        "line 4 = '-8 0.1 0.02 0.1 0.02': has 5 numbers where the table has 4 columns",
    ),
    "AeroDyn 14 cut off": (_14 % (2, b" 1.0 Re\n" + _ROWS_14), "is not the number of tables"),
    "AeroDyn 14 without rows": (_14 % (1, b" 1.0 Re\nEOT\n"), "line 3, table 1: begins a table"),
}

# XFOIL: Re is line 9, names are line 11, the row of angle alpha is line alpha + 21 ---------------

_XFOIL_LINES = [
    "  ",
    "       XFOIL         Version 6.99",
    "  ",
    " Calculated polar for: A SECTION",
    "  ",
    " 1 1 Reynolds number fixed          Mach number fixed",
    "  ",
    " xtrf =   1.000 (top)        1.000 (bottom)",
    " Mach =   0.000     Re =     0.200 e 6     Ncrit =   9.000",
    "  ",
    "   alpha    CL        CD       CDp       CM     Top_Xtr  Bot_Xtr",
    "  ------ -------- --------- --------- -------- -------- --------",
    *(
        "{:8.3f} {} {}  0.00300 {}  0.5000  1.0000".format(alpha, *_coefficients(alpha))
        for alpha in range(-8, 17)
    ),
]
_XFOIL = "\n".join(_XFOIL_LINES) + "\n"


def _xfoil(*lines: str) -> bytes:
    return ("\n".join(lines) + "\n").encode()


_BROKEN_XFOIL: dict[str, tuple[bytes, str]] = {
    "title alone": (_xfoil(*_XFOIL_LINES[:3]), "lacks the line Calculated polar for"),
    "no rows": (_xfoil(*_XFOIL_LINES[:12]), "line 4: the polar that begins here has no rows"),
    "names missing": (_replace(_XFOIL, (_XFOIL_LINES[10], "")), "lacks the line of column names"),
    "drag not named": (_replace(_XFOIL, ("   CD    ", "   C_D   ")), "lacks the column CD"),
    "Re missing": (_replace(_XFOIL, (_XFOIL_LINES[8], "")), "lacks the line Mach"),
    "Re without number": (_replace(_XFOIL, ("0.200 e 6", "")), "line 9, Re = 'Ncrit'"),
    "Re without power": (_replace(_XFOIL, ("0.200 e 6", "0.200")), "line 9, Re = '0.200'"),
    "Re varies": (_replace(_XFOIL, ("r fixed    ", "r ~ 1/sqrt ")), "fixed Reynolds number"),
    "same Re twice": (_XFOIL.encode() * 2, "Reynolds number = 200000.0"),
    "asterisks": (_replace(_XFOIL, ("0.6000", "*******")), "line 24, column cl = '*******'"),
    "words below": (_XFOIL.encode() + b" Point added to stored polar 1\n", "line 38"),
}

# Outlines: a NACA 4-digit section; Selig's point k is line k + 2 ----------------------------------


def _section() -> tuple[list[str], list[str]]:
    """Return points of the upper and the lower side, from the leading to the trailing edge."""
    upper, lower = [], []
    for step in range(21):
        x = 0.5 * (1.0 - math.cos(math.pi * step / 20))
        y = 0.6 * (0.2969 * math.sqrt(x) + x * (-0.126 + x * (-0.3516 + x * (0.2843 - 0.1015 * x))))
        upper.append(f"{x:.6f} {y:.6f}")
        lower.append(f"{x:.6f} {-y:.6f}")
    return upper, lower


_UPPER, _LOWER = _section()
_POINTS = [*_UPPER[::-1], *_LOWER[1:]]
_SELIG = "\n".join(["A SECTION", *_POINTS]) + "\n"
_LEDNICER = "\n".join(["A SECTION", "  21.  21.", "", *_UPPER, "", *_LOWER]) + "\n"
_OUTLINE_CSV = "\n".join(["x_over_c,y_over_c", *(p.replace(" ", ",") for p in _POINTS)]) + "\n"


def _points(change, points=_POINTS) -> bytes:
    """Return Selig's file with x and y changed."""
    pairs = (change(*map(float, point.split())) for point in points)
    return "\n".join(["A SECTION", *(f"{x:.6f} {y:.6f}" for x, y in pairs), ""]).encode()


_COUNTED = "\n".join(["43 NumCoords ! and the reference", "0.25 0", *_POINTS]).encode()
_ABSENT = b'"default" InterpOrd\n@"absent.txt" NumCoords\n1 NumTabs\n'
_FROM_THE_NOSE = "\n".join([*_LOWER, *_UPPER[-2::-1]]).encode()
_FROM_BEHIND = "\n".join(["21 21", *_UPPER[::-1], *_LOWER]).encode()

_FLAWS = {
    "empty.dat": (b"", "is empty"),
    "name alone.dat": (b"A SECTION\n", "has no coordinates"),
    "column missing.csv": (_replace(_OUTLINE_CSV, ("y_over_c", "y")), "lacks the column y_over_c"),
    "ragged row.dat": (_replace(_SELIG, (_POINTS[5], "0.9")), "line 7 = '0.9'"),
    "nan.dat": (_replace(_SELIG, (_POINTS[5], "0.9 nan")), "line 7, column y = 'nan'"),
    "half a point above.dat": (b"A BOOK\n1.0 -\n" + _SELIG.encode(), "line 2, column y"),
    "broken last point.dat": (_SELIG.encode() + b"1.0 O.0\n", "column y = 'O.0'"),
    "text between points.dat": (_replace(_SELIG, (_POINTS[5], "lower side")), "line 7"),
    "AeroDyn's count lies.txt": (_COUNTED, "line 1, NumCoords = 43: is followed by 42 pairs"),
    "AeroDyn's file is missing.dat": (_ABSENT, "line 2, NumCoords"),
    "upper side alone.dat": ("\n".join(_UPPER[::-1]).encode(), "last point"),
    "millimetres.dat": (_points(lambda x, y: (250 * x, 250 * y)), "largest x is 250"),
    "centred.dat": (_points(lambda x, y: (x - 0.25, y)), "smallest x is -0.25"),
    "back to front.dat": (_points(lambda x, y: (1.0 - x, y)), "trailing edge"),
    "thick beyond reason.dat": (_points(lambda x, y: (x, 15 * y)), "away from it"),
    "flat.dat": (_points(lambda x, y: (x, 0.01 * y)), "which is not the area of a section"),
    "sides exchanged.dat": (_points(lambda x, y: (x, y if x > 0.5 else -y)), "crosses itself"),
    "from the leading edge.dat": (_FROM_THE_NOSE, "the first point is not at the trailing edge"),
    "Lednicer's counts lie.dat": (
        _replace(_LEDNICER, ("21.  21.", "20.  21.")),
        "line 2 = '20.  21.': 42 points follow",
    ),
    "Lednicer's side from behind.dat": (_FROM_BEHIND, "the upper side begins nearer to the"),
    "too many points.dat": (b"0.5 0.1\n" * 5001, "5001 points"),
}

WELL: dict[str, tuple[str, bytes]] = {
    "CSV polar": ("polar.csv", _CSV.encode()),
    "CSV polar with pressure": ("pressure.csv", _PRESSURE.encode()),
    "CSV polars": ("polars.csv", _CSV_REYNOLDS.encode()),
    "AeroDyn table": ("section.dat", _AERODYN.encode()),
    "AeroDyn tables": ("sections.dat", _AERODYN_TWO.encode()),
    "AeroDyn circle": ("circle.dat", _aerodyn(_CIRCLE)),
    "XFOIL polar": ("section.pol", _XFOIL.encode()),
    "Selig outline": ("selig.dat", _SELIG.encode()),
    "Lednicer outline": ("lednicer.dat", _LEDNICER.encode()),
    "CSV outline": ("outline.csv", _OUTLINE_CSV.encode()),
}
"""The files before they were spoiled: all of them are to be read."""


def _named(kind: str, suffix: str, broken: dict[str, tuple[bytes, str]]) -> Broken:
    return {
        f"{kind}: {what}": (f"{what.replace(' ', '_')}.{suffix}", content, told)
        for what, (content, told) in broken.items()
    }


POLARS: Broken = {
    **_named("CSV polar", "csv", _BROKEN_CSV),
    **_named("AeroDyn polar", "dat", _BROKEN_AERODYN),
    **_named("XFOIL polar", "pol", _BROKEN_XFOIL),
}
OUTLINES: Broken = {f"outline: {name[:-4]}": (name, *flaw) for name, flaw in _FLAWS.items()}
