"""Put the study of one paper that was run again into its page of docs/, and its section of the table
of all claims:

    python -m strapdown_reproductions.papers.renew NAME OUT

NAME is one of PAPERS, OUT the folder of its results. A verdict that changes needs a row under
"Verdicts that changed" of that page.
"""

import json
import sys
from pathlib import Path
from typing import Any

from ..common import markdown, write_docs
from .main import PAPERS, section


def with_section(text: str, name: str, own: list[dict[str, Any]]) -> str:
    """The text of claims.md with the section of one paper anew."""
    before, _, rest = text.partition(f"## {PAPERS[name].authors}\n")
    _, next_heading, after = rest.partition("\n## ")
    return before + section(name, own) + "\n" + next_heading + after


def main(name: str, out: str) -> None:
    """Write the page of the paper and its section."""
    write_docs.main(name, out)
    own = json.loads((Path(out) / "claims.json").read_text(encoding="utf-8"))
    page, mark = write_docs.DOCS / write_docs.PAGES["papers"][1], write_docs.mark("papers")
    markdown.insert(page, with_section(markdown.read_marked(page, mark), name, own), mark)


if __name__ == "__main__":
    main(*sys.argv[1:])
