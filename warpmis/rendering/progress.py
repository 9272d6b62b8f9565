"""How far a render has come: what the renderer reports and the command line shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One report of a running render.

    Attributes:
        phase: "load", "compile", "learn" or "render".
        done: pixel samples of the whole run that are finished, learning included.
        total: pixel samples of the whole run; 0 while it is not known yet.
        samples: pixel samples taken within `seconds`: their quotient is the speed.
        seconds: time that `samples` took [s].
        detail: where in the phase, such as "round 3/8".
        relative_error, standard_error: of the picture so far, where a stopping rule watches it.
        seconds_left: until the stopping rule is expected to end the render [s].
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
