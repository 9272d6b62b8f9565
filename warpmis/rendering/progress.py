"""How far a render has come: what the renderer reports and the command line shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One report of a running render. The last one has `done` equal to `total`, unless the render is interrupted.

    Attributes:
        phase: "load", "compile", "learn" or "render".
        done: finished pixel samples of the whole run, learning included.
        total: pixel samples of the whole run, or 0 if not known yet.
        samples: pixel samples taken within `seconds`; samples / seconds is the speed.
        seconds: time that `samples` took [s].
        detail: the place within the phase, such as "round 3/8".
        relative_error: error of the picture so far, with a target error or a time limit; 0.02 is 2 %.
        standard_error: of `relative_error`.
        seconds_left: expected time until the stopping rule ends the render [s].
    """

    phase: str
    done: int
    total: int
    samples: int
    seconds: float
    detail: str = ""
    relative_error: float | None = None
    standard_error: float | None = None
    seconds_left: float | None = None
