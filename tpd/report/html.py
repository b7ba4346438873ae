"""A page for people: one HTML file with its pictures inside, which needs no network and no JavaScript.

Made of sections, each a title and HTML; the helpers here escape all that they are given.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tpd.core.formatting import number

_STYLE = """
body { font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; color: #1a1a1a; background: #fff;
  max-width: 66rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin-bottom: .3rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; border-bottom: 1px solid #bbb; }
table { border-collapse: collapse; font-size: .92rem; margin: .6rem 0; }
th, td { padding: .25rem .8rem .25rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid #ddd; }
th { border-bottom: 2px solid #555; vertical-align: bottom; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
td.n { white-space: nowrap; }
figure { margin: .6rem 0 1.2rem; }
figure img { max-width: 100%; height: auto; }
figcaption, caption { color: #444; font-size: .9rem; text-align: left; max-width: 48rem; }
caption { caption-side: bottom; padding-top: .3rem; }
pre { background: #f4f4f4; border: 1px solid #ddd; padding: .6rem .8rem; font-size: .88rem;
  white-space: pre-wrap; overflow-wrap: anywhere; }
.verdict, .danger { border-left: 6px solid #555; background: #f4f4f4; padding: .6rem .9rem; margin: .6rem 0; }
.danger { border-color: #a11; background: #fff1ef; font-weight: 600; }
.wide { overflow-x: auto; }
.beside { display: flex; flex-wrap: wrap; gap: 0 1.5rem; align-items: flex-end; }
.beside figcaption { width: 0; min-width: 100%; }
@media print {
  body { font-size: 10pt; max-width: none; margin: 0; }
  figure, tr, .danger, .verdict { break-inside: avoid; }
  h2 { break-after: avoid; }
  figure img { max-height: 15cm; width: auto; }
  table { font-size: 8.5pt; }
  .wide { overflow: visible; }
  .beside { display: block; }
  .beside img { max-height: 9.5cm; }
}
"""

_NUMBER = re.compile(r"[+-]?\d[\d.]*%?")
_KINDS = {b"\x89PNG": "image/png", b"GIF8": "image/gif"}


@dataclass(frozen=True)
class Section:
    """A titled part of a page; `html` is taken as it stands."""

    title: str
    html: str


def page(title: str, sections: Iterable[Section]) -> str:
    """The whole page."""
    body = "\n".join(f"<section>\n<h2>{_safe(s.title)}</h2>\n{s.html}\n</section>" for s in sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_safe(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{_safe(title)}</h1>\n{body}\n</body>\n</html>\n"
    )


def paragraph(text: str, kind: str = "") -> str:
    """Words; `kind` may be "verdict" or "danger", which stand out."""
    return f"<p{_class(kind)}>{_safe(text)}</p>"


def listing(items: Iterable[str]) -> str:
    """A list, an item a sentence or so."""
    return "<ul>\n" + "\n".join(f"<li>{_safe(item)}</li>" for item in items) + "\n</ul>"


def code(text: str) -> str:
    """What is to be typed, or stands in a file."""
    return f"<pre>{_safe(text)}</pre>"


def table(head: Sequence[str], rows: Iterable[Sequence[object]], *, caption: str = "") -> str:
    """A table: floats written by `number`, the rest as it is; None and NaN are dashes, and columns of numbers
    stand to the right.

    Raises:
        ValueError: a row with another number of cells than the head.
    """
    listed = [list(row) for row in rows]
    for row in listed:
        if len(row) != len(head):
            raise ValueError(f"a row must have {len(head)} cells as the head has, but has {len(row)}")
    columns = [[row[i] for row in listed if row[i] is not None] for i in range(len(head))]
    right = [bool(column) and all(_is_number(x) for x in column) for column in columns]
    lines = ['<div class="wide"><table>']
    lines += [f"<caption>{_safe(caption)}</caption>"] if caption else []
    lines.append(
        "<thead><tr>" + "".join(_cell("th", x, r) for x, r in zip(head, right, strict=True)) + "</tr></thead>"
    )
    lines.append("<tbody>")
    lines += [
        "<tr>" + "".join(_cell("td", x, r) for x, r in zip(row, right, strict=True)) + "</tr>"
        for row in listed
    ]
    return "\n".join([*lines, "</tbody></table></div>"])


def figure(image: bytes, *, alt: str, caption: str) -> str:
    """A picture, inside the page: PNG or GIF.

    Raises:
        ValueError: another kind of picture, or nothing that stands for it in words.
    """
    kind = next((mime for start, mime in _KINDS.items() if image.startswith(start)), None)
    if kind is None:
        raise ValueError("`image` must be a PNG or a GIF")
    if not alt:
        raise ValueError("`alt` must say what is to be seen, but is empty")
    data = base64.b64encode(image).decode()
    return (
        f'<figure>\n<img alt="{_safe(alt)}" src="data:{kind};base64,{data}">\n'
        f"<figcaption>{_safe(caption)}</figcaption>\n</figure>"
    )


def beside(*parts: str) -> str:
    """Pieces of a page next to each other, where there is room for it."""
    return '<div class="beside">\n' + "\n".join(parts) + "\n</div>"


def _is_number(x: object) -> bool:
    number_like = isinstance(x, str) and _NUMBER.fullmatch(x) is not None
    return number_like or (isinstance(x, (int, float)) and not isinstance(x, bool))


def _cell(tag: str, content: object, right: bool) -> str:
    text = "–" if content is None else number(content) if isinstance(content, float) else str(content)
    return f"<{tag}{_class('n' if right else '')}>{_safe(text)}</{tag}>"


def _class(name: str) -> str:
    return f' class="{name}"' if name else ""


def _safe(text: str) -> str:
    return html.escape(text)
