"""Every graph: legible on light and dark pages, in grey, on a phone, with units."""

import itertools
import re

import numpy as np
import pytest
from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path

import reproduce as rp
from reproduce.locate import data_files
from reproduce.printed.number import powers
from reproduce.views.figure import Figure, drawable

# Background and text colour of the theme; black in a figure becomes the text colour.
THEMES = (("#ffffff", "#222832"), ("#14181e", "#ced6dd"))
# WCAG 2.1, success criteria 1.4.11 (graphics) and 1.4.3 (text).
CONTRAST_GRAPHICS, CONTRAST_TEXT = 3.0, 4.5
# Width of a figure on a phone of 390 CSS pixels and on a page, in inches; in points.
WIDTH_PHONE, WIDTH_PAGE, MIN_FONT_SIZE = 358 / 96, 6.8, 8.0
# Labels of counts, which have no unit.
COUNTED = {"frames averaged", "frame", "state", "step", "electrons per frame"}
NONE = {"None", "", " ", None}


def luminance(colour):
    channels = np.asarray(to_rgba(colour)[:3])
    power = ((channels + 0.055) / 1.055) ** 2.4
    linear = np.where(channels <= 0.04045, channels / 12.92, power)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(first, second):
    dark, light = sorted((luminance(first), luminance(second)))
    return (light + 0.05) / (dark + 0.05)


def contrasts(colour, alpha=None):
    """Return the contrast of a colour with the page in each theme."""
    *rgb, opacity = to_rgba(colour, alpha)
    for page, text in THEMES:
        front, back = np.array(
            [rgb if any(rgb) else to_rgba(text)[:3], to_rgba(page)[:3]]
        )
        yield contrast(opacity * front + (1 - opacity) * back, page)


def marks(axes):
    """Return the lines, areas and points of some axes, without those on an image."""
    kinds = {type(artist).__name__ for artist in (*axes.images, *axes.collections)}
    if kinds & {"AxesImage", "QuadMesh"}:
        return []
    # The bars of an error belong to its marker.
    bars = {b for group in axes.containers for part in group.lines[1:] for b in part}
    artists = (*axes.lines, *axes.patches, *axes.collections)
    return [a for a in artists if a not in bars and a.get_visible()]


def colours(artist):
    """Return the colours of a mark, of which one must stand out: line, edge or face."""
    if isinstance(artist, Line2D):
        line, marker = artist.get_linestyle() in NONE, artist.get_marker() in NONE
        found = [] if line else [artist.get_color()]
        found += [] if marker else [artist.get_markeredgecolor()]
        return [to_rgba(colour, artist.get_alpha()) for colour in found]
    edges, faces = artist.get_edgecolor(), artist.get_facecolor()
    return [edges, faces] if isinstance(artist, Patch) else [*edges, *faces]


def look(artist):
    """Return the look of a mark in grey: dashes, marker, filling, hatch and line width."""
    if isinstance(artist, Line2D):
        line, marker = artist.get_linestyle(), artist.get_marker()
        filled = {artist.get_fillstyle(), str(artist.get_markerfacecolor())}
        # Widths that an eye can distinguish.
        width = round(2 * np.log2(artist.get_linewidth()))
        return line, marker, "none" in filled, line != "None" and width
    paths = [artist.get_path()] if isinstance(artist, Patch) else artist.get_paths()
    corners = [len(path.vertices) for path in paths]
    return artist.get_hatch(), str(artist.get_linestyle()), corners


def texts(figure):
    """Return the visible texts of a figure, with their axes."""
    found = [(text, None) for legend in figure.legends for text in legend.get_texts()]
    for axes in figure.axes:
        legend = axes.get_legend()
        parts = [*axes.texts, axes.title, *(legend.get_texts() if legend else ())]
        for index, axis in enumerate((axes.xaxis, axes.yaxis) if axes.axison else ()):
            low, high = sorted(axis.get_view_interval())
            ticks = axis.get_ticklabels(which="both")
            parts += [t for t in ticks if low <= t.get_position()[index] <= high]
            parts.append(axis.label)
        found += [(part, axes) for part in parts]
    return [(t, axes) for t, axes in found if t.get_text().strip() and t.get_visible()]


def strokes(axes):
    """Yield the lines and outlines of some axes with their paths on the canvas."""
    for artist in marks(axes):
        line = isinstance(artist, Line2D)
        if not (
            isinstance(artist, Collection) or (line and artist.get_linestyle() in NONE)
        ):
            path = artist.get_transform().transform_path(artist.get_path())
            for points in path.to_polygons(closed_only=False):
                yield artist, Path(points)


def faults(figure, width):
    """Yield the marks and texts that cannot be read."""
    for axes in figure.axes:
        artists = [(a, colours(a)) for a in marks(axes) if colours(a)]
        for artist, found in artists:
            best = np.max([[*contrasts(colour)] for colour in found], axis=0)
            if best.min() < CONTRAST_GRAPHICS:
                yield artist, "contrast"
        for (a, first), (b, second) in itertools.combinations(artists, 2):
            equal = to_rgba(first[0])[:3] == to_rgba(second[0])[:3]
            if type(a) is type(b) and not equal and look(a) == look(b):
                yield a, b, "only the colour differs"
        labels = {axes.get_xlabel(), axes.get_ylabel()} - {""}
        if axes.axison and not all("(" in name or name in COUNTED for name in labels):
            yield labels, "unit"
    renderer, boxes = figure.canvas.get_renderer(), []
    for text, axes in texts(figure):
        on_image = (
            axes and not marks(axes) and (text in axes.texts or axes.get_legend())
        )
        faint = min(contrasts(text.get_color(), text.get_alpha())) < CONTRAST_TEXT
        if (faint and not on_image) or text.get_fontsize() < MIN_FONT_SIZE:
            yield text, "size or contrast"
        box = text.get_window_extent(renderer)
        box = box.padded(-0.12 * min(box.width, box.height))
        inside = figure.bbox.contains(*box.min) and figure.bbox.contains(*box.max)
        if not inside or any(box.overlaps(other) for other in boxes):
            yield text, "cut, or on another text"
        boxes.append(box)
        for artist, path in strokes(axes) if axes else ():
            near = not artist.get_clip_on() or box.overlaps(axes.bbox)
            if near and path.intersects_bbox(box, filled=False):
                yield text, artist, "crossed"
    if figure.get_figwidth() > width:
        yield "width", figure.get_figwidth()


@pytest.mark.parametrize("width", [WIDTH_PAGE, WIDTH_PHONE], ids=["page", "phone"])
def test_every_graph_can_be_read(width):
    assert contrast("#777777", "white") == pytest.approx(4.48, abs=0.005)
    for key in drawable():
        if not data_files(f"schematics/{key}.svg"):  # these are tested in a browser
            figure = Figure(key).compute(narrow=width == WIDTH_PHONE)
            FigureCanvasAgg(figure)
            figure.draw_without_rendering()
            assert list(faults(figure, width)) == [], key


def test_figures_on_a_page_have_alternative_text_and_unique_ids():
    """Text is text in the colour of the page; no two figures have an identifier in common."""
    seen = set()
    for key in drawable():
        figure = rp.figure(key)
        figure.alternative = 'a "quoted" text'
        html = figure._repr_html_()
        svg = html.partition("</svg>")[0]
        for text in (
            'role="img"',
            "<text",
            "a &quot;quoted&quot; text",
        ):
            assert text in svg
        # SVG fills in black by default.
        assert re.search(r'<svg [^>]*fill="currentColor"', svg)
        assert "#000000" not in svg
        assert not re.search(r"<g [^>]*fill[^>]*>\s*<text>", svg)
        used = re.findall(r'(?:url\(#|xlink:href="#)([^)"]+)', svg)
        assert set(used) <= set(re.findall(r'\bid="([^"]+)"', svg))
        ids = re.findall(r'\bid="([^"]+)"', html)
        assert len(seen | set(ids)) == len(seen) + len(ids)
        seen |= set(ids)


def test_a_style_of_the_user_changes_no_figure():
    first = rp.figure("chen2023/fig-1d")._repr_html_()
    with style.context("dark_background"):
        assert rp.figure("chen2023/fig-1d")._repr_html_() == first


POWERS = {
    "1e−6": "10⁻⁶",
    "1e-06": "10⁻⁶",
    "3.2e+05 px": "3.2\u202f×\u202f10⁵ px",
    "−5.7e-5": "−5.7\u202f×\u202f10⁻⁵",
    "2e8": "2\u202f×\u202f10⁸",
    "table-2e-x, a1e5, 0x1e5, v1.2e3.4": "table-2e-x, a1e5, 0x1e5, v1.2e3.4",
}


def test_exponents_are_powers_of_ten_except_in_names():
    assert {text: powers(text) for text in POWERS} == POWERS
