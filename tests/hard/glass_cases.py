"""Hard glass: indices from 1 to 10, nearly smooth, faces that coincide, a camera within, total reflection."""

from __future__ import annotations

from typing import Any

from hard.case import HardCase
from hard.parts import SKY, bound, box, camera, grey, light, number, stage

DEEP = {"max_depth": 64, "spp": 64}


def glass(**inputs: Any) -> str:
    """A standard_surface that only transmits; thin_walled is a flag, the others numbers."""
    values = {"transmission": 1.0, "specular_roughness": 0.0, "base": 0.0} | inputs
    lines = [
        f"bool inputs:{key} = 1" if value is True else f"float inputs:{key} = {number(value)}"
        for key, value in values.items()
    ]
    body = "\n        ".join(lines)
    return f"""
def Material "Look" {{
    token outputs:mtlx:surface.connect = </Look/Surface.outputs:out>
    def Shader "Surface" {{
        uniform token info:id = "ND_standard_surface_surfaceshader"
        {body}
        token outputs:out
    }}
}}
"""


FRONT = camera((0.1, 0.2, 3.0), 0.0, 0.05)

GLASS_CASES = [
    *(
        HardCase(
            f"glass-of-ior-{ior:g}",
            trouble="at an index of 1 Fresnel's terms are 0 / 0 at grazing angles, and near 1 they cancel",
            remedy="differences over sums that are bounded from below; nothing is divided by eta - 1",
            build=lambda ior=ior: stage(box(0.7, color=None, more=bound()), glass(specular_IOR=ior), FRONT, SKY),
            mean=grey(1.0),
            settings=DEEP,
            learns=False,
        )
        for ior in (1.0, 1.0001, 1.5, 10.0)
    ),
    HardCase(
        "glass-of-roughness-1e-4",
        trouble="the density of a lobe narrower than float32's half vectors is noise",
        remedy="below alpha 1e-3 smooth, and no density is asked for (kernels/bsdf/dielectric.py)",
        build=lambda: stage(box(0.7, color=None, more=bound()), glass(specular_roughness=1e-4), FRONT, SKY),
        mean=grey(1.0),
        settings=DEEP,
        learns=False,
    ),
    HardCase(
        "glass-faces-that-coincide",
        trouble="a ray that leaves one face starts on the other, or misses it",
        remedy="rays start off the surface by the triangle's own rounding (kernels/hit.py: OFFSET)",
        build=lambda: stage(box(0.7, color=None, more=bound()), box(0.7, "Same", None, bound()), glass(), FRONT, SKY),
        mean=grey(1.0),
        settings=DEEP,
        learns=False,
    ),
    HardCase(
        "camera-within-glass",
        trouble="what the ray is within is not known before its first face",
        remedy="a back face tells it: radiance within is n^2 that outside (Veach 1997, section 5.2)",
        build=lambda: stage(box(0.7, color=None, more=bound()), glass(), camera((0.1, 0.2, 0.3), 0.0, 0.05), SKY),
        mean=grey(2.25),
        settings=DEEP,
        learns=False,
    ),
    HardCase(
        "lamp-in-a-closed-glass-box",
        trouble="beyond the critical angle all is reflected, again and again",
        remedy="Fresnel's term is 1 there, and the path ends at the bounces that it may have",
        build=lambda: stage(
            box(0.7, color=None, more=bound()),
            glass(specular_IOR=2.4),
            FRONT,
            light("SphereLight", at=(0.0, 0.0, 0.0), radius=0.3, intensity=5.0),
        ),
        settings=DEEP,
        learns=False,
    ),
    HardCase(
        "panes-in-a-row",
        trouble="a shadow ray through many panes",
        remedy="each lets its share through, up to 64 (kernels/shadow.py: MAX_TRANSPARENT)",
        build=lambda: stage(
            *(box(0.1 * k, f"Pane{k}", None, bound()) for k in range(1, 12)), glass(thin_walled=True), FRONT, SKY
        ),
        mean=grey(1.0),
        settings=DEEP,
        learns=False,
    ),
]
