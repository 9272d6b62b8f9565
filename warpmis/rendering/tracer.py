"""The samples of a round, launch by launch: the buffers on a device that they fill, and how far they have come."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.config import RenderConfig
from warpmis.device.aov_views import AovView
from warpmis.device.compilation import Compiler
from warpmis.device.film_buffers import allocate_film
from warpmis.device.snapshot import restore, snapshot
from warpmis.device.upload import DeviceScene
from warpmis.device.views import FilmView, RoundView
from warpmis.learn.allocation import MIXTURE, NEXT_EVENT, Allocation
from warpmis.learn.schedule import Round
from warpmis.rendering.kernel_choice import camera_kernels, learner_of, trace_kernels
from warpmis.rendering.launches import Launcher, Piece
from warpmis.rendering.light_path_aovs import light_path_aovs
from warpmis.rendering.round_view import round_view
from warpmis.scene.features import Features

# What kernels without a mixture take for shares and moments.
vec1f = wp.types.vector(length=1, dtype=wp.float32)
vec1d = wp.types.vector(length=1, dtype=wp.float64)

# Traces some samples of a piece of a round, and puts the sums into the integrator; see Integrator.trace.
Remote = Callable[[Round, range, range, Callable[[int], None]], None]

# No kernel's estimator: a pixel that the pass is over with.
DONE = 255


@dataclass(frozen=True, eq=False)
class Pass:
    """The launches of a round that go through one kernel, and where their samples go.

    estimators, estimator: the launches are for the pixels whose entry is this one; `estimators` is empty where they are
    for all pixels.
    """

    kernel: wp.Kernel
    estimators: wp.array
    estimator: int
    allocation: wp.array
    film: FilmView
    moments: wp.array


class RoundTracer:
    """The buffers of one render on one device, and the launches that fill them."""

    def __init__(
        self,
        scene: DeviceScene,
        features: Features,
        config: RenderConfig,
        allocation: NDArray[np.float32],
        compiler: Compiler | None = None,
    ) -> None:
        """compiler: where the kernels come from when they are needed; without one all are here from the beginning."""
        self.scene = scene
        self.config = config
        self.width, self.height = scene.camera.width, scene.camera.height
        self.pixels = self.width * self.height
        self.count = len(features.strategies)
        self.start_allocation = allocation
        kernels = self.learn_kernel, self.kernel, self.next_event_kernel = trace_kernels(features)
        self.learner = learner_of(features, config, (self.width, self.height))
        self.stride = self.learner.stride
        self.features = features
        self.compiler = compiler or Compiler(config.device)
        if compiler is None:
            self.compiler.wait((*kernels, *self.learner.kernels, *camera_kernels(features, config)))
        self.launcher = Launcher(config.device, config.threads)
        self.aovs = light_path_aovs(config.aov, scene.light_groups)
        # Samples of the present round that all pixels have, and of the pass under way which ones have those, too.
        self.next_sample = 0
        self.passing = range(0)
        self.traced: NDArray[np.bool_] = np.zeros(0, np.bool_)
        # The rows that are traced here, of pixels or cells, None for all; or what traces them elsewhere.
        self.window: range | None = None
        self.remote: Remote | None = None
        # Whether all of this, sums included, belongs together, so that a state can be taken.
        self.settled = False
        self._allocate()

    def _allocate(self) -> None:
        device, next_event = self.config.device, self.config.how.next_event
        shares = self.start_allocation if self.count else np.zeros((1, 1), dtype=np.float32)
        self.allocation = Allocation.of(shares, next_event, device)
        # What is learned: of the cells, from their films.
        self.learned = self.allocation
        if self.stride > 1:
            self.learned = Allocation.of(shares[: self.learner.cells], next_event, device)
        self.learn_film = self._new_film(self.learner.cells if self.config.how.learns else 0)
        self.film = self._new_film(self.pixels)
        if self.aovs is not None:
            self.aov_view = self.aovs.view(self.pixels, device)  # what the scene's view points into
            self.scene.view.aov = wp.array([self.aov_view], dtype=AovView, device=device)
        # For kernels without a mixture.
        self.no_shares = wp.zeros(1, dtype=vec1f, device=device)
        self.no_moments = wp.zeros(1, dtype=vec1d, device=device)

    def _new_film(self, pixels: int) -> FilmView:
        return allocate_film(pixels, self.config.device, 0 if self.aovs is None else self.aovs.row_count)

    def _passes(self, learn: bool) -> list[Pass]:
        """Those of a round: one, or two where some pixels have next-event estimation and others the mixture."""
        device = self.config.device
        all_pixels = wp.empty(0, dtype=wp.uint8, device=device)
        if learn:
            return [Pass(self.learn_kernel, all_pixels, 0, self.learned.shares, self.learn_film, self.learner.moments)]
        plain = self.learner.plain_moments
        mixture = Pass(self.kernel, all_pixels, MIXTURE, self.allocation.shares, self.film, plain)
        next_event = Pass(self.next_event_kernel, all_pixels, NEXT_EVENT, self.no_shares, self.film, self.no_moments)
        is_next_event = self.allocation.is_next_event()
        if not is_next_event.any():
            return [mixture]
        if is_next_event.all():
            return [next_event]
        return [replace(one, estimators=self.allocation.estimators) for one in (mixture, next_event)]

    def _sample_counts(self, part: Round, samples: range) -> NDArray[np.int64]:
        """How many of the samples each pixel takes; each cell, where it learns."""
        if part.learn:
            return np.full(self.learner.cells, len(samples))
        counts = np.full((self.height, self.width), len(samples))
        if part.pilot:
            counts[:: self.stride, :: self.stride] = len(range(max(samples.start, part.pilot), samples.stop))
        return counts.reshape(-1)

    def trace(
        self, part: Round, advance: Callable[[int], None], piece: range | None = None, samples: range | None = None
    ) -> None:
        """Trace one round, or a piece of its samples, or of this piece some; the pieces in turn are the round.

        A piece is what the sampler spreads evenly. Where it is cut, no bit of the sums depends on.
        `advance` is told the number of pixel samples of each launch that is done.
        """
        piece = piece or range(part.first_sample, part.first_sample + part.samples)
        samples = samples or piece
        self.begin_pass(part, samples)
        if self.remote is not None:
            self.remote(part, piece, samples, advance)
        else:
            self.trace_rows(part, piece, samples, advance)
        self.end_pass()

    def trace_rows(self, part: Round, piece: range, samples: range, advance: Callable[[int], None]) -> None:
        """Trace some samples of a round for all pixels, or cells, or those of the window."""
        view, taken = self._view(part, piece, samples, self.stride), self._sample_counts(part, samples)
        for passes in self._waves(self._passes(part.learn)):
            self.compiler.wait([one.kernel for one in passes])
            counts = taken
            if len(passes) == 1 and passes[0].estimators.shape[0]:
                counts = taken * (passes[0].estimators.numpy() == passes[0].estimator)
            self._trace(passes, view, counts, advance)

    def begin_pass(self, part: Round, samples: range) -> None:
        """Get ready for some samples of a round; if they have been begun, for the pixels that do not have them."""
        if samples != self.passing:
            self.settled = False
            if samples.start == part.first_sample:
                self.begin_round(part)
            self.passing = samples
            self.traced = np.zeros(self.rows_of(part), np.bool_)
        self.settled = True

    def end_pass(self) -> None:
        self.settled = False
        self.next_sample = self.passing.stop
        self.passing, self.traced = range(0), np.zeros(0, np.bool_)
        self.settled = True

    def begin_round(self, part: Round) -> None:
        self.learner.begin_round(part.learn)

    def rows_of(self, part: Round) -> int:
        """What a round traces: pixels, or the cells of which it traces one each."""
        return self.learner.cells if part.learn else self.pixels

    def _view(self, part: Round, piece: range, samples: range, stride: int) -> RoundView:
        view = round_view(self.config, part, piece, stride)
        view.first_sample, view.end_sample = samples.start, samples.stop
        return view

    def _waves(self, passes: list[Pass]) -> list[list[Pass]]:
        """Passes to launch together: all of them, or while a kernel is being compiled the others first.

        Each pixel goes through one pass, so the picture is the same.
        """
        kernels = [one.kernel for one in passes]
        self.compiler.begin(kernels)
        if not any(self.compiler.compiles(kernel) for kernel in kernels):
            return [passes]
        return [[one] for one in sorted(passes, key=lambda one: self.compiler.place(one.kernel))]

    def _trace(
        self, passes: list[Pass], view: RoundView, counts: NDArray[np.int64], advance: Callable[[int], None]
    ) -> None:
        """Launch the passes over the pixels, or cells, that are not through; `counts`: samples that each takes."""
        lock = threading.Lock()
        counts = np.where(self.traced, 0, counts)
        passes = [self._without_traced(one) for one in passes] if self.traced.any() else passes
        traces = [one.estimators.numpy() == one.estimator if one.estimators.shape[0] else None for one in passes]

        def launch(piece: Piece) -> None:
            self._launch(passes, view, *piece)
            rows = slice(piece[0], sum(piece))
            with lock:
                for own in traces:
                    self.traced[rows] |= True if own is None else own[rows]
                advance(int(counts[rows].sum()))

        window = self.window or range(len(counts))
        pieces = self.launcher.pieces(len(window), view.end_sample - view.first_sample)
        self.launcher.run(launch, ((window.start + first, count) for first, count in pieces))

    def _without_traced(self, one: Pass) -> Pass:
        """The pass for the pixels that are not through."""
        own = one.estimators.numpy() if one.estimators.shape[0] else np.full(len(self.traced), one.estimator)
        left = np.where(self.traced, DONE, own).astype(np.uint8)
        return replace(one, estimators=wp.array(left, dtype=wp.uint8, device=self.config.device))

    def _launch(self, passes: list[Pass], view: RoundView, first: int, count: int) -> None:
        for one in passes:
            inputs = [self.scene.view, self.scene.camera, view, first, one.estimators, one.estimator]
            inputs += [one.allocation, one.film, one.moments]
            wp.launch(one.kernel, dim=count, inputs=inputs, device=self.config.device)
        if self.launcher.is_cuda:
            wp.synchronize_device(self.config.device)

    # ---- state -----------------------------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """All that later samples and the picture depend on, between two launches: arrays and plain values."""
        return {
            "next_sample": self.next_sample,
            "passing": [self.passing.start, self.passing.stop],
            "traced": self.traced,
            "kept": {name: snapshot(value) for name, value in self._kept().items()},
        }

    def resume(self, state: dict[str, Any]) -> None:
        """Go on from a state of the same render."""
        self.next_sample = state["next_sample"]
        self.passing, self.traced = range(*state["passing"]), state["traced"]
        for name, value in self._kept().items():
            restore(value, state["kept"][name])

    # ---- rows, for those who trace elsewhere -------------------------------------------------------------------------

    def sums_of(self, part: Round) -> dict[str, Any]:
        """What a round adds to, row by row, each under a name."""
        film, moments = (
            (self.learn_film, self.learner.moments) if part.learn else (self.film, self.learner.plain_moments)
        )
        return {"film": film} | ({"moments": moments} if moments.shape[0] == self.rows_of(part) else {})

    def decisions_of(self, part: Round) -> dict[str, Any]:
        """What the rows of a round have been given, row by row."""
        own = self.learned if part.learn else self.allocation
        given = {"shares": own.shares, "estimators": own.estimators}
        return {name: array for name, array in given.items() if array.shape[0] == self.rows_of(part)}

    def kernels_of(self, part: Round) -> list[wp.Kernel]:
        """What traces a round."""
        return [one.kernel for one in self._passes(part.learn)]

    def common_of(self, part: Round) -> dict[str, Any]:
        """What all rows of a round share, as arrays and plain values."""
        return {}

    def adopt(self, part: Round, common: dict[str, Any]) -> None:
        """Get ready to trace rows of a round that another integrator has begun."""

    def records_taken(self) -> tuple[NDArray[Any], ...]:
        """What a round has recorded beside its sums: places and bytes; it is then forgotten."""
        return ()

    def put_records(self, records: tuple[NDArray[Any], ...]) -> None:
        """Take in what another integrator has recorded."""

    def resume_round(self, part: Round, state: dict[str, Any]) -> None:
        """Get ready for the rest of a round that had begun."""

    def _kept(self) -> dict[str, Any]:
        """What stays on the device from round to round."""
        kept: dict[str, Any] = {"film": self.film, "learn_film": self.learn_film}
        for name, one in (("allocation", self.allocation), ("learned", self.learned)):
            kept |= {f"{name}.shares": one.shares, f"{name}.estimators": one.estimators}
        return kept | {"moments": self.learner.moments, "plain_moments": self.learner.plain_moments}
