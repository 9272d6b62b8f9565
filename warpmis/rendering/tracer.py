"""The samples of a round, launch by launch: the buffers on a device that they fill, and how far they have come."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
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
from warpmis.learn.schedule import Round
from warpmis.rendering.held import interrupts_held
from warpmis.rendering.kernel_choice import camera_kernels, learner_of, trace_kernels
from warpmis.rendering.launches import Launcher, Piece
from warpmis.rendering.light_path_aovs import light_path_aovs
from warpmis.rendering.round_view import round_view
from warpmis.scene.features import Features

# What kernels without a mixture take for moments.
vec1d = wp.types.vector(length=1, dtype=wp.float64)

# Traces some samples of a piece of a round, and puts the sums into the integrator; see Integrator.trace.
Remote = Callable[[Round, range, range, Callable[[int], None]], None]


@dataclass(frozen=True, eq=False)
class Target:
    """The kernel that a round's launches go through, the shares that it reads, and where its samples go."""

    kernel: wp.Kernel
    shares: wp.array
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
        kernels = self.learn_kernel, self.kernel = trace_kernels(features)
        self.learner = learner_of(features, config, (self.width, self.height))
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
        # The rows that are traced here, None for all; or what traces them elsewhere.
        self.window: range | None = None
        self.remote: Remote | None = None
        # Whether a pass has begun, so that there is a state to be taken.
        self.has_state = False
        self._allocate()

    def _allocate(self) -> None:
        device = self.config.device
        # One row for kernels without a mixture, which take no moments either.
        shares = self.start_allocation if self.count else np.zeros((1, 1), dtype=np.float32)
        vec_s = wp.types.vector(length=shares.shape[1], dtype=wp.float32)
        self.shares = wp.array(shares, dtype=vec_s, device=device)
        self.no_moments = wp.zeros(1, dtype=vec1d, device=device)
        self.learn_film = self._new_film(self.pixels if self.config.how.learns else 0)
        self.film = self._new_film(self.pixels)
        if self.aovs is not None:
            self.aov_view = self.aovs.view(self.pixels, device)  # what the scene's view points into
            self.scene.view.aov = wp.array([self.aov_view], dtype=AovView, device=device)

    def _new_film(self, pixels: int) -> FilmView:
        return allocate_film(pixels, self.config.device, 0 if self.aovs is None else self.aovs.row_count)

    def target_of(self, part: Round) -> Target:
        if part.learn:
            return Target(self.learn_kernel, self.shares, self.learn_film, self.learner.moments)
        return Target(self.kernel, self.shares, self.film, self.learner.plain_moments)

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
        """Trace some samples of a round in all its rows, or those of the window."""
        view, target = self._view(part, piece, samples), self.target_of(part)
        self.compiler.wait([target.kernel])
        self._trace(target, view, advance)

    def begin_pass(self, part: Round, samples: range) -> None:
        """Get ready for some samples of a round; if they have been begun, for the pixels that do not have them."""
        with interrupts_held():
            if samples != self.passing:
                if samples.start == part.first_sample:
                    self.begin_round(part)
                self.passing = samples
                self.traced = np.zeros(self.rows_of(part), np.bool_)
            self.has_state = True

    def end_pass(self) -> None:
        with interrupts_held():
            self.next_sample = self.passing.stop
            self.passing, self.traced = range(0), np.zeros(0, np.bool_)

    def begin_round(self, part: Round) -> None:
        self.learner.begin_round(part.learn)

    def rows_of(self, part: Round) -> int:
        """What a round traces: pixels, or the cells of which it traces one each."""
        width, height = self._size(part.stride)
        return width * height

    def _size(self, stride: int) -> tuple[int, int]:
        return -(-self.width // stride), -(-self.height // stride)

    def _view(self, part: Round, piece: range, samples: range) -> RoundView:
        view = round_view(self.config, part, piece)
        view.first_sample, view.end_sample = samples.start, samples.stop
        return view

    def _trace(self, target: Target, view: RoundView, advance: Callable[[int], None]) -> None:
        """Launch a kernel over the rows that are not through."""
        lock = threading.Lock()
        samples = view.end_sample - view.first_sample
        traced = self.traced.astype(np.uint8) if self.traced.any() else np.zeros(0, np.uint8)
        skipped = wp.array(traced, dtype=wp.uint8, device=self.config.device)

        def launch(piece: Piece) -> None:
            self._launch(target, skipped, view, *piece)
            rows = slice(piece[0], sum(piece))
            with lock:
                left = int((~self.traced[rows]).sum())
                self.traced[rows] = True
                advance(left * samples)

        window = self.window or range(len(self.traced))
        pieces = self.launcher.pieces(len(window), samples)
        self.launcher.run(launch, ((window.start + first, count) for first, count in pieces))

    def _launch(self, target: Target, skipped: wp.array, view: RoundView, first: int, count: int) -> None:
        inputs = [self.scene.view, self.scene.camera, view, first, skipped, target.shares, target.film, target.moments]
        wp.launch(target.kernel, dim=count, inputs=inputs, device=self.config.device)
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
        target = self.target_of(part)
        moments = {"moments": target.moments} if target.moments.shape[0] == self.rows_of(part) else {}
        return {"film": target.film} | moments

    def decisions_of(self, part: Round) -> dict[str, Any]:
        """What the rows of a round have been given, row by row."""
        shares = self.target_of(part).shares
        return {"shares": shares} if shares.shape[0] == self.rows_of(part) else {}

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
        kept: dict[str, Any] = {"film": self.film, "learn_film": self.learn_film, "shares": self.shares}
        return kept | {"moments": self.learner.moments, "plain_moments": self.learner.plain_moments}
