"""When a render is good enough: its samples taken in steps, and after each a look at the error and the clock.

The error is told from four parts of the samples (metrics.relative_mse_of_parts). Stopping as soon as an estimate is
below the target would choose the lucky ones, so it is the error's upper bound that must be below it, at a confidence
that holds for all looks together (Bonferroni).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.config import RenderConfig
from warpmis.film.metrics import PARTS, relative_mse_of_parts
from warpmis.learn.schedule import Round
from warpmis.rendering.held import interrupts_held
from warpmis.rendering.stats import StoppingStats

# With this probability the picture's error is below the bound when the render stops.
CONFIDENCE = 0.95

# Looks that the confidence is shared among: the doublings from LEAST to the ceiling, and those about the target.
LOOKS = 16

# Fewer samples per pixel tell nothing: most of what is rare has not been met.
LEAST = 64

# Rounding to be expected of a path: some hundred operations in float32.
FLOAT32_FLOOR = 1e-5

# Part of a time limit after which no round begins that trains. Such rounds double, so they take half of it at most.
LEARNING_TIME = 0.25

# A step aims this far beyond the need, since about half of those that aim at it fall short.
BEYOND = 1.05

# What a checkpoint holds of a watch, beside its estimate.
SAVED = ("parts", "counts", "color", "target_spp", "round_spp", "round_seconds", "step_spp")


@dataclass(frozen=True)
class Estimate:
    """The relative error of a picture, from its own samples: 0.02 is 2 %.

    Attributes:
        relative_error: root of the expected relMSE.
        standard_error: of the difference to the picture's actual error.
        bound: the actual error is below it, with CONFIDENCE at all looks together.
    """

    relative_error: float
    standard_error: float
    bound: float


def estimate_of(parts: NDArray[np.floating], counts: NDArray[np.integer]) -> Estimate:
    """The error of the mean of four parts, as in relative_mse_of_parts."""
    squared, spread = relative_mse_of_parts(parts, counts)
    z = NormalDist().inv_cdf(1.0 - (1.0 - CONFIDENCE) / LOOKS)
    error = math.sqrt(squared)
    return Estimate(error, 0.5 * spread / error if error else 0.0, math.sqrt(squared + z * spread))


class Watch:
    """Deals the samples of a render out in steps, and ends it.

    The steps depend on samples alone, unless the time limit cuts one short.

    Attributes:
        estimate: of the last look, None before there were LEAST samples.
        target_spp: samples per pixel at which the bound is expected to be at the target; infinite if nobody knows.
        reason: why the render has ended: "target error", "time limit", "interrupted" or, where nothing cut it short,
            "samples".
    """

    def __init__(self, config: RenderConfig, resolution: tuple[int, int], seconds: Callable[[], float]) -> None:
        """`seconds` tells how long tracing has taken so far [s]."""
        width, height = resolution
        self.config = config
        self.seconds = seconds
        self.parts = np.zeros((PARTS, height, width, 3), np.float32)
        self.counts = np.zeros(PARTS, np.int64)
        self.color = np.zeros((height, width, 3))
        self.estimate: Estimate | None = None
        self.target_spp = math.inf
        self.reason = "samples"
        self.round_spp, self.round_seconds = 0, 0.0  # when the present round began
        self.step_spp = 0  # after the present step

    @property
    def spp(self) -> int:
        """Samples per pixel so far."""
        return int(self.counts.sum())

    @property
    def stopped(self) -> bool:
        return self.reason != "samples"

    def pieces(self, part: Round, *, resumed: bool = False) -> Iterator[tuple[int, range]]:
        """What to trace next of a round, and which of the parts `add` is to be told that it belongs to.

        resumed: the round had begun when the state was saved that this watch has.
        """
        if not resumed:
            self.round_spp, self.round_seconds, self.step_spp = self.spp, self.seconds(), 0
        end = self.round_spp + part.samples
        first = part.first_sample - self.round_spp  # the picture need not hold all samples before the round
        while (self.step_spp or self.spp < end) and not self.stopped:
            self.step_spp = self.step_spp or min(self._next_spp(), end)
            ends = [self.step_spp * index // PARTS for index in range(PARTS + 1)]
            for index in range(PARTS):
                count = ends[index + 1] - ends[index] - int(self.counts[index])
                if count > 0:
                    yield index, range(first + self.spp, first + self.spp + count)
            with interrupts_held():
                self._look()
                self.step_spp = 0

    def state(self) -> dict[str, Any]:
        """For a checkpoint."""
        estimate = self.estimate and dataclasses.asdict(self.estimate)
        return {name: getattr(self, name) for name in SAVED} | {"estimate": estimate}

    def resume(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        for name in SAVED:
            setattr(self, name, state[name])
        self.estimate = state["estimate"] and Estimate(**state["estimate"])

    def leaves_out(self, part: Round) -> bool:
        """Whether there is no time for a round that trains."""
        limit = self.config.time_limit
        return part.may_be_left_out and limit is not None and self.seconds() > LEARNING_TIME * limit

    def add(self, index: int, piece: range, color: NDArray[np.float64]) -> None:
        """Take in a piece that was traced; `color` is the sum of all samples so far, shape (H, W, 3)."""
        self.parts[index] += color - self.color
        self.color = color
        self.counts[index] += len(piece)

    def needed_spp(self) -> int:
        """Samples per pixel at which the render is expected to end."""
        needed = math.ceil(min(self.config.spp, self.target_spp))
        if self.config.time_limit is not None and self.spp:
            needed = min(needed, self.spp + int((self.config.time_limit - self.seconds()) / self._cost()))
        return max(needed, self.spp)

    def seconds_left(self) -> float:
        """Expected until the end [s]."""
        return (self.needed_spp() - self.spp) * self._cost()

    def progress(self) -> dict[str, float]:
        """For Progress; empty before there is an estimate."""
        if self.estimate is None:
            return {}
        return {
            "relative_error": self.estimate.relative_error,
            "standard_error": self.estimate.standard_error,
            "seconds_left": self.seconds_left(),
        }

    def stats(self) -> StoppingStats:
        """For RenderResult.stats."""
        told: StoppingStats = {"reason": self.reason, "spp": self.spp}
        if self.estimate is not None:
            told["relative_error"] = self.estimate.relative_error
            told["standard_error"] = self.estimate.standard_error
            told["bound"] = self.estimate.bound
            told["confidence"] = CONFIDENCE
        if math.isfinite(self.target_spp):
            told["target_spp"] = math.ceil(self.target_spp)
        return told

    def notes(self) -> tuple[str, ...]:
        """What a reader of the error has to know, a line each."""
        target, notes = self.config.target_error, []
        if target is not None:
            depth = self.config.max_depth
            notes.append(f"the error does not include light of more than {depth} bounces (max depth)")
            if target < FLOAT32_FLOOR:
                floor = f"{100.0 * FLOAT32_FLOOR:g} %"
                notes.append(
                    f"a target error below {floor} is below the rounding of float32 paths, which no sample shows"
                )
            if self.reason != "target error":
                notes.append(f"stopped by the {self._brake()} before the target error: {self._outlook()}")
        if self.spp and not self.color.any():
            notes.append("the picture is black: it has no relative error")
        return tuple(notes)

    def _brake(self) -> str:
        return self.reason if self.stopped else f"limit of {self.config.spp} samples per pixel"

    def _outlook(self) -> str:
        if self.estimate is None:
            return f"{self.spp} samples per pixel are too few to estimate it"
        error = f"{100.0 * self.estimate.relative_error:.2g} %"
        if not math.isfinite(self.target_spp):
            return f"it is {error}, and no number of samples reaches the target"
        return f"it is {error}, and the target would take about {self.target_spp:.0f} samples per pixel"

    def _cost(self) -> float:
        """Seconds of one sample per pixel: of this round, or of all before it where it has none."""
        spp, seconds = self.spp - self.round_spp, self.seconds() - self.round_seconds
        if spp == 0:
            spp, seconds = self.spp, self.seconds()
        return max(seconds, 1e-9) / max(spp, 1)

    def _next_spp(self) -> int:
        """Samples per pixel after the next step: twice as many, or what the target needs, or what the time allows."""
        spp = self.spp
        wanted = max(2 * spp, 1)
        if math.isfinite(self.target_spp):
            wanted = min(wanted, math.ceil(BEYOND * self.target_spp))
        if self.config.time_limit is not None and spp:
            left = self.config.time_limit - self.seconds()
            wanted = min(wanted, spp + max(1, int(left / self._cost())))
        return wanted

    def _look(self) -> None:
        if self.spp >= LEAST:
            self.estimate = estimate_of(self.parts, self.counts)
            if self.config.target_error is not None:
                # relMSE falls as the number of samples grows.
                excess = self.estimate.bound / self.config.target_error
                self.target_spp = self.spp * excess * excess  # infinite, where ** would raise an error
                if self.target_spp <= self.spp:
                    self.reason = "target error"
                    return
        limit = self.config.time_limit
        # What is left must have room for a step that is worth it.
        if limit is not None and limit - self.seconds() < max(1.0, 0.01 * self.spp) * self._cost():
            self.reason = "time limit"
