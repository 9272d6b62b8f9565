"""`warpmis render --explain`: what the kernels were compiled for, and what the render took."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import warpmis
from warpmis.cli.console import SUPPLIED, byte_text, say

if TYPE_CHECKING:
    from warpmis.rendering.result import RenderResult


def explain(result: RenderResult, stage: str, options: Mapping[str, Any]) -> None:
    """Say it on standard error; `options` are those that the stage was read with."""
    from warpmis.inspection import effects

    scene = warpmis.load_stage(stage, **options)
    callers = {effect.name: effect.prim for effect in effects(scene)}
    for line in lines(result.stats, callers):
        say(line)


def lines(stats: Mapping[str, Any], callers: Mapping[str, str | None]) -> Iterator[str]:
    """The effects that were compiled, each with the prim that called for it, those left out, kernels, time, memory."""
    on = stats["features"]
    called = [name for name in on if callers[name] is not None]
    yield from (f"effect {name}: {callers[name] or SUPPLIED}" for name in called)
    forced = [name for name in on if name not in called]
    if forced:
        yield f"compiled though nothing calls for it: {', '.join(forced)}"
    yield f"left out: {', '.join(name for name in callers if name not in on) or 'nothing'}"
    yield from _cache_lines(stats.get("cache"))
    compiled, cached = stats["kernels_compiled"], stats["kernels_cached"]
    yield f"kernels: {compiled} compiled, {cached} from the cache, ready after {stats['compile_seconds']:.2f} s"
    yield "seconds: " + ", ".join(f"{phase} {seconds:.2f}" for phase, seconds in stats["seconds"].items())
    per_sample = stats["rays"] / max(stats["samples"], 1)
    yield f"rays: {per_sample:.2f} a sample, {stats['rays_per_second'] / 1e6:.2f} M a second"
    memory = {**stats["bytes"]["scene"], "picture": stats["bytes"]["picture"]}
    yield "memory: " + ", ".join(f"{purpose} {byte_text(size)}" for purpose, size in memory.items())


def _cache_lines(cache: Mapping[str, Any] | None) -> Iterator[str]:
    """What pilot and trials of the spatial cache found, and what was decided."""
    if cache is None:
        return
    outcome = f"guided by a cache of {cache['cells']} cells" if cache["guided"] else "next-event estimation"
    found = []
    if "variance" in cache:
        found.append(f"a pilot found a relative variance of {cache['variance']:.3g} a sample")
    if cache["gains"]:
        found.append(f"trials promised a gain of {', '.join(f'{gain:.2f}' for gain in cache['gains'])}")
    yield f"picture: {outcome}" + (f"; {'; '.join(found)}" if found else "")
