"""A render's state on disk: written at intervals and when it is interrupted, so that a later process goes on from it.

The file holds the pictures under way: for each the settings and fingerprints that it must be gone on with, the results
of those of its parts that are over (times within the shutter, halves of a denoised one), and the state of the present
part; and of a sequence, which pictures are whole. It is replaced as a whole, so that a crash leaves the one before.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from warpmis.config import RenderConfig
from warpmis.errors import ConfigError, WarpmisError
from warpmis.learn.schedule import schedule
from warpmis.output.atomic import check_target
from warpmis.output.bundle import read_bundle, write_bundle
from warpmis.output.cryptomatte import Coverage
from warpmis.rendering.fingerprint import array_fingerprint, file_fingerprint, program_fingerprint, scene_fingerprint
from warpmis.rendering.result import RenderResult
from warpmis.rendering.run import Run

INTERVAL = 60.0

# What no bit of the picture depends on, or what depends on the clock anyway.
FREE = ("threads", "time_limit")

ANOTHER_PROGRAM = "another version of warpmis or Warp made it"


def asked_of(stage: Any, options: Mapping[str, Any], config: RenderConfig, **more: Any) -> dict[str, Any]:
    """What a picture is asked for, as plain values: what must be the same for a render to go on."""
    settings: dict[str, Any] = {name: value for name, value in config.to_dict().items() if name not in FREE}
    settings["learn"] = dataclasses.asdict(config.learn)  # as it was asked for: numbers not given follow from spp
    if isinstance(config.allocation, np.ndarray):
        settings["allocation"] = array_fingerprint(config.allocation)
    file = file_fingerprint(os.fspath(stage)) if isinstance(stage, str | os.PathLike) else ""
    reading = {name: repr(value) for name, value in options.items()}
    return {"stage": file, "stopping": config.stops, **more, **reading, **settings}


class Checkpoint:
    """One checkpoint file, for one picture or for a sequence of them.

    Attributes:
        name: of the present picture of a sequence.
        trouble: why the file could not be written the last time; "" if it could.
        tell: is told of trouble at once.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        interval: float = INTERVAL,
        resume: bool = False,
        tell: Callable[[str], None] | None = None,
    ) -> None:
        """resume: go on from the file, if there is one.

        Raises:
            ConfigError: there is a file, and nobody asked to go on from it; or it is another program's.
            WarpmisError: it cannot be read, or no file can be written there.
        """
        if not 0.0 < interval < float("inf"):
            raise ConfigError(f"the checkpoint interval must be above 0 and finite, got {interval:g} s")
        check_target(path)
        self.path = os.fspath(path)
        self.interval = interval
        self.tell = tell
        self.trouble = ""
        self.written = time.monotonic()
        self.name = ""
        self.content: dict[str, Any] = {"program": program_fingerprint(), "finished": {}, "pictures": {}}
        if os.path.exists(self.path):
            self._load(resume)

    def _load(self, resume: bool) -> None:
        if not resume:
            raise ConfigError(f"{self.path}: there is a checkpoint: go on from it with --resume, or remove it")
        content = read_bundle(self.path)
        if not isinstance(content, dict) or "program" not in content:
            raise WarpmisError(f"{self.path}: is not a checkpoint of warpmis; name another file")
        if content["program"] != self.content["program"]:
            raise ConfigError(f"{self.path}: {ANOTHER_PROGRAM}: go on with that one, or remove the file")
        self.content = content

    # ---- pictures --------------------------------------------------------------------------------------------------

    def begin_picture(self, asked: dict[str, Any], config: RenderConfig) -> None:
        """Begin a picture, or go on with the one in the file.

        Raises:
            ConfigError: the one in the file is of another stage or other settings.
        """
        before = self.picture["asked"]
        if before is not None:
            self._check_same(before, asked, config)
        self.picture["asked"] = asked

    @property
    def picture(self) -> dict[str, Any]:
        """What the file has of the present picture."""
        blank: dict[str, Any] = {"asked": None, "results": {}, "part": "", "scene": "", "state": None}
        found: dict[str, Any] = self.content["pictures"].setdefault(self.name, blank)
        return found

    def is_finished(self, output: str, asked: dict[str, Any]) -> bool:
        """Whether this picture of the sequence is whole.

        Raises:
            ConfigError: it was asked for something else.
        """
        before = self.content["finished"].get(output)
        if before is not None and before != asked:
            raise ConfigError(self._refusal(before, asked))
        return before is not None

    def finish_picture(self, output: str, asked: dict[str, Any]) -> None:
        """A picture of the sequence is in its file: the next one may begin."""
        self.content["pictures"].pop(output, None)
        self.content["finished"][output] = asked
        self._write()

    def remove(self) -> None:
        """All that the file is for is done."""
        if os.path.exists(self.path):
            os.unlink(self.path)

    def _check_same(self, before: dict[str, Any], asked: dict[str, Any], config: RenderConfig) -> None:
        more = before.get("spp") != asked["spp"] and {**before, "spp": 0} == {**asked, "spp": 0}
        if more and may_go_on(dataclasses.replace(config, spp=before["spp"]), config, asked):
            return
        if before != asked:
            raise ConfigError(self._refusal(before, asked))

    def _refusal(self, before: dict[str, Any], asked: dict[str, Any]) -> str:
        remedy = "give the same again, or remove the file"
        if before.get("stage") != asked["stage"]:
            return f"{self.path}: the stage was another one when this was written: {remedy}"
        names = [name for name in asked if before.get(name) != asked[name]] or ["settings"]
        name = names[0]
        was, now = (f"{values.get(name)}"[:40] for values in (before, asked))
        return f"{self.path}: {name.replace('_', ' ')} was {was} when this was written, and is {now}: {remedy}"

    # ---- parts of a picture ----------------------------------------------------------------------------------------

    def result(self, part: str) -> RenderResult | None:
        """Of a part of the picture that is over."""
        found = self.picture["results"].get(part)
        if found is None:
            return None
        return RenderResult(**{**found, "cryptomatte": tuple(Coverage(**one) for one in found["cryptomatte"])})

    def keep(self, part: str, result: RenderResult) -> None:
        """A part is over, and another one begins."""
        self.picture["results"][part] = vars(result) | {"cryptomatte": [vars(one) for one in result.cryptomatte]}
        self.picture["state"] = None
        self._write()

    def save(self, part: str, scene: str, state: dict[str, Any]) -> None:
        self.picture.update(part=part, scene=scene, state=state)
        self._write()
        self.picture["state"] = None  # it shares the render's memory

    @property
    def is_due(self) -> bool:
        return time.monotonic() - self.written >= self.interval

    def _write(self) -> None:
        """Where the disk is full, the render goes on, and the file stays as it was."""
        try:
            write_bundle(self.path, self.content)
            self.trouble = ""
        except WarpmisError as error:
            if not self.trouble and self.tell is not None:
                self.tell(f"warning: {error}; the render goes on without this checkpoint")
            self.trouble = str(error)
        self.written = time.monotonic()


class CheckpointPart:
    """A checkpoint as one of the renders sees it that make a picture."""

    def __init__(self, checkpoint: Checkpoint, name: str = "") -> None:
        self.checkpoint = checkpoint
        self.name = name
        self.scene = ""

    def named(self, name: str) -> CheckpointPart:
        """A part of this part."""
        return CheckpointPart(self.checkpoint, f"{self.name}/{name}")

    def result(self) -> RenderResult | None:
        return self.checkpoint.result(self.name)

    def keep(self, result: RenderResult) -> None:
        self.checkpoint.keep(self.name, result)

    def begin(self, run: Run) -> None:
        """Let a run that is about to trace go on from the file's state, if that is of this part.

        Raises:
            ConfigError: the state is of another scene.
        """
        self.scene = scene_fingerprint(run.scene)
        run.pass_seconds = min(run.pass_seconds, self.checkpoint.interval)
        run.after_pass.append(self.after_pass)
        picture = self.checkpoint.picture
        if picture["state"] is None or picture["part"] != self.name:
            return
        if picture["scene"] != self.scene:
            path = self.checkpoint.path
            raise ConfigError(f"{path}: the stage was another one when this was written: remove the file to begin anew")
        run.resume(picture["state"])
        picture["state"] = None

    def after_pass(self, run: Run) -> None:
        if self.checkpoint.is_due:
            self.checkpoint.save(self.name, self.scene, run.state())

    def interrupted(self, run: Run) -> None:
        """Save what there is; before the first pass the file stays as it was."""
        if run.integrator.has_state:
            self.checkpoint.save(self.name, self.scene, run.state())


def rendered_or_kept(
    part: CheckpointPart | None, render: Callable[[CheckpointPart | None], RenderResult], *, is_last: bool
) -> RenderResult:
    """One of the renders that make a picture: rendered, or as it was kept; the last one need not be kept."""
    found = None if part is None else part.result()
    if found is not None:
        return found
    result = render(part)
    if part is not None and not is_last:
        part.keep(result)
    return result


def may_go_on(before: RenderConfig, config: RenderConfig, asked: dict[str, Any]) -> bool:
    """Whether a render that was asked for `before.spp` samples may be for more: all that it learns is the same."""
    if config.spp < before.spp or asked.get("denoise") or asked.get("shutter_samples", 1) > 1:
        return False
    if config.how.cache and config.learn_budget != before.learn_budget:
        return False

    def learning(config: RenderConfig) -> list[tuple[int, int]]:
        return [(part.first_sample, part.samples) for part in schedule(config) if part.learn]

    return learning(before) == learning(config)
