"""The clock of a render's phases, and the reports to the caller's progress function."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from warpmis.rendering.preview import Preview
from warpmis.rendering.progress import Progress
from warpmis.rendering.stats import PhaseSeconds
from warpmis.rendering.stopping import Watch

ProgressCallback = Callable[[Progress], None]

# Progress is reported at most this often [s].
REPORT_SECONDS = 0.1


class Reporter:
    """Times the phases of one render, and reports how far it has come.

    Attributes:
        done: pixel samples of this render so far.
        total: pixel samples that this render is expected to take; 0 while nobody knows.
        watch: the render's stopping rule, if it has one.
    """

    def __init__(
        self,
        progress: ProgressCallback | None,
        before: int = 0,
        share: float = 1.0,
        preview: Preview | None = None,
    ) -> None:
        """A render may be one of several that make one picture, at several times within the shutter's interval.

        Args:
            before: pixel samples of the renders before this one.
            share: this render's part of all the samples from here on.
            preview: where the picture so far goes.
        """
        self.progress = progress
        self.preview = preview
        self.before = before
        self.share = share
        self.seconds: dict[str, float] = {}
        self.total = 0
        self.done = 0
        self.watch: Watch | None = None
        self.current = ""
        self.detail = ""
        self.waiting: tuple[str, str, float] | None = None
        self.started = self.reported = time.perf_counter()
        self.tracing_since = 0.0

    def phase(self, name: str, detail: str = "") -> None:
        """Begin a phase: "load", "compile", "learn" or "render"."""
        self.end_phase()
        if name in ("learn", "render") and not self.tracing_since:
            self.tracing_since = self.started
        self.current, self.detail = name, detail
        self._report()

    def compiling(self, detail: str) -> None:
        """The render waits for kernels, as `detail` says; with "" it goes on with what it was at."""
        if detail:
            if self.current != "compile":
                self.waiting = (self.current, self.detail, time.perf_counter())
            self.phase("compile", detail)
        elif self.waiting is not None:
            phase, before, since = self.waiting
            if self.tracing_since:
                self.tracing_since += time.perf_counter() - since
            self.waiting = None
            self.phase(phase, before)

    def end_phase(self) -> None:
        """Add the present phase's time to those of its name."""
        now = time.perf_counter()
        if self.current:
            self.seconds[self.current] = self.seconds.get(self.current, 0.0) + now - self.started
        self.current, self.started = "", now

    def advance(self, samples: int) -> None:
        """Count pixel samples that were taken."""
        self.done += samples
        if time.perf_counter() - self.reported > REPORT_SECONDS:
            self._report()

    def finish(self) -> None:
        """The last report: everything is done, whatever was expected."""
        self.total = self.done
        self.detail = ""
        self._report()

    def tracing_seconds(self) -> float:
        """Time since the first round began [s]."""
        return time.perf_counter() - self.tracing_since if self.tracing_since else 0.0

    def phase_seconds(self) -> PhaseSeconds:
        """Time of each phase that has ended [s]."""
        of = {name: self.seconds.get(name, 0.0) for name in ("load", "compile", "learn", "render")}
        return {"load": of["load"], "compile": of["compile"], "learn": of["learn"], "render": of["render"]}

    def state(self) -> dict[str, Any]:
        """For a checkpoint: what was counted and timed, the present phase included."""
        seconds = dict(self.seconds)
        if self.current:
            seconds[self.current] = seconds.get(self.current, 0.0) + time.perf_counter() - self.started
        return {"done": self.done, "total": self.total, "seconds": seconds, "tracing": self.tracing_seconds()}

    def resume(self, state: dict[str, Any]) -> None:
        """Go on counting from a state."""
        self.done, self.total = state["done"], state["total"]
        for name, seconds in state["seconds"].items():
            self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        self.tracing_since = time.perf_counter() - state["tracing"]

    def _report(self) -> None:
        self.reported = time.perf_counter()
        if self.progress is None:
            return
        watched = self.watch.progress() if self.watch is not None else {}
        done, seconds = self.before + self.done, self.tracing_seconds()
        total = self.before + round(self.total / self.share) if self.total else 0
        self.progress(Progress(self.current, done, total, self.done, seconds, self.detail, **watched))
