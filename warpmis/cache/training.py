"""How much of a render trains the cache: rounds that double, from few paths on, whatever the size of the picture."""

from __future__ import annotations

from dataclasses import dataclass

# Paths of the first round, and the most of all rounds: a cache of some hundred cells learns no more from others.
FIRST_PATHS = 1 << 13
MOST_PATHS = 1 << 20
# Part of the samples that may train.
MOST_SHARE = 0.5
# Rounds with fewer samples per pixel are left out of the picture, and the first one is: their guides know little yet.
KEPT_SAMPLES = 8


@dataclass(frozen=True)
class Training:
    """One round: `samples` paths of the first pixel of each cell of stride x stride pixels.

    is_kept: whether the picture holds the samples. It is fixed beforehand, so that no sample has a say in it.
    """

    stride: int
    samples: int
    is_kept: bool


def training_rounds(pixels: int, spp: int) -> list[Training]:
    """The rounds of a render of so many pixels and samples per pixel."""
    most = min(MOST_PATHS, MOST_SHARE * pixels * spp)
    rounds: list[Training] = []
    paths, spent = float(FIRST_PATHS), 0.0
    while spent + paths <= most:
        stride = max(1, round((pixels / paths) ** 0.5))
        samples = 1 << round_to_bit(paths / pixels) if stride == 1 else 1
        is_kept = len(rounds) > 0 and stride == 1 and samples >= KEPT_SAMPLES
        rounds.append(Training(stride, samples, is_kept))
        spent += pixels * rounds[-1].samples / stride**2
        paths *= 2.0
    return rounds


def round_to_bit(quotient: float) -> int:
    """The exponent of the power of two next to a number, at least 0."""
    exponent = 0
    while 2.0 ** (exponent + 0.5) <= quotient:
        exponent += 1
    return exponent
