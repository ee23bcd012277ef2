"""The manual: pages in Markdown, the reference from docstrings, the gallery from examples/."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent / "examples")]

import dmoc  # noqa: E402

project = "dmoc"
author = "the dmoc authors"
copyright = "the dmoc authors"
version = release = dmoc.__version__
language = "en"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "diagrams",
    "gallery",
    "github",
]
exclude_patterns = ["_build", "_ext", "examples/*.py", "examples/*.ipynb"]
nitpicky = True
# What docstrings name of other packages, and modules, which have no pages.
nitpick_ignore_regex = [("py:.*", r"(?!dmoc\.).*"), ("py:mod", r"dmoc\..*")]
linkcheck_timeout = 20

# Pages: headings are anchors, $ and $$ are mathematics.
myst_enable_extensions = ["amsmath", "deflist", "dollarmath", "substitution"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
html_math_renderer = "mathml"

# Reference.
autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

# Gallery: all examples but what they share and what needs a cluster.  An example that has not
# changed is not run again.
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "examples",
    "ignore_pattern": r"(example_report|search_dask|__init__)\.py$",
    "filename_pattern": "/",
    "image_scrapers": ("gallery.written",),
    "reset_modules": (),
    "thumbnail_size": (480, 360),
    "within_subsection_order": "gallery.Order",
    "copyfile_regex": r"example_report\.py",
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1,
    "remove_config_comments": True,
}
suppress_warnings = ["config.cache"]

html_theme = "furo"
html_title = f"dmoc {release}"
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["dmoc.css"]
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
copybutton_exclude = ".linenos, .gp, .go"
# What a page prints is not for copying, commands are without their prompt.
copybutton_selector = "div:not(.highlight-output) > div.highlight > pre"
