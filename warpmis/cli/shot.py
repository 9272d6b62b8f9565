"""What a shot asks for beside its pictures: checkpoints, frames that are there already, frames that fail, a preview."""

from __future__ import annotations

import argparse
import os
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from warpmis.cli.console import say
from warpmis.cli.jobs import Job
from warpmis.cli.option_values import time_in_seconds
from warpmis.cli.stage_options import given, stage_options
from warpmis.config import RenderConfig
from warpmis.errors import ConfigError, WarpmisError

if TYPE_CHECKING:
    from warpmis.rendering.checkpoint import Checkpoint
    from warpmis.rendering.cluster import Farm
    from warpmis.rendering.cluster_pictures import PictureQueue

MOST_NAMED = 10


def add_shot_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("long renders and sequences")
    group.add_argument(
        "--checkpoint", metavar="FILE",
        help="write the render's state to this file at intervals and when interrupted; removed when all is rendered",
    )  # fmt: skip
    group.add_argument("--checkpoint-interval", type=time_in_seconds, metavar="SECONDS", help="how often (default: 60)")
    group.add_argument(
        "--resume", action="store_true", help="go on from --checkpoint if there is one, to the same bits"
    )
    group.add_argument(
        "--skip-existing", action="store_true", help="leave pictures alone whose files are there and whole"
    )
    group.add_argument(
        "--cluster", metavar="WHERE",
        help="render on local:N processes, or on the workers of a Dask scheduler such as tcp://HOST:8786",
    )  # fmt: skip
    group.add_argument(
        "--ship-stage", action="store_true", help="send the stage to the workers, who then need not find its files"
    )
    group.add_argument("--preview", metavar="FILE.png", help="rewrite this picture every few seconds, to look at")


class Shot:
    """The pictures of one run as a whole.

    Attributes:
        current: the job at work.
        failed: what failed, and why.
    """

    def __init__(self, arguments: argparse.Namespace, jobs: list[Job]) -> None:
        """Checks the options; needs Warp to have been started.

        Raises:
            ConfigError: options exclude each other, or the checkpoint is another render's.
        """
        self.arguments = arguments
        self.jobs = jobs
        self.current = jobs[0]
        self.failed: list[dict[str, str]] = []
        self.checkpoint = _checkpoint_of(arguments)
        if arguments.ship_stage and arguments.cluster is None:
            raise ConfigError("--ship-stage is for --cluster")
        self.farm: Farm | None = None
        self.queue: PictureQueue | None = None
        self.show = None if arguments.preview is None else _preview_file(arguments)

    @contextmanager
    def workers(self, config: RenderConfig) -> Iterator[None]:
        """The cluster, if there is one, for as long as pictures are rendered."""
        if self.arguments.cluster is None:
            yield
            return
        from warpmis.rendering.cluster import farm_of
        from warpmis.rendering.cluster_pictures import PictureQueue

        tell = (lambda line: None) if self.arguments.quiet else say
        with farm_of(self.arguments.cluster, config, ship_stage=self.arguments.ship_stage, tell=tell) as self.farm:
            # A checkpoint and a preview follow one picture at a time, and so does what is shipped.
            is_queue = len(self.jobs) > 1 and not (self.checkpoint or self.show or self.arguments.ship_stage)
            if is_queue and self.farm is not None:
                self.queue = PictureQueue(self.farm, self.arguments.stage)
            try:
                yield
            finally:
                if self.queue is not None:
                    self.queue.cancel()

    def leaves_alone(self, job: Job, config: RenderConfig) -> bool:
        """Whether the job's pictures are there already."""
        output = job.targets["output"]
        if self.checkpoint is not None and self.checkpoint.is_finished(output, self._asked(job, config)):
            from warpmis.output.whole import is_whole

            if is_whole(output):
                return True
        return bool(self.arguments.skip_existing) and self._is_there(job)

    def _is_there(self, job: Job) -> bool:
        from warpmis.output.whole import is_whole

        found = [path for kind, path in job.targets.items() if kind != "round_maps"]
        there = all(is_whole(path) for path in found)
        if not self.arguments.quiet and (there or os.path.exists(found[0])):
            say(f"{found[0]}: {'is there, left alone' if there else 'is there but not whole, rendered again'}")
        return there

    @contextmanager
    def passing_over_failures(self, job: Job) -> Iterator[None]:
        """Name a picture that fails, and go on; a single one fails as ever, and so do settings that no picture has."""
        self.current = job
        try:
            yield
        except ConfigError:
            raise
        except Exception as error:
            if len(self.jobs) == 1:
                raise
            if not isinstance(error, WarpmisError) and os.environ.get("WARPMIS_TRACEBACK") == "1":
                traceback.print_exc()
            reason = str(error) if isinstance(error, WarpmisError) else f"{type(error).__name__}: {error}"
            self.failed.append({**job.targets, "error": reason})
            say(f"error: {job.label or job.targets['output']}: {reason}")

    def render_options(self) -> dict[str, Any]:
        """For warpmis.render, of the current job."""
        if self.checkpoint is not None:
            self.checkpoint.name = self.current.targets["output"] if len(self.jobs) > 1 else ""
        return given(checkpoint=self.checkpoint, preview=self.show, cluster=self.farm)

    def finished(self, job: Job, config: RenderConfig) -> None:
        """The job's files are written."""
        if self.checkpoint is not None and len(self.jobs) > 1:
            self.checkpoint.finish_picture(job.targets["output"], self._asked(job, config))

    def end(self) -> None:
        """After the last picture.

        Raises:
            WarpmisError: some of them failed; it names them.
        """
        if self.failed:
            names = [one["output"] for one in self.failed]
            more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
            shown = ", ".join(names[:MOST_NAMED])
            raise WarpmisError(f"{len(names)} of {len(self.jobs)} pictures failed: {shown}{more}")
        if self.checkpoint is not None:
            self.checkpoint.remove()

    def _asked(self, job: Job, config: RenderConfig) -> dict[str, Any]:
        from warpmis.rendering.checkpoint import asked_of

        options = {**stage_options(self.arguments), **job.options}
        more = {"shutter_samples": self.arguments.shutter_samples, "denoise": self.arguments.denoise}
        return asked_of(self.arguments.stage, options, config, **more)


def _checkpoint_of(arguments: argparse.Namespace) -> Checkpoint | None:
    if arguments.checkpoint is None:
        for name in ("resume", "checkpoint_interval"):
            if getattr(arguments, name):
                raise ConfigError(f"--{name.replace('_', '-')} is for --checkpoint: name its file")
        return None
    from warpmis.rendering.checkpoint import INTERVAL, Checkpoint

    interval = arguments.checkpoint_interval or INTERVAL
    return Checkpoint(arguments.checkpoint, interval, arguments.resume, None if arguments.quiet else say)


def _preview_file(arguments: argparse.Namespace) -> Callable[[Any], None]:
    """What writes the picture so far; a preview that cannot be written costs one line."""
    from warpmis.output.atomic import check_target
    from warpmis.output.png import write_png

    path, srgb = arguments.preview, arguments.color_correction_mode == "sRGB"
    if not path.lower().endswith(".png"):
        raise ConfigError(f"{path}: the file's name must end in .png")
    check_target(path)
    troubles: list[str] = []

    def show(image: Any) -> None:
        try:
            write_png(path, image, srgb=srgb)
        except WarpmisError as error:
            if not troubles:
                say(f"warning: {error}; the render goes on")
            troubles.append(str(error))

    return show
