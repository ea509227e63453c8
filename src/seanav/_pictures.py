"""Pictures that are small, and the same on every machine."""

import io
import warnings
from typing import Any

import numpy as np
import PIL.Image
from IPython.display import Image
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

DIGITS = 7  # of what is drawn; a picture shows four
SHOWN_DPI = 100  # of the picture in the notebook; the saved one has twice as many


def save(fig: Figure, target: Any, **options: Any) -> None:
    """Save `fig`; what it draws must be rounded already."""
    with warnings.catch_warnings():
        # Says only that a busy machine took over a second to place a legend.
        warnings.filterwarnings("ignore", "Creating legend with loc")
        fig.savefig(target, **options)


def shown(fig: Figure, caption: str) -> tuple[PIL.Image.Image, Image]:
    """Draw `fig`; return it whole, and a smaller picture of it for the notebook.

    Hosting services show no large notebooks. The caption is for who cannot see the picture.
    """
    drawn = io.BytesIO()
    rounded(fig)
    save(fig, drawn, format="png", dpi=2 * SHOWN_DPI)
    with PIL.Image.open(drawn) as picture:
        whole = picture.convert("RGB")
    small = palette_png(whole.reduce(2), SHOWN_DPI)
    return whole, Image(small, format="png", width=round(96 * fig.get_figwidth()), alt=caption)


def live(fig: Figure) -> bytes:
    """Return a PNG of `fig` that is drawn once and fast, for somebody who waits for it."""
    drawn = io.BytesIO()
    save(fig, drawn, format="png", dpi=SHOWN_DPI)
    return drawn.getvalue()


def rounded(fig: Figure) -> None:
    """Round what is drawn, and the ends of the axes, to `DIGITS` significant digits.

    Processors differ in the last digits of a long computation. Unrounded they show in the
    last printed digit of some vertex of a PDF, and the file is another one.
    """
    for axes in fig.axes:
        # Read before the data change; setting them ends the automatic choice.
        limits = {"xlim": _round(axes.get_xlim()), "ylim": _round(axes.get_ylim())}
        axes.set(**limits)
        for line in axes.findobj(Line2D):
            data = line.get_data()
            if all(np.asarray(part).dtype.kind == "f" for part in data):
                line.set_data(*map(_round, data))
        for drawn in axes.findobj(Collection):
            drawn.set_offsets(_round(drawn.get_offsets()))
            for path in drawn.get_paths():
                if not path.readonly:
                    path.vertices = _round(path.vertices)


def _round(numbers):
    numbers = np.asarray(numbers, dtype=float)
    size = np.abs(np.where(np.isfinite(numbers) & (numbers != 0), numbers, 1.0))
    scale = 10.0 ** (DIGITS - 1 - np.floor(np.log10(size)))
    return np.round(numbers * scale) / scale


def palette_png(picture: PIL.Image.Image, dpi: int) -> bytes:
    """Return a PNG of 256 colours, a third of the bytes of full colour.

    This method keeps rare colours, such as those of thin lines; the means that follow it
    keep greys without a tint.
    """
    method, dither = PIL.Image.Quantize.MAXCOVERAGE, PIL.Image.Dither.NONE
    text = io.BytesIO()
    few = picture.quantize(256, method=method, kmeans=3, dither=dither)
    few.save(text, "PNG", optimize=True, dpi=(dpi, dpi))
    return text.getvalue()
