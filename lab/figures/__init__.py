"""The figures that the pages show: runs in runs.json, and Markdown blocks that take their numbers from them."""

from lab.figures.pages import PAGES, Run, load, rendered, updated

__all__ = ["PAGES", "Run", "load", "rendered", "updated"]
