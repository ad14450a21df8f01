"""The pages of lab/: links that lead somewhere."""

from pathlib import Path

import pytest

from pages import headings, links

LAB = Path(__file__).resolve().parent.parent


PAGES = sorted(path for path in LAB.rglob("*.md") if path.parent.name != "blocks")  # those are parts of pages


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path):
    for target, anchor in links(page):
        assert target.exists(), f"{page} links to {target}"
        assert not anchor or anchor in headings(target), f"{page} links to #{anchor} of {target}"
