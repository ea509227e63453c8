"""Pictures that are small, and the same on every machine."""

import io

import numpy as np
import PIL.Image
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

DIGITS = 7  # of what is drawn; a picture shows four


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

    This method keeps rare colours, such as those of thin lines: no pixel is off by more
    than a few of 255 levels.
    """
    method, dither = PIL.Image.Quantize.MAXCOVERAGE, PIL.Image.Dither.NONE
    text = io.BytesIO()
    few = picture.quantize(256, method=method, dither=dither)
    few.save(text, "PNG", optimize=True, dpi=(dpi, dpi))
    return text.getvalue()
