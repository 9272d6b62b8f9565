"""Frames of a sequence: usdrecord's way to list them, and to number files."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Sequence

from warpmis.errors import ConfigError

NUMBER = r"[+-]?\d+(?:\.\d+)?"
RANGE = re.compile(rf"({NUMBER})(?::({NUMBER})(?:x({NUMBER}))?)?")
PLACEHOLDER = re.compile(r"(#+)(?:\.(#+))?")

# More are a typing error.
MAX_FRAMES = 100_000


def frame_list(text: str) -> tuple[float, ...]:
    """The time codes of "1:24", "10:1x-3" or "1:10x2,20", in order; the stride is 1, or -1 downwards."""
    frames: list[float] = []
    for part in text.split(","):
        match = RANGE.fullmatch(part.strip())
        if match is None:
            raise argparse.ArgumentTypeError(f"'{part}' is no frame or range such as 7, 1:24 or 1:10x2")
        start = float(match[1])
        end = start if match[2] is None else float(match[2])
        stride = math.copysign(1.0, end - start) if match[3] is None else float(match[3])
        if stride == 0.0 or (end - start) / stride < 0.0:
            raise argparse.ArgumentTypeError(f"'{part}' never gets from {start:g} to {end:g}")
        steps = (end - start) / stride
        if len(frames) + steps >= MAX_FRAMES:
            raise argparse.ArgumentTypeError(f"'{text}' is more than {MAX_FRAMES} frames")
        frames += [start + step * stride for step in range(math.floor(steps + 1e-9) + 1)]
    return tuple(frames)


def numbered(path: str, frames: Sequence[float]) -> list[str]:
    """The name of each frame's file: #### stands for the frame, ####.## also for what follows its decimal point.

    Raises:
        ConfigError: there is not exactly one such place, or it does not tell the frames apart.
    """
    if len(PLACEHOLDER.findall(path)) != 1:
        raise ConfigError(f"{path}: with --frames the name must contain the frame number once, such as image.####.exr")
    for frame in frames:
        if not math.isclose(frame, float(_digits(PLACEHOLDER.search(path), frame)), abs_tol=1e-9):
            raise ConfigError(f"{path}: frame {frame:g} needs decimals in the name, such as image.####.##.exr")
    if len(set(frames)) < len(frames):
        raise ConfigError(f"--frames lists a frame twice: {', '.join(f'{frame:g}' for frame in frames)}")
    return [_name(path, frame) for frame in frames]


def _name(path: str, frame: float) -> str:
    return PLACEHOLDER.sub(lambda place: _digits(place, frame), path)


def _digits(place: re.Match[str] | None, frame: float) -> str:
    assert place is not None
    decimals = len(place[2] or "")
    width = len(place[1]) + (decimals + 1 if decimals else 0)
    return f"{frame:0{width}.{decimals}f}"
