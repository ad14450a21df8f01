"""What ARCHITECTURE.md says of the rooms, and which file uses which: for test_architecture.py."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "scripts"))
from rust_source import code_of, without_tests

PATH = re.compile(r"\b(?:crate|super|self)(?:\s*::\s*\w+)+")
USE = re.compile(r"(?:(\bpub(?:\([^)]*\))?)\s+)?\buse\s+([^;]+);")
TEST_MODULE = re.compile(r"#\[cfg\(test\)\]\s*(?:pub(?:\([^)]*\))?\s+)?mod\s+(\w+)\s*;")
SEEN_BY = re.compile(r"\bpub\s*\(\s*in\s[^)]*\)")
CHILD = re.compile(r"\bmod\s+(\w+)\s*;")


@dataclass
class Rooms:
    """One side of the house as ARCHITECTURE.md has it."""

    files: dict[str, set[str]] = field(default_factory=dict)
    """Room -> its files and folders; "" for what lies beside the rooms."""
    order: list[str] = field(default_factory=list)
    """Rooms and files beside them, the ones that all others may use first."""


def stated(text: str, folder: str, side: str) -> Rooms:
    """The folder list below the line of a folder, and the line of order of a side."""
    block = re.search(rf"^{re.escape(folder)}/.*\n((?:    .*\n)*)", text, re.MULTILINE)
    order = re.search(rf"^{side}: (.*(?:\n`.*)*)", text, re.MULTILINE)
    assert block, f"ARCHITECTURE.md: expected a line that starts with {folder}/ in the folder list"
    assert order, f"ARCHITECTURE.md: expected a line that starts with {side}: in the order of rooms"
    rooms, room, listing = Rooms(), "", True
    for line in block.group(1).splitlines():
        indent = len(line) - len(line.lstrip())
        words = line.split()
        if indent == 4:
            room, listing = ("", True)
            if words[0].endswith("/"):
                room = words.pop(0)[:-1]
        if listing:
            named, dash, _ = f" {' '.join(words)} ".partition(" - ")
            rooms.files.setdefault(room, set()).update(named.split())
            listing = not dash
    rooms.order = re.findall(r"`([^`]+)`", order.group(1))
    return rooms


def found(root: Path, suffix: str, faces: Iterable[str]) -> dict[str, set[str]]:
    """The same of the files themselves: room -> stems of its files and names of the folders in it."""
    rooms: dict[str, set[str]] = {}
    for path in sorted(root.rglob(f"*{suffix}")):
        first, *rest = path.relative_to(root).parts
        room, inner = (first, rest) if rest else ("", [first])
        names = rooms.setdefault(room, set())
        names.update(f"{name}/" for name in inner[:-1])
        stem = inner[-1].removesuffix(suffix)
        if stem not in faces and not (room == "" and (root / stem).is_dir()):
            names.add(stem)
    return rooms


Module = tuple[str, ...]
Arrows = dict[Module, set[Module]]


def room_of(module: Module) -> str:
    """The room, or the file beside the rooms, that a module is."""
    return module[0] if module else ""


def backward(arrows: Arrows, order: list[str]) -> list[str]:
    """Arrows between rooms that the order does not allow, and rooms that it does not name."""
    place = {room: index for index, room in enumerate(order)}
    wrong = {f"{room_of(module)} is not in the order" for module in arrows if room_of(module) not in place}
    for module, used in arrows.items():
        for other in used:
            a, b = room_of(module), room_of(other)
            if a != b and a in place and b in place and place[b] > place[a]:
                wrong.add(f"{'/'.join(module)} uses {'/'.join(other)}, but {a} < {b}")
    return sorted(wrong)


def cycles(arrows: Mapping[Module, set[Module]]) -> list[str]:
    """Groups of modules of which each reaches the others."""

    def reach(start: Module) -> set[Module]:
        seen, todo = set[Module](), [start]
        while todo:
            for other in arrows.get(todo.pop(), ()):
                if other not in seen:
                    seen.add(other)
                    todo.append(other)
        return seen

    reached = {module: reach(module) for module in arrows}
    groups = {
        tuple(sorted("/".join(other) for other in reached[module] if module in reached.get(other, ())))
        for module in arrows
        if module in reached[module]
    }
    return sorted(" <-> ".join(group) for group in groups)


def rust_codes(root: Path) -> dict[Module, str]:
    """Module -> its code without tests; the crate's own face, lib.rs, left out."""
    codes, tests = {}, set()
    for path in sorted(root.rglob("*.rs")):
        parts = path.relative_to(root).with_suffix("").parts
        module = parts[:-1] if parts[-1] in ("mod", "lib") else parts
        code = SEEN_BY.sub("pub", code_of(path.read_text(encoding="utf-8")))
        tests.update((*module, name) for name in TEST_MODULE.findall(code))
        if parts != ("lib",):
            codes[module] = without_tests(code)
    return {module: code for module, code in codes.items() if module not in tests}


def use_paths(tree: str) -> Iterator[list[str]]:
    """The paths of a `use`, its groups opened; what it is renamed to does not matter."""
    head, bracket, rest = tree.partition("{")
    before = [word for word in re.split(r"\s*::\s*", head.strip()) if word]
    if not bracket:
        yield [word.split(" as ")[0].strip() for word in before]
        return
    depth, part = 0, ""
    for sign in rest[: rest.rindex("}")] + ",":
        depth += (sign == "{") - (sign == "}")
        if sign == "," and depth == 0:
            if part.strip():
                for path in use_paths(part):
                    yield [*before, *(word for word in path if word != "self")]
            part = ""
        else:
            part += sign


def rust_arrows(root: Path) -> Arrows:
    """Module -> the modules whose names it uses; a name that a module passes on counts for the one it comes from."""
    codes = rust_codes(root)
    children = {module: set(CHILD.findall(code)) for module, code in codes.items()}

    def absolute(module: Module, path: list[str]) -> list[str] | None:
        place = list(module)
        if path[0] == "crate":
            return path[1:]
        if path[0] in children[module]:
            return [*place, *path]
        if path[0] not in ("self", "super"):
            return None
        while path and path[0] in ("self", "super"):
            place = place[:-1] if path[0] == "super" else place
            path = path[1:]
        return [*place, *path]

    passed: dict[tuple[Module, str], list[str]] = {}
    for module, code in codes.items():
        for public, tree in USE.findall(code):
            for path in use_paths(tree) if public else ():
                if target := absolute(module, path):
                    passed[module, path[-1]] = target

    def target_of(path: list[str]) -> Module | None:
        for _ in range(8):
            known = next((path[:end] for end in range(len(path), 0, -1) if tuple(path[:end]) in codes), None)
            if known is None:
                return None
            rest = path[len(known) :]
            if not rest or (tuple(known), rest[0]) not in passed:
                return tuple(known)
            path = [*passed[tuple(known), rest[0]], *rest[1:]]
        return tuple(known)

    arrows: Arrows = {module: set() for module in codes}
    for module, code in codes.items():
        paths = [path for public, tree in USE.findall(code) if not public for path in use_paths(tree)]
        plain = USE.sub(" ", code)
        paths += [re.split(r"\s*::\s*", path) for path in PATH.findall(plain)]
        paths += [
            [name, after] for name in children[module] for after in re.findall(rf"(?<![\w:]){name}::(\w+)", plain)
        ]
        for path in paths:
            target = target_of(whole) if (whole := absolute(module, path)) else None
            if target is not None and target != module:
                arrows[module].add(target)
    return arrows


def python_arrows(root: Path) -> tuple[Arrows, list[str]]:
    """Module -> the modules it imports, wherever in the file; and the imports of the package's face."""
    trees = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        trees[parts[:-1] if parts[-1] == "__init__" else parts] = ast.parse(path.read_text(encoding="utf-8"))
    compiled = {path.relative_to(root).with_suffix("").parts for path in root.rglob("*.pyi")}
    packages = {path.parent.relative_to(root).parts for path in root.rglob("__init__.py")}
    definition = (ast.FunctionDef, ast.ClassDef)
    gathering = {module for module in packages if not any(isinstance(node, definition) for node in trees[module].body)}
    face = root.name

    def imports(module: Module) -> Iterator[tuple[list[str], str | None]]:
        for node in ast.walk(trees[module]):
            if isinstance(node, ast.Import):
                yield from ((name.name.split("."), None) for name in node.names)
            elif isinstance(node, ast.ImportFrom):
                base = (node.module or "").split(".") if node.module else []
                if node.level:
                    up = node.level - (module in packages)
                    base = [face, *module[: len(module) - up], *base]
                yield from ((base, name.name) for name in node.names)

    passed: dict[tuple[Module, str], list[str]] = {}
    for module in packages & set(trees):
        for base, name in imports(module):
            if name and base[:1] == [face] and tuple(base[1:]) != module:
                passed[module, name] = [*base[1:], name]

    def target_of(path: list[str]) -> Module | None:
        for _ in range(8):
            known = next(path[:end] for end in range(len(path), -1, -1) if tuple(path[:end]) in {*trees, *compiled})
            rest = path[len(known) :]
            if not rest or (tuple(known), rest[0]) not in passed or not known:
                return tuple(known)
            path = passed[tuple(known), rest[0]]
        return tuple(known)

    arrows: Arrows = {module: set() for module in trees if module}
    faced = []
    for module in arrows:
        for base, name in imports(module):
            if base[:1] != [face]:
                continue
            target = target_of([*base[1:], *([name] if name else [])])
            if target == ():
                faced.append(f"{'/'.join(module)} imports the package's face")
            elif target in trees and target != module:
                # A package's file that defines nothing only gathers its own modules.
                if module not in gathering or target[: len(module)] != module:
                    arrows[module].add(target)
    return arrows, sorted(set(faced))
