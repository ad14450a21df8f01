"""How Sphinx builds these pages: `scripts/docs`. Every warning is an error."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import voodoo  # the installed package: the reference is generated from it

project = "voodoo"
author = "the voodoo maintainers"
project_copyright = author
release = version = voodoo.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "generated"]
exclude_patterns = ["_build"]
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence", "deflist"]

html_theme = "furo"
html_title = f"voodoo {release}"
smartquotes_action = "D"  # dashes; quotes stay as they are written
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}

default_role = "code"  # docstrings put code between single backticks
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"npt.ArrayLike": "ArrayLike"}
toc_object_entries_show_parents = "hide"
python_maximum_signature_line_length = 88
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False

# Every name that looks like ours has to resolve; types of other packages are not linked.
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!voodoo\.).*"),
    ("py:.*", r"voodoo\._core\..*"),
    ("py:.*", r"voodoo\..*\.[A-Z]"),  # type variables
    ("py:.*", r"voodoo\.sensors\.skin\.tracker\..*"),  # what a front end keeps for itself
]
