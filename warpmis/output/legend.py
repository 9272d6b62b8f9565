"""The legend of a balance map: a bar of the mixtures' colours, and a line that names each colour and its share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from warpmis.output.balance_map import NEXT_EVENT, balance_map, entry_colors

FONT = "DroidSans"  # in every wheel of OpenImageIO
SMALLEST_FONT, LARGEST_FONT = 11, 28  # [pixel]

UInt8Array = NDArray[np.uint8]


@dataclass(frozen=True)
class Entry:
    """A colour, sRGB of shape (3,), and what it stands for."""

    color: UInt8Array
    text: str

    def width(self, font: int) -> int:
        """Of the square, the text and the space behind them [pixel]."""
        return font + font // 2 + text_width(self.text, font) + font


def with_legend(
    picture: UInt8Array, strategies: Sequence[str], shares: Mapping[str, float] | None = None
) -> UInt8Array:
    """Add a legend below a balance map.

    A bar runs from all of one strategy (left) to all of the next (right), with ticks at the quarters. Three strategies
    have three bars side by side: first to second, second to third, third to first. Below it each colour has its name
    and its share of the samples. Where no pixel shares its samples there is no bar. A picture that is too narrow for a
    name gets a black margin on its right.

    Args:
        picture: sRGB, shape (H, W, 3).
        strategies: as the balance map's.
        shares: of the samples, as balance_map.sample_shares has them; None for names alone.
    """
    font = int(np.clip(round(picture.shape[1] / 40), SMALLEST_FONT, LARGEST_FONT))
    colors = entry_colors(strategies)
    named: Mapping[str, float | None] = dict.fromkeys(strategies) if shares is None else shares
    entries = [Entry(colors[name], entry_text(name, share)) for name, share in named.items()]
    width = max(picture.shape[1], *(entry.width(font) for entry in entries))
    parts = [picture, np.zeros((1, picture.shape[1], 3), np.uint8)]
    if named.get(NEXT_EVENT) != 1.0:
        parts.append(_bar(picture.shape[1], max(8, picture.shape[0] // 24), strategies))
    parts.append(_words(entries, width, font))
    return np.concatenate([np.pad(part, ((0, 0), (0, width - part.shape[1]), (0, 0))) for part in parts])


def entry_text(name: str, share: float | None) -> str:
    """Such as "bsdf 12 %"; what is there is never 0 %, and what is not all never 100 %."""
    if share is None:
        return name
    percent = 100.0 * share
    if 0.0 < percent < 0.5:
        return f"{name} < 1 %"
    return f"{name} > 99 %" if 99.5 <= percent < 100.0 else f"{name} {percent:.0f} %"


def text_width(text: str, font: int) -> int:
    """Of a text as it is drawn [pixel]."""
    region = oiio.ImageBufAlgo.text_size(text, font, FONT)
    return int(region.xend - region.xbegin) if region.defined else 0


def _bar(width: int, rows: int, strategies: Sequence[str]) -> UInt8Array:
    bar = np.repeat(balance_map(_legend_shares(width, len(strategies)), strategies), rows, axis=0)
    bars = 3 if len(strategies) == 3 else 1
    for tick in np.linspace(0, width - 1, 4 * bars + 1).round().astype(int):
        bar[: rows // 3, tick] = 0
    return bar


def _words(entries: Sequence[Entry], width: int, font: int) -> UInt8Array:
    """The entries in lines, from left to right as far as there is room."""
    line = 2 * font
    places, x, lines = [], 0, 1
    for entry in entries:
        if x and x + entry.width(font) > width:
            x, lines = 0, lines + 1
        places.append((x, (lines - 1) * line))
        x += entry.width(font)
    strip = np.zeros((lines * line, width, 3), np.uint8)
    for entry, (x, y) in zip(entries, places, strict=True):
        strip[y + font // 2 : y + font // 2 + font, x : x + font] = entry.color
    drawn = oiio.ImageBuf(strip)
    for entry, (x, y) in zip(entries, places, strict=True):
        oiio.ImageBufAlgo.render_text(
            drawn, x + font + font // 2, y + font // 2 + round(0.87 * font), entry.text, font, FONT, (1.0, 1.0, 1.0)
        )
    return np.asarray(drawn.get_pixels(oiio.UINT8), np.uint8)


def _legend_shares(width: int, count: int) -> NDArray[np.float64]:
    """Shares along the legend, shape (1, width, count)."""
    corners = np.eye(count)
    stops = np.concatenate([corners, corners[:1]]) if count == 3 else corners
    position = np.linspace(0, len(stops) - 1, width)
    columns = [np.interp(position, np.arange(len(stops)), stops[:, strategy]) for strategy in range(count)]
    return np.stack(columns, axis=-1)[np.newaxis]
