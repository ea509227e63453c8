"""Sphinx settings of the book; `build.py` lays out the sources and calls Sphinx."""

project = "seanav"
author = "the seanav authors"
copyright = "the seanav authors; text and figures CC BY 4.0"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
html_theme = "furo"
html_title = "seanav"
html_static_path = ["_static"]
html_css_files = ["book.css"]
# Nothing is fetched: the pages work without a network.
mathjax_path = "mathjax/tex-svg.js"
html_show_sourcelink = False
# What is stored in the notebooks is shown; nothing is executed.
nb_execution_mode = "off"
nb_merge_streams = True
nb_render_image_options = {"width": "100%"}
nb_custom_formats = {}
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_dmath_double_inline = True
myst_heading_anchors = 3
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
suppress_warnings = ["mystnb.unknown_mime_type"]
exclude_patterns = ["downloads", "_static"]
