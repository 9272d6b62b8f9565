"""A render by the spatial cache: a pilot that decides, rounds that train, and the picture.

The pilot's samples and those of small training rounds are left out of the picture. All others count alike, and what a
round does depends on earlier rounds alone. So every round is unbiased given those before it, and so is their sum.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.cache.gate import PILOT_SAMPLES, THRESHOLD, pilot_stride, relative_variance
from warpmis.cache.pixel_worth import expected_luminance, pixel_worth, rate_strength
from warpmis.cache.spatial_cache import SpatialCache
from warpmis.cache.training import Training, training_rounds
from warpmis.config import RenderConfig
from warpmis.device.cache_views import CacheView, VertexRecord
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
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.round_view import round_view
from warpmis.rendering.tracer import Pass
from warpmis.scene.features import Features

# The pilot has random numbers of its own: its samples must not be in the picture that they decide on.
PILOT_SEED = 0x51ED270B
# Most vertices that a round records, at 64 bytes each, and most of one path.
MOST_RECORDS = 1_000_000
RECORDED_VERTICES = 8
CACHE_ARRAYS = ("nodes", "cells", "densities", "pixel_worth", "records")


def guided_kernels(features: Features) -> tuple[wp.Kernel, ...]:
    """For the pilot and pictures that do not gain; for rounds that train, and their records; and for the picture."""
    record, guide = (make_trace(features.with_cache(cache)) for cache in ("record", "guide"))
    return (make_trace(features), record, make_locate(), guide)


@dataclass(frozen=True)
class CacheRound(Round):
    """A round of the cache. pilot_half: which of the pilot's two, None for others; training: None for those that do
    not train."""

    pilot_half: int | None = None
    training: Training | None = None

    @property
    def stride(self) -> int:
        return self.training.stride if self.training else 1


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
        super().__init__(scene, features, config, allocation, compiler)
        self.plain_kernel, self.record_kernel, self.locate_kernel, self.guide_kernel = guided_kernels(features)
        self.cache = SpatialCache(scene.extent, config.device)
        if compiler is None:
            self.compiler.wait(guided_kernels(features))
        self.is_guided = False
        self.strength = 1.0
        self.pilot_pictures: list[Film] = []
        self.learned_film: Film | None = None  # of all training rounds that are over, at the picture's size
        self.kept_film: Film | None = None  # of those that the picture holds
        self.training: tuple[Training, FilmView] | None = None  # the present round
        self.records: wp.array | None = None
        self.traced_rays = 0  # by films that are gone
        self.cache_view: CacheView | None = None  # keeps alive what the scene's view points into
        self.present: CacheRound | None = None  # the round that has begun last
        self.is_filled = False

    def rounds(self) -> Iterator[Round]:
        """The pilot; then a plain render, or training and a guided one."""
        for half in (0, 1) if self.config.max_depth > 0 else ():
            first = half * PILOT_SAMPLES
            yield CacheRound(first, PILOT_SAMPLES, learn=True, label="pilot", is_kept=False, pilot_half=half)
        trainings = training_rounds(self.pixels, self.config.learn_budget) if self.is_guided else []
        first_sample, spent = 0, 0.0
        for number, training in enumerate(trainings, start=1):
            yield CacheRound(
                first_sample,
                training.samples,
                learn=True,
                label=f"round {number}/{len(trainings)}",
                is_kept=training.is_kept,
                may_be_left_out=True,
                training=training,
            )
            first_sample += training.samples
            spent += training.samples / training.stride**2
        yield CacheRound(first_sample, self.config.spp - math.ceil(spent), learn=False)

    def trace(
        self, part: Round, advance: Callable[[int], None], piece: range | None = None, samples: range | None = None
    ) -> None:
        assert isinstance(part, CacheRound)
        if part.pilot_half is None:
            super().trace(part, advance, piece, samples)
            return
        whole = range(part.first_sample, part.first_sample + part.samples)
        self.begin_pass(part, whole)
        self._trace_pilot(part, whole)
        self.end_pass()

    def trace_rows(self, part: Round, piece: range, samples: range, advance: Callable[[int], None]) -> None:
        assert isinstance(part, CacheRound)
        view = self._view(part, piece, samples, part.stride)
        if self.training is not None:
            self._launch_round(self.record_kernel, self.training[1], view, advance)
        else:
            self._launch_round(self.guide_kernel if self.is_guided else self.plain_kernel, self.film, view, advance)

    def begin_round(self, part: Round) -> None:
        assert isinstance(part, CacheRound)
        self.present = part
        if self.is_guided:
            self._upload_cache(part)
            if part.training:
                self.training = part.training, self._new_film(self._cells(part.stride))

    def rows_of(self, part: Round) -> int:
        assert isinstance(part, CacheRound)
        return self._cells(pilot_stride(self.pixels) if part.pilot_half is not None else part.stride)

    def _trace_pilot(self, part: CacheRound, samples: range) -> None:
        self.settled = False  # half a pilot is begun anew
        stride = pilot_stride(self.pixels)
        view = round_view(self.config, part, samples, stride)
        view.seed = (self.config.seed + PILOT_SEED) % 2**32
        film = self._new_film(self._cells(stride))
        self._launch_round(self.plain_kernel, film, view, lambda samples: None)
        self._count_rays(film)
        self.pilot_pictures.append(download_film(film, *self._size(stride)))

    def fill(self) -> None:
        super().fill()
        self.is_filled = True

    def _trace_first(self, part: Round) -> None:
        view = self._view(part, range(1), range(1), 1)
        self._launch_round(self.plain_kernel, self.film, view, lambda samples: None)

    def _launch_round(self, kernel: wp.Kernel, film: FilmView, view: RoundView, advance: Callable[[int], None]) -> None:
        self.compiler.wait([kernel])
        all_pixels = wp.empty(0, dtype=wp.uint8, device=self.config.device)
        passes = [Pass(kernel, all_pixels, 0, self.no_shares, film, self.no_moments)]
        self._trace(passes, view, np.full(film.color.shape[0], view.end_sample - view.first_sample), advance)

    def _size(self, stride: int) -> tuple[int, int]:
        return -(-self.width // stride), -(-self.height // stride)

    def _cells(self, stride: int) -> int:
        width, height = self._size(stride)
        return width * height

    # ---- learning -----------------------------------------------------------------------------------------------

    def solve(self, part: Round) -> None:
        assert isinstance(part, CacheRound)
        if part.pilot_half == 1:
            self._decide()
        elif part.training is not None:
            self._learn()

    def _decide(self) -> None:
        """Whether this picture is guided, and what its rates begin with."""
        first, second = self.pilot_pictures
        both = first.merge(second)
        variance = relative_variance(first.image(), second.image(), expected_luminance(both.color, both.count))
        self.strength = rate_strength(self.traced_rays / max(int(both.count.sum()), 1), variance)
        self.is_guided = variance > THRESHOLD
        if self.is_guided:
            self.compiler.begin((self.record_kernel, self.locate_kernel, self.guide_kernel))

    def _learn(self) -> None:
        assert self.records is not None and self.training is not None
        self.compiler.wait([self.locate_kernel])
        self.cache.learn(self.records, self.launcher.run_over)
        self.records = None
        training, view = self.training
        if training.stride == 1 and training.samples > 2:
            self._update_strength(download_film(view, self.width, self.height), self._cost(view))
        self._count_rays(view)
        self.learned_film, self.kept_film = self._trained_films()
        self.training = None

    def _trained_films(self) -> tuple[Film | None, Film | None]:
        """Of all training rounds, and of those that the picture holds; the present one with what it has so far."""
        learned, kept = self.learned_film, self.kept_film
        if self.training is not None:
            training, view = self.training
            film = download_film(view, *self._size(training.stride))
            film = film.spread_out(training.stride, self.width, self.height)
            learned = film if learned is None else learned.merge(film)
            if training.is_kept:
                kept = film if kept is None else kept.merge(film)
        return learned, kept

    def _update_strength(self, film: Film, cost: float) -> None:
        relative = film.variance() / np.maximum(squared_scale(film.image()), 1e-30)
        self.strength = rate_strength(cost, float(without_outliers(relative).mean()))

    def _upload_cache(self, part: CacheRound) -> None:
        """The cache as this round's kernels read it, and room for what they record."""
        worth = np.full(self.pixels, np.float32(1e30))  # before anything is known all paths live
        if self.learned_film is not None:
            worth = pixel_worth(expected_luminance(self.learned_film.color, self.learned_film.count), self.strength)
        view = self.cache.view(worth)
        if part.training:
            stride = part.stride
            vertices = min(self.config.max_depth, RECORDED_VERTICES)
            while self._cells(stride) * part.samples * vertices > MOST_RECORDS:
                stride += part.stride  # a cell's first pixel is traced
            count = self._cells(stride) * part.samples * vertices
            self.records = wp.zeros(count, dtype=VertexRecord, device=self.config.device)
            view.records, view.width, view.record_stride = self.records, self.width, stride
            view.vertices, view.first_sample, view.samples = vertices, part.first_sample, part.samples
        self.cache_view = view
        self.scene.view.cache = wp.array([view], dtype=CacheView, device=self.config.device)

    # ---- state ----------------------------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        return super().state() | {
            **{name: getattr(self, name) for name in ("is_guided", "strength", "traced_rays")},
            "pilot": [dict(vars(film)) for film in self.pilot_pictures],
            "films": [film and dict(vars(film)) for film in (self.learned_film, self.kept_film)],
            "training": self.training and {"round": vars(self.training[0]), "film": snapshot(self.training[1])},
            "records": None if self.records is None else self.records.numpy().view(np.uint8),
            "cache": self.cache.state(),
        }

    def resume(self, state: dict[str, Any]) -> None:
        super().resume(state)
        for name in ("is_guided", "strength", "traced_rays"):
            setattr(self, name, state[name])
        self.pilot_pictures = [Film(**film) for film in state["pilot"]]
        self.learned_film, self.kept_film = (film and Film(**film) for film in state["films"])
        self.cache.resume(state["cache"])
        if state["training"] is not None:
            training = Training(**state["training"]["round"])
            self.training = training, self._new_film(self._cells(training.stride))
            restore(self.training[1], state["training"]["film"])

    def sums_of(self, part: Round) -> dict[str, Any]:
        return {"film": self.film if self.training is None else self.training[1]}

    def decisions_of(self, part: Round) -> dict[str, Any]:
        return {}

    def kernels_of(self, part: Round) -> list[wp.Kernel]:
        if self.training is not None:
            return [self.record_kernel]
        return [self.guide_kernel if self.is_guided else self.plain_kernel]

    def common_of(self, part: Round) -> dict[str, Any]:
        films = [film and dict(vars(film)) for film in (self.learned_film, None)]
        return {"is_guided": self.is_guided, "strength": self.strength, "films": films, "cache": self.cache.state()}

    def adopt(self, part: Round, common: dict[str, Any]) -> None:
        self.is_guided, self.strength = common["is_guided"], common["strength"]
        self.learned_film = common["films"][0] and Film(**common["films"][0])
        self.cache.resume(common["cache"])
        self.training, self.records = None, None
        self.begin_round(part)

    def records_taken(self) -> tuple[NDArray[Any], ...]:
        if self.records is None:
            return ()
        table = self.records.numpy()
        places = np.flatnonzero(table["used"] != 0)
        taken = table[places].view(np.uint8)
        self.records.zero_()
        return places, taken

    def put_records(self, records: tuple[NDArray[Any], ...]) -> None:
        if self.records is None or not records:
            return
        places, taken = records
        table = self.records.numpy()
        table[places] = taken.view(table.dtype).reshape(places.shape)
        if self.launcher.is_cuda:
            self.records.assign(table)

    def resume_round(self, part: Round, state: dict[str, Any]) -> None:
        """Get ready for the rest of a round."""
        assert isinstance(part, CacheRound)
        self.present = part
        if not self.is_guided:
            return
        self._upload_cache(part)
        if self.records is not None and state["records"] is not None:
            self.records.assign(state["records"].view(self.records.numpy().dtype).reshape(self.records.shape))

    # ---- results ------------------------------------------------------------------------------------------------

    def _cost(self, film: FilmView) -> float:
        """Of one path [rays]."""
        paths = max(int(film.accepted.numpy().sum()), 1)
        return float(film.rays.numpy().sum() + SHADOW_RAY_COST * film.shadow_rays.numpy().sum()) / paths

    def _count_rays(self, film: FilmView) -> None:
        self.traced_rays += int(film.rays.numpy().sum() + film.shadow_rays.numpy().sum())

    def next_event_share(self) -> float:
        return 0.0 if self.is_guided else 1.0

    def bytes(self) -> dict[str, Any]:
        memory = super().bytes()
        if self.cache_view is not None:
            memory["picture"] += array_bytes([getattr(self.cache_view, name) for name in CACHE_ARRAYS])
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
        if self.training is not None and self.training[0].is_kept:
            colors.append(self.training[1].color.numpy().reshape(self.height, self.width, 3))
        sums: NDArray[np.float64] = np.sum(colors, axis=0)
        return sums
