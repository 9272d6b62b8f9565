"""Hard lights: of extreme size, place, strength and number. A grey floor is seen at the origin alone."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from hard.case import HardCase
from hard.parts import DOWN, SKY, UP, camera, floor, grey, light, mesh, scattered, stage
from numpy.typing import NDArray

import warpmis
from warpmis.scene import DomeLight, Scene

SMALL_CONE = "1 - cos(theta) as a difference is 0 in float32 below r / d = 3e-4: the density is infinite"
CONE_REMEDY = (
    "1 - cos = sin^2 / (1 + cos), no cosine is ever subtracted from 1 (kernels/light/sphere.py; Haines, Guenther, "
    "Akenine-Moeller 2019 for the hit); what the sampler drew counts as hit, not its rounded direction"
)
ROUNDED = "a direction has 24 digits: of those drawn towards a light 1e-6 of its distance 1 % miss it when traced"
DRAWN = "the path remembers light, distance and density of the draw (Receiver.drawn)"


COS_ASIDE = 0.8


def lit(*parts: str) -> Callable[[], Any]:
    return lambda: stage(floor(), camera(), *parts)


# At the distance 1, and in no axis' direction: one along an axis has small components, which rounding leaves alone.
ASIDE = (0.36, COS_ASIDE, 0.48)


def sphere_case(name: str, radius: float, **text: str) -> HardCase:
    """A sphere aside, or overhead with its nearest point 1 above the floor where it is large: normalised, so that
    E = pi L (r / d)^2 cos(theta) with L = intensity / (4 pi r^2)."""
    overhead = radius > 0.5
    distance = radius + 1.0 if overhead else 1.0
    intensity = 4.0 * distance**2 / (1.0 if overhead else COS_ASIDE)
    at = (0, distance, 0) if overhead else ASIDE
    lamp = light("SphereLight", at=at, radius=radius, intensity=intensity, normalize=True)
    return HardCase(name, build=lit(lamp), mean=scattered(1.0), settings={"spp": 256}, **text)


def corner_factor(height: float, width: float, away: float) -> float:
    """Configuration factor from a floor element to an upright rectangle whose lower corner is next to it.

    Reference: Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-5.
    """
    x, y = height / width, away / width
    root = math.hypot(x, y)
    return (math.atan(1.0 / y) - y / root * math.atan(1.0 / root)) / (2.0 * math.pi)


def rect_factor(half: float, height: float) -> float:
    """From a floor element to a square centred above it (Howell, B-4, four corners)."""
    a = half / height
    return 4.0 * a / math.sqrt(1 + a * a) * math.atan(a / math.sqrt(1 + a * a)) / math.pi


EDGE = 1e-3
ON_EDGE = light("RectLight", at=(0, 0.5, -EDGE), rotate=(0, 180, 0), width=1.0, height=1.0, intensity=1.0)


def crowd(count: int) -> tuple[str, float]:
    """`count` faint spheres in a wide ring, and what they bring: E = pi L (r / d)^2 cos(theta)."""
    rng = np.random.default_rng(1)
    lamps, total = [], 0.0
    for k in range(count):
        angle, height, out = rng.uniform(0, 2 * math.pi), rng.uniform(0.5, 2.0), rng.uniform(2.0, 4.0)
        strength = 10.0 ** rng.uniform(-6, -3)
        at = (out * math.cos(angle), height, out * math.sin(angle))
        lamps.append(light("SphereLight", f"Faint{k}", at=at, radius=0.1, intensity=strength))
        d2 = out**2 + height**2
        total += math.pi * strength * 0.01 / d2 * height / math.sqrt(d2)
    return "".join(lamps), total


@cache
def crowded() -> tuple[str, float]:
    text, brought = crowd(999)
    one = light("SphereLight", "One", at=(0, 1, 0), radius=0.01, intensity=1e4)
    return text + one, brought + math.pi * 1e4 * 1e-4


@cache
def hidden_crowd() -> str:
    """As bright as the one that is seen, above a card."""
    card = mesh("Card", [(-3, 1.5, 3), (3, 1.5, 3), (3, 1.5, -3), (-3, 1.5, -3)], [(0, 1, 2, 3)], 0.0)
    rng = np.random.default_rng(2)
    places = np.stack([rng.uniform(-1, 1, 99), rng.uniform(1.7, 2.0, 99), rng.uniform(-1, 1, 99)], axis=1)
    lamps = [light("SphereLight", f"Hidden{k}", at=at, radius=0.02, intensity=100.0) for k, at in enumerate(places)]
    return card + "".join(lamps) + light("SphereLight", "One", at=(0, 1, 0), radius=0.02, intensity=100.0)


def sky_picture(bright: float, dark: float) -> NDArray[np.float32]:
    """16 x 32 texels, one of them bright, some 40 degrees below the pole."""
    picture = np.full((16, 32, 3), dark, np.float32)
    picture[3, 11] = bright
    return picture


def sky_irradiance(picture: NDArray[np.float32], side: int = 24) -> float:
    """Of a floor under the bilinearly interpolated picture, by the midpoint rule over side^2 points a texel."""
    rows, columns = picture.shape[:2]
    v = (np.arange(rows * side // 2) + 0.5) / side  # the upper half, in texels
    u = (np.arange(columns * side) + 0.5) / side
    y, x = v - 0.5, u - 0.5
    row, column = np.floor(y).astype(int), np.floor(x).astype(int)
    fy, fx = (y - row)[:, None], (x - column)[None, :]
    value = picture[..., 1].astype(np.float64)

    def texel(r: Any, c: Any) -> Any:
        return value[np.clip(r, 0, rows - 1)[:, None], (c % columns)[None, :]]

    upper = texel(row, column) * (1 - fx) + texel(row, column + 1) * fx
    lower = texel(row + 1, column) * (1 - fx) + texel(row + 1, column + 1) * fx
    radiance = upper * (1 - fy) + lower * fy
    theta = np.pi * v / rows
    cell = (np.pi / rows / side) * (2.0 * np.pi / columns / side)
    return float((radiance * (np.sin(theta) * np.cos(theta))[:, None]).sum() * cell)


def under_sky(bright: float, dark: float) -> Callable[[], Scene]:
    """A loaded scene, for a picture comes from a file else."""

    def build() -> Scene:
        scene = warpmis.load_stage(stage(floor(), camera(), SKY))
        dome = DomeLight("/Sky", np.eye(3), np.ones(3), sky_picture(bright, dark))
        return dataclasses.replace(scene, lights=(dome,))

    return build


def line_irradiance(half_length: float, height: float) -> float:
    """Of a thin line above the floor, per 2 r L (tests/analytic/test_closed_forms.py)."""
    b, h = half_length, height
    return (b * h / (h * h + b * b) + math.atan(b / h)) / h


LIGHT_CASES = [
    sphere_case("sphere-light-1e-6-of-its-distance", 1e-6, trouble=SMALL_CONE, remedy=CONE_REMEDY),
    sphere_case("sphere-light-1e-5-of-its-distance", 1e-5, trouble=ROUNDED, remedy=DRAWN),
    sphere_case("sphere-light-near", 0.5, trouble="none", remedy="the case to compare the others with"),
    sphere_case(
        "sphere-light-1e6-times-the-scene",
        1e6,
        trouble="distance to the near side as d cos - sqrt(r^2 - d^2 sin^2) loses all its digits",
        remedy="the quotient (d - r)(d + r) / (d cos + sqrt(...)) (Haines, Guenther, Akenine-Moeller 2019)",
    ),
    HardCase(
        "inside-a-sphere-light",
        trouble="sin^2(theta_max) = (r / d)^2 is above 1: the root of a negative number",
        remedy="a sphere shines outwards: no light inside, no density, and the light strategy draws from the BSDF",
        build=lit(light("SphereLight", at=(0, 1, 0), radius=2.0, intensity=3.0)),
        mean=grey(0.0),
    ),
    HardCase(
        "rect-light-1e-6-of-its-distance",
        trouble="the determinant of the half edges, a fourth power of their length, underflows with the scene's scale",
        remedy="dual vectors made in float64 (device/light.py: flat_record); " + DRAWN,
        build=lit(light("RectLight", at=ASIDE, rotate=DOWN, width=1e-6, height=1e-6, intensity=1.0, normalize=True)),
        mean=scattered(COS_ASIDE**2),
    ),
    HardCase(
        "disk-light-1e-6-of-its-distance",
        trouble=ROUNDED,
        remedy=DRAWN,
        build=lit(light("DiskLight", at=ASIDE, rotate=DOWN, radius=1e-6, intensity=1.0, normalize=True)),
        mean=scattered(COS_ASIDE**2),
    ),
    HardCase(
        "rect-light-1e6-times-the-scene",
        trouble="uniform area sampling finds the part overhead once in 1e12",
        remedy="the balance heuristic leaves it to the BSDF (Veach 1997); no sample overflows",
        build=lit(light("RectLight", rotate=DOWN, width=1e6, height=1e6, intensity=1.0)),
        mean=scattered(math.pi),
    ),
    HardCase(
        "on-a-rect-light-s-plane",
        trouble="cosine 0 at the light: density 0 / 0",
        remedy="no sample where the plane does not face the point (kernels/light/area.py: pdf_of_area)",
        build=lit(light("RectLight", at=(0, 0, -0.4), rotate=UP, width=0.4, height=0.4, intensity=5.0)),
        mean=grey(0.0),
    ),
    HardCase(
        "at-a-rect-light-s-edge",
        trouble="the solid angle's differences lose their digits in a grazing view",
        remedy="area sampling below a height of a tenth (Urena, Fajardo, King 2013; kernels/light/rect.py)",
        build=lit(ON_EDGE),
        mean=scattered(math.pi * 2.0 * corner_factor(1.0, 0.5, EDGE)),
        settings={"spp": 256},
    ),
    HardCase(
        "light-of-zero-area",
        trouble="density 1 / 0",
        remedy="refused with a warning: its area is zero",
        build=lit(light("RectLight", rotate=DOWN, width=0.0, height=1.0, intensity=5.0)),
        mean=grey(0.0),
        learns=False,
    ),
    HardCase(
        "light-of-intensity-0",
        trouble="importance 0 / 0 in the choice among lights",
        remedy="a light that emits nothing is none (usd/lights/light.py: read_emission)",
        build=lit(light("SphereLight", radius=0.1, intensity=0.0)),
        mean=grey(0.0),
        learns=False,
    ),
    HardCase(
        "light-of-intensity-1e-30",
        trouble="importance, luminance times solid angle times cosine, leaves float32's range: a share of 0 / 0",
        remedy="luminance relative to the brightest light's (device/light.py: make_luminance_relative)",
        build=lit(light("SphereLight", radius=1e-3, intensity=1e-30)),
        mean=scattered(math.pi * 1e-36),
    ),
    HardCase(
        "light-of-intensity-1e+17",
        trouble="squares of radiance overflow float32",
        remedy="moments and variance are float64, the choice among lights relative",
        build=lit(light("SphereLight", radius=0.1, intensity=1e17)),
        mean=scattered(math.pi * 1e15),
    ),
    HardCase(
        "light-of-intensity-1e+30",
        trouble="its variance overflows the picture's float32",
        remedy="refused with a warning: radiance above 1e18 (usd/lights/light.py)",
        build=lit(light("SphereLight", radius=0.1, intensity=1e30)),
        mean=grey(0.0),
        learns=False,
    ),
    HardCase(
        "light-of-radiance-beyond-float32",
        trouble="intensity over area is infinite in float32",
        remedy="refused with a warning: radiance above 1e30 (usd/lights/light.py: is_in_range)",
        build=lit(light("SphereLight", radius=1e-10, intensity=1e17, normalize=True)),
        mean=grey(0.0),
        learns=False,
    ),
    HardCase(
        "a-thousand-lights-one-matters",
        trouble="uniform choice finds the one that matters once in a thousand",
        remedy="choice by an estimate of irradiance, a reservoir of one (Shirley, Wang, Zimmerman 1996)",
        build=lambda: stage(floor(), camera(), crowded()[0]),
        mean=scattered(crowded()[1]),
    ),
    HardCase(
        "a-hundred-lights-all-hidden-but-one",
        trouble="their importance does not know of the occluder: one sample in a hundred is of use",
        remedy="unbiased, but noisy: no remedy",
        build=lambda: stage(floor(), camera(), hidden_crowd()),
        mean=scattered(math.pi * 100.0 * 4e-4),
        settings={"spp": 256},
    ),
    HardCase(
        "sun-in-one-texel",
        trouble="in a float32 cumulative distribution the sky's texels are 0 wide beside the sun",
        remedy="density from the table that is sampled; what has none is left to the BSDF (device/environment.py)",
        build=under_sky(1e9, 1.0),
        mean=scattered(sky_irradiance(sky_picture(1e9, 1.0))),
    ),
    HardCase(
        "dome-black-but-for-one-texel",
        trouble="a density by texels is 0 where interpolation still shines",
        remedy="the density is blurred as interpolation spreads the light (device/environment.py: distribution)",
        build=under_sky(1.0, 0.0),
        mean=scattered(sky_irradiance(sky_picture(1.0, 0.0))),
        settings={"spp": 256},
    ),
    HardCase(
        "light-wholly-occluded",
        trouble="no sample ever tells anything: moments of 0",
        remedy="a pixel that learns nothing keeps its shares",
        build=lit(
            mesh("Card", [(-1, 0.6, 1), (1, 0.6, 1), (1, 0.6, -1), (-1, 0.6, -1)], [(0, 1, 2, 3)], 0.0),
            light("DiskLight", rotate=DOWN, radius=0.05, intensity=9.0),
        ),
        mean=grey(0.0),
    ),
    HardCase(
        "light-in-the-plane-of-a-ceiling",
        trouble="shadow rays end in the ceiling that the light lies in",
        remedy="shadow rays end 1e-4 of their length short (kernels/light/on_ray.py: SHADOW_END)",
        build=lit(
            mesh("Ceiling", [(-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1)], [(0, 3, 2, 1)], 0.0),
            light("RectLight", rotate=DOWN, width=0.5, height=0.5, intensity=2.0),
        ),
        mean=scattered(math.pi * 2.0 * rect_factor(0.25, 1.0)),
    ),
    HardCase(
        "cylinder-light-1e-6-thin",
        trouble="sampled by area the density is infinite at the silhouette, and half of the samples are of its back",
        remedy="azimuth and sine of elevation of the visible part (kernels/light/cylinder.py; Zimmerman 1995); "
        + DRAWN,
        build=lit(light("CylinderLight", at=(0, 0.8, 0.6), radius=1e-6, length=2.0, intensity=1e6)),
        mean=scattered(2.0 * COS_ASIDE * line_irradiance(1.0, 1.0)),
        settings={"spp": 256},
    ),
    HardCase(
        "cylinder-light-small",
        trouble="the ends' sines of elevation are equal to 24 digits",
        remedy="their difference as a quotient of squares (kernels/light/cylinder.py: sine_span)",
        build=lit(light("CylinderLight", at=(0, 0.8, 0.6), radius=1e-6, length=1e-6, intensity=1e12)),
        mean=scattered(2.0 * COS_ASIDE),
    ),
    HardCase(
        "distant-light-1e-5-degrees-wide",
        trouble=ROUNDED,
        remedy="1 - cos from the half angle's sine; " + DRAWN,
        build=lit(light("DistantLight", rotate=(-60, 25, 0), angle=1e-5, intensity=3.0, normalize=True)),
        mean=scattered(3.0 * math.sin(math.radians(60.0))),
    ),
    HardCase(
        "distant-light-all-around",
        trouble="half of the cone is below the horizon",
        remedy="uniform over the whole cone, what is below is no light",
        build=lit(light("DistantLight", rotate=DOWN, angle=360.0, intensity=1.0)),
        mean=scattered(math.pi),
    ),
    HardCase(
        "point-light-on-the-floor",
        trouble="1 / d^2 of a distance of 0",
        remedy="the falloff is bounded, and the cosine is 0 there (kernels/light/delta_light.py)",
        build=lit(
            light(
                "SphereLight", at=(0.3, 0, 0), radius=0.0, intensity=5.0, normalize=True, more="bool treatAsPoint = 1"
            ),
            light("DistantLight", "Sun", rotate=DOWN, angle=0.0, intensity=1.0, normalize=True),
        ),
        mean=scattered(1.0),
        learns=False,
    ),
]
