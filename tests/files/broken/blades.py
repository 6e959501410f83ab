"""Broken blade files: one flaw each, made from a sound file of tests/data/broken."""

from pathlib import Path

import yaml

DATA = Path(__file__).parents[2] / "data" / "broken"
CSV, AERODYN, WINDIO = ((DATA / f"blade.{suffix}").read_text() for suffix in ("csv", "dat", "yaml"))

_HEAD = "\n".join(AERODYN.splitlines()[:5])
# Nine lists of nine lists of ...: a copy of each alias would fill the memory.
_BILLION = "l0: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
for _level in range(1, 20):
    _BILLION += f"l{_level}: &l{_level} [{', '.join([f'*l{_level - 1}'] * 9)}]\n"
_BLADE = "{outer_shape: {}, reference_axis: {z: *l19}}"
_BILLION += f"components: {{hub: {{diameter: 1}}, blade: {_BLADE}}}\n"

# whole files, where no change of the sound one would do
_WHOLE = {
    "csv: empty": (b"", "is empty"),
    "csv: one row": (b"r_m,chord_m,twist_deg\n0.5,0.1,3\n", "line 2, column r_m = '0.5'"),
    "csv: no header": (b"0.2,0.18,20\n0.6,0.12,9\n", "line 1 = '0.2,0.18,20': has a number where"),
    "csv: beyond the tip": (b"r_over_R,c_over_R,pitch_deg\n0.2,0.1,15\n1.4,1,0\n", "beyond the t"),
    "dat: primary file": (b"--- AERODYN INPUT FILE ---\nA turbine\nTrue Echo\n", "`19 NumBlNds`"),
    "dat: ends after the names": (_HEAD.encode(), "line of units"),
    "yaml: deep": (b"components: " + b"[" * 100_000, "nested deeper"),
    "yaml: aliases by the billion": (_BILLION.encode(), "components.blade.reference_axis.z"),
}


def _broken():
    """Yield the name of each flaw, and its file's name, content and what is said of it."""
    for suffix, flaws in yaml.safe_load((DATA / "flaws.yaml").read_text()).items():
        sound = (DATA / f"blade.{suffix}").read_text()
        for name, old, new, message in flaws:
            assert old in sound, name
            content = sound.replace(old, new, 1).encode()
            yield f"{suffix}: {name}", (f"blade.{suffix}", content, message)
    for name, (content, message) in _WHOLE.items():
        yield name, (f"blade.{name.partition(':')[0]}", content, message)


BROKEN: dict[str, tuple[str, bytes, str]] = dict(_broken())
"""Name of the flaw: file name, content, and what the one message must say."""
