"""Makes usd_scenes/open_terrace/sky.exr: a clear sky with a low sun, far hills and a darker ground, lat-long.

The picture is a model of our own, no photograph: a gradient from a blue zenith to a pale horizon, a warm glow about the
sun, and a sun of a handful of texels that gives a facing surface about three times the whole sky's irradiance, as on a
clear day. UsdLux's orientation: row 0 is the zenith, u = 0.25 looks along +X and u = 0.5 along +Z.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

WIDTH, HEIGHT = 512, 256
SUN_ELEVATION, SUN_AZIMUTH = np.radians(31.0), np.radians(-62.0)  # azimuth from -Z towards +X
SUN_RADIUS = np.radians(0.9)  # larger than the real 0.27 degrees, so that it covers a few texels
SUN_IRRADIANCE = np.array([5.6, 4.5, 3.2])  # on a surface that faces the sun

ZENITH, HORIZON = np.array([0.13, 0.27, 0.66]), np.array([0.70, 0.79, 0.92])
GLOW, GROUND = np.array([1.0, 0.72, 0.42]), np.array([0.13, 0.115, 0.085])
FAR_HILLS, NEAR_HILLS = np.array([0.40, 0.50, 0.64]), np.array([0.20, 0.27, 0.28])
SOFT_EDGE = np.radians(1.8)

Picture = NDArray[np.float64]


def directions() -> Picture:
    """The unit vector through each texel's centre, shape (HEIGHT, WIDTH, 3)."""
    theta = np.pi * (np.arange(HEIGHT) + 0.5) / HEIGHT
    phi = 2.0 * np.pi * (np.arange(WIDTH) + 0.5) / WIDTH
    sin_theta = np.sin(theta)[:, None]
    y = np.broadcast_to(np.cos(theta)[:, None], (HEIGHT, WIDTH))
    return np.stack([sin_theta * np.sin(phi), y, -sin_theta * np.cos(phi)], axis=-1)


def sun_direction() -> NDArray[np.float64]:
    """The unit vector towards the sun."""
    flat = np.cos(SUN_ELEVATION)
    return np.array([flat * np.sin(SUN_AZIMUTH), np.sin(SUN_ELEVATION), -flat * np.cos(SUN_AZIMUTH)])


def sky(w: Picture, to_sun: NDArray[np.float64]) -> Picture:
    """The clear sky without its sun: paler towards the horizon, warmer and brighter towards the sun."""
    height = np.clip(w[..., 1:2], 0.0, 1.0)
    base = ZENITH + (HORIZON - ZENITH) * np.exp(-4.0 * height)
    angle = np.arccos(np.clip(w @ to_sun, -1.0, 1.0))[..., None]
    return base + GLOW * (0.35 * np.exp(-3.0 * angle) + 1.2 * np.exp(-16.0 * angle))


def ridge(azimuth: NDArray[np.float64], *, height_degrees: float, phase: float) -> NDArray[np.float64]:
    """The elevation [radian] of a range of hills; whole frequencies, so that it closes on itself."""
    waves = ((3, 0.40), (7, 0.25), (13, 0.15), (29, 0.06))
    shape = 0.55 + sum(a * np.sin(k * azimuth + phase * k + 1.7 * k * k) for k, a in waves)
    return np.radians(height_degrees) * np.clip(shape, 0.05, None)


def landscape(w: Picture, picture: Picture) -> Picture:
    """The picture with two ranges of hills in the haze, their edges as soft as a texel, and a ground beneath."""
    elevation = np.arcsin(w[..., 1])[..., None]
    azimuth = np.arctan2(w[..., 0], -w[..., 2])[..., None]
    for color, height_degrees, phase in ((FAR_HILLS, 6.5, 0.4), (NEAR_HILLS, 3.0, 2.1)):
        inside = (ridge(azimuth, height_degrees=height_degrees, phase=phase) - elevation) / SOFT_EDGE + 0.5
        picture = picture + (color - picture) * np.clip(inside, 0.0, 1.0)
    fade = np.exp(np.clip(elevation, None, 0.0) / np.radians(5.0))
    return np.where(elevation < 0.0, GROUND + (NEAR_HILLS - GROUND) * fade, picture)


def add_sun(w: Picture, picture: Picture, to_sun: NDArray[np.float64]) -> Picture:
    """The picture with the sun's texels set so that they sum to SUN_IRRADIANCE."""
    solid_angle = (2.0 * np.pi / WIDTH) * (np.pi / HEIGHT) * np.sqrt(1.0 - w[..., 1] ** 2)
    disc = w @ to_sun > np.cos(SUN_RADIUS)
    return np.where(disc[..., None], SUN_IRRADIANCE / solid_angle[disc].sum(), picture)


def main() -> None:
    """Write the picture, half floats, ZIP."""
    default = Path(__file__).resolve().parents[1] / "usd_scenes" / "open_terrace" / "sky.exr"
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("out", nargs="?", type=Path, default=default)
    out = parser.parse_args().out
    w, to_sun = directions(), sun_direction()
    picture = add_sun(w, landscape(w, sky(w, to_sun)), to_sun).astype(np.float16)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(picture)}).write(str(out))


if __name__ == "__main__":
    main()
