"""A render by the spatial cache: rounds that train, and the picture; where it is to be tried, a pilot before them.

The samples of the pilot and of small training rounds are left out of the picture. All others count alike, and what a
round does depends on earlier rounds alone. So every round is unbiased given those before it, and so is their sum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.cache.cell_shares import share_kernel
from warpmis.cache.gate import (
    FEWEST_SAMPLES,
    PILOT_SAMPLES,
    Findings,
    Prospect,
    Trial,
    is_quiet,
    pays,
    pilot_stride,
    quiet_stride,
    relative_variance,
)
from warpmis.cache.maps import CacheMaps, first_cells, maps_of, shares_of
from warpmis.cache.pixel_worth import MOST_VARIANCE, expected_luminance, pixel_worth, rate_strength
from warpmis.cache.round_records import MOST_VERTICES, RECORDED_VERTICES, RoundRecords
from warpmis.cache.spatial_cache import SpatialCache
from warpmis.cache.training import prospects, training_rounds
from warpmis.config import RenderConfig
from warpmis.device.cache_views import CacheView
from warpmis.device.compilation import Compiler
from warpmis.device.film_buffers import download_film
from warpmis.device.footprint import array_bytes
from warpmis.device.snapshot import restore, snapshot
from warpmis.device.upload import DeviceScene
from warpmis.device.views import FilmView, RoundView
from warpmis.film.film import Film
from warpmis.film.metrics import squared_scale, without_outliers
from warpmis.kernels.cache.lookup import make_locate
from warpmis.kernels.moments import SHADOW_RAY_COST
from warpmis.kernels.trace import make_trace
from warpmis.learn.schedule import Round
from warpmis.rendering.cache_rounds import PICTURE, PILOT, TRAINING, CacheRound, pilot_rounds, training_round
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.stats import CacheStats
from warpmis.rendering.tracer import Target
from warpmis.scene.features import Features

# The pilot has random numbers of its own: its samples must not be in the picture that they decide on.
PILOT_SEED = 0x51ED270B
CACHE_ARRAYS = ("cells", "shares", "densities", "pixel_worth", "records", "ratios")
# What draws directions beside light samples.
BESIDE_LIGHT_SAMPLES = ("bsdf", "guide")

PLAIN_STATE = ("strength", "traced_rays", "first_cells")


def guided_kernels(features: Features) -> tuple[wp.Kernel, ...]:
    """For paths by next-event estimation, and by the cache; for what the cache records, and for its shares."""
    plain = features.with_strategies(())
    shares = share_kernel(features.strategies or BESIDE_LIGHT_SAMPLES)
    return make_trace(plain), make_trace(features.with_cache()), make_locate(), shares


class GuidedIntegrator(Integrator):
    """One render in progress, by a spatial cache."""

    def __init__(
        self,
        scene: DeviceScene,
        features: Features,
        config: RenderConfig,
        allocation: Any,
        compiler: Compiler | None = None,
    ) -> None:
        super().__init__(scene, features.with_strategies(()), config, allocation, compiler)
        self.plain_kernel, self.guide_kernel, *self.learning_kernels = guided_kernels(features)
        self.cache = SpatialCache(scene.extent, features.strategies or BESIDE_LIGHT_SAMPLES, config.device)
        if compiler is None:
            self.compiler.wait(guided_kernels(features))
        self.strength = rate_strength(1.0, MOST_VARIANCE)
        # What pilots and trials have found, and the film of the first half of the present one.
        self.found = Findings()
        self.halves: list[Film] = []
        size = self.pixels, config.learn_budget
        self.trainings = training_rounds(*size) if config.max_depth > 0 else []
        self.prospects = prospects(self.trainings, *size)
        self.learned_film: Film | None = None  # of all training rounds that are over, at the picture's size
        self.kept_film: Film | None = None  # of those that the picture holds
        self.present: CacheRound | None = None  # the round that has begun last
        self.own_film: FilmView | None = None  # its samples, where it is not the picture's
        self.records: RoundRecords | None = None  # of the present round's vertices
        self.traced_rays = 0  # by films that are gone
        self.cache_view: CacheView | None = None  # keeps alive what the scene's view points into
        self.first_cells: NDArray[np.int32] = np.full((1, 1), -1, np.int32)  # of the pixels that were recorded last
        self.is_filled = False

    # ---- rounds ---------------------------------------------------------------------------------------------------

    def rounds(self) -> Iterator[Round]:
        """Training and the guided picture; where that is to be tried, a pilot before them, and perhaps a plain one."""
        trainings = self.trainings
        if self.config.how.tries:
            has_trial = any(training.half == 1 for training in trainings)
            if not has_trial or self.pixels * self.config.learn_budget < FEWEST_SAMPLES:
                trainings = []
            else:
                yield from self._pilot_rounds()
                if is_quiet(self.found.pilots[-1]):
                    trainings = []
                else:
                    self.compiler.begin((self.guide_kernel, *self.learning_kernels))
        dropped = math.ceil(sum(one.samples / one.stride**2 for one in trainings if not one.is_kept))
        first_sample, spent, kept, tried = 0, 0.0, 0, 0
        for number, training in enumerate(trainings, start=1):
            yield training_round(training, first_sample, f"round {number}/{len(trainings)}")
            first_sample += training.samples
            spent += training.samples / training.stride**2
            kept += training.samples * training.is_kept
            tried += training.half == 1
            if training.half == 1 and not self._is_guided_by(self.found.trials[:tried]):
                break
        # Once the picture holds samples, how many it will hold must not depend on them: a trial may end training.
        rest = self.config.spp - dropped - kept if kept else self.config.spp - math.ceil(spent)
        yield CacheRound(first_sample, rest, learn=False)

    def _pilot_rounds(self) -> Iterator[Round]:
        """In few pixels, and where those are noisy in more."""
        size = self.pixels, self.config.learn_budget
        first, full = quiet_stride(*size), pilot_stride(*size)
        yield from pilot_rounds(first)
        if full != first and not is_quiet(self.found.pilots[0]):
            yield from pilot_rounds(full)

    @property
    def is_guided(self) -> bool:
        """Whether the picture is, as far as is known."""
        return self._is_guided_by(self.found.trials)

    def _is_guided_by(self, trials: list[Trial]) -> bool:
        if not self.config.how.tries:
            return True
        return self.found.pilot is not None and pays(self.found.pilot, trials, self.prospects)

    def begin_round(self, part: Round) -> None:
        assert isinstance(part, CacheRound)
        self.present = part
        self.own_film = None if part.kind == PICTURE else self._new_film(self.rows_of(part))
        if self._is_by_cache(part):
            self._upload_cache(part)

    def _is_by_cache(self, part: CacheRound) -> bool:
        return part.kind == TRAINING or (part.kind == PICTURE and self.is_guided)

    def target_of(self, part: Round) -> Target:
        assert isinstance(part, CacheRound)
        kernel = self.guide_kernel if self._is_by_cache(part) else self.plain_kernel
        return Target(kernel, self.shares, self.own_film or self.film, self.no_moments)

    def plain_target(self) -> Target:
        return Target(self.plain_kernel, self.shares, self.film, self.no_moments)

    def _view(self, part: Round, piece: range, samples: range) -> RoundView:
        view = super()._view(part, piece, samples)
        if isinstance(part, CacheRound) and part.kind == PILOT:
            view.seed = (self.config.seed + PILOT_SEED) % 2**32
        return view

    def fill(self) -> None:
        super().fill()
        self.is_filled = True

    # ---- learning -------------------------------------------------------------------------------------------------

    def solving_kernels(self, part: Round) -> Sequence[wp.Kernel]:
        assert isinstance(part, CacheRound)
        return self.learning_kernels if part.kind == TRAINING else ()

    def solve(self, part: Round) -> None:
        assert isinstance(part, CacheRound) and self.own_film is not None
        film = download_film(self.own_film, *self._size(part.stride))
        cost = self._cost(self.own_film)
        if part.half is not None:
            self._compare(part, film, cost)
        if part.kind == TRAINING:
            self._learn(part, film, cost)
            self.learned_film, self.kept_film = self._trained_films()
        self._count_rays(self.own_film)
        self.own_film = None

    def _compare(self, part: CacheRound, film: Film, cost: float) -> None:
        """Take in one half of a pilot or a trial."""
        if part.half == 0:
            self.halves = [film]
            return
        first = self.halves.pop()
        both = first.merge(film)
        found = Trial(relative_variance(first.image(), film.image(), expected_luminance(both.color, both.count)), cost)
        (self.found.pilots if part.kind == PILOT else self.found.trials).append(found)

    def _learn(self, part: CacheRound, film: Film, cost: float) -> None:
        assert self.records is not None
        cell_of = self.cache.learn(self.records, self.launcher.run_over)
        width, height = self._size(self.records.stride)
        self.first_cells = first_cells(cell_of, (height, width, part.samples), self.records.vertices)
        self.records = None
        variance = MOST_VARIANCE
        if part.samples >= PILOT_SAMPLES:
            relative = film.variance() / np.maximum(squared_scale(film.image()), 1e-30)
            variance = float(without_outliers(relative).mean())
        self.strength = rate_strength(cost, variance)

    def _trained_films(self) -> tuple[Film | None, Film | None]:
        """Of all training rounds, and of those that the picture holds; the present one with what it has so far."""
        learned, kept, part = self.learned_film, self.kept_film, self.present
        if self.own_film is not None and part is not None and part.kind == TRAINING:
            film = download_film(self.own_film, *self._size(part.stride))
            film = film.spread_out(part.stride, self.width, self.height)
            learned = film if learned is None else learned.merge(film)
            if part.is_kept:
                kept = film if kept is None else kept.merge(film)
        return learned, kept

    def _upload_cache(self, part: CacheRound) -> None:
        """The cache as this round's kernels read it, and room for what they record."""
        view = self.cache.view(self._worth())
        if part.kind == TRAINING:
            self.records = self._new_records(part)
            self.records.show_to(view)
            view.width, view.first_sample, view.samples = self.width, part.first_sample, part.samples
        self.cache_view = view
        self.scene.view.cache = wp.array([view], dtype=CacheView, device=self.config.device)

    def _new_records(self, part: CacheRound) -> RoundRecords:
        """Of the paths in all pixels that are traced, or in as many as there is room for."""
        stride, vertices = part.stride, min(self.config.max_depth, RECORDED_VERTICES)
        while self._paths(stride, part.samples) * vertices > MOST_VERTICES:
            stride += part.stride  # a cell's first pixel is traced
        paths = self._paths(stride, part.samples)
        return RoundRecords(stride, vertices, paths, len(self.strategies), self.config.device)

    def _worth(self) -> NDArray[np.float32]:
        """What radiance is worth in each pixel, shape (pixels,): before anything is known all paths live."""
        if self.learned_film is None:
            return np.full(self.pixels, np.float32(1e30))
        return pixel_worth(expected_luminance(self.learned_film.color, self.learned_film.count), self.strength)

    def _paths(self, stride: int, samples: int) -> int:
        width, height = self._size(stride)
        return width * height * samples

    # ---- state ----------------------------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        return super().state() | {
            **{name: getattr(self, name) for name in PLAIN_STATE},
            "found": self.found.to_dict(),
            "halves": [dict(vars(film)) for film in self.halves],
            "films": [film and dict(vars(film)) for film in (self.learned_film, self.kept_film)],
            "own_film": self.own_film and snapshot(self.own_film),
            "records": self.records and self.records.state(),
            "cache": self.cache.state(),
        }

    def resume(self, state: dict[str, Any]) -> None:
        super().resume(state)
        for name in PLAIN_STATE:
            setattr(self, name, state[name])
        self.found = Findings.from_dict(state["found"])
        self.halves = [Film(**film) for film in state["halves"]]
        self.learned_film, self.kept_film = (film and Film(**film) for film in state["films"])
        self.cache.resume(state["cache"])

    def resume_round(self, part: Round, state: dict[str, Any]) -> None:
        """Get ready for the rest of a round."""
        self.begin_round(part)
        if self.own_film is not None and state["own_film"] is not None:
            restore(self.own_film, state["own_film"])
        if self.records is not None and state["records"] is not None:
            self.records.resume(state["records"])

    def common_of(self, part: Round) -> dict[str, Any]:
        film = self.learned_film and dict(vars(self.learned_film))
        plain = {name: getattr(self, name) for name in PLAIN_STATE}
        to_come = [dict(vars(prospect)) for prospect in self.prospects]
        return {**plain, "found": self.found.to_dict(), "prospects": to_come, "film": film, "cache": self.cache.state()}

    def adopt(self, part: Round, common: dict[str, Any]) -> None:
        for name in PLAIN_STATE:
            setattr(self, name, common[name])
        self.found = Findings.from_dict(common["found"])
        self.prospects = [Prospect(**one) for one in common["prospects"]]
        self.learned_film = common["film"] and Film(**common["film"])
        self.cache.resume(common["cache"])
        self.records = None
        self.begin_round(part)

    def records_taken(self) -> tuple[NDArray[Any], ...]:
        return () if self.records is None else self.records.take()

    def put_records(self, records: tuple[NDArray[Any], ...]) -> None:
        if self.records is not None and records:
            self.records.put(records)

    # ---- results ------------------------------------------------------------------------------------------------

    def _cost(self, film: FilmView) -> float:
        """Of one path [rays]."""
        paths = max(int(film.accepted.numpy().sum()), 1)
        return float(film.rays.numpy().sum() + SHADOW_RAY_COST * film.shadow_rays.numpy().sum()) / paths

    def _count_rays(self, film: FilmView) -> None:
        self.traced_rays += int(film.rays.numpy().sum() + film.shadow_rays.numpy().sum())

    @property
    def strategies(self) -> tuple[str, ...]:
        return self.cache.sharing.strategies

    def allocation_map(self) -> NDArray[np.float32]:
        """Shares of what draws directions at the first vertex, shape (H, W, S); equal ones where nothing is guided."""
        cells = self.first_cells if self.is_guided else np.full((1, 1), -1, np.int32)
        return shares_of(self.cache, cells, (self.height, self.width))

    def cache_maps(self) -> CacheMaps | None:
        if not self.is_guided:
            return None
        return maps_of(self.cache, self.first_cells, (self.height, self.width), self._worth())

    def cache_stats(self) -> CacheStats | None:
        stats: CacheStats = {"guided": self.is_guided, "gains": self.found.gains, "cells": self.cache.cells}
        if self.found.pilot is not None:
            stats["variance"] = self.found.pilot.variance
        return stats

    def next_event_map(self) -> NDArray[np.float32]:
        return np.full((self.height, self.width), 0.0 if self.is_guided else 1.0, np.float32)

    def bytes(self) -> dict[str, Any]:
        memory = super().bytes()
        if self.cache_view is not None:
            memory["picture"] += array_bytes(
                [self.cache_view.tree, *(getattr(self.cache_view, name) for name in CACHE_ARRAYS)]
            )
        return memory

    def rays(self) -> int:
        return self.traced_rays + super().rays()

    def download(self) -> tuple[Film, ...]:
        """The picture's samples: of the training rounds that it holds, and of the render."""
        final = download_film(self.film, self.width, self.height)
        learned, kept = self._trained_films()
        if kept is not None:
            return kept, final
        # An interrupted render shows what it has.
        has_more = self.is_filled or not final.count.any()
        return (learned, final) if learned is not None and has_more else (final,)

    def color_sums(self) -> NDArray[np.float64]:
        colors = [super().color_sums()]
        if self.kept_film is not None:
            colors.append(self.kept_film.color)
        if self.own_film is not None and self.present is not None and self.present.is_kept:
            colors.append(self.own_film.color.numpy().reshape(self.height, self.width, 3))
        sums: NDArray[np.float64] = np.sum(colors, axis=0)
        return sums
