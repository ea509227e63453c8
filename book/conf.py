"""Sphinx settings of the book; `build.py` lays out the sources and calls Sphinx."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "seanav"
author = "the seanav authors"
copyright = "the seanav authors; text and figures CC BY 4.0"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinxcontrib.bibtex",
    "links",
]
bibtex_bibfiles = ["references.bib"]
html_theme = "furo"
html_title = "seanav"
html_static_path = ["_static"]
html_extra_path = ["files"]
html_css_files = ["book.css"]
# Nothing is fetched: the pages work without a network, and from a disk, where a browser
# does not let the search read other pages for their first lines.
mathjax_path = "mathjax/tex-svg.js"
html_show_search_summary = False
nb_ipywidgets_js = {}
html_show_sourcelink = False
# The page of the functions and the search say what is where.
html_domain_indices = False
html_copy_source = False
# What is stored in the notebooks is shown; nothing is executed.
nb_execution_mode = "off"
nb_merge_streams = False  # `chapters.py` merges neighbours only: captions stay at their pictures
nb_custom_formats = {}
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_dmath_double_inline = True
myst_heading_anchors = 3
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
# Types are words such as "array" and "(runs, steps)": they are printed, not looked up.
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = True
suppress_warnings = ["mystnb.unknown_mime_type", "ref.python"]
exclude_patterns = ["files", "_static", "code/*.py"]
