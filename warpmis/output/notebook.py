"""A render as a notebook shows it: the picture, what was learned, and how noisy it is."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from warpmis.output.balance_map import balance_map, with_legend
from warpmis.output.png import png_bytes
from warpmis.output.tonemap import to_display

MOST_COLORS = 3  # of a balance map


def notebook_html(
    caption: str,
    image: NDArray[np.floating],
    allocation: NDArray[np.floating],
    strategies: Sequence[str],
) -> str:
    """The picture, beside it the balance map if the pixels' shares differ, and a line below.

    Args:
        image: linear Rec.709, shape (H, W, 3).
        allocation: shape (H, W, S), of the S strategies.
    """
    cells = [_cell(to_display(image), "")]
    if 1 < len(strategies) <= MOST_COLORS and np.ptp(allocation, axis=(0, 1)).any():
        legend = f"share of the samples: all {' to all '.join(strategies)}"
        cells.append(_cell(with_legend(balance_map(allocation, strategies), strategies), legend))
    pictures = "".join(cells)
    return f'<div style="display:flex;flex-wrap:wrap;gap:12px">{pictures}</div><p>{escape(caption)}</p>'


def _cell(picture: NDArray[np.uint8], legend: str) -> str:
    data = base64.b64encode(png_bytes(picture)).decode("ascii")
    style = "margin:0;max-width:480px;flex:1 1 0"
    return (
        f'<figure style="{style}"><img style="width:100%" alt="" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(legend)}</figcaption></figure>"
    )
