"""A render as a notebook shows it: the picture, what was learned, and how noisy it is."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import ConfigError
from warpmis.output.balance_map import balance_map, entry_colors, sample_shares
from warpmis.output.legend import entry_text
from warpmis.output.png import png_bytes
from warpmis.output.tonemap import to_display

MOST_COLORS = 3  # of a balance map


def notebook_preview() -> Callable[[NDArray[np.floating]], None]:
    """A picture in a notebook that follows a render: for `warpmis.render(..., preview=warpmis.notebook_preview())`.

    Raises:
        ConfigError: there is no IPython.
    """
    try:
        from IPython.display import Image, display
    except ImportError:
        raise ConfigError("a preview in a notebook needs IPython, which every notebook has: run it in one") from None
    handles: list[Any] = []

    def show(image: NDArray[np.floating]) -> None:
        picture = Image(data=png_bytes(to_display(image)), format="png")
        if handles:
            handles[0].update(picture)
        else:
            handles.append(display(picture, display_id=True))

    return show


def notebook_html(
    caption: str,
    image: NDArray[np.floating],
    allocation: NDArray[np.floating],
    strategies: Sequence[str],
    next_event: NDArray[np.floating] | None = None,
) -> str:
    """The picture, beside it the balance map if something was learned, and a line below.

    Args:
        image: linear Rec.709, shape (H, W, 3).
        allocation: shape (H, W, S), of the S strategies.
        next_event: as balance_map has it; None where nothing was learned or the method has no such pixels.
    """
    cells = [_cell(to_display(image), "")]
    learned = next_event is not None or np.ptp(allocation, axis=(0, 1)).any()
    if 1 < len(strategies) <= MOST_COLORS and learned:
        shares = sample_shares(allocation, strategies, next_event)
        cells.append(_cell(balance_map(allocation, strategies, next_event), _legend(strategies, shares)))
    pictures = "".join(cells)
    return f'<div style="display:flex;flex-wrap:wrap;gap:12px">{pictures}</div><p>{escape(caption)}</p>'


def _legend(strategies: Sequence[str], shares: Mapping[str, float]) -> str:
    """Each colour of the balance map, with its name and its share of the samples."""
    colors = entry_colors(strategies)
    entries = []
    for name, share in shares.items():
        square = f"display:inline-block;width:0.8em;height:0.8em;background:rgb{tuple(colors[name].tolist())}"
        entries.append(f'<span style="{square}"></span> {escape(entry_text(name, share))}')
    return f"share of the samples: {', '.join(entries)}"


def _cell(picture: NDArray[np.uint8], legend: str) -> str:
    """A picture over a legend in HTML."""
    data = base64.b64encode(png_bytes(picture)).decode("ascii")
    style = "margin:0;max-width:480px;flex:1 1 0"
    return (
        f'<figure style="{style}"><img style="width:100%" alt="" src="data:image/png;base64,{data}">'
        f"<figcaption>{legend}</figcaption></figure>"
    )
