"""How blocks are written for a page."""

from __future__ import annotations

from collections.abc import Iterable

from markupsafe import Markup, escape

from reproduce.views.writing.blocks import Block, Box, Entry, Fold, Grid, Html
from reproduce.views.writing.numbers import powers_in_html


def html(blocks: Iterable[Block]) -> str:
    """Write blocks as HTML."""
    return powers_in_html(_joined(blocks))


def _joined(blocks: Iterable[Block]) -> Markup:
    return Markup("\n").join(map(_block_html, blocks))


def _block_html(block: Block) -> Markup:
    if isinstance(block, Html):
        return Markup(block.text)
    if isinstance(block, Grid):
        return _table_html(block)
    if isinstance(block, Fold):
        fold = '<details class="rp-details"{}>\n<summary>{}</summary>\n{}\n</details>'
        opened = Markup(" open" if block.opened else "")
        return Markup(fold).format(opened, block.summary, _joined(block.blocks))
    return Markup('<p class="rp-joint">{}</p>').format(block)


def _table_html(grid: Grid) -> Markup:
    th = '<th scope="{}">{}</th>'.format
    head = "".join(th("col", escape(name)) for name in grid.head)
    marks = [f' id="{escape(name)}"' for name in grid.anchors] or [""] * len(grid.rows)
    rows = "\n".join(
        f"<tr{mark}>{th('row', escape(row[0]))}{''.join(map(_td, row[1:]))}</tr>"
        for mark, row in zip(marks, grid.rows, strict=True)
    )
    anchor = f' id="{escape(grid.identifier)}"' if grid.identifier else ""
    label = escape(Markup(escape(grid.caption)).striptags())
    return Markup(
        f'<div class="rp-scroll"{anchor} tabindex="0" role="region" aria-label="{label}">'
        f'\n<table class="{f"rp-table {grid.kind}".strip()}">'
        f"<caption>{escape(grid.caption)}</caption>"
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody></table></div>"
    )


def _td(entry: Entry | Box) -> str:
    one = entry if isinstance(entry, Box) else Box(entry)
    named = (("id", one.identifier), ("class", one.kind))
    marks = "".join(f' {name}="{escape(value)}"' for name, value in named if value)
    lines = one.content if isinstance(one.content, tuple) else (one.content,)
    return f"<td{marks}>{Markup('<br>').join(line for line in lines if line)}</td>"
