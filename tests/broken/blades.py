"""Broken blade files: one flaw each, made from a sound file."""

CSV = """# a sound blade
r_m,chord_m,twist_deg,t_over_c,section
0.2,0.18,20,0.24,root
0.6,0.12,9,0.18,middle
1.0,0.09,4,0.15,tip
1.4,0.06,1,0.12,tip
"""

AERODYN = """------- AERODYN v15.00.* BLADE DEFINITION INPUT FILE ----------------
A sound blade
======  Blade Properties ============================================
4   NumBlNds  - Number of blade nodes used in the analysis (-)
BlSpn  BlCrvAC  BlSwpAC  BlCrvAng  BlTwist  BlChord  BlAFID
(m)    (m)      (m)      (deg)     (deg)    (m)      (-)
0.00   0.0      0.0      0.0       20.0     0.18     1
0.40   0.0      0.0      0.0       9.0      0.12     2
0.80   0.0      0.0      0.0       4.0      0.09     2
1.225  0.0      0.0      0.0       1.0      0.06     3
"""

_ALPHA = [-180, -90, -20, -10, -5, 0, 5, 10, 15, 30, 90, 180]
_LIFT = [0, 0, -0.8, -0.9, -0.4, 0.1, 0.7, 1.1, 1.2, 0.9, 0, 0]
_DRAG = [0.02, 1.3, 0.2, 0.05, 0.01, 0.01, 0.01, 0.02, 0.06, 0.5, 1.3, 0.02]

WINDIO = f"""windIO_version: '2.0'
name: a sound turbine
assembly:
    number_of_blades: 3
    rotor_diameter: 2.8
components:
    blade:
        reference_axis:
            x: {{grid: [0.0, 1.0], values: [0.0, 0.0]}}
            y: {{grid: [0.0, 1.0], values: [0.0, 0.0]}}
            z: {{grid: [0.0, 1.0], values: [0.0, 1.225]}}
        outer_shape:
            chord:
                grid: &grid [0.0, 0.3, 0.7, 1.0]
                values: [0.18, 0.12, 0.09, 0.06]
            twist:
                grid: *grid
                values: [20.0, 9.0, 4.0, 1.0]
            rthick:
                grid: *grid
                values: [0.24, 0.18, 0.15, 0.12]
            airfoils:
              - {{name: thick, spanwise_position: 0.0, configuration: [clean], weight: [1.0]}}
              - {{name: thin, spanwise_position: 1.0, configuration: [clean], weight: [1.0]}}
    hub:
        diameter: 0.35
        cone_angle: 2.5
airfoils:
  - name: thick
    rthick: 0.24
    coordinates: {{x: [1.0, 0.5, 0.0, 0.5, 1.0], y: [0.0, 0.12, 0.0, -0.12, 0.0]}}
    polars:
      - configuration: clean
        re_sets:
          - re: 1.0e+6
            cl: {{grid: {_ALPHA}, values: {_LIFT}}}
            cd: {{grid: {_ALPHA}, values: {_DRAG}}}
  - name: thin
    rthick: 0.12
    polars:
      - configuration: clean
        re_sets:
          - re: 1.0e+6
            cl: {{grid: {_ALPHA}, values: {_LIFT}}}
            cd: {{grid: {_ALPHA}, values: {_DRAG}}}
"""


def _changed(base, changes):
    """Return {name: (content, expected fragment)} of a sound text with one change each."""
    made = {}
    for name, (old, new, fragment) in changes.items():
        assert old in base, name
        made[name] = (base.replace(old, new, 1).encode(), fragment)
    return made


_HEADER = "r_m,chord_m,twist_deg,t_over_c,section"

_CSV = _changed(
    CSV,
    {
        "falling radius": ("1.0,0.09", "0.5,0.09", "line 5, column r_m = '0.5'"),
        "radius twice": ("1.0,0.09", "0.6,0.09", "line 5, column r_m = '0.6': stands there twice"),
        "negative radius": ("0.2,0.18", "-0.2,0.18", "line 3, column r_m = '-0.2'"),
        "nan": ("0.12,9", "nan,9", "line 4, column chord_m = 'nan'"),
        "infinity": ("0.12,9", "1e999,9", "line 4, column chord_m = '1e999'"),
        "chord zero": ("0.06,1", "0,1", "line 6, column chord_m = '0'"),
        "chord negative": ("0.06,1", "-0.06,1", "line 6, column chord_m = '-0.06'"),
        "chord in mm": ("0.18,20", "180,20", "line 3, column chord_m = '180': is a chord longer"),
        "twist too large": (",20,", ",200,", "line 3, column twist_deg = '200'"),
        "twist in another unit": ("twist_deg", "twist_rad", "line 3, column twist_rad = '20'"),
        "thickness zero": ("0.24", "0", "line 3, column t_over_c = '0'"),
        "thickness in per cent": ("0.24", "24", "line 3, column t_over_c = '24'"),
        "chord without unit": ("chord_m", "chord", "column chord: has no unit in its name"),
        "radius without unit": ("r_m", "r", "column r: has no unit in its name"),
        "twist without unit": ("twist_deg", "twist", "column twist: has no unit in its name"),
        "unknown unit": ("chord_m", "chord_inch", "column chord_inch: is no known column"),
        "unit in brackets": ("r_m", "Radius [m]", "column Radius [m]: is no known column"),
        "no chord": ("chord_m", "weight_kg", "lacks a column of the chord"),
        "no twist": ("twist_deg", "weight_kg", "lacks a column of the twist"),
        "mixed lengths": ("chord_m", "c_over_R", "mixes r_m with c_over_R"),
        "two radii": ("t_over_c", "r_mm", "two columns for the radius"),
        "a column twice": ("t_over_c", "chord_m", "column chord_m: appears twice"),
        "a unit in a cell": ("0.12,9", "0.12 m,9", "line 4, column chord_m = '0.12 m'"),
        "a decimal comma": ("0.12,9", "0,12,9", "line 4"),
        "an empty cell": ("0.12,9", ",9", "line 4, column chord_m = ''"),
        "an underscore": ("0.12,9", "0.1_2,9", "line 4, column chord_m"),
        "a word": ("0.12,9", "wide,9", "line 4, column chord_m = 'wide'"),
        "a missing cell": ("0.12,9,0.18,middle", "0.12,9,0.18", "line 4"),
        "no section": ("0.18,middle", "0.18,", "line 4, column section: names no section"),
        "an open quote": ("middle", '"middle', "is not CSV"),
        "a formula": ("0.12,9", "=A1,9", "line 4, column chord_m = '=A1'"),
        "other digits": ("0.12,9", "0.1٢,9", "line 4, column chord_m"),
    },
) | {
    "empty": (b"", "is empty"),
    "remarks only": (b"# r_m,chord_m,twist_deg\n\n", "remarks only"),
    "header only": (_HEADER.encode(), "has a header but no rows"),
    "one row": (b"r_m,chord_m,twist_deg\n0.5,0.1,3\n", "line 2, column r_m = '0.5'"),
    "no header": (b"0.2,0.18,20\n0.6,0.12,9\n", "lacks a column of the radius"),
    "semicolons": (CSV.replace(",", ";").encode(), "is not separated by commas"),
    "tabs": (CSV.replace(",", "\t").encode(), "is not separated by commas"),
    "beyond the tip": (
        b"r_over_R,c_over_R,pitch_deg\n0.2,0.1,15\n1.4,0.05,0\n",
        "line 3, column r_over_R = '1.4': lies beyond the tip",
    ),
    "chord longer than R": (
        b"r_over_R,c_over_R,pitch_deg\n0.2,12.5,15\n1.0,5,0\n",
        "line 2, column c_over_R = '12.5'",
    ),
    "not UTF-8": (CSV.replace("root", "wurzel \xe4").encode("latin-1"), "line 3: is not UTF-8"),
    "UTF-16": (CSV.encode("utf-16"), "is not UTF-8"),
    "a picture": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00", "is not UTF-8"),
    "zeros": (b"\0" * 64, "line 1"),
    "a web page": (b"<!doctype html><html><body>404</body></html>\n", "lacks a column"),
}

_LAST = AERODYN.splitlines()[-1]

_AERODYN = _changed(
    AERODYN,
    {
        "truncated": (_LAST + "\n", "", "NumBlNds = 4: promises 4 rows"),
        "cut in a row": ("1.0      0.06     3", "1.0", "line 10"),
        "count too large": ("4   Num", "40  Num", "NumBlNds = 40: promises 40 rows"),
        "count one": ("4   Num", "1   Num", "NumBlNds = '1'"),
        "count zero": ("4   Num", "0   Num", "NumBlNds = '0'"),
        "count broken": ("4   Num", "4.5 Num", "NumBlNds = '4.5'"),
        "count a word": ("4   Num", "four Num", "NumBlNds = 'four'"),
        "count enormous": ("4   Num", "999999999 Num", "NumBlNds = '999999999'"),
        "no count": ("4   NumBlNds", "4   nodes", "has no line `19 NumBlNds`"),
        "no chord column": ("BlChord", "Chord", "lacks the column BlChord"),
        "no span column": ("BlSpn", "Span", "lacks the column BlSpn"),
        "no airfoil column": ("BlAFID", "Foil", "lacks the column BlAFID"),
        "a column twice": ("BlSwpAC", "BlCrvAC", "column BlCrvAC: appears twice"),
        "no units": (
            "(m)    (m)      (m)      (deg)     (deg)    (m)      (-)\n",
            "",
            "line of units",
        ),
        "twist in radians": (
            "(deg)    (m)      (-)",
            "(rad)    (m)      (-)",
            "line 6, column BlTwist",
        ),
        "span in feet": ("(m)    (m)      (m) ", "(ft)   (m)      (m) ", "line 6, column BlSpn"),
        "radius not span": ("0.00   ", "0.175  ", "line 7, column BlSpn = '0.175'"),
        "falling span": ("0.80 ", "0.30 ", "line 9, column BlSpn = '0.30'"),
        "span twice": ("0.80 ", "0.40 ", "line 9, column BlSpn = '0.40': stands there twice"),
        "negative span": ("0.40 ", "-.40 ", "line 8, column BlSpn = '-.40'"),
        "nan": ("0.12 ", "NaN  ", "line 8, column BlChord = 'NaN'"),
        "stars": ("0.12 ", "**** ", "line 8, column BlChord = '****'"),
        "chord zero": ("0.06 ", "0.00 ", "line 10, column BlChord = '0.00'"),
        "chord negative": ("0.06 ", "-0.6 ", "line 10, column BlChord = '-0.6'"),
        "chord in mm": ("0.18 ", "180. ", "line 7, column BlChord = '180.'"),
        "twist too large": ("20.0 ", "200. ", "line 7, column BlTwist = '200.'"),
        "airfoil zero": ("0.18     1", "0.18     0", "line 7, column BlAFID = '0'"),
        "airfoil broken": ("0.18     1", "0.18     1.5", "line 7, column BlAFID = '1.5'"),
        "airfoil a name": ("0.18     1", "0.18     naca", "line 7, column BlAFID = 'naca'"),
        "a decimal comma": ("0.12 ", "0,12 ", "line 8, column BlChord = '0,12'"),
        "an empty line": ("0.40   0.0", "\n0.40   0.0", "line 8"),
        "one number more": ("0.12     2", "0.12     2    7", "line 8"),
        "one number less": ("0.12     2", "0.12", "line 8"),
    },
) | {
    "primary file": (
        b"------- AERODYN INPUT FILE --------\nA turbine\nTrue Echo - echo (flag)\n",
        "has no line `19 NumBlNds`",
    ),
    "ends after the count": ("\n".join(AERODYN.splitlines()[:4]).encode(), "lacks the column"),
    "ends after the names": ("\n".join(AERODYN.splitlines()[:5]).encode(), "line of units"),
    "ends after the units": ("\n".join(AERODYN.splitlines()[:6]).encode(), "promises 4 rows"),
    "not UTF-8": (AERODYN.replace("A sound", "Ein sch\xf6nes").encode("latin-1"), "line 2: is not"),
    "another program's": (b"nothing that belongs here\n1 2 3\n", "has no line `19 NumBlNds`"),
}

# Nine lists of nine lists of ...: a copy of each alias would fill the memory.
_BILLION = "l0: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
for _level in range(1, 20):
    _BILLION += f"l{_level}: &l{_level} [{', '.join([f'*l{_level - 1}'] * 9)}]\n"
_BILLION += (
    "components: {hub: {diameter: 1}, blade: {outer_shape: {}, reference_axis: {z: *l19}}}\n"
)

_OUTER = "components.blade.outer_shape"

_WINDIO = _changed(
    WINDIO,
    {
        "no components": ("components:", "parts:", "components (line 1): is missing"),
        "no blade": ("    blade:", "    wing:", "components.blade (line 7): is missing"),
        "no outer shape": ("outer_shape:", "shape:", f"{_OUTER} (line 8): is missing"),
        "no chord": ("chord:", "chords:", f"{_OUTER}.chord (line 13): is missing"),
        "no twist": ("twist:", "twists:", f"{_OUTER}.twist (line 13): is missing"),
        "no axis": ("reference_axis:", "axis:", "components.blade.reference_axis (line 8)"),
        "no z": ("            z:", "            w:", "reference_axis.z (line 9): is missing"),
        "no airfoils along the span": (
            "            airfoils:",
            "            foils:",
            f"{_OUTER}.airfoils",
        ),
        "no library": ("\nairfoils:", "\nfoils:", "airfoils (line 1): is missing"),
        "unknown airfoil": ("name: thin,", "name: slim,", "names the airfoil slim"),
        "no polars": ("    polars:", "    tables:", "airfoils[0].polars"),
        "no drag": ("            cd:", "            dd:", "airfoils[0].polars[0].re_sets[0].cd"),
        "unknown configuration": ("[clean]", "[rough]", "has no polars of configuration rough"),
        "blended configurations": (
            "configuration: [clean], weight: [1.0]",
            "configuration: [clean, rough], weight: [0.5, 0.5]",
            "blends 2 configurations",
        ),
        "weights missing": (
            "configuration: [clean], weight: [1.0]",
            "configuration: [clean, rough], weight: [1.0]",
            "1 weights for 2 configurations",
        ),
        "value missing": ("0.12, 0.09, 0.06]", "0.12, 0.06]", "4 numbers in grid and 3 in values"),
        "empty values": (
            "[0.18, 0.12, 0.09, 0.06]",
            "[]",
            f"{_OUTER}.chord.values (line 15): is empty",
        ),
        "falling grid": ("0.3, 0.7", "0.7, 0.3", f"{_OUTER}.chord.grid[2] (line 14) = '0.3'"),
        "grid in metres": (
            "0.3, 0.7, 1.0]",
            "0.3, 0.7, 1.225]",
            "grid runs from 0 at the root to 1",
        ),
        "short grid": ("[0.0, 0.3,", "[0.1, 0.3,", "has a grid from 0.1 to 1"),
        "nan": ("0.12, 0.09", ".nan, 0.09", f"{_OUTER}.chord.values[1] (line 15) = '.nan'"),
        "a word": ("0.12, 0.09", "wide, 0.09", f"{_OUTER}.chord.values[1] (line 15) = 'wide'"),
        "quoted number": ("0.12, 0.09", "'0.12', 0.09", f"{_OUTER}.chord.values[1]"),
        "a list in a list": ("0.12, 0.09", "[0.12], 0.09", f"{_OUTER}.chord.values[1]"),
        "no list": ("[0.18, 0.12, 0.09, 0.06]", "0.18", "must be a list"),
        "no mapping": ("{grid: [0.0, 1.0], values: [0.0, 1.225]}", "1.225", "must be a mapping"),
        "chord zero": ("0.09, 0.06]", "0.09, 0.0]", f"{_OUTER}.chord.values[3] (line 15)"),
        "chord in mm": ("[0.18,", "[180,", f"{_OUTER}.chord.values[0] (line 15) = '180'"),
        "twist too large": ("[20.0,", "[200.0,", f"{_OUTER}.twist.values[0] (line 18) = '200.0'"),
        "thickness in per cent": ("[0.24, 0.18", "[24, 18", f"{_OUTER}.rthick.values[0]"),
        "position beyond the tip": (
            "position: 1.0",
            "position: 1.2",
            "airfoils[1].spanwise_position",
        ),
        "positions fall": ("position: 0.0", "position: 1.0", "airfoils[1].spanwise_position"),
        "no position": ("spanwise_position: 1.0, ", "", "airfoils[1].spanwise_position"),
        "blade inwards": ("[0.0, 1.225]", "[0.0, -1.225]", "reference_axis.z.values[1]"),
        "span from the centre": ("[0.0, 1.225]", "[0.175, 1.4]", "is not 0 at the blade's root"),
        "no hub": ("diameter: 0.35", "size: 0.35", "components.hub.diameter"),
        "hub zero": ("diameter: 0.35", "diameter: 0", "components.hub.diameter (line 26) = '0'"),
        "hub in words": ("diameter: 0.35", "diameter: 0.35 m", "components.hub.diameter"),
        "another diameter": ("diameter: 2.8", "diameter: 28", "assembly.rotor_diameter (line 5)"),
        "half a blade": ("of_blades: 3", "of_blades: 2.5", "assembly.number_of_blades (line 4)"),
        "no blades": ("of_blades: 3", "of_blades: 0", "assembly.number_of_blades (line 4)"),
        "cone too large": ("cone_angle: 2.5", "cone_angle: 250", "components.hub.cone_angle"),
        "thickness of an airfoil": ("rthick: 0.24", "rthick: 24", "airfoils[0].rthick"),
        "outline": ("-0.12, 0.0]}", "0.0]}", "airfoils[0].coordinates"),
        "Reynolds number zero": ("re: 1.0e+6", "re: 0", "airfoils[0].polars[0].re_sets[0].re"),
        "angles fall": ("-90, -20", "-20, -90", "re_sets[0].cl.grid[2]"),
        "angles beyond": ("[-180, ", "[-190, ", "lies beyond the full circle"),
        "drag negative": ("0.01, 0.01, 0.01", "0.01, -0.01, 0.01", "drag must be positive"),
        "lift too few": ("1.1, 1.2, 0.9", "1.1, 0.9", "12 numbers in grid and 11 in values"),
        "airfoil twice": ("  - name: thin\n", "  - name: thick\n", "second airfoil thick"),
        "key twice": ("name: a sound turbine", "name: a\nname: b", "gives the key name twice"),
        "tab": ("    hub:", "\thub:", "cannot be read as YAML"),
        "open bracket": ("0.09, 0.06]", "0.09, 0.06", "cannot be read as YAML"),
        "unknown alias": ("grid: *grid", "grid: *nothing", "*nothing stands before its anchor"),
        "alias in itself": ("grid: &grid [0.0,", "grid: &grid [*grid,", "or within it"),
        "a tag": (
            "number_of_blades: 3",
            "number_of_blades: !!python/object:os.system 3",
            "the tag",
        ),
        "an include": ("rthick: 0.24", "rthick: !include thick.yaml", "the tag !include"),
        "merge keys": ("    number_of_blades: 3", "    <<: {number_of_blades: 3}", "merge keys"),
        "two documents": ("\nairfoils:", "\n---\nairfoils:", "second document"),
        "both shapes": (
            "        outer_shape:",
            "        outer_shape_bem: {a: 1}\n        outer_shape:",
            "outer_shape and outer_shape_bem",
        ),
        "radians in version 2": (
            str(_ALPHA),
            str([round(angle / 57.29578, 4) for angle in _ALPHA]),
            "windIO 2 counts them in degrees",
        ),
        "degrees in version 1": (
            "outer_shape:",
            "outer_shape_bem:",
            "windIO 1 counts it in radians",
        ),
    },
) | {
    "a list of sections": (b"- components\n- airfoils: 1\n", "is no windIO turbine"),
    "one word": (b"components\n", "is no windIO turbine"),
    "truncated": (WINDIO[: len(WINDIO) // 2].encode(), "line"),
    "not UTF-8": (WINDIO.replace("a sound", "ein sch\xf6ner").encode("latin-1"), "is not UTF-8"),
    "deep": (b"components: " + b"[" * 100_000, "nested deeper"),
    "aliases by the billion": (_BILLION.encode(), "components.blade.reference_axis.z"),
    "a control character": (
        WINDIO.replace("sound", "so\x07und").encode(),
        "cannot be read as YAML",
    ),
}

_KINDS = (("csv", _CSV), ("dat", _AERODYN), ("yaml", _WINDIO))

BROKEN: dict[str, tuple[str, bytes, str]] = {
    f"{suffix}: {name}": (f"blade.{suffix}", content, fragment)
    for suffix, kind in _KINDS
    for name, (content, fragment) in kind.items()
}
"""Name of the flaw: file name, content, and what the one message must say."""
