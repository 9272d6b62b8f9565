"""Hard cases of learning: stages whose radiance at one point of a floor is known, but hardly ever found."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from hard.case import HardCase
from usd.stages import stage_of

from warpmis.config import STRATEGIES

RHO = 0.5  # albedo of the floor
PIXELS = 8

# The camera's window is so narrow that every pixel sees the origin.
FLOOR = f"""(
    upAxis = "Y"
    renderSettingsPrimPath = "/Render/Settings"
)
def Mesh "Floor" {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)]
    color3f[] primvars:displayColor = [({RHO}, {RHO}, {RHO})]
}}
def Camera "Camera" {{
    float focalLength = 1
    float horizontalAperture = 0.0001
    float verticalAperture = 0.0001
    double3 xformOp:translate = (0, 1, 3)
    float xformOp:rotateX = {-math.degrees(math.atan2(1, 3))}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}}
def Scope "Render" {{
    def RenderSettings "Settings" {{
        uniform int2 resolution = ({PIXELS}, {PIXELS})
    }}
}}
"""


def lamp(center: tuple[float, float, float], radius: float, intensity: float) -> str:
    return f"""
def SphereLight "Lamp" {{
    float inputs:radius = {radius!r}
    float inputs:intensity = {intensity!r}
    double3 xformOp:translate = {center}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


def quad(name: str, points: str, look: str) -> str:
    return f"""
def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    uniform token subdivisionScheme = "none"
    uniform bool doubleSided = 1
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [{points}]
    {look}
}}
"""


BLACK = "color3f[] primvars:displayColor = [(0, 0, 0)]"
MIRROR = """
def Material "Silver" {
    token outputs:surface.connect = </Silver/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 1, 1)
        float inputs:metallic = 1
        float inputs:roughness = 0
        token outputs:surface
    }
}
"""


def lit_floor(radius: float = 0.4, intensity: float = 1.0) -> str:
    """A lamp in plain view of the floor at (0, 1, 0)."""
    return FLOOR + lamp((0, 1, 0), radius, intensity)


def radiance_below_lamp(radius: float = 0.4, intensity: float = 1.0) -> float:
    """Of the floor at the origin: E = pi L (r / d)^2 cos(theta), rho E / pi."""
    return RHO * intensity * radius**2


def caustic(share: float, radiance: float) -> str:
    """A lamp that the floor sees in a mirror alone; `share`, at most 0.01, of the BSDF's samples find it.

    The lamp at (1, 1, 0) is screened from the origin by a black plate; its image in the mirror at y = 1.5 is at
    (1, 2, 0): share = E / (pi L) = r^2 cos(theta) / d^2, with d^2 = 5 and cos(theta) = 2 / sqrt(5).
    """
    mirror = "(0.3, 1.5, -3), (3, 1.5, -3), (3, 1.5, 3), (0.3, 1.5, 3)"
    look = "rel material:binding = </Silver>"
    return shut_lamp(math.sqrt(share * 5.0 * math.sqrt(5.0) / 2.0), radiance) + MIRROR + quad("Mirror", mirror, look)


def shut_lamp(radius: float, radiance: float) -> str:
    """A lamp of which the plate lets no light come straight to the origin."""
    plate = "(0.66, 0.45, -0.3), (0.66, 0.45, 0.3), (0.45, 0.66, 0.3), (0.45, 0.66, -0.3)"
    return FLOOR + lamp((1, 1, 0), radius, radiance) + quad("Plate", plate, BLACK)


def mixed(share: float, radiance: float) -> str:
    """A lamp in plain view of the origin, beside a `caustic` of another: what is met first says nothing of the rest.

    Its image in the mirror's plane is beside the mirror: E / (pi L) = r^2 cos(theta) / d^2 with d^2 = 2.
    """
    return caustic(share, radiance).replace("Lamp", "Rare") + lamp((0, 1, -1), 0.3, 1.0)


def case(
    name: str,
    trouble: str,
    remedy: str,
    text: Callable[[], str],
    mean: float | None,
    learns: bool = True,
    **settings: Any,
) -> HardCase:
    grey = None if mean is None else (mean, mean, mean)
    return HardCase(name, trouble, remedy, lambda: stage_of(text()), grey, {"max_depth": 2, **settings}, learns)


def map_of(*shares: float) -> np.ndarray:
    """An allocation map that is right but for one pixel."""
    allocation = np.full((PIXELS, PIXELS, len(shares)), 1.0 / len(shares))
    allocation[2, 3] = shares
    return allocation


LEARNING_CASES = [
    case(
        "no-light-reaches-a-pixel",
        "all moments are 0, and Newton's step is 0 / 0",
        "the allocation stays (learn/newton_seed.py and the other solvers: nothing is known)",
        lambda: shut_lamp(0.2, 1.0),
        0.0,
    ),
    case(
        "one-sample-in-10000",
        "a solver that moves without evidence, or leaves the BSDF no share, never finds the light again",
        "no share below 0.1 (Murray et al. 2020, section 4; methods.py: min_share)",
        lambda: caustic(1e-4, 1e4),
        RHO,
        spp=16384,
    ),
    case(
        "light-density-0-where-light-is",
        "M2 = c / a has no minimum inside; Newton's step overshoots the simplex",
        "the step is clamped to 0.1 to 0.9 (Murray et al. 2020, section 4)",
        lambda: caustic(1e-2, 1e2),
        RHO,
        spp=4096,
    ),
    case(
        "equal-densities",
        "the Hessian is 0 but for rounding, and the step is noise over noise",
        "below 1e-12 of M2 the Hessian counts as 0: every allocation is as good (learn/newton_seed.py)",
        lit_floor,
        radiance_below_lamp(),
        learns=False,
        strategies=("bsdf", "cosine"),
        spp=4096,
    ),
    case(
        "one-round",
        "nothing is rendered after the last step",
        "the learn round's samples are the picture (rendering.py: result_of)",
        lit_floor,
        radiance_below_lamp(),
        learns=False,
        learn_rounds=1,
        learn_spp=1024,
        spp=1024,
    ),
    case(
        "thousand-rounds-of-one-sample",
        "each step is taken from one sample, whose own optimum is a corner; equidistant numbers carried on would "
        "tell of the shares: a bias",
        "the step is clamped, and each round's numbers start anew (kernels/lattice.py: choice)",
        lit_floor,
        radiance_below_lamp(),
        learns=False,
        learn_rounds=1000,
        learn_spp=1,
        spp=1000,
    ),
    case(
        "start-at-the-edge-of-the-simplex",
        "q_s = p_s / p_a is a million where the BSDF draws alone, its square in the Hessian a million million",
        "sums in float64, divided by M2 first (learn/newton_seed.py)",
        lit_floor,
        radiance_below_lamp(),
        learns=False,
        method="murray20",
        initial_allocation=(1e-6, 1.0 - 1e-6),
        spp=1024,
    ),
    case(
        "shares-on-the-bounds",
        "a share of 0 makes p_a vanish where its strategy alone draws",
        "shares of 0 are allowed only where another strategy reaches every direction (config.py); one that is 0 is "
        "never drawn (kernels/strategies.py: choose)",
        lit_floor,
        radiance_below_lamp(),
        learns=False,
        method="fixed",
        allocation=map_of(1.0, 0.0),
        spp=1024,
    ),
    case(
        "eight-strategies-six-useless",
        "with equal shares six samples of eight find nothing; five densities are equal, and the Hessian is singular",
        "a ridge of 1e-6 of the Hessian's trace, no share below 0.01 (learn/newton_seed.py)",
        lambda: lit_floor(0.1),
        radiance_below_lamp(0.1),
        strategies=STRATEGIES,
        spp=1024,
    ),
    case(
        "light-of-1e+18",
        "F^2 of float32 overflows from F = 1.8e19 on, its sums sooner: shares and variance are NaN",
        "moments are sums in float64 of squares in float64 (kernels/moments.py: squared)",
        lambda: lit_floor(intensity=1e18),
        radiance_below_lamp(intensity=1e18),
        spp=1024,
    ),
    case(
        "light-of-1e-30",
        "F^2 of float32 is 0 below F = 1e-23: a lit pixel looks unlit",
        "moments are sums in float64 of squares in float64 (kernels/moments.py: squared)",
        lambda: lit_floor(intensity=1e-30),
        radiance_below_lamp(intensity=1e-30),
        spp=1024,
    ),
    case(
        "a-rare-light-beside-a-common-one",
        "all that is met at first speaks for the lights, and the rare light has a tenth of the samples",
        "no share below 0.1: the loss is bounded by 0.5 / 0.1 (methods.py: min_share)",
        lambda: mixed(1e-4, 1e3),
        RHO * (0.1 + 0.3**2 / 2.0**1.5),
        spp=65536,
    ),
]

# Maps that no render takes: each ends in one line.
REFUSED_MAPS = {
    "map-with-zeros": (map_of(0.0, 0.0), "sum to 1"),
    "map-without-bsdf": (map_of(0.0, 1.0), "no indirect light"),
    "map-with-nan": (map_of(float("nan"), 1.0), "finite"),
    "map-with-infinity": (map_of(float("inf"), 0.0), "finite"),
    "map-with-a-negative-share": (map_of(-0.5, 1.5), "not negative"),
    "map-that-sums-to-2": (map_of(1.0, 1.0), "sum to 1"),
}
