"""The pictures of one run: one, or the frames of a sequence, or the RenderProducts of a stage, at each frame."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warpmis.cli.frame_ranges import PLACEHOLDER, numbered
from warpmis.errors import ConfigError


@dataclass(frozen=True)
class Job:
    """One picture.

    Attributes:
        targets: the files to write, by what they are.
        options: what of the stage it takes, beside the arguments.
        label: what to call it while it is rendered.
        channels: of the EXR, as RenderResult.write takes them.
        warnings: what of it is not supported.
        aovs: what its variables ask of the render, beside --aov.
    """

    targets: dict[str, str]
    options: dict[str, Any] = field(default_factory=dict)
    label: str = ""
    channels: dict[str, str] | None = None
    warnings: tuple[str, ...] = ()
    aovs: tuple[str, ...] = ()


def jobs_of(arguments: argparse.Namespace, stage_options: Mapping[str, Any]) -> list[Job]:
    """The pictures to render, with files every one of which can be written."""
    from warpmis.output.atomic import check_target

    if arguments.frames is not None and arguments.time is not None:
        raise ConfigError("--frames lists time codes, --time is one; give one of the two")
    if arguments.products is None:
        jobs = list(_picture_jobs(arguments))
    else:
        jobs = list(_product_jobs(arguments, stage_options))
        _check_distinct(jobs)
    for job in jobs:
        for kind, path in job.targets.items():
            check_target(f"{path}/round.png" if kind == "round_maps" else path)
    return jobs


def _picture_jobs(arguments: argparse.Namespace) -> Iterator[Job]:
    targets = _targets(arguments)
    if arguments.frames is None:
        yield Job(targets)
        return
    names = {kind: numbered(path, arguments.frames) for kind, path in targets.items()}
    for index, frame in enumerate(arguments.frames):
        here = {kind: names[kind][index] for kind in targets}
        yield Job(here, {"time": frame}, f"frame {frame:g} ({index + 1}/{len(arguments.frames)})")


def _targets(arguments: argparse.Namespace) -> dict[str, str]:
    """The files to write, by what they are; of a sequence the names with a place for the frame."""
    frames = arguments.frames is not None
    out = arguments.out or f"{Path(arguments.stage).stem}{'.####' if frames else ''}.exr"
    targets = {"output": out}
    for kind, path in (("png", arguments.png), ("balance_map", arguments.balance_map)):
        if path is not None:
            targets[kind] = path
    for kind, path in targets.items():
        suffix = ".exr" if kind == "output" else ".png"
        if Path(path).suffix.lower() != suffix:
            remedy = "; use --png for a picture" if kind == "output" else ""
            raise ConfigError(f"{path}: the file's name must end in {suffix}{remedy}")
    if len({os.path.realpath(path) for path in targets.values()}) < len(targets):
        raise ConfigError("--png and --balance-map name the same file; name two")
    if arguments.round_maps is not None:
        targets["round_maps"] = arguments.round_maps
    return targets


def _product_jobs(arguments: argparse.Namespace, stage_options: Mapping[str, Any]) -> Iterator[Job]:
    from warpmis.usd.products import read_products

    for name in ("out", "png", "balance_map", "round_maps"):
        if getattr(arguments, name) is not None:
            option = "OUT" if name == "out" else f"--{name.replace('_', '-')}"
            raise ConfigError(f"--products names the files; drop {option}")
    known = ("render_settings", "variants", "mask", "session_layer", "time")
    options = {name: value for name, value in stage_options.items() if name in known}
    frames = [None] if arguments.frames is None else arguments.frames
    for frame in frames:
        at = {} if frame is None else {"time": frame}
        for product in read_products(arguments.stage, **{**options, **at}):
            path = os.path.join(arguments.products, product.file)
            if frame is not None and PLACEHOLDER.search(product.file):
                (path,) = numbered(path, [frame])
            label = product.path if frame is None else f"{product.path} frame {frame:g}"
            yield Job(
                {"output": path},
                {**at, "product": product.path},
                label,
                product.channels,
                product.warnings,
                product.aovs,
            )


def _check_distinct(jobs: list[Job]) -> None:
    seen: dict[str, str] = {}
    for job in jobs:
        path = job.targets["output"]
        if path in seen:
            raise ConfigError(f"{path}: {seen[path]} and {job.label} would write the same file; give productName ####")
        seen[path] = job.label
