"""A render with several light samples and paths at the first vertex: a pilot that finds how many, and the picture.

The pilot has random numbers of its own, and none of its samples are in the picture that it decides on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.views import FilmView
from warpmis.kernels.learning import vec_parts_d
from warpmis.kernels.moments import SHADOW_RAY_COST
from warpmis.kernels.path.parts import RAYS, SHADOW_RAYS
from warpmis.kernels.trace import make_trace
from warpmis.learn.sample_counts import Cost, best_counts
from warpmis.learn.schedule import Round
from warpmis.rendering.held import interrupts_held
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.round_view import round_view
from warpmis.rendering.tracer import Target
from warpmis.scene.features import Features

vec1f = wp.types.vector(length=1, dtype=wp.float32)
PILOT_SEED = 0x2C0FFEE5
# Rounds of so many samples in about so many pixels, and in no more than this part of the picture's samples.
PILOT_ROUNDS, PILOT_SAMPLES, PILOT_PIXELS = 8, 16, 1024
PILOT_PART = 1.0 / 32.0
# Light samples and paths of the pilot.
PILOT_COUNT = 2
FEWEST_PIXELS = 256


def pilot_kernel(features: Features) -> wp.Kernel:
    return make_trace(features.with_strategies(features.strategies, ("parts",)))


def plain_kernel(features: Features) -> wp.Kernel:
    """That of next-event estimation, for one sample of each."""
    return make_trace(features.with_strategies(()).with_allocation("shares"))


class CountsIntegrator(Integrator):
    """One render in progress, with counts of samples."""

    def __init__(self, scene: Any, features: Features, config: Any, allocation: Any, compiler: Any = None) -> None:
        super().__init__(scene, features, config, np.ones_like(allocation), compiler)
        self.pilot_kernel, self.plain_kernel = pilot_kernel(features), plain_kernel(features)
        if compiler is None:
            self.compiler.wait([self.pilot_kernel, self.plain_kernel])
        self.no_shares = wp.zeros(1, dtype=vec1f, device=config.device)
        self.pilot_rounds: list[NDArray[np.float64]] = []  # means of each round's parts, shape (cells, 6)
        self.pilot_rays = 0
        self.pilot_cost = 0.0  # of all samples so far

    def rounds(self) -> Iterator[Round]:
        """The pilot, unless the picture has too few samples to pay for it; then the picture."""
        samples = PILOT_ROUNDS * PILOT_SAMPLES
        pixels = min(float(PILOT_PIXELS), PILOT_PART * self.pixels * self.config.learn_budget / samples)
        if pixels >= FEWEST_PIXELS and self.config.max_depth > 0:
            stride = max(1, round((self.pixels / pixels) ** 0.5))
            for number in range(PILOT_ROUNDS):
                first = number * PILOT_SAMPLES
                yield Round(first, PILOT_SAMPLES, learn=True, label="pilot", is_kept=False, stride=stride)
        yield Round(0, self.config.spp, learn=False)

    def trace(
        self, part: Round, advance: Callable[[int], None], piece: range | None = None, samples: range | None = None
    ) -> None:
        if not part.learn:
            super().trace(part, advance, piece, samples)
            return
        whole = range(part.first_sample, part.first_sample + part.samples)
        self.begin_pass(part, whole)
        film, moments = self._trace_pilot(part, whole)
        with interrupts_held():
            accepted = np.maximum(film.accepted.numpy(), 1)
            self.pilot_rounds.append(moments.numpy().astype(np.float64) / accepted[:, np.newaxis])
            self._count(film)
            self.end_pass()

    def _trace_pilot(self, part: Round, samples: range) -> tuple[FilmView, wp.array]:
        """The film and the moments; a round that is interrupted is begun anew."""
        cells, device = self.rows_of(part), self.config.device
        view = round_view(self.config, part, samples)
        view.seed = (self.config.seed + PILOT_SEED) % 2**32
        film = self._new_film(cells)
        moments = wp.zeros(cells, dtype=vec_parts_d, device=device)
        counts = wp.full(cells, float(PILOT_COUNT), dtype=self.shares.dtype, device=device)
        self.compiler.wait([self.pilot_kernel])
        try:
            self._trace(Target(self.pilot_kernel, counts, film, moments), view, lambda done: None)
        finally:
            self.traced[:] = False
        return film, moments

    def _count(self, film: FilmView) -> None:
        rays, shadow_rays = int(film.rays.numpy().sum()), int(film.shadow_rays.numpy().sum())
        self.pilot_rays += rays + shadow_rays
        self.pilot_cost += (rays + SHADOW_RAY_COST * shadow_rays) / max(int(film.accepted.numpy().sum()), 1)

    def solving_kernels(self, part: Round) -> tuple[()]:
        """Counts are found on the host."""
        return ()

    def solve(self, part: Round) -> None:
        if len(self.pilot_rounds) < PILOT_ROUNDS:
            return
        rounds = np.array(self.pilot_rounds)
        lights, paths = best_counts(rounds[..., :RAYS], self._cost(rounds))
        counts = {"light": lights, "bsdf": paths}
        self._take([counts[name] for name in self.config.strategies])

    def _take(self, counts: list[int]) -> None:
        self.shares.assign(np.tile(np.array(counts, dtype=np.float32), (self.pixels, 1)))

    def _cost(self, rounds: NDArray[np.float64]) -> Cost:
        base = float(rounds[..., RAYS].mean())
        lights = SHADOW_RAY_COST * float(rounds[..., SHADOW_RAYS].mean())
        whole = self.pilot_cost / len(rounds)
        return Cost(base, lights / PILOT_COUNT, max(whole - base - lights, 0.0) / PILOT_COUNT)

    def target_of(self, part: Round) -> Target:
        if self.counts() == (1, 1):
            return Target(self.plain_kernel, self.no_shares, self.film, self.no_moments)
        return Target(self.kernel, self.shares, self.film, self.no_moments)

    def decisions_of(self, part: Round) -> dict[str, Any]:
        return {}

    def common_of(self, part: Round) -> dict[str, Any]:
        return {"counts": list(self.counts())}

    def adopt(self, part: Round, common: dict[str, Any]) -> None:
        self._take(common["counts"])

    # ---- state ------------------------------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        own = {name: getattr(self, name) for name in ("pilot_rounds", "pilot_rays", "pilot_cost")}
        return super().state() | own

    def resume(self, state: dict[str, Any]) -> None:
        super().resume(state)
        for name in ("pilot_rounds", "pilot_rays", "pilot_cost"):
            setattr(self, name, state[name])

    # ---- results ----------------------------------------------------------------------------------------------------

    def counts(self) -> tuple[int, ...]:
        """Samples of each strategy at a pixel's first vertex."""
        return tuple(int(count) for count in self.shares.numpy()[0])

    def allocation_map(self) -> NDArray[np.float32]:
        """Each strategy's part of the samples, shape (H, W, S)."""
        counts = self.shares.numpy().reshape(self.height, self.width, -1)
        shares: NDArray[np.float32] = counts / counts.sum(axis=2, keepdims=True)
        return shares

    def next_event_map(self) -> NDArray[np.float32] | None:
        """Next-event estimation takes one sample of each."""
        return np.full((self.height, self.width), float(self.counts() == (1, 1)), np.float32)

    def certificate(self, variance: NDArray[np.float32], image: NDArray[np.float32]) -> dict[str, float]:
        """Counts have none."""
        return {}

    def rays(self) -> int:
        return self.pilot_rays + super().rays()
