"""What the kernels of the notebooks run first: figures are drawn by the plotly.js of the site, nothing is
loaded from the network."""

from typing import Any

import plotly.io as pio
from plotly.io.base_renderers import MimetypeRenderer


class OfSite(MimetypeRenderer):  # type: ignore[misc]  # plotly has no types
    """HTML of a figure; the first of a page loads the script, which lies at the root of the site."""

    script: str | bool = "../plotly.min.js"

    def to_mimebundle(self, fig_dict: dict[str, Any]) -> dict[str, str]:
        """{type: text} of a figure."""
        html = pio.to_html(
            fig_dict, include_plotlyjs=self.script, include_mathjax=False, full_html=False
        )
        OfSite.script = False  # renderers are copied for each figure
        return {"text/html": html}


pio.renderers["site"] = OfSite()
pio.renderers.default = "site"
