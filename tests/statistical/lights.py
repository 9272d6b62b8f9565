"""Lights for tests of samplers, described about one receiver, and a kernel that asks the device of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.upload import DeviceScene
from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.light.choice import light_importance
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.records import Response
from warpmis.kernels.light.table import make_lights
from warpmis.scene import (
    Camera,
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    Geometry,
    Light,
    Material,
    Prim,
    RectLight,
    Scene,
    SphereLight,
)
from warpmis.scene.features import Features

COUNT = 340_000
PILOT = 1 << 15

# A rotation about no particular axis, so that nothing is right by being aligned.
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
RECEIVER = np.array([0.3, -0.2, 0.1])
NONE = np.zeros((0, 3))

lights = make_lights(Features.all(("bsdf", "light")))

SAMPLE = 0  # draw from all lights
SAMPLE_FIRST = 1  # draw from the first light, whatever its importance
LOOK = 2  # evaluate the directions given


@wp.struct
class Probe:
    """What the device says of one direction: by the sampler that drew it, and of the direction by itself; choice and
    importance: those of the first light."""

    sampled_pdf: float
    sampled_distance: float
    sampled_luminance: float
    pdf: float
    radiance: float
    hits: int
    hit_distance: float
    choice: float
    importance: float


@wp.func
def some_response(n: wp.vec3, k: int) -> Response:
    """That of a matte receiver for even k; for others with lobes of any width, seen from anywhere above the surface.
    Every second of these has no coat, and is seen from right above."""
    response = Response()
    if k % 2 == 1:
        key = rng.RngKey()
        key.sample = wp.uint32(k)
        u = rng.uniform4(key, 0)
        v = rng.uniform4(key, 1)
        response.wo = wp.normalize(n + 0.99 * wp.normalize(wp.vec3(u[0] - 0.5, u[1] - 0.5, u[2] - 0.5)))
        response.matte = 0.1 * u[3]
        response.gloss = 0.7
        response.alpha2 = wp.pow(10.0, -6.0 * v[0])
        response.coat = 0.2
        response.coat_alpha2 = wp.pow(10.0, -6.0 * v[1])
        if k % 4 == 3:
            response.wo = n
            response.coat = 0.0
            response.coat_alpha2 = 0.0
    return response


@wp.kernel(module="unique", enable_backward=False)
def probe(
    scene: SceneView,
    xs: wp.array(dtype=wp.vec3),
    ns: wp.array(dtype=wp.vec3),
    mode: int,
    seed: int,
    near: float,
    far: float,
    wi: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=Probe),
):
    i = wp.tid()
    key = rng.RngKey()
    key.seed = wp.uint32(seed)
    key.sample = wp.uint32(i)
    u = rng.uniform4(key, 0)
    r = lights.receiver(scene, xs[i % xs.shape[0]], ns[i % ns.shape[0]], 0, u[0], u[1], Response())
    p = Probe()
    if mode != LOOK:
        s = lights.sample(scene, r, u)
        if mode == SAMPLE_FIRST:
            s = lights.sample_light(scene, scene.lights[0], -1, -1, r.x, r.n, u)
        wi[i] = s.wi
        p.sampled_pdf = s.pdf_solid_angle
        p.sampled_distance = s.distance
        p.sampled_luminance = s.radiance[1]
    ray = lights.gather(scene, r, wi[i], near, far, 0.0, True)
    finite = ray.finite + lights.pdf_emitter_triangles(scene, r, wi[i])
    p.pdf = lights.density(finite + ray.infinite, r.total)
    p.radiance = ray.radiance[1]
    p.hits = ray.hits
    p.hit_distance = lights.hit(scene.lights[0], r.x, wi[i]).distance
    p.choice = lights.density(lights.importance_of(scene, r, 0), r.total)
    p.importance = light_importance(scene.lights[0], r.x, r.n)
    out[i] = p


def make_scene(
    *found: Light, points: NDArray[Any] = NONE, triangles: Any = (), prims: Any = (), double: tuple[bool, ...] = ()
) -> Scene:
    """Lights, and emissive triangles of a material each: prim k shines like (k + 1)."""
    faces = np.array(triangles, dtype=np.int32).reshape(-1, 3)
    prim = np.array(prims, dtype=np.int32)
    geometry = Geometry(
        points=np.asarray(points, np.float32),
        triangles=faces,
        normals=np.zeros((0, 3), np.float32),
        normal_indices=np.full((len(faces), 3), -1, np.int32),
        materials=prim,
        prims=prim,
    )
    x, y, z = np.eye(3)
    return Scene(
        name="lights",
        camera=Camera("/camera", np.zeros(3), x, y, -z, (-1.0, 1.0, -1.0, 1.0)),
        resolution=(1, 1),
        geometry=geometry,
        materials=tuple(Material(f"/m{k}", emissive_color=(k + 1.0,) * 3) for k in range(len(double))),
        prims=tuple(Prim(f"/p{k}", sided) for k, sided in enumerate(double)),
        lights=found,
    )


def turned(light: Light) -> Light:
    """A light described about the receiver and with +Z as the axis, brought to where the tests have the receiver."""
    moved: dict[str, Any] = {}
    for name in ("half_u", "half_v", "half_axis", "direction"):
        if hasattr(light, name):
            moved[name] = TURN @ getattr(light, name)
    if hasattr(light, "center"):
        moved["center"] = RECEIVER + TURN @ light.center
    return replace(light, **moved)


WHITE = np.ones(3)


def rect(center: Any, half_u: Any, half_v: Any) -> Light:
    return turned(RectLight("/rect", np.array(center, float), np.array(half_u, float), np.array(half_v, float), WHITE))


def disk(center: Any, half_u: Any, half_v: Any) -> Light:
    return turned(DiskLight("/disk", np.array(center, float), np.array(half_u, float), np.array(half_v, float), WHITE))


def sphere(center: Any, radius: float) -> Light:
    return turned(SphereLight("/sphere", np.array(center, float), radius, WHITE))


def cylinder(center: Any, half_axis: Any, radius: float) -> Light:
    return turned(CylinderLight("/cylinder", np.array(center, float), np.array(half_axis, float), radius, WHITE))


def distant(degrees: float) -> Light:
    return turned(DistantLight("/sun", np.array([0.0, 0.0, 1.0]), np.radians(degrees), WHITE))


def dome(picture: NDArray[np.float32] | None = None) -> DomeLight:
    return DomeLight("/dome", TURN, np.array([0.5, 1.0, 2.0]), picture)


def starry_picture() -> NDArray[np.float32]:
    """8 x 16 texels: an upper half of some texture with one very bright texel, a black lower half."""
    picture = np.random.default_rng(1).uniform(0.2, 1.0, (8, 16, 3)).astype(np.float32)
    picture[4:] = 0.0
    picture[2, 5] = 100.0
    return picture


def patch(*double: bool) -> Scene:
    """Unequal triangles of either winding before the receiver, one on a line with others, divided among the prims."""
    local = np.array(
        [
            *([-1, -1, 2], [1, -1, 2], [1, 1, 2.5], [-1, 1, 2], [0.2, 1.5, 1], [2.5, 0.3, 1]),
            *([0, 0, 3], [1, 0, 3.3], [0, 2, 3.5], [-3, 0.5, -1], [-2.5, -0.5, 0.4], [-2.9, 1, 0.5]),
        ]
    )
    triangles = [[0, 2, 1], [0, 3, 2], [4, 2, 5], [6, 7, 8], [9, 10, 11], [6, 8, 7]]
    prims = np.arange(6) % len(double)
    return make_scene(points=RECEIVER + local @ TURN.T, triangles=triangles, prims=prims, double=double)


def everything(environment: DomeLight) -> Scene:
    """Lights of all kinds, a sphere and a mesh behind a rect among them."""
    scene = patch(True, False)
    found = (
        rect((0.2, 0.1, 1.5), (0.5, 0, 0), (0, 0.5, 0)),
        sphere((0.5, 0.2, 4.0), 0.8),
        disk((-1.5, 0.3, 0.8), (0.2, 0.5, 0), (0.5, 0, 0.5)),
        rect((1.5, 1.0, 0.8), (0.5, 0, 0.2), (0.4, 0.5, 0)),
        cylinder((-1.0, 2.0, 1.0), (0.5, 1.0, 0.0), 0.3),
        distant(12.0),
        environment,
    )
    return replace(scene, lights=tuple(replace(light, radiance=WHITE * (k + 1)) for k, light in enumerate(found)))


def run(
    scene: DeviceScene,
    mode: int,
    xs: NDArray[Any],
    ns: NDArray[Any],
    wi: NDArray[np.float32] | int,
    *,
    seed: int = 1,
    near: float = 0.0,
    far: float = INFINITE_DISTANCE,
) -> tuple[NDArray[np.float32], NDArray[Any]]:
    """Launch `probe`; wi is the number of directions to draw, or the directions to look along."""
    directions = wp.zeros(wi, dtype=wp.vec3) if isinstance(wi, int) else wp.array(wi, dtype=wp.vec3)
    out = wp.zeros(len(directions), dtype=Probe)
    points, normals = (wp.array(np.atleast_2d(a).astype(np.float32), dtype=wp.vec3) for a in (xs, ns))
    wp.launch(probe, len(directions), [scene.view, points, normals, mode, seed, near, far, directions, out])
    return directions.numpy(), out.numpy()
