"""Names of a package that are imported when they are first used; its stub lists them, for this module and for type checkers."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any


def lazily(package: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """`__all__`, `__getattr__` and `__dir__` of a package, from the imports in its `__init__.pyi`."""
    known = vars(sys.modules[package])
    stub = known["__file__"].rpartition(".")[0] + ".pyi"
    imports = [node for node in ast.parse(known["__loader__"].get_data(stub)).body if isinstance(node, ast.ImportFrom)]
    homes = {alias.name: str(node.module) for node in imports for alias in node.names}
    home_of = {name: home for name, home in homes.items() if home.startswith(f"{__package__}.")}

    def get(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
        if name in home_of:
            known[name] = getattr(import_module(home_of[name]), name)
            return known[name]
        if name.isidentifier() and find_spec(f"{package}.{name}") is not None:
            return import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    def listed() -> list[str]:
        from pkgutil import iter_modules

        return sorted({*known, *home_of, *(room.name for room in iter_modules(known["__path__"]))})

    return [name for name, home in homes.items() if home.startswith(str(__package__))], get, listed
