"""The experiment: every variant rendered with growing budgets, in turns, several times over."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.compare.plan import LADDER, REFERENCE_FACTOR, affordable_spp, ladder
from warpmis.compare.reference import PARTS, Reference, merged_reference, read_reference, tracing_seconds
from warpmis.compare.variants import Variant
from warpmis.config import MAX_SECONDS
from warpmis.errors import ConfigError
from warpmis.film.metrics import kept_pixels, mean_squared_error, squared_error, squared_scale
from warpmis.film.oidn import require_oidn
from warpmis.rendering.progress import Progress
from warpmis.rendering.stats import RenderStats
from warpmis.whole_numbers import checked_integer

ProgressCallback = Callable[[Progress], None]

# A run shorter than this tells the launch's cost rather than a sample's [s].
SHORTEST_TRIAL = 0.1


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What the experiment is asked for.

    Attributes:
        common: settings of RenderConfig that all variants share, such as max_depth.
        seed: all runs' seeds follow from it.
        repeats: runs of every budget, 2 at least, so that a spread is known.
        spp: samples per pixel of the longest runs; None takes what `seconds` affords.
        seconds: about how long all of it may take [s].
        reference: an EXR; None renders one.
        reference_spp: samples per pixel of a rendered reference; None takes 16 times those of the longest runs.
        denoise: measure every method once more with denoising, those of a sweep left out.

    Raises:
        ConfigError: a setting is impossible, or denoising is asked for without its package.
    """

    common: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    repeats: int = 3
    spp: int | None = None
    seconds: float = 200.0
    reference: str | None = None
    reference_spp: int | None = None
    denoise: bool = False

    def __post_init__(self) -> None:
        checked_integer("seed", self.seed)
        checked_integer("repeats", self.repeats)
        if self.spp is not None:
            checked_integer("longest_spp", self.spp)
        if self.reference_spp is not None:
            checked_integer("reference_spp", self.reference_spp)
        if not 0.0 < self.seconds <= MAX_SECONDS:
            raise ConfigError(f"the time for the comparison must be above 0 and finite, got {self.seconds:g} s")
        if self.denoise:
            require_oidn()


@dataclass(frozen=True)
class Run:
    """One timed render.

    Errors include the reference's noise, of which `reference_noise` is in `relative_mse`. `seconds` and `learn_seconds`
    exclude compilation; `denoise_seconds` are a part of `seconds`. Rejected samples are those that were not finite.
    """

    spp: int
    seed: int
    seconds: float
    learn_seconds: float
    denoise_seconds: float
    relative_mse: float
    reference_noise: float
    mean_squared_error: float
    rejected_samples: int


@dataclass(eq=False)
class Pictures:
    """What the repetitions of one budget leave behind: the first one's result, and means over all of them.

    Attributes:
        first: of the first repetition.
        image_sum: shape (H, W, 3).
        error_sum: squared error relative to squared_scale, shape (H, W).
        count: repetitions so far.
    """

    first: warpmis.RenderResult
    image_sum: NDArray[np.float64]
    error_sum: NDArray[np.float64]
    count: int = 1

    def mean_image(self) -> NDArray[np.float64]:
        return self.image_sum / self.count

    def mean_error(self) -> NDArray[np.float64]:
        return self.error_sum / self.count


@dataclass(eq=False)
class Measurement:
    """All that was measured of one variant.

    Attributes:
        compile_seconds: of its first render [s].
        denoise_seconds: what denoising adds to a run, however many samples it has [s].
        runs: by samples per pixel, the repetitions of each budget.
        equal_time: the repetitions of the run that takes as long as the baseline's longest.
        longest, in_equal_time: pictures of the largest budget, and of the equal time.
        denoised: the same method with denoising; None where that was not asked for.
    """

    variant: Variant
    compile_seconds: float
    seconds_per_spp: float
    denoise_seconds: float = 0.0
    runs: dict[int, list[Run]] = field(default_factory=dict)
    equal_time: list[Run] = field(default_factory=list)
    longest: Pictures | None = None
    in_equal_time: Pictures | None = None
    denoised: Measurement | None = None


def with_denoised(measurements: Iterable[Measurement]) -> list[Measurement]:
    """Each one, and behind it what was measured of it with denoising."""
    return [one for measurement in measurements for one in (measurement, measurement.denoised) if one is not None]


@dataclass(eq=False)
class Experiment:
    """Everything measured, the baseline first; is_interrupted: of less than was asked for."""

    scene: warpmis.Scene
    settings: Settings
    spp: int
    reference: Reference
    measurements: list[Measurement]
    left_out: list[str]
    is_interrupted: bool = False


def run_experiment(
    scene: warpmis.Scene, variants: Sequence[Variant], settings: Settings, progress: ProgressCallback | None = None
) -> Experiment:
    """Calibrate, make the reference, measure; the first variant is the baseline.

    Raises:
        ConfigError: a variant or a setting is impossible.
        WarpmisError: the reference cannot be used.

    Ctrl-C ends the measuring: the experiment then holds what there is.
    """
    bench = _Bench(scene, settings, progress)
    given = read_reference(settings.reference, scene.resolution) if settings.reference else None
    measurements = [bench.calibrated(variant) for variant in variants]
    for measurement in measurements:
        if settings.denoise and not measurement.variant.knob:
            measurement.denoised = bench.calibrated(measurement.variant.denoised())
    spp = settings.spp or bench.affordable(measurements, reference=given is None and settings.reference_spp is None)
    reference_spp = 0 if given else settings.reference_spp or REFERENCE_FACTOR * spp
    bench.expect(measurements, spp, reference_spp)
    bench.reference = given or bench.rendered_reference(variants, reference_spp)
    if settings.spp is None and not given:
        bench.slowdown = bench.reference.seconds / (reference_spp * measurements[0].seconds_per_spp)
        spp = min(spp, bench.affordable(measurements, reference=False))
        bench.expect(measurements, spp, 0)
    left_out = _without_impossible(measurements, settings, spp)
    experiment = Experiment(scene, settings, spp, bench.reference, measurements, left_out)
    try:
        _measure(bench, measurements, spp)
    except KeyboardInterrupt:
        experiment.is_interrupted = True
    return experiment


def _without_impossible(measurements: list[Measurement], settings: Settings, spp: int) -> list[str]:
    """Remove what can do no rung of the ladder, and name it."""
    impossible = [one for one in with_denoised(measurements) if not _budgets(one, settings, spp)]
    measurements[:] = [one for one in measurements if one not in impossible]
    for measurement in measurements:
        if measurement.denoised in impossible:
            measurement.denoised = None
    return [f"{one.variant.label} needs more than {spp} samples per pixel: raise --spp" for one in impossible]


def _measure(bench: _Bench, measurements: Sequence[Measurement], spp: int) -> None:
    """The ladder up to `spp`, then every variant for as long as the baseline's longest run took."""
    settings = bench.settings
    every = with_denoised(measurements)
    for repeat in range(settings.repeats):
        for measurement in _in_turn(every, repeat):
            for budget in _budgets(measurement, settings, spp):
                bench.climb(measurement, budget, longest=budget == spp, repeat=repeat)
    seconds = min(run.seconds for run in measurements[0].runs[spp])
    for repeat in range(settings.repeats):
        for measurement in _in_turn(every, repeat):
            bench.spend(measurement, seconds, repeat)


def _budgets(measurement: Measurement, settings: Settings, spp: int) -> list[int]:
    """The rungs of the ladder that the variant can do."""
    budgets = []
    for budget in ladder(spp):
        try:
            measurement.variant.config(settings.common, budget, settings.seed)
        except ConfigError:
            continue
        budgets.append(budget)
    return budgets


def _in_turn(measurements: Sequence[Measurement], repeat: int) -> Iterator[Measurement]:
    """All of them, each repetition beginning with another one, so that a machine's drift favours none."""
    start = repeat % len(measurements)
    yield from measurements[start:]
    yield from measurements[:start]


class _Bench:
    """Renders, times and compares; hands out seeds, and tells how far it all has come."""

    reference: Reference

    def __init__(self, scene: warpmis.Scene, settings: Settings, progress: ProgressCallback | None) -> None:
        self.scene = scene
        self.settings = settings
        self.progress = progress
        self.pixels = scene.resolution[0] * scene.resolution[1]
        self.next_seed = settings.seed
        self.done = 0
        self.total = 0
        self.started = time.perf_counter()
        # How much longer a long render takes than its trial promised: other programs come, and a warm processor slows.
        self.slowdown = 1.0

    def affordable(self, measurements: Sequence[Measurement], *, reference: bool) -> int:
        """The longest runs' samples per pixel that the rest of the time has room for."""
        every = with_denoised(measurements)
        rest = self.settings.seconds - (time.perf_counter() - self.started)
        rest -= self.settings.repeats * (len(LADDER) + 1) * sum(one.denoise_seconds for one in every)
        costs = [one.seconds_per_spp * max(1.0, self.slowdown) for one in every]
        return affordable_spp(max(rest, 0.0), costs, self.settings.repeats, reference=reference)

    def render(self, variant: Variant, spp: int, what: str) -> warpmis.RenderResult:
        """A render with a seed that no other has."""
        config = variant.config(self.settings.common, spp, self.next_seed)
        self.next_seed = (self.next_seed + 1) % 2**32

        def show(inner: Progress) -> None:
            if self.progress is not None:
                detail = f"{what}, {spp} spp"
                self.progress(Progress(variant.label, self.done + inner.done, self.total, 0, 0.0, detail))

        result = warpmis.render(self.scene, config=config, progress=show, denoise=variant.denoise)
        self.done += spp * self.pixels
        return result

    def calibrated(self, variant: Variant) -> Measurement:
        """Compile a variant, and find out what a sample of it costs."""
        spp = variant.least_spp(self.settings.common)
        compile_seconds = float(self.render(variant, spp, "compile").stats["seconds"]["compile"])
        while True:
            stats = self.render(variant, spp, "trial").stats
            seconds = tracing_seconds(stats)
            if seconds > SHORTEST_TRIAL or spp > 100_000:
                return Measurement(variant, compile_seconds, seconds / spp, _denoise_seconds(stats))
            spp *= 8

    def expect(self, measurements: Sequence[Measurement], spp: int, reference_spp: int) -> None:
        """Tell the progress how many samples are to come."""
        each = sum(sum(ladder(spp)) + spp for _ in with_denoised(measurements))
        self.done, self.total = 0, self.pixels * (self.settings.repeats * each + reference_spp)

    def rendered_reference(self, variants: Sequence[Variant], spp: int) -> Reference:
        """By the baseline, as deep as the deepest variant goes."""
        baseline = variants[0]
        common = self.settings.common
        depths = [variant.config(common, variant.least_spp(common), 0).max_depth for variant in variants]
        deepest = Variant(baseline.label, {**baseline.render, "max_depth": max(depths)}, baseline.learn)
        part = -(-spp // PARTS)
        results = [self.render(deepest, part, f"reference {number}/{PARTS}") for number in range(1, PARTS + 1)]
        return merged_reference(results, baseline.label, max(depths))

    def climb(self, measurement: Measurement, spp: int, *, longest: bool, repeat: int) -> None:
        """One run of the ladder."""
        result, run = self._timed(measurement.variant, spp, f"repeat {repeat + 1}/{self.settings.repeats}")
        measurement.runs.setdefault(spp, []).append(run)
        if longest:
            measurement.longest = self._added(measurement.longest, result)

    def spend(self, measurement: Measurement, seconds: float, repeat: int) -> None:
        """One run of as many samples as `seconds` have room for."""
        spp, runs = max(measurement.runs.items())
        # What disturbs a run only ever makes it longer.
        cost = min(run.seconds - run.denoise_seconds for run in runs) / spp
        rest = seconds - min(run.denoise_seconds for run in runs)
        affordable = max(measurement.variant.least_spp(self.settings.common), round(rest / cost))
        what = f"equal time {repeat + 1}/{self.settings.repeats}"
        result, run = self._timed(measurement.variant, affordable, what)
        measurement.equal_time.append(run)
        measurement.in_equal_time = self._added(measurement.in_equal_time, result)

    def _timed(self, variant: Variant, spp: int, what: str) -> tuple[warpmis.RenderResult, Run]:
        result = self.render(variant, spp, what)
        truth = self.reference.image
        error = squared_error(result.shown, truth) / squared_scale(truth)
        kept = kept_pixels(error)
        return result, Run(
            spp=spp,
            seed=int(result.settings["seed"]),
            seconds=tracing_seconds(result.stats) + _denoise_seconds(result.stats),
            learn_seconds=float(result.stats["seconds"]["learn"]),
            denoise_seconds=_denoise_seconds(result.stats),
            relative_mse=float(error.ravel()[kept].mean()),
            reference_noise=float(self.reference.relative_noise().ravel()[kept].mean()),
            mean_squared_error=mean_squared_error(result.shown, truth),
            rejected_samples=int(result.stats["rejected_samples"]),
        )

    def _added(self, pictures: Pictures | None, result: warpmis.RenderResult) -> Pictures:
        error = squared_error(result.shown, self.reference.image) / squared_scale(self.reference.image)
        image = result.shown.astype(np.float64)
        if pictures is None:
            return Pictures(result, image, error)
        pictures.image_sum += image
        pictures.error_sum += error
        pictures.count += 1
        return pictures


def _denoise_seconds(stats: RenderStats) -> float:
    """What denoising took, 0 where there was none [s]."""
    return float(stats["denoise"]["seconds"]) if "denoise" in stats else 0.0
