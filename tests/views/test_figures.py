"""Every graph: seen in light, in the dark, in grey, in print and on a phone."""

import functools
import itertools
import re

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path

import reproduce as rp
from reproduce.locate import schematic_files
from reproduce.papers.catalogue import drawings
from reproduce.printed.cells import library
from reproduce.views import figure as figures
from reproduce.views.figure import _inline, _vector_of
from reproduce.views.numbers import powers
from reproduce.views.verdicts import filled

NARROWED = "on a phone"
# Each as a wide page shows it, and as a narrow one; schematics are tested in a browser.
NAMES = [
    name
    for key in (*figures.drawable(), *drawings())
    if not schematic_files(key)
    for name in (key, f"{key} {NARROWED}")
]
# The theme's backgrounds, and what it writes with; black in a figure becomes the latter.
PAGES = {"light": ("#ffffff", "#222832"), "dark": ("#14181e", "#ced6dd")}
# WCAG 2.1, success criteria 1.4.11 (graphics) and 1.4.3 (text).
GRAPHICS, TEXT = 3.0, 4.5
# Inches that a phone of 390 CSS pixels shows beside its margins, and the least points of a text.
PHONE, LEAST = 358 / 96, 8.0


@functools.cache
def drawn(name):
    """Return a figure, laid out."""
    key, _, narrowed = name.partition(" ")
    figure = figures.draw(key, narrow=bool(narrowed))
    FigureCanvasAgg(figure).draw()
    return figure


def luminance(colour):
    channels = np.asarray(to_rgba(colour)[:3])
    linear = np.where(
        channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4
    )
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def over(colour, ground):
    """Return what a colour with its alpha looks like on a ground."""
    *rgb, alpha = to_rgba(colour)
    return tuple(
        alpha * np.asarray(rgb) + (1 - alpha) * np.asarray(to_rgba(ground)[:3])
    )


def seen(colour, alpha, page):
    """Return a colour as a page shows it."""
    ground, ink = PAGES[page]
    colour = to_rgba(colour, alpha)
    if colour[:3] == (0.0, 0.0, 0.0):
        colour = to_rgba(ink, colour[3])
    return over(colour, ground)


def series(axes):
    """Return what carries meaning in some axes: lines, arrows, outlines, points."""
    # The bars of an error go with its marker, which is looked at itself.
    bars = [
        bar for group in axes.containers for part in group.lines[1:] for bar in part
    ]
    kept = [a for a in (*axes.lines, *axes.patches, *axes.collections) if a not in bars]
    return [
        artist for artist in kept if artist.get_visible() and not on_image(axes, artist)
    ]


def on_image(axes, artist):
    """Tell whether something lies on a raster, which has a ground of its own."""
    return bool(axes.images) or any(
        type(c).__name__ == "QuadMesh" for c in axes.collections
    )


def colours(artist):
    """Return the colours of a mark, of which one must stand out: line, edge or face."""
    alpha = artist.get_alpha()
    if isinstance(artist, Line2D):
        drawn_line = artist.get_linestyle() not in {"None", "", " "}
        found = [artist.get_color()] if drawn_line else []
        if artist.get_marker() not in {"None", "", " ", None}:
            found.append(artist.get_markeredgecolor())
        return [(colour, alpha) for colour in found]
    edges, faces = artist.get_edgecolor(), artist.get_facecolor()
    rows = [edges, faces] if isinstance(artist, Patch) else [*edges, *faces]
    return [(row, None) for row in rows]


@pytest.mark.parametrize("name", NAMES)
def test_every_mark_and_word_stands_out_from_the_page(name):
    assert contrast("white", "black") == pytest.approx(21.0)
    assert contrast("#777777", "white") == pytest.approx(4.48, abs=0.005)
    for page, (ground, _) in PAGES.items():
        for axes in drawn(name).axes:
            for artist in filter(colours, series(axes)):
                found = [contrast(seen(*one, page), ground) for one in colours(artist)]
                assert max(found) >= GRAPHICS, f"{artist}: {colours(artist)}"
        for text, axes in texts(drawn(name)):
            if axes is not None and on_image(axes, text) and text in axes.texts:
                continue
            on_raster = axes is not None and bool(axes.images and axes.get_legend())
            colour = seen(text.get_color(), text.get_alpha(), page)
            assert on_raster or contrast(colour, ground) >= TEXT, text


def texts(figure):
    """Return every piece of text that a figure shows, with the axes it stands in."""
    found = []
    for axes in figure.axes:
        legend = axes.get_legend()
        pieces = [*axes.texts, axes.title, *(legend.get_texts() if legend else ())]
        if axes.axison:
            pieces += [axes.xaxis.label, axes.yaxis.label]
            for index, axis in enumerate((axes.xaxis, axes.yaxis)):
                low, high = sorted(axis.get_view_interval())
                ticks = axis.get_ticklabels(which="both")
                pieces += [t for t in ticks if low <= t.get_position()[index] <= high]
        found += [(t, axes) for t in pieces if t.get_text().strip() and t.get_visible()]
    for legend in figure.legends:
        found += [(t, None) for t in legend.get_texts()]
    return found


def look(artist):
    """Return how a mark looks in grey: dashes, marker, filling, hatch, and roughly how thick."""
    if isinstance(artist, Line2D):
        faces = {artist.get_fillstyle(), str(artist.get_markerfacecolor())}
        # Steps that an eye can distinguish.
        thick = round(2 * np.log2(artist.get_linewidth()))
        line = artist.get_linestyle()
        return line, artist.get_marker(), "none" in faces, line != "None" and thick
    paths = [artist.get_path()] if isinstance(artist, Patch) else artist.get_paths()
    corners = [len(path.vertices) for path in paths]
    return artist.get_hatch(), str(artist.get_linestyle()), corners


def hue(artist):
    found = colours(artist)
    return to_rgba(found[0][0])[:3] if found else None


@pytest.mark.parametrize("name", NAMES)
def test_what_differs_in_colour_differs_without_it(name):
    for axes in drawn(name).axes:
        for one, other in itertools.combinations(series(axes), 2):
            if type(one) is not type(other) or hue(one) == hue(other):
                continue
            assert look(one) != look(other), f"{one} and {other} differ in colour alone"


def boxes(figure):
    """Return every text with its box on the paper, without its margin."""
    renderer = figure.canvas.get_renderer()
    found = [
        (text, axes, text.get_window_extent(renderer)) for text, axes in texts(figure)
    ]
    return [
        (t, axes, box.padded(-0.12 * min(box.width, box.height)))
        for t, axes, box in found
    ]


def strokes(axes):
    """Return the lines, outlines and arrows of some axes, on the paper."""
    for artist in series(axes):
        if isinstance(artist, Collection):
            continue
        if isinstance(artist, Line2D) and artist.get_linestyle() in {"None", ""}:
            continue
        path = artist.get_transform().transform_path(artist.get_path())
        for points in path.to_polygons(closed_only=False):
            yield artist, Path(points)


@pytest.mark.parametrize("name", NAMES)
def test_every_text_is_whole_free_and_large_enough(name):
    figure, paper = drawn(name), drawn(name).bbox
    found = boxes(figure)
    for (one, _, first), (other, _, second) in itertools.combinations(found, 2):
        assert not first.overlaps(second), f"{one.get_text()!r} on {other.get_text()!r}"
    for text, axes, box in found:
        assert paper.x0 <= box.x0 < box.x1 <= paper.x1, text
        assert paper.y0 <= box.y0 < box.y1 <= paper.y1, text
        assert text.get_fontsize() >= LEAST, text
        for artist, path in strokes(axes) if axes is not None else ():
            if not artist.get_clip_on() or box.overlaps(axes.bbox):
                crossed = path.intersects_bbox(box, filled=False)
                assert not crossed, f"{text.get_text()!r} and {artist}"
    assert figure.get_figwidth() <= (PHONE if name.endswith(NARROWED) else 6.8)


@pytest.mark.parametrize("name", NAMES)
def test_black_follows_the_page(name):
    html = _inline([_vector_of(drawn(name))], "x", "what it shows")
    assert re.search(r'<svg [^>]*fill="currentColor"', html), (
        "SVG fills in black by itself"
    )
    assert not re.search(r"#000000\b|\bblack\b", html)


def test_an_alternative_text_is_filled_with_numbers_of_the_ledger():
    text = "{one} of {niu2024/table-2#scale.red printed}"
    assert filled(text, {"one": "scale"}) == "scale of 0.9976"
    with pytest.raises(KeyError):
        filled("a {blank}", {})


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("1e−6", "10⁻⁶"),
        ("1e-06", "10⁻⁶"),
        ("3.2e+05 px", "3.2\u202f×\u202f10⁵ px"),
        ("−5.7e-5", "−5.7\u202f×\u202f10⁻⁵"),
        ("2e8", "2\u202f×\u202f10⁸"),
        ("table-2e-x, a1e5, 0x1e5, v1.2e3.4", "table-2e-x, a1e5, 0x1e5, v1.2e3.4"),
    ],
)
def test_exponents_are_written_as_powers_of_ten(written, read):
    assert powers(written) == read


def test_no_table_shows_an_exponent_as_a_letter():
    """The sources of the printed numbers are shown as they stand, all else is rewritten."""
    key = "niu2024/table-1"
    written = " ".join(cell.shown for cell in library()[key].cells)
    assert re.search(r"\d[eE][−+-]?\d", written), (
        "nothing to rewrite: this test is void"
    )
    html = rp.table(key)._repr_html_()
    prose = re.sub(r"<(code|pre)\b.*?</\1>|<[^>]*>", " ", html, flags=re.DOTALL)
    assert "10⁻" in prose
    assert not re.search(r"(?<![\w.])\d+(\.\d+)?[eE][−+-]?\d", prose)
