"""What a worker of a cluster does: rows of a round of somebody's picture.

A task is a function of what it is given alone, so that any worker may do it, and do it again, to the same bits.
"""

from __future__ import annotations

import dataclasses
import os
import signal
import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.config import RenderConfig
from warpmis.device.compilation import Compiler
from warpmis.device.snapshot import device_arrays, restore, snapshot
from warpmis.device.trees import tree_kernels
from warpmis.device.upload import Uploads, upload
from warpmis.errors import StageError, WarpmisError
from warpmis.learn.schedule import Round
from warpmis.rendering.fingerprint import program_fingerprint, scene_fingerprint
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.kinds import integrator_of
from warpmis.scene import Scene
from warpmis.scene.features import Features

# Pictures that a worker keeps on its device.
MOST_KEPT = 2
THREADS = "WARPMIS_WORKER_THREADS"


@dataclass(frozen=True, eq=False)
class Job:
    """One picture, as a worker must know it.

    Attributes:
        name: no other job has it.
        scene: shipped, or None where the worker reads `stage` itself, with these options.
        fingerprint: of the scene that the worker must find.
        program: fingerprint of the program that it must be.
    """

    name: str
    scene: Scene | None
    stage: str
    options: dict[str, Any]
    fingerprint: str
    program: str
    config: RenderConfig
    features: Features


@dataclass(frozen=True, eq=False)
class Task:
    """Some samples of some rows of a round.

    Attributes:
        round: the round's number; piece: the samples that are spread evenly together, samples: those to take.
        traced: which of the rows have them.
        decisions, sums: of the rows so far, by name; no sums where there are none.
    """

    round: int
    part: Round
    piece: range
    samples: range
    rows: range
    traced: NDArray[np.bool_]
    decisions: dict[str, Any]
    sums: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Traced:
    """What a task has brought: the rows' sums, what was recorded, and how many samples were taken."""

    sums: dict[str, Any]
    records: tuple[NDArray[Any], ...]
    samples: int


@dataclass(eq=False)
class Kept:
    """A job's integrator, and the round that it is ready for."""

    integrator: Integrator
    lock: threading.Lock = field(default_factory=threading.Lock)
    round: int = -1


_kept: OrderedDict[str, Kept] = OrderedDict()
_lock = threading.Lock()
_uploads = Uploads()


def program() -> str:
    return program_fingerprint()


def ignore_interrupts() -> None:
    """Ctrl-C is for whoever has started the workers: it ends them in its own time."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def same(value: Any) -> Any:
    """Data as a task of its own: a scheduler that loses it with a worker makes it again."""
    return value


def trace_rows(job: Job, common: dict[str, Any], task: Task) -> Traced:
    """Do a task.

    Raises:
        WarpmisError: the worker is another program, or finds another stage.
    """
    kept = _kept_of(job)
    rows = slice(task.rows.start, task.rows.stop)
    taken: list[int] = []
    with kept.lock:
        integrator = kept.integrator
        if kept.round != task.round:
            integrator.adopt(task.part, common)
            kept.round = task.round
        for name, array in integrator.decisions_of(task.part).items():
            restore(array, task.decisions[name], rows)
        for name, sums in integrator.sums_of(task.part).items():
            if task.sums:
                restore(sums, task.sums[name], rows)
            else:
                for array in device_arrays(sums).values():
                    if array.size:
                        array[rows].zero_()
        integrator.window = task.rows
        integrator.traced = np.zeros(integrator.rows_of(task.part), np.bool_)
        integrator.traced[rows] = task.traced
        integrator.trace_rows(task.part, task.piece, task.samples, taken.append)
        return Traced(sums_in(integrator, task.part, rows), integrator.records_taken(), sum(taken))


def sums_in(integrator: Integrator, part: Round, rows: slice) -> dict[str, Any]:
    """Copies of some rows' sums."""
    sums = integrator.sums_of(part).items()
    return {name: {key: array.copy() for key, array in snapshot(value, rows).items()} for name, value in sums}


def decisions_in(integrator: Integrator, part: Round, rows: slice) -> dict[str, Any]:
    """Copies of what some rows have been given."""
    given = integrator.decisions_of(part).items()
    return {name: {"": snapshot(array, rows)[""].copy()} for name, array in given}


def check_program(expected: str) -> None:
    if program_fingerprint() != expected:
        raise WarpmisError(f"the worker on {os.uname().nodename} has another version of warpmis or Warp: install one")


def worker_threads(config: RenderConfig) -> int | None:
    """Where several workers share a machine, each has its part of the CPUs."""
    part = os.environ.get(THREADS)
    return config.threads if part is None else int(part)


def _kept_of(job: Job) -> Kept:
    with _lock:
        if job.name not in _kept:
            check_program(job.program)
            _kept[job.name] = Kept(_integrator_of(job))
            while len(_kept) > MOST_KEPT:
                _kept.popitem(last=False)
        _kept.move_to_end(job.name)
        return _kept[job.name]


def _integrator_of(job: Job) -> Integrator:
    scene, config = job.scene, job.config
    if scene is None:
        from warpmis.usd import load_stage  # here, as in render.py

        scene = load_stage(job.stage, **job.options)
        if scene_fingerprint(scene) != job.fingerprint:
            where = f"the worker on {os.uname().nodename} finds another stage there"
            raise StageError(f"{where}: put it on a shared disk, or ship it with --ship-stage", job.stage)
    config = dataclasses.replace(config, threads=worker_threads(config))
    compiler = Compiler(config.device)
    compiler.wait(tree_kernels(config.device))
    on_device = upload(scene, config.device, config.mis_compensation, config.ids, _uploads)
    kind = integrator_of(config)
    return kind(on_device, job.features, config, allocation_of(config, *scene.resolution), compiler)
