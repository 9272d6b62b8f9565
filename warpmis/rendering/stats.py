"""What a render counts and times. Dictionaries at run time, whose keys editors and type checkers know."""

from __future__ import annotations

from typing import NotRequired, TypedDict


class PhaseSeconds(TypedDict):
    """Wall clock time of each phase [s]."""

    load: float
    compile: float
    learn: float
    render: float


class StoppingStats(TypedDict):
    """Why a render with a target error or a time limit ended, and what it knows of its error.

    Keys:
        reason: "target error", "time limit", "interrupted", or "samples" for the limit of samples per pixel.
        spp: samples per pixel that were taken.
        relative_error, standard_error, bound: estimates from the picture's own samples, 0.02 is 2 %; the actual error
            is below the bound with the probability `confidence`. Missing where there were too few samples to tell.
        target_spp: samples per pixel that the target error takes, as far as it is known.
    """

    reason: str
    spp: int
    relative_error: NotRequired[float]
    standard_error: NotRequired[float]
    bound: NotRequired[float]
    confidence: NotRequired[float]
    target_spp: NotRequired[int]


class DenoiseStats(TypedDict):
    """What denoising took, and the errors that the two halves of the render tell without a reference.

    Keys:
        seconds: wall clock time of denoising [s].
        relative_error_bound: the denoised picture's relative error is below this with about 95 % confidence, 0.02 is
            2 %. Where rare bright pixels carry much of the light the actual error may be larger.
        relative_mse, standard_error: relMSE of the denoised picture, below 0 by chance where it is small, and its
            standard error; noisy_relative_mse: that of the noisy picture.
    """

    seconds: float
    relative_error_bound: float
    relative_mse: float
    standard_error: float
    noisy_relative_mse: float


class CacheStats(TypedDict):
    """What became of the spatial cache.

    Keys:
        guided: whether the picture is guided by it.
        variance: relative variance of a sample by next-event estimation, as the pilot found it; missing without one.
        gains: of each trial, how many times as efficient a guided picture promised to be.
        cells: how many the cache has.
    """

    guided: bool
    variance: NotRequired[float]
    gains: list[float]
    cells: int


class DeviceBytes(TypedDict):
    """Device memory [byte]: the scene's by what it is for, and the picture's."""

    scene: dict[str, int]
    picture: int


class RenderStats(TypedDict):
    """RenderResult.stats: a dictionary of plain values.

    Keys:
        seconds: wall clock time of each phase [s].
        samples: pixel samples taken, learning and rejected ones included.
        rejected_samples: samples that were not finite and are left out of the picture.
        rays: rays traced, shadow rays included.
        rays_per_second: rays over the time of learning and rendering.
        next_event_pixels: share of the pixels that next-event estimation rendered, from 0 to 1.
        excess_variance_bound: the part of the relative variance that other shares could have saved at most, from 0 to
            1; missing where no samples were shared between strategies.
        cache: missing from methods without a spatial cache.
        stopping: missing without a target error and a time limit.
        denoise: missing where the picture was not denoised.
        triangles, lights: of the scene, instances included.
        features: names of the effects that the kernels were compiled with.
        device, threads: where it was rendered.
        compile_seconds: time that the render waited for kernels [s]; others were compiled while it traced.
        kernels_compiled, kernels_cached: how many were compiled, and how many were found in the cache.
        bytes: device memory.
    """

    seconds: PhaseSeconds
    samples: int
    rejected_samples: int
    rays: int
    rays_per_second: float
    next_event_pixels: float
    excess_variance_bound: NotRequired[float]
    cache: NotRequired[CacheStats]
    stopping: NotRequired[StoppingStats]
    denoise: NotRequired[DenoiseStats]
    triangles: int
    lights: int
    features: list[str]
    device: str
    threads: int
    compile_seconds: float
    kernels_compiled: int
    kernels_cached: int
    bytes: DeviceBytes
