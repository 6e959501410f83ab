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


_CSV = _changed(
    CSV,
    {
        "falling radius": ("1.0,0.09", "0.5,0.09", "line 5, column r_m = '0.5'"),
        "radius twice": ("1.0,0.09", "0.6,0.09", "line 5, column r_m = '0.6': does not exceed"),
        "negative radius": ("0.2,0.18", "-0.2,0.18", "line 3, column r_m = '-0.2'"),
        "chord zero": ("0.06,1", "0,1", "line 6, column chord_m = '0'"),
        "chord in mm": ("0.18,20", "180,20", "line 3, column chord_m = '180': is a chord longer"),
        "twist in another unit": ("twist_deg", "twist_rad", "line 3, column twist_rad = '20'"),
        "thickness zero": ("0.24", "0", "line 3, column t_over_c = '0'"),
        "thickness in per cent": ("0.24", "24", "line 3, column t_over_c = '24'"),
        "chord without unit": ("chord_m", "chord", "of the chord; name it chord_m or chord_mm"),
        "unit in brackets": ("r_m", "Radius [m]", "name it r_m or r_mm or r_over_R"),
        "mixed lengths": ("chord_m", "c_over_R", "mixes r_m with c_over_R"),
        "two radii": ("t_over_c", "r_mm", "two columns for the radius"),
        "a column twice": ("t_over_c", "chord_m", "column chord_m: appears twice"),
        "a decimal comma": ("0.12,9", "0,12,9", "line 4"),
        "no section": ("0.18,middle", "0.18,", "line 4, column section: names no section"),
    },
) | {
    "empty": (b"", "is empty"),
    "one row": (b"r_m,chord_m,twist_deg\n0.5,0.1,3\n", "line 2, column r_m = '0.5'"),
    "no header": (b"0.2,0.18,20\n0.6,0.12,9\n", "line 1 = '0.2,0.18,20': has a number where"),
    "beyond the tip": (b"r_over_R,c_over_R,pitch_deg\n0.2,0.1,15\n1.4,1,0\n", "beyond the tip"),
}

_LAST = AERODYN.splitlines()[-1]
_UNITS = AERODYN.splitlines(keepends=True)[5]

_AERODYN = _changed(
    AERODYN,
    {
        "truncated": (_LAST + "\n", "", "NumBlNds = 4: announces 4 rows"),
        "count broken": ("4   Num", "4.5 Num", "NumBlNds = '4.5'"),
        "no count": ("4   NumBlNds", "4   nodes", "has no line `19 NumBlNds`"),
        "no chord column": ("BlChord", "Chord", "lacks the column BlChord"),
        "a column twice": ("BlSwpAC", "BlCrvAC", "has the column BlCrvAC twice"),
        "no units": (_UNITS, "", "line of units"),
        "twist in radians": ("(deg)    (m) ", "(rad)    (m) ", "line 6, column BlTwist"),
        "radius not span": ("0.00   ", "0.175  ", "line 7, column BlSpn = '0.175'"),
        "airfoil broken": ("0.18     1", "0.18     1.5", "line 7, column BlAFID = '1.5'"),
        "a decimal comma": ("0.12 ", "0,12 ", "line 8, column BlChord = '0,12'"),
        "an empty line": ("0.40   0.0", "\n0.40   0.0", "line 8"),
    },
) | {
    "primary file": (b"--- AERODYN INPUT FILE ---\nA turbine\nTrue Echo\n", "`19 NumBlNds`"),
    "ends after the names": ("\n".join(AERODYN.splitlines()[:5]).encode(), "line of units"),
}

# Nine lists of nine lists of ...: a copy of each alias would fill the memory.
_BILLION = "l0: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
for _level in range(1, 20):
    _BILLION += f"l{_level}: &l{_level} [{', '.join([f'*l{_level - 1}'] * 9)}]\n"
_BILLION += (
    "components: {hub: {diameter: 1}, blade: {outer_shape: {}, reference_axis: {z: *l19}}}\n"
)

_SHAPE = "components.blade.outer_shape"
_CHORD, _AXIS = "[0.18, 0.12, 0.09, 0.06]", "[0.0, 1.225]"
_TWO = ("configuration: [clean], weight: [1.0]", "configuration: [a, b], weight: [0.5, 0.5]")
_RADIANS = str([round(angle / 57.29578, 4) for angle in _ALPHA])
_BOTH = "        outer_shape_bem: {a: 1}\n        outer_shape:"

_WINDIO = _changed(
    WINDIO,
    {
        "no components": ("components:", "parts:", "components (line 1): is missing"),
        "no outer shape": ("outer_shape:", "shape:", f"{_SHAPE} (line 8): is missing"),
        "no chord": ("chord:", "chords:", f"{_SHAPE}.chord (line 13): is missing"),
        "no axis": ("reference_axis:", "axis:", "components.blade.reference_axis (line 8)"),
        "unknown airfoil": ("name: thin,", "name: slim,", "names the airfoil slim"),
        "no polars": ("    polars:", "    tables:", "airfoils[0].polars"),
        "unknown configuration": ("[clean]", "[rough]", "has no polars of configuration rough"),
        "blended configurations": (*_TWO, "blends 2 configurations"),
        "empty values": (_CHORD, "[]", f"{_SHAPE}.chord.values (line 15): is empty"),
        "grid in metres": ("0.3, 0.7, 1.0]", "0.3, 0.7, 1.225]", "from 0 at the root to 1"),
        "nan": ("0.12, 0.09", ".nan, 0.09", f"{_SHAPE}.chord.values[1] (line 15) = '.nan'"),
        "a list in a list": ("0.12, 0.09", "[0.12], 0.09", f"{_SHAPE}.chord.values[1]"),
        "no list": (_CHORD, "0.18", "must be a list"),
        "no mapping": (f"{{grid: [0.0, 1.0], values: {_AXIS}}}", "1.225", "must be a mapping"),
        "thickness in per cent": ("[0.24, 0.18", "[24, 18", f"{_SHAPE}.rthick.values[0]"),
        "positions fall": ("position: 0.0", "position: 1.0", "airfoils[1].spanwise_position"),
        "blade inwards": (_AXIS, "[0.0, -1.225]", "reference_axis.z.values[1]"),
        "span from the centre": (_AXIS, "[0.175, 1.4]", "is not 0 at the blade's root"),
        "no hub": ("diameter: 0.35", "size: 0.35", "components.hub.diameter"),
        "another diameter": ("diameter: 2.8", "diameter: 28", "WISDEM scales the axis); delete"),
        "half a blade": ("blades: 3", "blades: 2.5", "assembly.number_of_blades (line 4)"),
        "cone too large": ("angle: 2.5", "angle: 250", "components.hub.cone_angle"),
        "outline": ("-0.12, 0.0]}", "0.0]}", "airfoils[0].coordinates"),
        "angles beyond": ("[-180, ", "[-190, ", "lies beyond the full circle"),
        "airfoil twice": ("- name: thin\n", "- name: thick\n", "second airfoil named thick"),
        "key twice": ("name: a sound", "name: a\nname: b", "is given twice (again in line 3)"),
        "unknown alias": ("grid: *grid", "grid: *nothing", "line 17, column 23: cannot be read"),
        "alias in itself": ("&grid [0.0,", "&grid [*grid,", "chord.grid[0] (line 14): must be a"),
        "a tag": ("blades: 3", "blades: !!python/object:os.system 3", "tags (!) are refused"),
        "an include": ("k: 0.24", "k: !include a.yaml", "tags (!) are refused, here !include"),
        "both shapes": ("        outer_shape:", _BOTH, "outer_shape and outer_shape_bem"),
        "radians in version 2": (str(_ALPHA), _RADIANS, "windIO 2 counts them in degrees"),
        "degrees in version 1": ("shape:", "shape_bem:", "windIO 1 counts angles in radians"),
    },
) | {
    "deep": (b"components: " + b"[" * 100_000, "nested deeper"),
    "aliases by the billion": (_BILLION.encode(), "components.blade.reference_axis.z"),
}

_KINDS = (("csv", _CSV), ("dat", _AERODYN), ("yaml", _WINDIO))

BROKEN: dict[str, tuple[str, bytes, str]] = {
    f"{suffix}: {name}": (f"blade.{suffix}", content, fragment)
    for suffix, kind in _KINDS
    for name, (content, fragment) in kind.items()
}
"""Name of the flaw: file name, content, and what the one message must say."""
