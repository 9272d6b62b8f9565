"""Points in scenes that call for all strategies, and a kernel that draws from one and asks for all their densities.

A direction counts as drawn where the path would go on with it: above the horizon.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from statistical.lights import RECEIVER, TURN, WHITE, distant, dome, make_scene, rect, sphere, starry_picture

from warpmis.config import STRATEGIES
from warpmis.device.upload import DeviceScene, upload
from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.surface import make_surface
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.table import make_lights
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.path.vertex import response_of
from warpmis.kernels.shading_frame import frame_from_normal, to_local
from warpmis.kernels.strategies import make_strategies
from warpmis.scene import Material, Scene
from warpmis.scene.features import Features

EVERY = Features.all(STRATEGIES)
surface = make_surface(EVERY)
lights = make_lights(EVERY)
strategies = make_strategies(EVERY, surface, lights)
vec_s = strategies.vec_s

MIXTURE = -1  # in place of a strategy: one chosen by the allocation
LOOK = -2  # evaluate the directions given


@wp.struct
class Drawn:
    """densities: of every strategy, of the direction that `strategy` drew; q: what the path has before they are known;
    pdf_bsdf: the BSDF's own density."""

    strategy: int
    densities: vec_s
    q: vec_s
    pdf_bsdf: float


@wp.kernel(module="unique", enable_backward=False)
def draw(
    scene: SceneView,
    x: wp.vec3,
    n: wp.vec3,
    material: int,
    wo: wp.vec3,
    strategy: int,
    allocation: vec_s,
    seed: int,
    wis: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=Drawn),
):
    i = wp.tid()
    key = rng.RngKey()
    key.seed = wp.uint32(seed)
    key.sample = wp.uint32(i)
    vertex = Vertex()
    vertex.u_light = rng.uniform4_of_step(key, 0, rng.LIGHT)
    vertex.u_bsdf = rng.uniform4_of_step(key, 0, rng.SCATTER)
    d = Drawn()
    d.strategy = strategy
    if strategy == MIXTURE:
        # As the path does it: the number that chose the strategy, remapped, chooses the light and the lobe.
        u_strategy = rng.uniform4(key, rng.CAMERA)[2]
        d.strategy = strategies.choose(allocation, u_strategy)
        d.q = strategies.one_strategy_ratios(allocation, d.strategy)
        vertex.u_light[0] = strategies.remapped(allocation, d.strategy, u_strategy)
        vertex.u_bsdf[0] = vertex.u_light[0]
    vertex.frame = frame_from_normal(n)
    vertex.surface = surface.prepare(scene, scene.materials[2 * material], wo)
    response = response_of(vertex.surface, vertex.frame)
    r = lights.receiver(scene, x, n, 0, vertex.u_light[0], vertex.u_light[1], response)
    if strategy != LOOK:
        wis[i] = strategies.sample(scene, r, vertex, d.strategy).wi
    wi = wis[i]
    local = to_local(vertex.frame, wi)
    if local[2] > 0.0:
        # As the path does it: the vertex first, then what the ray meets, hidden lights included.
        scattering = surface.evaluate(vertex.surface, local)
        p = strategies.vertex_densities(vertex.surface, local[2], scattering)
        ray = lights.gather(scene, r, wi, 0.0, INFINITE_DISTANCE, scattering.pdf_solid_angle, True)
        finite = ray.finite + lights.pdf_emitter_triangles(scene, r, wi)
        d.densities = strategies.completed(p, r, finite, ray.infinite)
        d.pdf_bsdf = scattering.pdf_solid_angle
    out[i] = d


MATERIALS = {
    "diffuse": Material("/diffuse", diffuse_color=(0.8, 0.6, 0.4), lambertian=True),
    "coated": Material(
        "/coated", diffuse_color=(0.3, 0.2, 0.1), roughness=0.5, ior=2.0, clearcoat=1.0, clearcoat_roughness=0.3
    ),
    "gold": Material("/gold", diffuse_color=(1.0, 0.78, 0.34), metallic=1.0, roughness=0.4),
    "plastic": Material("/plastic", diffuse_color=(0.2, 0.2, 0.3), roughness=0.4, ior=1.8),
}


def sails() -> Scene:
    """Two mesh lights above the receiver: a quad of two sides, and behind the rect a triangle of one."""
    quad = [[-0.9, 0.4, 2.0], [-0.2, 0.4, 2.2], [-0.2, 1.2, 2.0], [-0.9, 1.2, 1.8]]
    local = np.array([*quad, [-0.3, -0.4, 2.5], [0.6, 0.9, 2.6], [0.9, -0.3, 2.4]])
    triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    return make_scene(points=RECEIVER + local @ TURN.T, triangles=triangles, prims=[0, 0, 1], double=(True, False))


def shining(finite: bool, infinite: bool) -> Scene:
    """Lights of five kinds: rect, sphere and two mesh lights all above the receiver, a distant light and a dome."""
    scene = sails() if finite else make_scene()
    near = (rect((0.2, 0.1, 1.5), (0.5, 0, 0), (0, 0.5, 0)), sphere((0.8, 1.2, 2.0), 0.8))
    far = (distant(12.0), dome(starry_picture()))
    found = near * finite + far * infinite
    found = tuple(replace(light, radiance=WHITE * (k + 1)) for k, light in enumerate(found))
    return replace(scene, lights=found, materials=(*scene.materials, *MATERIALS.values()))


@dataclass(frozen=True)
class Point:
    """Where to scatter: lights at a distance and at infinity or not, a material, a normal that faces them or turns
    away, and the cosine of the direction to the viewer. falls_back: strategies with nothing to sample here."""

    finite: bool
    infinite: bool
    material: str
    faces: bool
    cos_theta: float
    falls_back: tuple[str, ...] = ()


POINTS = {
    "everything": Point(True, True, "coated", True, 0.7),
    "turned away": Point(True, True, "gold", False, 0.4, ("area", "diffuse")),
    "lights at a distance": Point(True, False, "diffuse", True, 0.9, ("dome", "specular")),
    "turned away from all": Point(True, False, "plastic", False, 0.3, ("light", "area", "dome")),
    "lights at infinity": Point(False, True, "plastic", True, 0.2, ("area",)),
    "no light": Point(False, False, "coated", True, 0.5, ("light", "area", "dome")),
}


@cache
def device_scene(finite: bool, infinite: bool) -> DeviceScene:
    return upload(shining(finite, infinite), "cpu")


def outgoing(point: Point) -> NDArray[np.float64]:
    """Towards the viewer, in the point's own frame."""
    sin_theta = np.sqrt(1.0 - point.cos_theta**2)
    return np.array([0.8 * sin_theta, -0.6 * sin_theta, point.cos_theta])


def normal_of(point: Point) -> NDArray[np.float64]:
    """Turned away: no bounding sphere of a light reaches above the horizon."""
    return TURN[:, 2] if point.faces else TURN @ np.array([0.48, -0.36, -0.8])


def run(
    point: Point,
    strategy: int,
    wi: NDArray[np.float32] | int,
    allocation: NDArray[np.float64] | None = None,
    seed: int = 1,
) -> tuple[NDArray[np.float32], NDArray[Any]]:
    """Launch `draw`; wi is the number of directions to draw, or the directions to look along."""
    shares = vec_s(*(np.zeros(len(STRATEGIES)) if allocation is None else allocation).tolist())
    directions = wp.zeros(wi, dtype=wp.vec3) if isinstance(wi, int) else wp.array(wi, dtype=wp.vec3)
    out = wp.zeros(len(directions), dtype=Drawn)
    scene = device_scene(point.finite, point.infinite)
    first = len(shining(point.finite, point.infinite).materials) - len(MATERIALS)
    material = first + list(MATERIALS).index(point.material)
    x, n, wo = (wp.vec3(*a.tolist()) for a in (RECEIVER, normal_of(point), outgoing(point)))
    wp.launch(draw, len(directions), [scene.view, x, n, material, wo, strategy, shares, seed, directions, out])
    return directions.numpy(), out.numpy()
