"""Copies the docstrings of the compiled module into its stub, where editors read them.

Run with the installed or built package importable: `python python/docstrings.py`. A test fails while they differ.
"""

import ast
import inspect
import sys
from pathlib import Path
from typing import Iterator, Optional, Union

Documented = Union[ast.ClassDef, ast.FunctionDef]


def documented(tree: ast.Module, module: object) -> Iterator[tuple[Documented, Optional[str], int]]:
    """Definitions of the stub that exist at run time, with their docstrings there and the stub's indentation."""
    for node in tree.body:
        if not isinstance(node, (ast.ClassDef, ast.FunctionDef)) or not hasattr(module, node.name):
            continue
        found = getattr(module, node.name)
        yield node, inspect.getdoc(found), 4
        for member in node.body if isinstance(node, ast.ClassDef) else []:
            if isinstance(member, ast.FunctionDef) and not member.name.startswith("__"):
                yield member, inspect.getdoc(getattr(found, member.name)), 8


def rewritten(stub: str, module: object) -> str:
    """The stub with the docstrings of the module."""
    lines = stub.split("\n")
    changes = []
    for node, doc, indent in documented(ast.parse(stub), module):
        first = node.body[0]
        written = ast.get_docstring(node, clean=False) is not None
        if doc is None or not (written or isinstance(first, ast.Expr)):
            continue
        space = " " * indent
        text = [(space + line).rstrip() for line in f'"""{doc}"""'.split("\n")]
        if "\n" in doc:
            text = [(space + line).rstrip() for line in f'"""{doc}\n"""'.split("\n")]
        changes.append((first.lineno - 1, first.end_lineno, text))
    for begin, end, text in sorted(changes, reverse=True):
        if lines[begin].strip() == "..." or lines[begin].strip().startswith('"""'):
            lines[begin:end] = text
        else:  # `def f() -> int: ...`
            lines[begin:end] = [lines[begin].removesuffix(" ..."), *text]
    return "\n".join(lines)


if __name__ == "__main__":
    # The folder of the sources has no compiled module.
    sys.path.remove(str(Path(__file__).resolve().parent))
    from farnear import _farnear

    path = Path(__file__).parent / "farnear" / "_farnear.pyi"
    path.write_text(rewritten(path.read_text(), _farnear))
