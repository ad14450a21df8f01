"""What scripts/constants needs to know of a Rust file: its code without comments, strings and tests.

Not a parser: it knows tokens and brackets, which is enough for code that rustfmt has set.
"""

from __future__ import annotations

import re

_TEXT = re.compile(
    r"""
    //[^\n]*                                   # a comment to the end of the line
    | /\*.*?\*/                                # one in brackets; ours are not nested
    | b?r(?P<hashes>\#*)".*?"(?P=hashes)       # a raw string
    | b?"(?:\\.|[^"\\])*"                      # a string
    | b?'(?:\\u\{[0-9a-fA-F]+\}|\\.|[^'\\])'   # a character, not a lifetime
    """,
    re.VERBOSE | re.DOTALL,
)
_TEST = re.compile(r"#\[(?:cfg\(test\)|test)\]")
_OPEN, _CLOSE = "([{", ")]}"


def blank(text: str) -> str:
    """As long as the text, line by line, but without any other character than spaces."""
    return re.sub(r"[^\n]", " ", text)


def code_of(text: str) -> str:
    """The text with comments, strings and characters as spaces, every other character where it was."""
    return _TEXT.sub(lambda found: blank(found.group()), text)


def end_of_block(code: str, start: int) -> int:
    """Place behind the bracket that closes the first one at or after `start`; the end of the code without one."""
    depth = 0
    for place in range(start, len(code)):
        if code[place] in _OPEN:
            depth += 1
        elif code[place] in _CLOSE:
            depth -= 1
            if depth == 0:
                return place + 1
    return len(code)


def end_of_item(code: str, start: int) -> int:
    """Place behind the item that starts there: behind its block, or its semicolon if that is first."""
    place = start
    while place < len(code):
        if code[place] == ";":
            return place + 1
        if code[place] == "{":
            return end_of_block(code, place)
        place = end_of_block(code, place) if code[place] in "([" else place + 1
    return place


def end_of_statement(code: str, start: int) -> int:
    """Place behind the semicolon of the statement that goes on there."""
    while start < len(code) and code[start] != ";":
        start = end_of_block(code, start) if code[start] in _OPEN else start + 1
    return start + 1


def without_tests(code: str) -> str:
    """Code without the items that only tests have."""
    while found := _TEST.search(code):
        end = end_of_item(code, found.end())
        code = code[: found.start()] + blank(code[found.start() : end]) + code[end:]
    return code


def line_of(code: str, place: int) -> int:
    """Number of the line of a place, from 1."""
    return code.count("\n", 0, place) + 1
