"""The pages of lab/: links that lead somewhere."""

from pathlib import Path

import pytest

from pages import headings, links

LAB = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("page", sorted(LAB.rglob("*.md")), ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path):
    for target, anchor in links(page):
        assert target.exists(), f"{page} links to {target}"
        assert not anchor or anchor in headings(target), f"{page} links to #{anchor} of {target}"
