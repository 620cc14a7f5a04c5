"""What Sphinx is told. `make_site.py` stages the pages and runs it: `make docs`."""

import os
import shutil
import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import plotly  # noqa: E402

import strapdown  # noqa: E402

project = "strapdown"
version = release = strapdown.__version__
author = "the authors of strapdown"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton", "docstrings"]
exclude_patterns = ["_gallery", "**/.ipynb_checkpoints"]
templates_path: list[str] = []
nitpicky = False
default_role = "literal"  # docstrings name code in single backquotes

smartquotes = False  # names and options stay as they are typed

myst_heading_anchors = 4
myst_links_external_new_tab = False
suppress_warnings = ["myst.header"]  # evidence that commands write begins with ### under a ##

nb_execution_mode = "cache"
nb_execution_cache_path = os.environ["STRAPDOWN_NOTEBOOKS"]
nb_execution_raise_on_error = True
nb_execution_timeout = 300
kernels = Path(os.environ["STRAPDOWN_NOTEBOOKS"]).parent / "ipython"
(kernels / "profile_default" / "startup").mkdir(parents=True, exist_ok=True)
shutil.copy(HERE / "kernel.py", kernels / "profile_default" / "startup")
os.environ["IPYTHONDIR"] = str(kernels)

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
add_module_names = False

html_theme = "furo"
html_title = f"strapdown {release}"
html_static_path = [str(HERE / "static")]
html_extra_path = [str(Path(plotly.__file__).parent / "package_data" / "plotly.min.js")]
html_css_files = ["site.css"]
html_search_scorer = str(HERE / "static" / "scorer.js")
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0b5394",
        "color-brand-content": "#0b5394",
    },
    "dark_css_variables": {
        "color-brand-primary": "#7db8f0",
        "color-brand-content": "#7db8f0",
    },
}
copybutton_exclude = ".linenos, .gp"

POLICY = "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; connect-src 'self'"
"""Content security: what the site itself holds, and nothing from elsewhere."""


def setup(app: Sphinx) -> None:
    def guard(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: Any) -> None:
        tag = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        context["metatags"] = tag + context.get("metatags", "")

    app.connect("html-page-context", guard)
