"""Sphinx builds the pages: pip install '.[docs]' && sphinx-build -W docs site."""

import sys
from pathlib import Path

import rotor_mbs

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "rotor_mbs"
author = copyright = "The rotor_mbs developers"
release = version = rotor_mbs.__version__
extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "myst_nb",
    "docstrings",
    "reference",
    "root_pages",
]
exclude_patterns = ["_ext"]

html_theme = "furo"
html_title = f"rotor_mbs {release}"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["wide.css"]

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
# What a runner with nothing cached needs: the notebooks compile models and references.
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

default_role = "literal"  # docstrings write `name`
autodoc_typehints = "none"
autodoc_member_order = "bysource"
