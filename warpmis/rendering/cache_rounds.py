"""The rounds of a render by the spatial cache, as launches see them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from warpmis.cache.gate import PILOT_SAMPLES
from warpmis.cache.training import Training
from warpmis.learn.schedule import Round

PILOT, TRAINING, PICTURE = "pilot", "training", "picture"


@dataclass(frozen=True)
class CacheRound(Round):
    """A round of the cache.

    kind: PILOT, by next-event estimation; TRAINING; or PICTURE.
    half: of a pilot or a trial, which of its two; None of other rounds.
    """

    kind: str = PICTURE
    half: int | None = None


def pilot_rounds(stride: int) -> Iterator[CacheRound]:
    """The pilot's two: none of their samples is in the picture."""
    for half in (0, 1):
        first, label = half * PILOT_SAMPLES, "pilot"
        yield CacheRound(
            first, PILOT_SAMPLES, learn=True, label=label, stride=stride, is_kept=False, kind=PILOT, half=half
        )


def training_round(training: Training, first_sample: int, label: str) -> CacheRound:
    return CacheRound(
        first_sample,
        training.samples,
        learn=True,
        label=label,
        stride=training.stride,
        is_kept=training.is_kept,
        may_be_left_out=True,
        kind=TRAINING,
        half=training.half,
    )
