"""What a render returns: the image, what is known about it, and how to store it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.config import SettingsDict
from warpmis.errors import ConfigError
from warpmis.film.metrics import estimated_relative_error
from warpmis.output import cryptomatte
from warpmis.output.cryptomatte import Coverage
from warpmis.rendering.stats import RenderStats

if TYPE_CHECKING:
    from warpmis.cache.maps import CacheMaps

Float32Array = NDArray[np.float32]

# Hydra's names of the pictures in RenderResult.ids.
IDS = ("primId", "instanceId", "elementId")


@dataclass(frozen=True, eq=False, kw_only=True)
class RenderResult:
    """A finished render. Row 0 of every picture is on top.

    Attributes:
        image: radiance, linear Rec.709, shape (H, W, 3) float32.
        denoised: the denoised picture if you asked for it, else None; linear Rec.709, shape (H, W, 3) float32. `image`
            stays as it was sampled.
        alpha: coverage from 0 to 1, shape (H, W) float32.
        albedo: mean reflectance at the first hit, linear Rec.709, shape (H, W, 3) float32.
        normal: mean shading normal at the first hit, world space, shape (H, W, 3) float32.
        depth: mean distance along the viewing axis to the first hit [scene units], shape (H, W) float32.
        samples: number of samples, shape (H, W).
        variance: variance of one sample's luminance, shape (H, W) float32. Evenly spread samples (the strategy choice
            "stratified", the sampler "lattice") give a picture less noise than this suggests.
        allocation: share of each strategy, in the order of `strategies`, shape (H, W, S) float32.
        strategies: names of the S strategies.
        next_event: share of each pixel's samples that next-event estimation takes in place of the mixture, shape (H, W)
            float32, where the method may do so; such a pixel's `allocation` says nothing. None for other methods.
        cache: where the picture is guided by the spatial cache, what that has learned, see CacheMaps; else None.
        round_allocations: with keep_maps, the allocation after each learn round, shape (H, W, S) float32 each.
        ids: with ids=True, what the middle of each pixel sees, shape (H, W, 3) int32: the prim's place in `paths`, its
            instance, and its face, curve or point; -1 where there is no surface.
        paths: with ids=True or the AOV primId, the prims' paths; material_paths: with materialId, the materials'.
        aovs: with aov=(...), the further pictures by name: of light, linear Rec.709, shape (H, W, 3) float32; of the
            surface in the middle of each pixel, shape (H, W) or (H, W, 2).
        cryptomatte: with cryptomatte=True, which prims and which materials cover each pixel, see Coverage.
        stats: counts and times, see RenderStats.
        name: the stage's file name or identifier.
        settings: the settings of the render, as plain values.
        warnings: what in the stage is not supported, one line each.
        notes: what warpmis supplied because the stage has none, one line each.
    """

    image: Float32Array
    alpha: Float32Array
    albedo: Float32Array
    normal: Float32Array
    depth: Float32Array
    samples: NDArray[Any]
    variance: Float32Array
    allocation: Float32Array
    strategies: tuple[str, ...]
    stats: RenderStats
    name: str
    denoised: Float32Array | None = None
    next_event: Float32Array | None = None
    cache: CacheMaps | None = None
    round_allocations: tuple[Float32Array, ...] = ()
    ids: NDArray[np.int32] | None = None
    paths: tuple[str, ...] = ()
    material_paths: tuple[str, ...] = ()
    aovs: Mapping[str, Float32Array] = field(default_factory=dict)
    cryptomatte: tuple[Coverage, ...] = ()
    settings: SettingsDict = field(default_factory=SettingsDict)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def write(self, path: str | os.PathLike[str], channels: Mapping[str, str] | None = None) -> None:
        """Write a file by its ending.

        ".exr": the image, everything known per pixel as in `channels()`, and the settings in the header; linear
        Rec.709, float32. ".png": the picture to look at, `shown`, as 8-bit sRGB, values above 1 cut off.

        Args:
            channels: of an EXR, the names in the file and which of `channels()` each one is, such as {"beauty.R": "R"};
                None for all.

        Raises:
            ConfigError: the name ends in neither, or there is no such channel.
            WarpmisError: the file cannot be written.
        """
        ending = os.path.splitext(os.fsdecode(path))[1].lower()
        if ending == ".exr":
            self._write_exr(path, channels)
        elif ending != ".png":
            raise ConfigError(f"{os.fsdecode(path)}: the file's name must end in .exr or .png")
        elif channels is not None:
            raise ConfigError(f"{os.fsdecode(path)}: a PNG has no named channels; write an .exr")
        else:
            from warpmis.output.png import write_png  # here, so that a render can be had without OpenImageIO

            write_png(path, self.shown)

    def _write_exr(self, path: str | os.PathLike[str], channels: Mapping[str, str] | None) -> None:
        from warpmis.output.exr import write_exr  # here, so that a render can be had without OpenEXR

        pictures = self.channels()
        if channels is not None:
            unknown = [own for own in channels.values() if own not in pictures]
            if unknown:
                raise ConfigError(f"there is no channel {unknown[0]}; there are {', '.join(pictures)}")
            pictures = {name: pictures[own] for name, own in channels.items()}
        for one in self.cryptomatte:
            pictures |= cryptomatte.channels(one.layer, one.ids, one.shares)
        mattes = [cryptomatte.attributes(one.layer, one.names) for one in self.cryptomatte]
        header = {"version": warpmis.__version__, "stage": self.name, **_flat(self.settings)}
        if self.paths:
            header["paths"] = " ".join(self.paths)  # a path has no spaces
        if self.material_paths:
            header["materials"] = " ".join(path or "-" for path in self.material_paths)
        write_exr(path, pictures, header, {name: value for matte in mattes for name, value in matte.items()})

    @property
    def shown(self) -> Float32Array:
        """The picture to look at: the denoised one if there is one, else `image`."""
        return self.image if self.denoised is None else self.denoised

    def relative_error(self) -> float:
        """An estimate of the picture's relative error from its own samples: 0.02 is 2 %.

        With a target error or a time limit it is the estimate that ended the render. Otherwise it comes from the spread
        of single samples' luminance. That misses noise in colour alone and fireflies that outshine their pixel, so it
        can be too low by a quarter; with evenly spread samples in smooth light it can be too high by a factor of 2. See
        film/metrics.py.
        """
        stopping = self.stats.get("stopping")
        if stopping is not None and "relative_error" in stopping:
            return stopping["relative_error"]
        return estimated_relative_error(self.image, self.variance / np.maximum(self.samples, 1))

    def __repr__(self) -> str:
        height, width, _ = self.image.shape
        spp = self.stats["stopping"]["spp"] if "stopping" in self.stats else self.settings.get("spp", "?")
        settings = f"{self.settings.get('method', '?')}, {spp} spp"
        return f"RenderResult({self.name}, {width} x {height}, {settings})"

    def _repr_html_(self) -> str:
        """What a notebook shows: the picture, the balance map, the expected error."""
        from warpmis.output.notebook import notebook_html

        caption = f"{self!r}: relative error about {100.0 * self.relative_error():.2g} %"
        learned = self.stats["seconds"]["learn"] > 0.0
        next_event = self.next_event if learned else None
        return notebook_html(caption, self.shown, self.allocation, self.strategies, next_event)

    def aov_channels(self, asked: Sequence[str]) -> list[str]:
        """Names of the EXR channels of the AOVs among `asked`, which are as RenderConfig.aov."""
        layers = {one.partition("=")[0] for one in asked}
        found = []
        for name, picture in self.aovs.items():
            if name in layers or ("lights" in layers and name.startswith("light.")):
                found += list(_named(name, picture))
        return found

    def channels(self) -> dict[str, Float32Array]:
        """Every picture under its EXR channel name, each of shape (H, W) float32."""
        pictures = {"A": self.alpha, "Z": self.depth, "variance.Y": self.variance, "samples.Y": self.samples}
        for axis, name in enumerate("RGB"):
            pictures[name] = self.image[..., axis]
            pictures[f"albedo.{name}"] = self.albedo[..., axis]
        if self.denoised is not None:
            pictures |= {f"denoised.{name}": self.denoised[..., axis] for axis, name in enumerate("RGB")}
        for axis, name in enumerate("XYZ"):
            pictures[f"N.{name}"] = self.normal[..., axis]
        if self.ids is not None:
            pictures |= {name: self.ids[..., axis] for axis, name in enumerate(IDS)}
        for name, picture in self.aovs.items():
            pictures |= _named(name, picture)
        if self.next_event is not None:
            pictures["nextEvent.Y"] = self.next_event
        if self.cache is not None:
            pictures |= self.cache.channels()
        for axis, name in enumerate(self.strategies):
            pictures[f"allocation.{name}"] = self.allocation[..., axis]
        return {name: np.asarray(picture, dtype=np.float32) for name, picture in pictures.items()}


def _named(name: str, picture: Float32Array) -> dict[str, Float32Array]:
    """An AOV's channels by name."""
    if picture.ndim == 2:
        return {name: picture}
    letters = {"uv": "UV", "motion": "XY"}.get(name, "RGB")
    return {f"{name}.{letter}": picture[..., axis] for axis, letter in enumerate(letters)}


def _flat(settings: Mapping[str, Any], prefix: str = "") -> dict[str, str | int | float]:
    """Nested settings as header attributes: "learn.rounds", sequences as "0.5,0.5", unset ones left out."""
    flat: dict[str, str | int | float] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        elif isinstance(value, str | int | float):
            flat[prefix + name] = value
        elif value:
            flat[prefix + name] = ",".join(str(item) for item in value)
    return flat
