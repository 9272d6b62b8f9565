"""One render under way, and the result that is made of its films."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.config import RenderConfig, SettingsDict
from warpmis.device import kernel_cache
from warpmis.film.film import Film
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.reporter import Reporter
from warpmis.rendering.result import RenderResult
from warpmis.rendering.seen import seen_coverage, seen_ids, seen_surfaces
from warpmis.rendering.stats import RenderStats
from warpmis.scene import Scene
from warpmis.scene.features import Features

PASS_SECONDS = 2.0


@dataclass(eq=False)
class Run:
    """One render under way: all that it is at between two launches is in `state`.

    Attributes:
        round_allocations: the allocation after each learn round so far, if they are to be kept.
        after_pass: called whenever a pass over the picture is through, and on a cluster more often.
        pass_seconds: about how long a pass takes once the first ones are through [s].
        first_pass, growth: samples of a piece's first pass, and how many times as many the next one takes at most.
        round: the present round's number, from 0 on.
        has_begun: whether that round has; else the one before is over, with what it learned.
        saved: the state that this run goes on from, until it has come to the round where that was taken.
    """

    scene: Scene
    config: RenderConfig
    features: Features
    integrator: Integrator
    reporter: Reporter
    round_allocations: list[NDArray[np.float32]] = field(default_factory=list)
    after_pass: list[Callable[[Run], None]] = field(default_factory=list)
    pass_seconds: float = PASS_SECONDS
    first_pass: int = 1
    growth: int = 2
    round: int = 0
    has_begun: bool = False
    saved: dict[str, Any] | None = None

    def between(self, is_kept: bool) -> None:
        """What is to be done now and then, while no launch is under way; is_kept: the picture holds the samples."""
        for call in self.after_pass:
            call(self)
        if self.reporter.preview is not None and is_kept:
            self.reporter.preview.offer(self.image)

    def state(self) -> dict[str, Any]:
        """Arrays and plain values, from which another process goes on to the same bits."""
        watch = self.reporter.watch
        return {
            "round": self.round,
            "has_begun": self.has_begun,
            "integrator": self.integrator.state(),
            "reporter": self.reporter.state(),
            "watch": watch and watch.state(),
            "round_allocations": list(self.round_allocations),
        }

    def resume(self, state: dict[str, Any]) -> None:
        """Go on from a state of the same render."""
        self.saved, self.round, self.has_begun = state, state["round"], state["has_begun"]
        self.integrator.resume(state["integrator"])
        self.reporter.resume(state["reporter"])
        self.round_allocations[:] = state["round_allocations"]
        if self.reporter.watch is not None:
            self.reporter.watch.resume(state["watch"])

    def image(self) -> NDArray[np.float32]:
        """The picture of all samples so far, linear Rec.709, shape (H, W, 3)."""
        return self._films()[0].image() * np.float32(self.scene.camera.exposure)

    def result(self, notes: Sequence[str] = (), interrupted: str = "") -> RenderResult:
        """The picture of all samples so far, with `notes` after the scene's own; interrupted: where, if it was."""
        scene, config, integrator = self.scene, self.config, self.integrator
        film, final = self._films()
        exposure = scene.camera.exposure
        aovs = integrator.aovs.pictures(film, exposure) if integrator.aovs is not None else {}
        shows_prims = config.ids or "primId" in config.aov
        stats = self._stats(film, final)
        return RenderResult(
            image=film.image() * np.float32(exposure),
            alpha=film.coverage(),
            albedo=film.mean_albedo(),
            normal=film.mean_normal(),
            depth=film.mean_depth(),
            samples=film.count,
            variance=final.variance(exposure),
            allocation=integrator.allocation_map(),
            next_event=integrator.next_event_map(),
            ids=seen_ids(integrator),
            paths=tuple(prim.path for prim in scene.prims) if shows_prims else (),
            material_paths=tuple(one.path for one in scene.materials) if "materialId" in config.aov else (),
            aovs=aovs | seen_surfaces(integrator, scene),
            cryptomatte=seen_coverage(integrator, scene),
            round_allocations=tuple(self.round_allocations),
            strategies=integrator.strategies,
            cache=integrator.cache_maps(),
            stats=stats,
            name=scene.name,
            settings=self._settings(interrupted),
            warnings=scene.warnings,
            notes=(*scene.notes, *notes, *self._rejected(stats), *kernel_cache.notes()),
        )

    def _settings(self, interrupted: str) -> SettingsDict:
        settings = self.config.to_dict()
        settings["camera"] = self.scene.camera.path
        if interrupted:
            settings["interrupted"] = interrupted
        return settings

    def _films(self) -> tuple[Film, Film]:
        """All samples, which make the picture; and those of the last allocation, whose variance it has."""
        *learned, final = self.integrator.download()
        film = learned[0].merge(final) if learned else final
        # An interrupted last round has pixels without samples.
        return film, final if (final.count + final.rejected).min() > 1 else film

    def _stats(self, film: Film, final: Film) -> RenderStats:
        integrator, reporter = self.integrator, self.reporter
        next_event = integrator.next_event_map()
        compilation = integrator.compiler.outcome()
        seconds, rays, memory = reporter.phase_seconds(), integrator.rays(), integrator.bytes()
        tracing = seconds["learn"] + seconds["render"]
        stats: RenderStats = {
            "seconds": seconds,
            "samples": int(film.count.sum() + film.rejected.sum()),
            "rejected_samples": int(film.rejected.sum()),
            "rays": rays,
            "rays_per_second": rays / tracing if tracing > 0.0 else 0.0,
            "next_event_pixels": 0.0 if next_event is None else float(next_event.mean()),
            "triangles": self.scene.triangle_count,
            "lights": len(self.scene.lights),
            "features": [name for name, on in dataclasses.asdict(self.features).items() if on is True],
            "device": self.config.device,
            "threads": integrator.launcher.threads,
            "compile_seconds": compilation.seconds,
            "kernels_compiled": compilation.compiled,
            "kernels_cached": compilation.cached,
            "bytes": {"scene": memory["scene"], "picture": memory["picture"]},
        }
        certificate = integrator.certificate(final.variance(), film.image())
        if certificate:
            stats["excess_variance_bound"] = certificate["excess_variance_bound"]
        cache = integrator.cache_stats()
        if cache is not None:
            stats["cache"] = cache
        if reporter.watch is not None:
            stats["stopping"] = reporter.watch.stats()
        return stats

    def _rejected(self, stats: RenderStats) -> tuple[str, ...]:
        if not stats["rejected_samples"]:
            return ()
        share = f"{stats['rejected_samples']} of {stats['samples']} samples by method {self.config.method}"
        return (f"{share} were not finite and are left out of the picture",)
