"""What a page holds, unpacked as a browser does it."""

import base64
import json
import re
import zlib

import numpy as np

BLOCK = r"<script type='application/x-deflate' id={}>(.*?)</script>"


def own(page):
    """The HTML of a page without plotly's script, its figures as JSON."""

    def shown(block):
        text = json.dumps(unpacked(block[2])).replace("<", "\\u003c")
        return f"<script type='application/json' id={block[1]}>{text}</script>"

    html = re.sub(BLOCK.format("plotly"), "", page.html)
    return re.sub(BLOCK.format(r"((?:data-p\d+|playback-data))"), shown, html)


def plotly(page):
    """Plotly's script as the page has it; "" where there is none."""
    found = re.search(BLOCK.format("plotly"), page.html)
    return zlib.decompress(base64.b64decode(found[1])).decode() if found else ""


def unpacked(text):
    """What `pack_json` of strapdown.pages.packing was given; columns are lists, None where unknown."""
    head, numbers = zlib.decompress(base64.b64decode(text)).split(b"\n", 1)
    return json.loads(head, object_hook=lambda value: _column(value, numbers))


def _column(value, numbers):
    if "packed" not in value:
        return value
    begin, n, step = value["packed"]
    planes = np.frombuffer(numbers, np.uint8, 4 * n, begin).reshape(4, n)
    folded = np.ascontiguousarray(planes.T).view("<u4")[:, 0].astype(np.int64)
    column = (np.cumsum((folded >> 1) ^ -(folded & 1)) * step).tolist()
    for first, number in zip(value["unknown"][::2], value["unknown"][1::2]):
        column[first : first + number] = [None] * number
    return column
