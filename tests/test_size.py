"""The size of the package: lines of code by package, long functions, many parameters."""

import ast
import io
import tokenize
from collections import Counter
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "hkt_mdo"
MODULES = sorted(PACKAGE.rglob("*.py"))

MOST_LINES = 25_120
LONGEST_FUNCTION = 60
MOST_PARAMETERS = 8

BLANK = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}
FUNCTIONS = ast.FunctionDef, ast.AsyncFunctionDef


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


def functions(tree, outer=None, within=""):
    """Yield each function of a module with its class, if it has one, and its qualified name."""
    for node in ast.iter_child_nodes(tree):
        name = f"{within}{node.name}" if hasattr(node, "name") else within
        if isinstance(node, FUNCTIONS):
            yield node, outer, name
        inner = node if isinstance(node, ast.ClassDef) else None
        yield from functions(node, inner, f"{name}." if hasattr(node, "name") else within)


def length(function):
    """Return the lines from `def` to the last one, without the docstring."""
    text = function.body[0]
    has = isinstance(text, ast.Expr) and isinstance(getattr(text.value, "value", None), str)
    docstring = text.end_lineno - text.lineno + 1 if has else 0
    return function.end_lineno - function.lineno + 1 - docstring


def parameters(function, owner):
    """Return the number of parameters, without `self` or `cls` of a method."""
    given = function.args
    count = len(given.posonlyargs + given.args + given.kwonlyargs)
    count += (given.vararg is not None) + (given.kwarg is not None)
    decorators = {ast.unparse(each) for each in function.decorator_list}
    return count - (owner is not None and "staticmethod" not in decorators)


def may_have_many(path, function, owner):
    """Return whether a function is a command, a compiled kernel or makes a value."""
    decorators = " ".join(map(ast.unparse, function.decorator_list))
    command = path.parent.name == "cli"
    return command or "compiled" in decorators or "njit" in decorators or is_value(owner)


def is_value(owner):
    """Return whether a class is a dataclass or a NamedTuple."""
    if owner is None:
        return False
    texts = map(ast.unparse, (*owner.decorator_list, *owner.bases))
    return any(word in text for text in texts for word in ("dataclass", "NamedTuple"))


def offenders(excess):
    """Return a line for each function of which `excess` tells a number above what is allowed."""
    return [
        f"{path.relative_to(PACKAGE)}:{function.lineno} {name}: {number}"
        for path in MODULES
        for function, owner, name in functions(ast.parse(path.read_text(encoding="utf-8")))
        if (number := excess(path, function, owner))
    ]


def test_the_package_is_small_enough(capsys):
    rooms = Counter()
    for path in MODULES:
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        rooms[room] += len(code_lines(path.read_text(encoding="utf-8")))
    with capsys.disabled():
        print("\nlines of code:", *(f"{room} {lines:,}" for room, lines in rooms.most_common()))
        print(f"together {rooms.total():,}, at most {MOST_LINES:,}")
    assert rooms.total() <= MOST_LINES


def test_no_function_is_long():
    def excess(_, function, __):
        return length(function) if length(function) > LONGEST_FUNCTION else 0

    found = offenders(excess)
    assert not found, "\n".join(found)


def test_no_function_has_many_parameters():
    def excess(path, function, owner):
        count = parameters(function, owner)
        return count if count > MOST_PARAMETERS and not may_have_many(path, function, owner) else 0

    found = offenders(excess)
    assert not found, "\n".join(found)


def test_what_counts_as_code():
    text = '"""Doc."""\n\nx = (  # comment\n    1,\n\n)\n"""Attribute."""\n# no\ny = """a\n\nb"""\n'
    assert code_lines(text) == {3, 4, 6, 9, 10, 11}
    method = 'def f(self, a, *b, c, **d):\n        """D.\n\n        """\n        x'
    tree = ast.parse(f"class A:\n    {method}")
    ((function, owner, name),) = functions(tree)
    assert (length(function), parameters(function, owner), name) == (2, 4, "A.f")
