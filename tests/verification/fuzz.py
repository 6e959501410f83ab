"""Hostile input: mutilated case and data files are accepted, or refused in one line."""

import time
from collections import Counter

import hypothesis
from hypothesis import strategies as st

from hkt_mdo.case import load_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.cases import shipped_cases
from hkt_mdo.files.shipped import data_path, shipped_names
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.studies.common import markdown_table

DATA = {"polar": PolarFamily.from_file, "outline": Outline.from_file, "blade": read_blade}
READERS = {"case": lambda path: physics(load_case(path))} | DATA
_JUNK = (
    b"nan", b"1e999", b"-0", b"{", b"]", b"&a", b"*a", b"!!python/name:os", b"\x00", b"\n", b"\r",
    b",", b":", b"#", b"1 m/s", b"1e-320 m", b"null", b"[]", b"9" * 400,
)  # fmt: skip


def fuzz(study) -> list[str]:
    """Read mutilated case and data files, made by Hypothesis.

    Goal: accepted, or refused in one line (exit code 2) within a second.
    """
    folder = study.out / "fuzz"
    folder.mkdir(parents=True, exist_ok=True)
    cases = sorted((shipped_cases()).glob("*.yaml"))
    originals = {"case": [load_case(path).to_yaml().encode() for path in cases]}
    originals["case"] += [path.read_bytes() for path in cases]
    for kind in DATA:
        originals[kind] = [data_path(name, kind).read_bytes() for name in shipped_names(kind)]
    rows, broken = [], []
    for kind, reader in READERS.items():
        path = folder / ("case.yaml" if kind == "case" else f"{kind}.csv")
        words, slowest, errors = _read_mutilated(reader, originals[kind], path, study)
        study.done(path, f"{study.count} examples")
        broken += [f"- {kind}: {error}" for error in errors[:5]]
        total, accepted, refused = words.total(), words["accepted"], words["refused"]
        counts = total, accepted, refused, total - accepted - refused
        rows.append([kind, *map(str, counts), f"{1e3 * slowest:.0f}"])
    header = "file", "examples", "accepted", "refused in one line", "anything else", "slowest (ms)"
    return [*markdown_table(header, rows), "", *broken]


def _read_mutilated(reader, originals, path, study):
    """Return how often a reader said what, its longest time (s) and the errors it let through."""
    words, times, errors = Counter(), [], []

    def apply(content, edits):
        for place, length, insertion in edits:
            place %= len(content) + 1
            content = content[:place] + insertion + content[place + length :]
        return content

    junk = st.one_of(
        st.binary(max_size=8),
        st.text(max_size=8).map(lambda text: text.encode("utf-8", "surrogatepass")),
        st.floats().map(lambda number: repr(number).encode()),
        st.sampled_from(_JUNK),
    )
    edit = st.tuples(st.integers(0, 10**6), st.integers(0, 30), junk)
    edits = st.lists(edit, min_size=1, max_size=6)
    edited = st.builds(apply, st.sampled_from(originals), edits)

    @hypothesis.seed(study.seed)
    @hypothesis.settings(
        max_examples=study.count,
        database=None,
        deadline=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(edited | st.binary(max_size=200))
    def read(content):
        path.write_bytes(content)
        began = time.perf_counter()
        try:
            reader(path)
            words["accepted"] += 1
        except InputError as error:
            words["refused" if str(error).isprintable() else "unprintable"] += 1
        except Exception as error:
            word = type(error).__name__
            words[word] += 1
            errors.append(f"{word}: {str(error)[:200]} in `{content[:200]!r}`")
        times.append(time.perf_counter() - began)

    read()
    return words, max(times), errors
