"""One render under way, and the result that is made of its films."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpmis.config import RenderConfig
from warpmis.device import kernel_cache
from warpmis.film.film import Film
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.reporter import Reporter
from warpmis.rendering.result import RenderResult
from warpmis.rendering.stats import RenderStats
from warpmis.scene import Scene
from warpmis.scene.features import Features


@dataclass(frozen=True, eq=False)
class Run:
    """One render under way.

    Attributes:
        round_allocations: the allocation after each learn round so far, if they are to be kept.
    """

    scene: Scene
    config: RenderConfig
    features: Features
    integrator: Integrator
    reporter: Reporter
    round_allocations: list[NDArray[np.float32]] = field(default_factory=list)

    def result(self, notes: Sequence[str] = ()) -> RenderResult:
        """The picture of all samples so far, with `notes` after the scene's own."""
        scene, config, integrator = self.scene, self.config, self.integrator
        film, final = self._films()
        exposure = scene.camera.exposure
        ids = integrator.ids() if config.ids else None
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
            next_event=integrator.next_event_map().astype(np.float32) if config.uses_next_event else None,
            ids=ids,
            paths=tuple(prim.path for prim in scene.prims) if config.ids else (),
            round_allocations=tuple(self.round_allocations),
            strategies=config.strategies,
            stats=stats,
            name=scene.name,
            settings={**config.to_dict(), "camera": scene.camera.path},
            warnings=scene.warnings,
            notes=(*scene.notes, *notes, *self._rejected(stats), *kernel_cache.notes()),
        )

    def _films(self) -> tuple[Film, Film]:
        """All samples, which make the picture; and those of the last allocation, whose variance it has."""
        *learned, final = self.integrator.download()
        film = learned[0].merge(final) if learned else final
        # An interrupted last round has pixels without samples.
        return film, final if (final.count + final.rejected).min() > 1 else film

    def _stats(self, film: Film, final: Film) -> RenderStats:
        integrator, reporter = self.integrator, self.reporter
        compilation = integrator.compiler.outcome()
        seconds, rays, memory = reporter.phase_seconds(), integrator.rays(), integrator.bytes()
        tracing = seconds["learn"] + seconds["render"]
        stats: RenderStats = {
            "seconds": seconds,
            "samples": int(film.count.sum() + film.rejected.sum()),
            "rejected_samples": int(film.rejected.sum()),
            "rays": rays,
            "rays_per_second": rays / tracing if tracing > 0.0 else 0.0,
            "next_event_pixels": integrator.next_event_share(),
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
        if reporter.watch is not None:
            stats["stopping"] = reporter.watch.stats()
        return stats

    def _rejected(self, stats: RenderStats) -> tuple[str, ...]:
        if not stats["rejected_samples"]:
            return ()
        share = f"{stats['rejected_samples']} of {stats['samples']} samples by method {self.config.method}"
        return (f"{share} were not finite and are left out of the picture",)
