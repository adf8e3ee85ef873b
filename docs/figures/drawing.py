"""A few strokes of SVG, enough for the figures of these pages."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path

INK, FAINT, PAPER = "#24292f", "#8c959f", "#ffffff"
BLUE, RED, GREEN, ORANGE = "#0969da", "#cf222e", "#1a7f37", "#bc4c00"

XY = tuple[float, float]


class Drawing:
    """Collects strokes; x to the right, y down, in pixels."""

    def __init__(self, width: int, height: int) -> None:
        self._size = (width, height)
        self._parts: list[str] = []
        self._heads: dict[str, str] = {}

    def line(
        self, start: XY, end: XY, colour: str = INK, width: float = 1.5, dash: str = ""
    ) -> None:
        """A straight line."""
        self.polyline((start, end), colour, width, dash)

    def polyline(
        self, points: Iterable[XY], colour: str = INK, width: float = 1.5, dash: str = ""
    ) -> None:
        """A line through points."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self._parts.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"'
            f' stroke-linejoin="round"{dashed}/>'
        )

    def arrow(self, start: XY, end: XY, colour: str = INK, width: float = 1.8) -> None:
        """A line with a head at its end."""
        self.path(f"M {start[0]:.1f} {start[1]:.1f} L {end[0]:.1f} {end[1]:.1f}", colour, width)

    def path(self, d: str, colour: str = INK, width: float = 1.8, head: bool = True) -> None:
        """An SVG path, with a head at its end unless told otherwise."""
        marker = ""
        if head:
            name = self._heads.setdefault(colour, f"head{len(self._heads)}")
            marker = f' marker-end="url(#{name})"'
        self._parts.append(
            f'<path d="{d}" fill="none" stroke="{colour}" stroke-width="{width:g}"{marker}/>'
        )

    def circle(
        self, centre: XY, radius: float, colour: str = INK, fill: str = "none", dash: str = ""
    ) -> None:
        """A circle."""
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self._parts.append(
            f'<circle cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{radius:g}" fill="{fill}"'
            f' stroke="{colour}" stroke-width="1.5"{dashed}/>'
        )

    def box(
        self, corner: XY, size: XY, colour: str = INK, fill: str = PAPER, rounded: float = 6.0
    ) -> None:
        """A filled rectangle."""
        self._parts.append(
            f'<rect x="{corner[0]:.1f}" y="{corner[1]:.1f}" width="{size[0]:.1f}"'
            f' height="{size[1]:.1f}" rx="{rounded:g}" fill="{fill}" stroke="{colour}"'
            ' stroke-width="1.5"/>'
        )

    def text(
        self,
        at: XY,
        words: str,
        colour: str = INK,
        size: int = 14,
        anchor: str = "start",
        bold: bool = False,
    ) -> None:
        """A line of text; ``anchor`` is start, middle or end."""
        weight = ' font-weight="bold"' if bold else ""
        self._parts.append(
            f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" fill="{colour}" font-size="{size}"'
            f' text-anchor="{anchor}"{weight}>{escape(words)}</text>'
        )

    def save(self, path: Path) -> None:
        """Write the file."""
        width, height = self._size
        heads = "".join(
            f'<marker id="{name}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7"'
            f' markerHeight="7" orient="auto"><path d="M 0 1 L 10 5 L 0 9 z" fill="{colour}"/>'
            "</marker>"
            for colour, name in self._heads.items()
        )
        body = "\n".join(self._parts)
        path.write_text(
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
            f' width="{width}" height="{height}" font-family="DejaVu Sans, Arial, sans-serif">\n'
            f'<defs>{heads}</defs>\n<rect width="{width}" height="{height}" fill="{PAPER}"/>\n'
            f"{body}\n</svg>\n",
            encoding="utf-8",
        )
