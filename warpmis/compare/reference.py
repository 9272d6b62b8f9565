"""The picture that is taken for the truth, and how far it is to be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.errors import WarpmisError
from warpmis.film.metrics import LUMINANCE, estimated_relative_error, squared_error, squared_scale
from warpmis.output.exr import read_exr

# A reference is rendered in so many independent parts: their scatter tells its noise.
PARTS = 4

# Where an EXR says how sure its pixels are; the first is our own references'.
NOISE_CHANNEL = "squared_standard_error.Y"


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference and its own noise.

    Attributes:
        image: linear Rec.709, shape (H, W, 3).
        squared_standard_error: per pixel, colours weighted as in metrics.squared_error, shape (H, W); None if the
            file does not say.
        source: where it comes from, in words.
        seconds: what it took to make [s], 0 if it was read.
    """

    image: NDArray[np.float64]
    squared_standard_error: NDArray[np.float64] | None
    source: str
    seconds: float = 0.0

    def relative_error(self) -> float | None:
        """Its own relative standard error, None if unknown."""
        if self.squared_standard_error is None:
            return None
        return estimated_relative_error(self.image, self.squared_standard_error)

    def relative_noise(self) -> NDArray[np.float64]:
        """Per pixel what its noise adds to a relative squared error, shape (H, W); 0 if unknown."""
        if self.squared_standard_error is None:
            return np.zeros(self.image.shape[:2])
        return self.squared_standard_error / squared_scale(self.image)

    def channels(self) -> dict[str, NDArray[np.float32]]:
        """What `read_reference` reads back."""
        channels = {name: self.image[..., axis].astype(np.float32) for axis, name in enumerate("RGB")}
        if self.squared_standard_error is not None:
            channels[NOISE_CHANNEL] = self.squared_standard_error.astype(np.float32)
        return channels


def read_reference(path: str, resolution: tuple[int, int]) -> Reference:
    """A reference from an EXR with R, G and B of the resolution (width, height).

    Its noise is known if the file is a reference of `warpmis compare`, or any render of ours.
    """
    channels, _ = read_exr(path)
    if any(name not in channels for name in "RGB"):
        raise WarpmisError(f"{path}: has no channels R, G and B; name a picture in colour")
    image = np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float64)
    height, width = image.shape[:2]
    if (width, height) != resolution:
        raise WarpmisError(
            f"{path}: is {width} x {height}, the stage's picture {resolution[0]} x {resolution[1]}; "
            f"set --image-width {width}, or render the reference anew"
        )
    noise = None
    if NOISE_CHANNEL in channels:
        noise = channels[NOISE_CHANNEL].astype(np.float64)
    elif "variance.Y" in channels and "samples.Y" in channels:
        noise = channels["variance.Y"] / np.maximum(channels["samples.Y"].astype(np.float64), 1.0)
    return _checked(Reference(image, noise, path), path)


def merged_reference(results: list[warpmis.RenderResult], method: str, depth: int) -> Reference:
    """The mean of independent renders with equal budgets, its noise from their scatter.

    Squared standard error: sum_k |x_k - mean|^2 / (K (K - 1)).
    """
    images = np.stack([result.image.astype(np.float64) for result in results])
    mean = images.mean(axis=0)
    count = len(images)
    scatter = sum(squared_error(image, mean) for image in images) / (count * (count - 1))
    spp = sum(int(result.settings["spp"]) for result in results)
    seconds = sum(tracing_seconds(result.stats) for result in results)
    source = f"rendered here: {method}, {spp} samples per pixel, up to {depth} bounces"
    return _checked(Reference(mean, np.asarray(scatter), source, seconds), "the reference")


def tracing_seconds(stats: Mapping[str, Any]) -> float:
    """What counts as the time of a render: learning and rendering, not loading and compiling [s]."""
    seconds = stats["seconds"]
    return float(seconds["learn"] + seconds["render"])


def _checked(reference: Reference, name: str) -> Reference:
    if not np.isfinite(reference.image).all():
        raise WarpmisError(f"{name}: has pixels that are not finite, so nothing can be compared with it")
    if not (reference.image @ LUMINANCE).any():
        raise WarpmisError(f"{name}: is black, so no relative error exists; light the scene")
    return reference
