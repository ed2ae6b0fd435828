"""Settings of the documentation; `make docs` builds it, warnings are errors."""

import sys
from pathlib import Path

from sphinx.application import Sphinx

import motionary

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "extensions"))

project = "motionary"
author = "motionary maintainers"
copyright = "motionary maintainers, Apache-2.0"
version = release = motionary.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "plain_sections",
    "sphinx.ext.napoleon",
    "from_package",
]
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown"}

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

# Single backticks in docstrings are code.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = "motionary"
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["motionary.css"]


def _only_what_there_is(app: Sphinx, page: str, text: list[str]) -> None:
    if page == "index" and not any(HERE.glob("evidence/*.md")):
        text[0] = text[0].partition("## Evidence")[0]


def _outdated(*_: object) -> list[str]:
    return ["index"]


def setup(app: Sphinx) -> None:
    """List the pages of evidence only where there are some."""
    app.connect("source-read", _only_what_there_is)
    app.connect("env-get-outdated", _outdated)
