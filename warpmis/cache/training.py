"""How much of a render trains the cache: rounds that double, from few paths on, whatever the size of the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

from warpmis.cache.gate import PILOT_SAMPLES, Prospect, pilot_stride

# Paths of the first round, and the most of all rounds: a cache of some hundred cells learns no more from others.
FIRST_PATHS = 1 << 13
MOST_PATHS = 1 << 20
# After rounds of so many paths there is another trial.
TRIALS = (1 << 15, 1 << 17)
# Part of the samples that may train.
MOST_SHARE = 0.5
# Rounds with fewer samples per pixel are left out of the picture, and the first one is: their guides know little yet.
KEPT_SAMPLES = 8


@dataclass(frozen=True)
class Training:
    """One round: `samples` paths of the first pixel of each cell of stride x stride pixels.

    is_kept: whether the picture holds the samples. It is fixed beforehand, so that no sample has a say in it.
    half: of a trial, which of its two rounds, None for others.
    """

    stride: int
    samples: int
    is_kept: bool
    half: int | None = None

    def paths(self, pixels: int) -> float:
        return pixels * self.samples / self.stride**2


def training_rounds(pixels: int, spp: int) -> list[Training]:
    """The rounds of a render of so many pixels and samples per pixel: with trials among them."""
    most = min(MOST_PATHS, MOST_SHARE * pixels * spp)
    stride = pilot_stride(pixels, spp)
    trial = [Training(stride, PILOT_SAMPLES, stride == 1, half) for half in (0, 1)]
    plan = [_round(FIRST_PATHS, pixels, is_first=True), *trial]
    paths = 2.0 * FIRST_PATHS
    while paths <= most:
        plan.append(_round(paths, pixels))
        if paths in TRIALS:
            plan += trial
        paths *= 2.0
    rounds: list[Training] = []
    for one in plan:
        if sum(other.paths(pixels) for other in rounds) + one.paths(pixels) > most:
            break
        rounds.append(one)
    return rounds


def prospects(rounds: list[Training], pixels: int, spp: int) -> list[Prospect]:
    """What follows each trial, in a render of so many pixels and samples per pixel."""
    learned = sum(one.paths(pixels) for one in rounds)
    found = []
    for number, one in enumerate(rounds):
        if one.half == 1:
            before = sum(other.paths(pixels) for other in rounds[: number - 1])
            left = pixels * spp - before - 2.0 * one.paths(pixels)
            dropped = sum(other.paths(pixels) for other in rounds[number + 1 :] if not other.is_kept)
            found.append(Prospect(math.log2(learned / before), min(dropped / max(left, 1.0), 1.0)))
    return found


def _round(paths: float, pixels: int, *, is_first: bool = False) -> Training:
    stride = max(1, round((pixels / paths) ** 0.5))
    samples = 1 << round_to_bit(paths / pixels) if stride == 1 else 1
    return Training(stride, samples, stride == 1 and samples >= KEPT_SAMPLES and not is_first)


def round_to_bit(quotient: float) -> int:
    """The exponent of the power of two next to a number, at least 0."""
    exponent = 0
    while 2.0 ** (exponent + 0.5) <= quotient:
        exponent += 1
    return exponent
