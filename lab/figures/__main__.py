"""Write the figures into the pages: `python -m lab.figures [--check] [--pictures [--data D]]`.

Numbers come from runs.json; change them there, after a run of the command that is named beside them. `--check` only compares,
and names the pages that differ. `--pictures` draws docs/demo.webp (the bundled recording), docs/joint-frames.png and
docs/failures.png (a rendered recording of the data folder, by default ../shared/data) with this build.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from lab.figures.pages import PAGES, ROOT, load, updated


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare, and change nothing")
    parser.add_argument("--pictures", action="store_true", help="draw the pictures of the documentation as well")
    default = Path(os.environ.get("VOODOO_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=default, help="folder of the measurement data")
    options = parser.parse_args()
    machines, runs = load()
    stale = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        new = updated(text, machines, runs)
        if new != text:
            stale.append(page)
            if not options.check:
                page.write_text(new, encoding="utf-8")
    for page in stale:
        print(f"{page.relative_to(ROOT)}: {'differs from runs.json' if options.check else 'written'}")
    if options.pictures:
        from lab.figures.pictures import draw

        draw(options.data)
    return 1 if options.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
