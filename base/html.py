"""Pages of HTML that need nothing but themselves: no network, no scripts; light and dark."""

from __future__ import annotations

import base64
from html import escape

STYLE = """
:root{color-scheme:light dark;--ground:#fff;--ink:#1b1f24;--line:#d0d7de;--accent:#1f4e79}
@media (prefers-color-scheme:dark){
:root{--ground:#14171b;--ink:#dde3ea;--line:#3a424c;--accent:#7db8e8}}
*{box-sizing:border-box}
body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.5 system-ui,sans-serif}
main{max-width:62rem;margin:0 auto;padding:1.2rem 1rem 3rem}
h1{font-size:1.7rem;line-height:1.2}
h2{font-size:1.25rem;margin:2rem 0 .5rem;padding-top:.6rem;border-top:1px solid var(--line)}
h3{font-size:1.05rem;margin:1.4rem 0 .2rem;color:var(--accent)}
p{margin:.3rem 0;max-width:46rem}
table{font-variant-numeric:tabular-nums;font-size:.92rem}
.dmoc{overflow-x:auto}
pre{overflow-x:auto;font-size:.85rem}
math{font-size:1.08em}
figure{margin:.8rem 0}
figcaption{font-size:.88rem;opacity:.8}
img,svg{max-width:100%;height:auto}
img{border-radius:4px}
.row{display:flex;flex-wrap:wrap;gap:1.5rem;align-items:flex-start}
.row>*{flex:1 1 18rem;min-width:0;max-width:100%}
@media print{main{max-width:none}h2{break-after:avoid}figure,table{break-inside:avoid}}
""".strip()


def page(title: str, body: str) -> str:
    """A whole document."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>"
        f"<body><main><h1>{escape(title)}</h1>{body}</main></body></html>\n"
    )


def section(title: str, body: str) -> str:
    return f"<h2>{escape(title)}</h2>{body}"


def paragraph(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def picture(light: bytes, dark: bytes, caption: str) -> str:
    """A picture within the page, PNG for a light ground and for a dark one."""
    shown, other = (
        f"data:image/png;base64,{base64.b64encode(png).decode()}" for png in (light, dark)
    )
    return _captioned(
        f'<picture><source media="(prefers-color-scheme:dark)" srcset="{other}"/>'
        f'<img alt="{escape(caption)}" src="{shown}"/></picture>',
        caption,
    )


def sparsity(rows: int, columns: int, entries: list[tuple[int, int]], caption: str) -> str:
    """The places of a matrix that are not zero, as a drawing in the colour of the text."""
    squares = "".join(f"M{j} {i}h1v1h-1z" for i, j in entries)
    return _captioned(
        f'<svg viewBox="-0.5 -0.5 {columns + 1} {rows + 1}" width="{min(460, 7 * columns)}" '
        f'role="img" aria-label="{escape(caption)}">'
        f'<rect x="0" y="0" width="{columns}" height="{rows}" fill="none" stroke="currentColor" '
        f'stroke-width="{0.004 * columns:.3f}" opacity=".5"/>'
        f'<path d="{squares}" fill="currentColor"/></svg>',
        caption,
    )


def _captioned(content: str, caption: str) -> str:
    return f"<figure>{content}<figcaption>{escape(caption)}</figcaption></figure>"
