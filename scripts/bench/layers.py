"""What surfaces reflect in all, under a white sky, beside Mitsuba's and a random walk over microfacets.

    python scripts/bench/layers.py

Prints the table of docs/theory.md. The walk follows light from facet to facet until it leaves, with the heights and
slopes of Smith's model: no approximation of multiple scattering. Needs the extra `peer`.

Reference: Heitz et al. (2016), "Multiple-Scattering Microfacet BSDFs with the Smith Model".
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.scene import DomeLight, Material

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from scenes import camera, quads, scene

mi.set_variant("scalar_rgb")

ROUGHNESSES = (0.3, 0.6, 1.0)
COSINES = (0.9, 0.2)
WALKS = 200_000
MITSUBA_SAMPLES = 4000
Vectors = NDArray[np.float64]


def smith_lambda(cosines: Vectors, alpha: float) -> Vectors:
    """Smith's Lambda, of directions below the horizon too."""
    tan2 = (1.0 - cosines**2) / np.maximum(cosines**2, 1e-12)
    return 0.5 * (np.sign(cosines) * np.sqrt(1.0 + alpha**2 * tan2) - 1.0)


def visible_normals(w: Vectors, alpha: float, rng: np.random.Generator) -> Vectors:
    """Normals by the area that they show to w, which may lie below the horizon (Dupuy and Benyoub 2023)."""
    stretched = w * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched, axis=1)[:, None]
    phi, v = 2.0 * np.pi * rng.random(len(w)), rng.random(len(w))
    z = (1.0 - v) * (1.0 + stretched[:, 2]) - stretched[:, 2]
    sine = np.sqrt(np.clip(1.0 - z**2, 0.0, 1.0))
    h = (np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1) + stretched) * [alpha, alpha, 1.0]
    normals: Vectors = h / np.linalg.norm(h, axis=1)[:, None]
    return normals


def walked(f0: float, roughness: float, cos_o: float) -> float:
    """Share of the light that leaves a metal of microfacets again, of heights uniform in [-1, 1]."""
    alpha, rng = roughness**2, np.random.default_rng(0)
    w = np.tile([-np.sqrt(1.0 - cos_o**2), 0.0, -cos_o], (WALKS, 1))
    below = np.ones(WALKS)  # share of the heights that lie below the ray
    weight, total = np.ones(WALKS), 0.0
    for _bounce in range(100):
        slope = smith_lambda(w[:, 2], alpha)
        u = 1.0 - rng.random(len(w))
        leaves = (w[:, 2] > 0.0) & (u < below ** np.maximum(slope, 0.0))
        total += float(weight[leaves].sum())
        w, below, weight = w[~leaves], below[~leaves], weight[~leaves]
        below = np.clip(below / u[~leaves] ** (1.0 / slope[~leaves]), 1e-12, 1.0)
        if len(w) == 0:
            break
        h = visible_normals(-w, alpha, rng)
        cosine = -(w * h).sum(axis=1)
        weight = weight * (f0 + (1.0 - f0) * (1.0 - cosine) ** 5)
        w = w + 2.0 * cosine[:, None] * h
    return total / WALKS


def rendered(material: Material, cos_o: float) -> float:
    floor = np.array([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)], dtype=np.float32)
    view = camera((0.0, cos_o, float(np.sqrt(1.0 - cos_o**2))), (0.0, 0.0, 0.0), half_width=1e-3)
    sky = DomeLight("/sky", np.eye(3), np.ones(3))
    stage = scene(quads([(floor, 0)]), [material], [sky], view, pixels=16)
    return float(warpmis.render(stage, spp=1024, method="nee", max_depth=1).image.mean())


def mitsuba(cos_o: float, **bsdf: Any) -> float:
    """Mean weight of Mitsuba's own samples."""
    built = mi.load_dict(bsdf)
    rng = np.random.default_rng(1)
    at = mi.SurfaceInteraction3f()
    at.wi, at.n, at.sh_frame = [float(np.sqrt(1.0 - cos_o**2)), 0.0, cos_o], [0.0, 0.0, 1.0], mi.Frame3f([0, 0, 1])
    weights = [
        np.array(built.sample(mi.BSDFContext(), at, float(u[0]), u[1:].tolist())[1]).mean()
        for u in rng.random((MITSUBA_SAMPLES, 3))
    ]
    return float(np.mean(weights))


def metal_row(f0: float, roughness: float, cos_o: float) -> list[float]:
    look = Material(path="/metal", diffuse_color=(f0,) * 3, metallic=1.0, roughness=roughness)
    principled = mitsuba(
        cos_o, type="principled", base_color={"type": "rgb", "value": f0}, metallic=1.0, roughness=roughness
    )
    return [rendered(look, cos_o), walked(f0, roughness, cos_o), principled]


def plastic_row(color: float, roughness: float, cos_o: float) -> list[float]:
    look = Material(path="/plastic", diffuse_color=(color,) * 3, roughness=roughness)
    rough = mitsuba(
        cos_o, type="roughplastic", distribution="ggx", int_ior=1.5, ext_ior=1.0, alpha=roughness**2,
        diffuse_reflectance={"type": "rgb", "value": color},
    )  # fmt: skip
    principled = mitsuba(cos_o, type="principled", base_color={"type": "rgb", "value": color}, roughness=roughness)
    return [rendered(look, cos_o), rough, principled]


def main() -> None:
    print("| metal: F0, roughness, cosine | warpmis | random walk | principled |\n|---|---|---|---|")
    for f0 in (1.0, 0.5):
        for roughness in ROUGHNESSES:
            for cos_o in COSINES:
                row = " | ".join(f"{value:.3f}" for value in metal_row(f0, roughness, cos_o))
                print(f"| {f0:g}, {roughness:g}, {cos_o:g} | {row} |", flush=True)
    print("\n| plastic: color, roughness, cosine | warpmis | roughplastic | principled |\n|---|---|---|---|")
    for color in (1.0, 0.5):
        for roughness in ROUGHNESSES:
            for cos_o in COSINES:
                row = " | ".join(f"{value:.3f}" for value in plastic_row(color, roughness, cos_o))
                print(f"| {color:g}, {roughness:g}, {cos_o:g} | {row} |", flush=True)


if __name__ == "__main__":
    main()
