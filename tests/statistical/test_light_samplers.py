"""Every light's sampler against the density that a ray's direction is given: the same light asked in two ways.

`lights.sample` draws directions; their density is taken from `gather` and `pdf_emitter_triangles`, which know nothing
of how a direction was drawn. What the sampler says of its own density, distance and radiance is compared as well.

Significance is Sidak-corrected over the file; each chi-square test has the power to find a density that is wrong by
2 % over half of its probability, one way or the other (asserted).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from stats import DirectionGrid, Grid, detectable_imbalance, fit_directions, sidak

from warpmis.device.upload import DeviceScene, upload
from warpmis.device.views import SceneView
from warpmis.features import Features, detect
from warpmis.kernels import rng
from warpmis.kernels.light.distant import INFINITE_DISTANCE
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

COUNT = 1 << 19
PILOT = 1 << 15
SIGNIFICANCE = sidak(0.01, 40)
DETECTABLE = 0.02

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
    """What the device says of one direction: by the sampler that drew it, and of the direction by itself."""

    sampled_pdf: float
    sampled_distance: float
    sampled_luminance: float
    pdf: float
    radiance: float
    hits: int
    hit_distance: float
    choice: float


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
    r = lights.receiver(scene, xs[i % xs.shape[0]], ns[i % ns.shape[0]])
    p = Probe()
    if mode != LOOK:
        key = rng.RngKey()
        key.seed = wp.uint32(seed)
        key.sample = wp.uint32(i)
        u = rng.uniform4(key, 0)
        s = lights.sample(scene, r, u)
        if mode == SAMPLE_FIRST:
            s = lights.sample_light(scene, scene.lights[0], r, u)
        wi[i] = s.wi
        p.sampled_pdf = s.pdf_solid_angle
        p.sampled_distance = s.distance
        p.sampled_luminance = s.radiance[1]
    ray = lights.gather(scene, r, wi[i], near, far, 0.0)
    p.pdf = ray.pdf_solid_angle + lights.pdf_emitter_triangles(scene, r, wi[i])
    p.radiance = ray.radiance[1]
    p.hits = ray.hits
    p.hit_distance = lights.hit(scene.lights[0], r.x, wi[i]).distance
    p.choice = lights.choice_probability(scene, scene.lights[0], r)
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


@dataclass(frozen=True)
class Case:
    """A scene with one light, except where `overlaps` says that a line may meet light more than once.

    yields: share of the samples that have a direction (an emitter's back has none), where it is known.
    """

    scene: Callable[[], Scene]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    yields: float = 1.0
    overlaps: bool = False
    # Of the emitted directions, those that rounding leaves beside the light when asked again.
    stray: float = 1e-4
    # Cells on the light's surface, see SurfaceGrid.
    by_surface: bool = False


def one(make: Callable[..., Light], *arguments: Any, **options: Any) -> Case:
    return Case(lambda: make_scene(make(*arguments)), **options)


CASES: dict[str, Case] = {
    # half_u = +X and half_v = +Y emit along -Z, towards the receiver.
    "rect": one(rect, (0.2, 0.1, 3.0), (0.5, 0, 0), (0, 1.0, 0), by_surface=True),
    "rect_near": one(rect, (0.2, 0.1, 0.25), (0.5, 0, 0), (0, 0.5, 0)),
    "rect_touching": one(rect, (0.1, 0.2, 0.01), (0.5, 0, 0), (0, 0.5, 0), by_surface=True),  # solid angle > 6.1
    "rect_far": one(rect, (3.0, 2.0, 40.0), (0.5, 0, 0), (0, 1.0, 0), stray=1e-3),  # solid angle < 0.01
    "rect_grazing": one(rect, (0.0, 1.6, 0.05), (2.0, 0, 0), (0, 1.5, 0), stray=1e-3, by_surface=True),
    "rect_skimming": one(rect, (0.0, 1.6, 0.002), (2.0, 0, 0), (0, 1.5, 0), stray=5e-3, by_surface=True),
    "rect_skimming_by_area": one(rect, (0.0, 2.6, 0.002), (2.0, 0, 0), (0, 1.5, 0), stray=5e-3, by_surface=True),
    "rect_over_its_edge": one(rect, (0.5, 0.5, 0.2), (0.5, 0, 0), (0, 0.5, 0)),
    "rect_long": one(rect, (0.0, 0.1, 0.3), (0.02, 0, 0), (0, 4.0, 0), by_surface=True),
    "parallelogram": one(rect, (0.2, 0.1, 0.8), (0.5, 0, 0), (0.4, 0.5, 0)),
    "disk": one(disk, (0.2, 0.1, 0.5), (0.5, 0, 0), (0, 0.5, 0)),
    "ellipse_sheared": one(disk, (0.2, 0.1, 1.5), (1.5, 0, 0), (0.6, 0.4, 0.3)),
    "disk_grazing": one(disk, (0.0, 1.6, 0.05), (1.5, 0, 0), (0, 1.5, 0), stray=1e-3, by_surface=True),
    "sphere": one(sphere, (0.0, 1.0, 2.0), 1.0),
    "sphere_near": one(sphere, (0.0, 0.0, 1.001), 1.0, stray=1e-3),
    "sphere_far": one(sphere, (1.0, 2.0, 50.0), 1.0, stray=1e-3),
    "sphere_tiny": one(sphere, (0.1, 0.2, 3.0), 3e-4, stray=1e-2),
    # Seen from the distance d of the axis, acos(r / d) / pi of the mantle faces the receiver. Towards the silhouette
    # the density becomes infinite and float32 tells it less and less precisely.
    "cylinder": one(cylinder, (0, 0, 2.0), (1.0, 1.0, 0.2), 0.3, yields=np.nan, stray=0.02, by_surface=True),
    "cylinder_beside": one(cylinder, (0, 0, 1.5), (2.0, 0, 0), 0.75, yields=1 / 3, stray=0.02, by_surface=True),
    "cylinder_end_on": one(cylinder, (0, 0.6, 2.0), (0, 0, 0.5), 0.3, yields=1 / 3, stray=0.02, by_surface=True),
    "sun": one(distant, 0.265, stray=2e-3),
    "distant_wide": one(distant, 10.0),
    "distant_beyond_the_horizon": one(distant, 100.0),
    "dome": Case(lambda: make_scene(dome()), normal=(-0.48, 0.6, -0.64)),
    "dome_picture": Case(lambda: make_scene(dome(starry_picture())), stray=1e-3),
    "mesh_one_sided": Case(lambda: patch(False), yields=float(np.nan), overlaps=True),
    "mesh_two_sided": Case(lambda: patch(True), overlaps=True),
    "mesh_lights": Case(lambda: patch(True, False, True), yields=float(np.nan), overlaps=True),
    "all_kinds": Case(lambda: everything(dome()), yields=float(np.nan), overlaps=True),
    "all_kinds_and_picture": Case(lambda: everything(dome(starry_picture())), yields=float(np.nan), overlaps=True),
}
SINGLE = [name for name, case in CASES.items() if not case.overlaps]


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


@cache
def device_scene(name: str) -> DeviceScene:
    return upload(CASES[name].scene(), "cpu")


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


def normal_of(name: str) -> NDArray[np.float64]:
    return TURN @ np.array(CASES[name].normal)


@cache
def sampled(name: str, count: int = COUNT, seed: int = 1) -> tuple[NDArray[np.float32], NDArray[Any]]:
    return run(device_scene(name), SAMPLE, RECEIVER, normal_of(name), count, seed=seed)


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """Cells of directions that are the equal parts of a light's surface, seen from the receiver (float64, NumPy).

    For lights whose density varies too much over cells of direction: slivers, and silhouettes where it is infinite.
    A part's solid angle is its area times cos / distance^2.
    """

    light: RectLight | DiskLight | CylinderLight
    side: int = 12
    cells: int = 144

    def surface(self, a: NDArray[Any], b: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], float]:
        """Points and unit normals for (a, b) in the unit square, and the area of its image."""
        light = self.light
        if isinstance(light, CylinderLight):
            s, t, half_length, reach = self.towards_receiver()
            phi = (2.0 * b - 1.0) * reach
            n = np.cos(phi)[:, None] * s + np.sin(phi)[:, None] * t
            p = light.center + (2.0 * a - 1.0)[:, None] * light.half_axis + light.radius * n
            return p, n, 4.0 * half_length * reach * light.radius
        normal = np.cross(light.half_v, light.half_u)
        area = float(np.linalg.norm(normal))
        x, y = 2.0 * a - 1.0, 2.0 * b - 1.0
        if isinstance(light, DiskLight):
            x, y = np.sqrt(a) * np.cos(np.pi * y), np.sqrt(a) * np.sin(np.pi * y)
        p = light.center + x[:, None] * light.half_u + y[:, None] * light.half_v
        return p, np.broadcast_to(normal / area, p.shape), area * (np.pi if isinstance(light, DiskLight) else 4.0)

    def towards_receiver(self) -> tuple[NDArray[Any], NDArray[Any], float, float]:
        """Across a cylinder's axis: the directions to the receiver and sideways; half its length; the largest angle
        between its normals that face the receiver and the former."""
        assert isinstance(self.light, CylinderLight)
        half_length = float(np.linalg.norm(self.light.half_axis))
        axis = self.light.half_axis / half_length
        o = RECEIVER - self.light.center
        across = o - axis * (o @ axis)
        distance = float(np.linalg.norm(across))
        s = across / distance
        return s, np.cross(axis, s), half_length, float(np.arccos(self.light.radius / distance))

    def coordinates(self, directions: NDArray[np.float32]) -> tuple[NDArray[Any], NDArray[Any]]:
        """(a, b) of the point that each direction meets first."""
        light, d = self.light, directions.astype(np.float64)
        o = RECEIVER - light.center
        if isinstance(light, CylinderLight):
            s, t, half_length, reach = self.towards_receiver()
            ds, dt, distance = d @ s, d @ t, o @ s
            # A direction that rounding takes past the silhouette meets the mantle where it comes closest.
            root = np.sqrt(np.maximum((ds * distance) ** 2 - (ds**2 + dt**2) * (distance**2 - light.radius**2), 0.0))
            length = (-ds * distance - root) / (ds**2 + dt**2)
            phi = np.arctan2(length * dt, distance + length * ds)
            a = 0.5 + 0.5 * ((o + length[:, None] * d) @ light.half_axis) / half_length**2
            return a, 0.5 + 0.5 * phi / reach
        normal = np.cross(light.half_v, light.half_u)
        p = o - d * ((o @ normal) / (d @ normal))[:, None]
        x, y, _ = np.linalg.solve(np.stack([light.half_u, light.half_v, normal], axis=1), p.T)
        if isinstance(light, DiskLight):
            return x**2 + y**2, 0.5 + 0.5 * np.arctan2(y, x) / np.pi
        return 0.5 + 0.5 * x, 0.5 + 0.5 * y

    def counts(self, directions: NDArray[np.float32]) -> NDArray[np.float64]:
        """Directions in each cell, the last entry those beside the light by more than rounding, shape (cells + 1,)."""
        a, b = self.coordinates(directions)
        inside = (np.abs(a - 0.5) < 0.501) & (np.abs(b - 0.5) < 0.501)
        row, column = (np.clip((c * self.side).astype(int), 0, self.side - 1) for c in (a, b))
        index = np.where(inside, row * self.side + column, self.cells)
        return np.bincount(index, minlength=self.cells + 1).astype(np.float64)

    def lattice(self, side: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Directions to side x side points of each cell, and the solid angle for which each stands [sr]."""
        steps = (np.arange(self.side)[:, None] + (np.arange(side) + 0.5)[None, :] / side) / self.side
        a, b = np.broadcast_arrays(steps[:, None, :, None], steps[None, :, None, :])
        p, n, area = self.surface(a.ravel(), b.ravel())
        d = p - RECEIVER
        distance = np.linalg.norm(d, axis=1)
        wi = d / distance[:, None]
        cos_light = -np.einsum("ij,ij->i", wi, n)
        return wi, cos_light / distance**2 * area / len(wi)

    def points(self, side: int) -> NDArray[np.float32]:
        return self.lattice(side)[0].astype(np.float32)

    def integrals(self, values: NDArray[np.float32], side: int) -> NDArray[np.float64]:
        return (values.astype(np.float64) * self.lattice(side)[1]).reshape(self.cells, -1).sum(axis=1)


def grid_of(name: str) -> tuple[Grid, int]:
    """Cells for a case's directions, and the quadrature's points along a cell's side."""
    if CASES[name].by_surface:
        light = CASES[name].scene().lights[0]
        assert isinstance(light, RectLight | DiskLight | CylinderLight)
        return SurfaceGrid(light), 40
    if name == "dome_picture":
        # The texels' own edges: about the dome's +Y, phi = pi / 2 - 2 pi u.
        frame = np.stack([TURN[:, 0], -TURN[:, 2], TURN[:, 1]])
        return DirectionGrid(frame, 1.0 - np.cos(np.pi * np.arange(9) / 8), np.linspace(-np.pi, np.pi, 17)), 48
    wi, out = sampled(name, PILOT, seed=2)
    grid = DirectionGrid.fitted(wi[out["sampled_pdf"] > 0.0], np.linspace(0.0, 1.0, 13), sectors=12)
    return grid, 96 if CASES[name].overlaps else 40


@pytest.mark.parametrize("name", CASES)
def test_directions_have_the_density_that_rays_are_given(name: str) -> None:
    case = CASES[name]
    wi, out = sampled(name)
    has_sample = out["sampled_pdf"] > 0.0
    grid, side = grid_of(name)

    def density(directions: NDArray[np.float32]) -> NDArray[np.float32]:
        return run(device_scene(name), LOOK, RECEIVER, normal_of(name), directions)[1]["pdf"]

    missing = int((~has_sample).sum())
    fit, integral = fit_directions(wi[has_sample], density, grid, side, missing)
    assert fit.p_value > SIGNIFICANCE, fit
    assert detectable_imbalance(fit.count, fit.dof, SIGNIFICANCE) < DETECTABLE
    yields = case.yields
    if np.isnan(yields):
        assert 0 < missing < COUNT
        yields = 1.0 - missing / COUNT
    # The quadrature's error, and where the yield is itself counted 4 standard errors of it.
    assert integral == pytest.approx(yields, abs=5e-3)
    if case.yields == 1.0:
        assert missing == 0


@pytest.mark.parametrize("name", SINGLE)
def test_sampler_and_ray_agree_on_density_distance_and_radiance(name: str) -> None:
    wi, out = sampled(name)
    has_sample = out["sampled_pdf"] > 0.0
    out, wi = out[has_sample], wi[has_sample]
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1.0, atol=1e-6)
    same = np.abs(out["sampled_pdf"] / np.maximum(out["pdf"], 1e-30) - 1.0) < 1e-3
    assert 1.0 - same.mean() <= CASES[name].stray
    same = np.abs(out["sampled_luminance"] - out["radiance"]) <= 1e-3 * out["sampled_luminance"]
    assert 1.0 - same.mean() <= CASES[name].stray
    if not name.startswith("dome"):
        same = np.abs(out["hit_distance"] / out["sampled_distance"] - 1.0) < 1e-3
        assert 1.0 - same.mean() <= CASES[name].stray


@pytest.mark.parametrize("name", [name for name in SINGLE if not name.startswith(("dome", "sun", "distant"))])
def test_sampled_points_lie_on_the_light(name: str) -> None:
    """In float64 and by the light's equation alone."""
    wi, out = sampled(name)
    has_sample = out["sampled_pdf"] > 0.0
    wi, distance = wi[has_sample].astype(float), out["sampled_distance"][has_sample].astype(float)
    light = CASES[name].scene().lights[0]
    p = RECEIVER + wi * distance[:, None] - light.center
    scale = float(np.abs(RECEIVER - light.center).max()) + 1.0
    if isinstance(light, SphereLight):
        # The near side: at a distance that is known to the tangent's length.
        off = np.linalg.norm(p, axis=1) - light.radius
        assert (np.einsum("ij,ij->i", p, wi) < 2e-6 * scale).all()
    elif isinstance(light, CylinderLight):
        half_length = np.linalg.norm(light.half_axis)
        along = p @ light.half_axis / half_length
        off = np.sqrt((p**2).sum(axis=1) - along**2) - light.radius
        assert (np.abs(along) < half_length + 2e-6 * scale).all()
        # All of the length is sampled.
        assert np.abs(along).max() > 0.999 * half_length
    else:
        assert isinstance(light, RectLight | DiskLight)
        basis = np.stack([light.half_u, light.half_v, np.cross(light.half_v, light.half_u)], axis=1)
        a, b, height = np.linalg.solve(basis, p.T)
        off = height * np.linalg.norm(basis[:, 2])
        radius = np.maximum(np.abs(a), np.abs(b)) if isinstance(light, RectLight) else np.hypot(a, b)
        assert 0.998 < radius.max() < 1.0 + 1e-4
    assert np.abs(off).max() < 2e-6 * scale


@pytest.mark.parametrize("name", ["sun", "distant_wide", "dome", "dome_picture"])
def test_lights_at_infinity_are_infinitely_far(name: str) -> None:
    assert (sampled(name)[1]["sampled_distance"] == np.float32(INFINITE_DISTANCE)).all()


@pytest.mark.parametrize("double_sided", [False, True])
def test_mesh_samples_lie_on_its_triangles_and_on_the_side_that_shines(double_sided: bool) -> None:
    name = "mesh_two_sided" if double_sided else "mesh_one_sided"
    wi, out = sampled(name)
    geometry = CASES[name].scene().geometry
    corners = geometry.points[geometry.triangles].astype(float)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(e1, e2)
    front = np.einsum("ij,ij->i", normals, RECEIVER - corners[:, 0]) > 0.0
    assert 0 < front.sum() < len(front)
    has_sample = out["sampled_pdf"] > 0.0
    p = RECEIVER + wi[has_sample].astype(float) * out["sampled_distance"][has_sample, None]
    on = np.zeros((len(corners), len(p)), dtype=bool)
    for k in range(len(corners)):
        solution = np.linalg.solve(np.stack([e1[k], e2[k], normals[k]], axis=1), (p - corners[k, 0]).T)
        on[k] = (solution[:2] > -1e-5).all(axis=0) & (solution[:2].sum(axis=0) < 1.0 + 1e-5)
        on[k] &= np.abs(solution[2]) * np.linalg.norm(normals[k]) < 1e-5
    shines = front | double_sided
    assert on[shines].any(axis=0).all()
    assert on[shines].any(axis=1).all()
    # Each triangle by its area. The last one is the fourth turned round: a sample of either lies on both.
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    for k in np.flatnonzero(shines[:-1]):
        share = areas[k] * (2.0 if k == 3 and double_sided else 1.0) / areas.sum()
        share += areas[5] / areas.sum() if k == 3 and not double_sided and front[5] else 0.0
        assert on[k].sum() / COUNT == pytest.approx(share, abs=4.0 * np.sqrt(share / COUNT))


def test_lights_that_are_hidden_count_in_the_density_but_do_not_shine() -> None:
    """The density of the light strategy is of a line, not of what can be seen along it."""
    rays = np.array([[0.0, 0.0, 1.0], [0.2, 0.1, 3.0]]) @ TURN.T
    wi = (rays / np.linalg.norm(rays, axis=1)[:, None]).astype(np.float32)
    found = (rect((0.0, 0.0, 2.0), (1.0, 0, 0), (0, 1.0, 0)), sphere((0.0, 0.0, 5.0), 1.0), dome())
    alone = upload(make_scene(*found[:1]), "cpu")
    scene = upload(make_scene(*found), "cpu")
    n = TURN[:, 2]

    def look(near: float, far: float, where: DeviceScene = scene) -> NDArray[Any]:
        return run(where, LOOK, RECEIVER, n, wi, near=near, far=far)[1]

    everything = look(0.0, INFINITE_DISTANCE)
    assert (everything["hits"] == 2).all()
    np.testing.assert_allclose(everything["radiance"], 3.0)
    for near, far, radiance in [(0.0, 1.0, 0.0), (0.0, 3.5, 1.0), (3.5, 6.0, 1.0), (1.0, 7.0, 2.0), (7.0, 9.0, 0.0)]:
        part = look(near, far)
        np.testing.assert_array_equal(part["pdf"], everything["pdf"])
        np.testing.assert_allclose(part["radiance"], radiance)
        assert (part["hits"] == radiance).all()
    # A light flush with the surface that ends the ray shines, and once only if the surface lets the ray through.
    straight = look(0.0, 2.0), look(2.0, 3.0)
    assert straight[0]["radiance"][0] == 1.0
    assert straight[1]["radiance"][0] == 0.0
    # Alone, the rect's density is 1 / its solid angle; in company it is that times the choice.
    solid_angle = 4.0 * np.arctan(1.0 / (2.0 * np.sqrt(6.0)))
    single = look(0.0, INFINITE_DISTANCE, alone)
    np.testing.assert_allclose(single["pdf"], 1.0 / solid_angle, rtol=1e-5)
    assert (everything["pdf"] > everything["choice"] / solid_angle).all()


def test_choice_among_lights_is_a_distribution() -> None:
    """Lights that differ only in brightness are chosen in proportion to it; a light that shows its back is not."""
    left = sphere((-1.0, 0.0, 2.0), 0.1)
    right = replace(sphere((1.0, 0.0, 2.0), 0.1), radiance=3.0 * WHITE)
    away = rect((0.0, 1.0, 2.0), (0, 0.5, 0), (0.5, 0, 0))
    scene = upload(make_scene(left, right, away), "cpu")
    wi, out = run(scene, SAMPLE, RECEIVER, TURN[:, 2], PILOT)
    assert (out["sampled_pdf"] > 0.0).all()
    share = (wi @ TURN[:, 0] > 0.0).mean()
    assert share == pytest.approx(0.75, abs=4.0 * np.sqrt(0.1875 / PILOT))
    np.testing.assert_allclose(out["choice"], 0.25, rtol=1e-5)


ROUND = ["rect", "parallelogram", "disk", "ellipse_sheared", "sphere", "cylinder", "distant_wide"]
ROUND += ["distant_beyond_the_horizon", "dome", "dome_picture", "mesh_one_sided", "mesh_two_sided"]


@pytest.mark.parametrize("name", ROUND)
def test_from_anywhere_a_light_that_contributes_can_be_chosen(name: str) -> None:
    """Receivers all around, near and far, facing anywhere: importance 0 only where the light brings nothing, finite
    numbers, and a density that both routes agree on."""
    random = np.random.default_rng(3)
    count = 1 << 16
    light = CASES[name].scene().lights
    center = light[0].center if light and hasattr(light[0], "center") else RECEIVER
    away = random.normal(size=(count, 3))
    away *= (10.0 ** random.uniform(-2.0, 1.5, count) / np.linalg.norm(away, axis=1))[:, None]
    n = random.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    wi, out = run(device_scene(name), SAMPLE_FIRST, center + away, n, count)
    for field in ("sampled_pdf", "sampled_distance", "pdf", "radiance", "choice"):
        assert np.isfinite(out[field]).all(), field
    has_sample = out["sampled_pdf"] > 0.0
    assert has_sample.mean() > 0.2
    contributes = has_sample & (np.einsum("ij,ij->i", wi, n) > 1e-5)
    assert contributes.mean() > 0.1
    assert (out["choice"][contributes] == 1.0).all()
    chosen = has_sample & (out["choice"] > 0.0)
    if CASES[name].overlaps:
        assert (out["pdf"][chosen] > 0.999 * out["sampled_pdf"][chosen]).mean() > 0.999
    else:
        same = np.abs(out["pdf"][chosen] / out["sampled_pdf"][chosen] - 1.0) < 2e-3
        assert 1.0 - same.mean() < max(2e-3, CASES[name].stray)


def test_solid_angle_of_a_rect_is_exact_down_to_grazing_views() -> None:
    """1 / pdf against van Oosterom and Strackee (1983) in float64, wherever the solid angle is sampled: from the height
    of a tenth of the farthest corner's distance up.
    """
    light = rect((0.0, 0.0, 0.0), (0.5, 0, 0), (0, 0.5, 0))
    assert isinstance(light, RectLight)
    random = np.random.default_rng(4)
    count = 1 << 15
    local = random.uniform(-1.2, 1.2, (count, 3))
    local[:, 2] = -(10.0 ** random.uniform(-3.0, 0.0, count))
    x = (light.center + local @ TURN.T).astype(np.float32)
    _, out = run(upload(make_scene(light), "cpu"), SAMPLE_FIRST, x, -TURN[:, 2], count)
    corners = [light.center + a * light.half_u + b * light.half_v - x for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    exact = triangle_solid_angle(*corners[:3]) + triangle_solid_angle(corners[0], corners[2], corners[3])
    farthest = np.hypot(np.abs(local[:, 0]) + 0.5, np.abs(local[:, 1]) + 0.5)
    by_solid_angle = (exact > 0.0101) & (np.abs(local[:, 2]) > 0.101 * farthest)
    assert by_solid_angle.mean() > 0.2
    assert np.abs(exact * out["sampled_pdf"] - 1.0)[by_solid_angle].max() < 5e-4


def triangle_solid_angle(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> NDArray[Any]:
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    numerator = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    return 2.0 * np.arctan2(numerator, la * lb * lc + ab * lc + bc * la + ca * lb)


def test_a_stage_of_lights_alone_and_one_of_degenerate_emitters_upload() -> None:
    """No materials at all; and a mesh light with no area, which Features still names, has neither samples nor hits."""
    _, out = run(device_scene("sphere"), SAMPLE, RECEIVER, TURN[:, 2], 16)
    assert (out["sampled_pdf"] > 0.0).all()
    points = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [2.0, 0.0, 2.0]])
    scene = make_scene(points=points, triangles=[[0, 1, 2]], prims=[0], double=(True,))
    assert detect(scene).mesh_light
    _, out = run(upload(scene, "cpu"), SAMPLE, np.zeros(3), np.eye(3)[2], 16)
    assert not out["sampled_pdf"].any()
    assert not run(upload(scene, "cpu"), LOOK, np.zeros(3), np.eye(3)[2], np.eye(3, dtype=np.float32))[1]["pdf"].any()
