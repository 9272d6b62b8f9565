"""Whole pictures as tasks of a cluster: of a sequence, each worker renders frames of its own."""

from __future__ import annotations

import dataclasses
import os
import threading
from typing import Any

from warpmis.device.upload import Uploads
from warpmis.errors import WarpmisError
from warpmis.rendering.cluster import IN_FLIGHT, MOST_LOSSES, TICK, Farm, is_loss, one_line
from warpmis.rendering.cluster_worker import check_program, worker_threads
from warpmis.rendering.fingerprint import program_fingerprint
from warpmis.rendering.render import render
from warpmis.rendering.result import RenderResult

_lock = threading.Lock()
_uploads = Uploads()


def render_picture(stage: str, options: dict[str, Any], program: str) -> RenderResult:
    """A task: one picture, by `warpmis.render` with these options."""
    check_program(program)
    config = dataclasses.replace(options["config"], threads=worker_threads(options["config"]))
    with _lock:  # a worker does one at a time
        return render(stage, **{**options, "config": config}, uploads=_uploads)


class PictureQueue:
    """Pictures that are rendered ahead, and handed out by name in the order in which they were added."""

    def __init__(self, farm: Farm, stage: str) -> None:
        self.farm = farm
        self.stage = os.path.abspath(stage)
        self.waiting: list[tuple[str, dict[str, Any]]] = []
        self.pending: dict[str, tuple[Any, dict[str, Any]]] = {}

    def add(self, name: str, options: dict[str, Any]) -> None:
        self.waiting.append((name, options))

    def result(self, name: str) -> RenderResult:
        """Wait for a picture; later ones are under way meanwhile.

        Raises:
            WarpmisError: what its render has raised.
        """
        for losses in range(MOST_LOSSES + 1):
            self._submit_some()
            future, options = self.pending.pop(name)
            try:
                found: RenderResult = self._waited_for(future)
                return found
            except WarpmisError:
                raise
            except Exception as error:
                if losses == MOST_LOSSES or not is_loss(error):
                    raise WarpmisError(f"a task on the cluster failed: {one_line(error)}") from error
                self.waiting.insert(0, (name, options))
        raise AssertionError("the loop returns or raises")

    def _submit_some(self) -> None:
        while self.waiting and len(self.pending) < IN_FLIGHT * self.farm.workers:
            name, options = self.waiting.pop(0)
            future = self.farm.submit(render_picture, self.stage, options, program_fingerprint())
            self.pending[name] = future, options

    def _waited_for(self, future: Any) -> Any:
        while not future.done():
            self.farm.look_for_lost()
            with self.farm.client.as_current():
                threading.Event().wait(TICK / 5)
        return future.result()

    def cancel(self) -> None:
        self.farm.client.cancel([future for future, _ in self.pending.values()])
