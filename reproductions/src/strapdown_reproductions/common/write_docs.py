"""Put what a run has written into the page of docs/ that shows it:

    python -m strapdown_reproductions.common.write_docs NAME OUT

NAME is that of `strapdown reproduce`, OUT the folder of its results. For the study of one paper
`python -m strapdown_reproductions.papers.renew` also renews its section in the table of all claims.
"""

import sys
from pathlib import Path

from strapdown.fileio.files import replacing

from . import markdown

DOCS = Path(__file__).resolve().parents[4] / "docs" / "reference" / "evidence"
"""In the source tree: where what studies write is looked up."""
PAGES = {
    "alam": ("findings.md", "alam.md"),
    "bias-decay": ("table.md", "bias-decay.md"),
    "broad": ("table.md", "attitude-broad.md"),
    "consistency": ("table.md", "consistency.md"),
    "faults": ("table.md", "faults.md"),
    "fossen": ("findings.md", "fossen.md"),
    "geometry": ("table.md", "geometry.md"),
    "hager-bryne": ("findings.md", "open-or-closed-loop.md"),
    "installation": ("table.md", "installation-figures.md"),
    "mollaei": ("findings.md", "mollaei.md"),
    "noise": ("table.md", "noise.md"),
    "papers": ("claims.md", "claims.md"),
    "recordings": ("table.md", "every-filter.md"),
    "vehicle-kit": ("table.md", "../../how-to/vehicle.md"),
    "verdicts": ("table.md", "verdicts.md"),
    "worth": ("table.md", "sensor-worth.md"),
    "wrong-sensors": ("table.md", "wrong-sensors.md"),
    "wrong-setups": ("table.md", "wrong-setups.md"),
}
"""{name: (file of the results, page of docs/)}."""
MORE = {
    "alam": ("concordance.md", "alam.md"),
    "consistency": ("each.md", "consistency-each.md"),
    "faults": ("each.md", "faults-each.md"),
    "hager-bryne": ("concordance.md", "open-or-closed-loop.md"),
    "papers": ("seeds.md", "claims.md"),
}
"""The same of a second file and page."""
PICTURES = {"consistency": "consistency.svg", "fossen": "fossen-flight.svg"}
"""{name: file of the results that stands in docs/ as it is}."""


def mark(name: str) -> str:
    """Return the mark in the page above the text of reproduction `name`."""
    return markdown.begin(PAGES[name][0], name)


def insert(page: Path, name: str, text: str) -> None:
    """Put `text` of reproduction `name` between the marks of the Markdown file `page`."""
    markdown.insert(page, text, mark(name))


def main(name: str, out: str) -> None:
    """Put what the run in the folder `out` has written into its page."""
    file, page = PAGES[name]
    insert(DOCS / page, name, (Path(out) / file).read_text(encoding="utf-8"))
    if name in MORE and (Path(out) / MORE[name][0]).exists():
        file, page = MORE[name]
        text = (Path(out) / file).read_text(encoding="utf-8")
        markdown.insert(DOCS / page, text, markdown.begin(file, name))
    if name in PICTURES and (Path(out) / PICTURES[name]).exists():
        with replacing(DOCS / PICTURES[name]) as part:
            part.write_bytes((Path(out) / PICTURES[name]).read_bytes())


if __name__ == "__main__":
    main(*sys.argv[1:])
