"""How Sphinx builds this site: `sphinx-build -W docs OUT`. What is made from the code is in `made.py`."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import made

import fpsolve

project = "fpsolve"
author = "the fpsolve authors"
project_copyright = "the fpsolve authors"
version = release = fpsolve.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["generated/cases/*", "generated/*.part.md", "tutorials/*", "charts/*"]
default_role = "code"
highlight_language = "none"
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
suppress_warnings = ["ref.python"]  # an attribute that several classes have

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_default_options = {"exclude-members": "model_config, model_post_init"}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

sphinx_gallery_conf = {
    "examples_dirs": ["tutorials", "generated/cases"],
    "gallery_dirs": ["generated/tutorials", "generated/gallery"],
    "filename_pattern": r"\.py",
    "within_subsection_order": "made.OneOfEachKindFirst",
    "image_scrapers": ["matplotlib", "made.pictures_of_results"],
    "show_memory": False,
    "min_reported_time": 10_000,
    "capture_repr": (),
    "show_signature": False,
    "write_computation_times": False,
    "download_all_examples": False,
    "remove_config_comments": True,
}

html_theme = "pydata_sphinx_theme"
html_title = "fpsolve"
html_static_path = ["_static"]
html_sidebars = {
    page: []
    for page in ("start", "theory", "validation", "performance", "contributing", "extending", "inside", "tests")
}
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 6,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": True,
}


def link_tutorials_of_the_site(app, page, text):
    """Lead links to the tutorials in Markdown, which a code host shows, to their pages here, which have figures."""
    text[0] = re.sub(r"\]\(tutorials/(\w+)\.md\)", r"](generated/tutorials/\1.rst)", text[0])


def setup(app):
    """Make the pages that follow from the code before the galleries look for theirs."""
    made.write_all(Path(__file__).parent / "generated")
    app.connect("source-read", link_tutorials_of_the_site)
    app.connect("autodoc-process-docstring", made.plain_docstring, priority=100)
    app.connect("autodoc-process-docstring", made.plain_types, priority=900)
    app.connect("autodoc-process-docstring", made.parameter_list, priority=900)
    app.connect("autodoc-process-signature", made.plain_signature)
