"""Markdown pages as the tests of documentation read them."""

import functools
import re
from pathlib import Path


@functools.cache
def prose(page: Path) -> str:
    """The text without fenced blocks."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def headings(page: Path) -> set[str]:
    """Anchors of a page, as GitHub and MyST make them."""
    found = re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.replace("`", "").lower()).replace(" ", "-") for heading in found}


def links(page: Path) -> list[tuple[Path, str]]:
    """File and anchor of every link that stays in the repository."""
    text = re.sub(r"\s+", " ", prose(page))
    found = re.findall(r"\[[^\]]*\]\((?!https?:)([^)#]*)#?([^)]*)\)", text)
    return [((page.parent / path).resolve() if path else page, anchor) for path, anchor in found]
