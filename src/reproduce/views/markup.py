"""Small pieces of HTML that several pages share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from markupsafe import Markup


def html_table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    caption: str,
    style: str = "table",
    anchors: Sequence[str] = (),
) -> str:
    """Return a table; the first column names the row, which has the anchor at its place if any.

    Cells that are `Markup` stay as they are, others are escaped.
    """
    top = Markup("").join(Markup('<th scope="col">{}</th>').format(cell) for cell in head)
    body = Markup("")
    for position, (name, *cells) in enumerate(rows):
        mark = Markup(' id="{}"').format(anchors[position]) if anchors else ""
        rest = Markup("").join(Markup("<td>{}</td>").format(cell) for cell in cells)
        body += Markup('<tr{}><th scope="row">{}</th>{}</tr>').format(mark, name, rest)
    whole = Markup(
        '<table class="{}"><caption>{}</caption><thead><tr>{}</tr></thead><tbody>{}</tbody></table>'
    )
    return str(whole.format(style, caption, top, body))
