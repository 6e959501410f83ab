"""The size of the package: its lines of code."""

import ast
import io
import tokenize
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "hkt_mdo"
MODULES = sorted(PACKAGE.rglob("*.py"))

MOST_LINES = 20_193

BLANK = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}


def docstrings(tree):
    """Return the lines of all docstrings of a module, and of texts that describe an attribute."""
    return {
        line
        for node in ast.walk(tree)
        for child in ast.iter_child_nodes(node)
        if isinstance(child, ast.Expr) and isinstance(getattr(child.value, "value", None), str)
        for line in range(child.lineno, child.end_lineno + 1)
    }


def code_lines(text):
    """Return the lines of a module that are neither blank, nor comment, nor docstring."""
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in BLANK:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return lines - docstrings(ast.parse(text))


def test_the_package_is_small_enough():
    assert sum(len(code_lines(path.read_text(encoding="utf-8"))) for path in MODULES) <= MOST_LINES


def test_what_counts_as_code():
    text = '"""Doc."""\n\nx = (  # comment\n    1,\n\n)\n"""Attribute."""\n# no\ny = """a\n\nb"""\n'
    assert code_lines(text) == {3, 4, 6, 9, 10, 11}
