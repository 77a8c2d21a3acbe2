"""Figures as a notebook shows them."""

from __future__ import annotations

from os import PathLike
from pathlib import Path


class Figure:
    """An SVG text that shows itself in a notebook.

    >>> import nsdc
    >>> figure = nsdc.loads("model rest { state x = 1; x' = 0; } simulate r of rest { horizon 1; }")["r"].run().plot()
    >>> figure.svg.startswith("<svg")
    True
    """

    def __init__(self, svg: str) -> None:
        #: The text.
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: str | PathLike[str]) -> None:
        """Writes it to a file `.svg`; `ValueError` for other endings."""
        path = Path(path)
        if path.suffix != ".svg":
            raise ValueError(f"a figure is written as .svg, not as `{path.suffix}`")
        path.write_text(self.svg, encoding="utf-8")

    def __repr__(self) -> str:
        return f"Figure({len(self.svg)} bytes of SVG)"
