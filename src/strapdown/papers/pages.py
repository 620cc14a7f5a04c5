"""What every reproduction writes: claims.json, CSV tables and an index.html that shows them."""
import json
from html import escape

from ..files import replacing

STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222;background:#fff}
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.25rem .8rem;border-bottom:1px solid #ccc;text-align:right}
td:first-child,th:first-child{text-align:left}.yes{color:#17692d}.no{color:#a11}caption{text-align:left;color:#555;padding:.3rem 0}
@media(prefers-color-scheme:dark){body{background:#16181c;color:#ddd}td,th{border-color:#444}.yes{color:#7cd992}.no{color:#ff8d85}a{color:#8ab4f8}caption{color:#aaa}}"""


def claim(text, figure, bound, unit):
    """One claim: what was asked for, what was measured, whether it holds (figure <= bound)."""
    return {"claim": text, "target": f"<= {bound:g} {unit}", "figure": f"{figure:.3g} {unit}", "value": float(figure), "bound": float(bound),
            "holds": bool(figure <= bound)}


def write_page(out, title, introduction, claims, tables, links=()):
    """Write claims.json, one CSV per table {name: (caption, DataFrame)} and index.html into the folder `out`, each of them whole."""
    with replacing(out / "claims.json") as part:
        part.write_text(json.dumps(claims, indent=1) + "\n")
    for name, (_, table) in tables.items():
        with replacing(out / f"{name}.csv") as part:
            table.to_csv(part, index=False, float_format="%.6g")
    with replacing(out / "index.html") as part:
        part.write_text(_html(title, introduction, claims, tables, links), encoding="utf-8")


def _html(title, introduction, claims, tables, links):
    verdict = lambda holds: f"<td class='{'yes' if holds else 'no'}'>{'holds' if holds else 'does not hold'}</td>"
    rows = "".join(f"<tr><td>{escape(c['claim'])}</td><td>{escape(c['target'])}</td><td>{escape(c['figure'])}</td>{verdict(c['holds'])}</tr>" for c in claims)
    shown = "".join(f"<table><caption>{escape(caption)} (<a href='{name}.csv'>CSV</a>)</caption>{_rows(table)}</table>" for name, (caption, table) in tables.items())
    pages = "".join(f"<li><a href='{escape(path)}'>{escape(text)}</a></li>" for text, path in links)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>{escape(title)}</title>
<link rel="icon" href="data:,"><style>{STYLE}</style></head><body><h1>{escape(title)}</h1>
{''.join(f'<p>{escape(text)}</p>' for text in introduction)}
<h2>Claims</h2><table><tr><th>claim</th><th>target</th><th>measured</th><th>verdict</th></tr>{rows}</table>
<h2>Tables</h2>{shown}<h2>Reports</h2><ul>{pages}</ul></body></html>
"""


def _rows(table):
    cell = lambda value: f"{value:.3g}" if isinstance(value, float) else escape(str(value))
    head = "".join(f"<th>{escape(str(name))}</th>" for name in table.columns)
    return f"<tr>{head}</tr>" + "".join("<tr>" + "".join(f"<td>{cell(value)}</td>" for value in row) + "</tr>" for row in table.itertuples(index=False))
