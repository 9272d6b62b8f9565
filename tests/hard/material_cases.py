"""Hard materials: from mirror to matt, seen at grazing angles, black, white, coated, and not there at all."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from hard.case import HardCase
from hard.parts import RHO, SKY, bound, box, camera, floor, grey, light, material, mesh, stage

import warpmis
from warpmis.scene import Scene

ROUGHNESSES = (0.0, 1e-4, 1e-2, 0.04, 0.3, 1.0)
# The floor's centre seen at an angle of 1 / 200 to the plane, through a window that spans little of it.
GRAZING_SLOPE = 0.005
GRAZING = camera((0, GRAZING_SLOPE, 1.0), -math.degrees(math.atan(GRAZING_SLOPE)), 1e-6)


def card(view: str, look: str, *parts: str, color: float | None = None) -> Callable[[], Any]:
    """The floor with a material, under a sky of 1."""
    return lambda: stage(floor(color=color, more=bound()), look, view, SKY, *parts)


def metal_case(roughness: float, grazing: bool) -> HardCase:
    """A white metal in a white world is invisible, however rough: what masking loses is brought back."""
    smooth = roughness**2 < 1e-3
    seen = GRAZING if grazing else camera()
    return HardCase(
        f"white-metal-of-roughness-{roughness:g}{'-grazing' if grazing else ''}",
        trouble=(
            "D(h) of a lobe narrower than float32's half vectors is noise"
            if smooth
            else "D(h) written with cos^2 loses its digits about the normal, and D / (4 cos) those at the horizon"
        ),
        remedy=(
            "below alpha 1e-3 a mirror, followed without a density (scene/material.py: SMOOTH_ALPHA; pbrt-v4)"
            if smooth
            else "D by slopes, visible normals (Heitz 2018), no density where there is no sample"
        ),
        build=card(seen, material(diffuseColor=1.0, metallic=1.0, roughness=roughness)),
        mean=grey(1.0),
        settings={"max_depth": 1, "spp": 256},
    )


def bright_box(depth: int) -> Callable[[], Scene]:
    """Inside a closed box that emits 1 and reflects all: L = depth + 1. A Scene, for a material has a specular lobe."""

    def build() -> Scene:
        look = material(diffuseColor=1.0, emissiveColor=1.0)
        inside = camera((0.1, 0.2, 0.3), -10.0, 0.3)
        scene = warpmis.load_stage(
            stage(box(1.0, color=None, more="uniform bool doubleSided = 1\n" + bound()), look, inside)
        )
        white = tuple(dataclasses.replace(one, lambertian=True) for one in scene.materials)
        return dataclasses.replace(scene, materials=white)

    return build


LAYERS = "the layers add up to more than falls on them"
LEFT_OVER = "what lies below a lobe gets what that lobe does not reflect in all (kernels/bsdf/albedo.py)"

MATERIAL_CASES = [
    *(metal_case(roughness, grazing) for grazing in (False, True) for roughness in ROUGHNESSES),
    HardCase(
        "black",
        trouble="albedo 0: the choice of a lobe divides 0 by 0",
        remedy="a surface without any lobe scatters nothing (kernels/bsdf/surface.py: prepare)",
        build=lambda: stage(floor(color=0.0), camera(), SKY),
        mean=grey(0.0),
        learns=False,
    ),
    HardCase(
        "black-metal",
        trouble="the lobe is there with a reflectance of 0 at normal incidence",
        remedy="F90 goes to 0 with F0: nothing is left (Lagarde and de Rousiers 2014)",
        build=card(camera(), material(diffuseColor=0.0, metallic=1.0, roughness=0.3)),
        mean=grey(0.0),
        settings={"max_depth": 1},
    ),
    HardCase(
        "white-box-32-bounces",
        trouble="paths that never lose energy never end, or the roulette's weights grow",
        remedy="survival of at most 0.95, its inverse as weight (Arvo and Kirk 1990); a bounded number of bounces",
        build=bright_box(32),
        mean=grey(33.0),
        settings={"max_depth": 32, "spp": 32},
    ),
    HardCase(
        "white-matt-floor-under-a-white-sky",
        trouble="none",
        remedy="the case to compare the others with",
        build=lambda: stage(floor(color=1.0), camera(), SKY),
        mean=grey(1.0),
        settings={"max_depth": 1},
    ),
    *(
        HardCase(
            f"clearcoat-over-{name}",
            trouble=LAYERS,
            remedy=LEFT_OVER,
            build=card(camera(), material(diffuseColor=1.0, clearcoat=1.0, clearcoatRoughness=0.4, **below)),
            settings={"max_depth": 1},
        )
        for name, below in {
            "matt": {"metallic": 0.0, "roughness": 1.0},
            "metal": {"metallic": 1.0, "roughness": 0.3},
            "mirror": {"metallic": 1.0, "roughness": 0.0},
        }.items()
    ),
    HardCase(
        "smooth-coat-over-mirror",
        trouble=LAYERS,
        remedy="either mirror is chosen by its albedo; they add up to 1 (kernels/bsdf/events.py)",
        build=card(
            camera(),
            material(diffuseColor=1.0, metallic=1.0, roughness=0.0, clearcoat=1.0, clearcoatRoughness=0.0),
        ),
        settings={"max_depth": 1},
    ),
    *(
        HardCase(
            f"ior-{ior:g}",
            trouble="reflectance ((1 - ior) / (1 + ior))^2 of 0, or near 1",
            remedy="Schlick's term stays within [F0, 1]; no lobe is left out at ior 1 (Schlick 1994)",
            build=card(camera(), material(diffuseColor=1.0, roughness=0.5, ior=ior)),
            settings={"max_depth": 1},
        )
        for ior in (1.0, 10.0)
    ),
    HardCase(
        "opacity-0-everywhere",
        trouble="a division by the opacity; a path that spends its bounces on what is not there",
        remedy="passing is an event of weight 1 and no bounce (kernels/bsdf/events.py)",
        build=lambda: stage(
            box(0.7, color=None, more=bound()),
            *(floor(0.5, 0.1 * k, f"Layer{k}", None, bound()) for k in range(1, 4)),
            floor(0.5, -0.5, "Black", 0.0),
            material(diffuseColor=RHO, opacity=0.0, opacityMode="presence"),
            camera((0, 2.0, 2.0), -15.0, 0.05),
            light("DomeLight", "Sky", intensity=3.0),
        ),
        mean=grey(3.0),
        learns=False,
    ),
    HardCase(
        "seen-through-70-layers-of-opacity-0",
        trouble="a path through endless layers never ends",
        remedy="refused beyond 64 layers: black behind them (kernels/shadow.py: MAX_TRANSPARENT)",
        build=lambda: stage(
            mesh(
                "Layers",
                [(x, 0.01 * k, z) for k in range(70) for x, z in ((-1, 1), (1, 1), (1, -1), (-1, -1))],
                [tuple(range(4 * k, 4 * k + 4)) for k in range(70)],
                None,
                bound(),
            ),
            material(diffuseColor=RHO, opacity=0.0, opacityMode="presence"),
            camera((0, 2.0, 0.01), -90.0, 0.05),
            SKY,
        ),
        mean=grey(0.0),
        settings={"max_depth": 1},
        learns=False,
    ),
]
