"""Whole images against Mitsuba 3, which shares no line with us; and Mitsuba's conversion against closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import USD_SCENES, camera, quads, scene

import warpmis
from warpmis.scene import Camera, CylinderLight, DistantLight, DomeLight, Light, Material, RectLight, Scene, SphereLight

mi = pytest.importorskip("mitsuba")

from peer.mitsuba_material import NoCounterpartError, bsdf  # noqa: E402
from peer.mitsuba_scene import reference_image, sensor, to_mitsuba  # noqa: E402

pytestmark = pytest.mark.peer

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
MEAN_BOUND = 0.01  # relative, each channel of the whole picture
BLOCK_BOUND = 0.06  # relative, 95th percentile of the blocks' luminance
DARK = 0.05  # a block below this share of the picture's mean is judged against DARK * mean: its own noise is all it has

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """How a scene is compared: small, and sampled enough for the bounds to mean something.

    The door has half the others' width and many times their samples: nearly all its paths carry nothing.
    """

    name: str
    width: int
    spp: int  # ours, and each of the two references'
    max_depth: int


BLOCK = 6  # [pixel]; divides both sides of the pictures

CORNELL = Case("cornell_box", width=96, spp=1024, max_depth=8)
DOOR = Case("ajar_door", width=48, spp=49152, max_depth=6)
PLATES = Case("veach_plates", width=96, spp=6144, max_depth=6)


@dataclass(frozen=True)
class Reference:
    """The mean of two of Mitsuba's pictures with different seeds, and half their difference: its noise."""

    image: Image
    noise: Image


@cache
def stage(case: Case) -> Scene:
    """The scene with no metal rougher than 0.22: Mitsuba's metals lose what is scattered twice, and ours do not."""
    found = warpmis.load_stage(USD_SCENES / case.name / "scene.usda")
    materials = [
        replace(look, roughness=min(float(look.roughness), 0.22)) if look.metallic == 1.0 else look
        for look in found.materials
    ]
    return replace(found, materials=tuple(materials))


@cache
def reference(case: Case) -> Reference:
    width, height = stage(case).resolution
    height = round(case.width * height / width)
    first, second = (
        reference_image(stage(case), spp=case.spp, max_depth=case.max_depth, width=case.width, height=height, seed=seed)
        for seed in (1, 2)
    )
    return Reference(0.5 * (first + second), 0.5 * (first - second))


def blocks(image: Image) -> Image:
    """Mean luminance of blocks of BLOCK x BLOCK pixels."""
    luminance = image @ LUMINANCE
    height, width = luminance.shape
    return luminance.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean(axis=(1, 3))


def block_errors(difference: Image, image: Image) -> Image:
    """|difference| of each block relative to the block, or to DARK of the picture's mean where that is more."""
    level = blocks(image)
    return np.abs(blocks(difference)) / np.maximum(level, DARK * level.mean())


def mean_errors(difference: Image, image: Image) -> Image:
    """|difference| of the pictures' means, relative, per channel."""
    return np.abs(difference.mean(axis=(0, 1))) / image.mean(axis=(0, 1))


@pytest.mark.parametrize("case", [CORNELL, DOOR, PLATES], ids=lambda case: case.name)
def test_the_reference_is_quieter_than_the_bounds(case: Case) -> None:
    """The noise of the mean of two pictures is half their difference."""
    truth = reference(case)
    assert mean_errors(truth.noise, truth.image).max() < 0.4 * MEAN_BOUND
    assert np.quantile(block_errors(truth.noise, truth.image), 0.95) < 0.6 * BLOCK_BOUND


@pytest.mark.parametrize(
    ("case", "method"),
    [
        (CORNELL, "balance"),
        (CORNELL, "nee"),
        (CORNELL, "murray20"),
        (DOOR, "balance"),
        (PLATES, "balance"),
        (PLATES, "nee"),
    ],
    ids=lambda value: value if isinstance(value, str) else value.name,
)
def test_same_image_as_mitsuba(case: Case, method: str) -> None:
    truth = reference(case).image
    result = warpmis.render(
        stage(case), width=case.width, spp=case.spp, max_depth=case.max_depth, method=method, seed=3, device="cpu"
    )
    difference = result.image - truth
    assert mean_errors(difference, truth).max() < MEAN_BOUND
    assert np.quantile(block_errors(difference, truth), 0.95) < BLOCK_BOUND


# The conversion itself, where a formula gives the answer.


def floor(albedo: float = 0.5) -> tuple[NDArray[np.float32], Material]:
    """A square of 200 x 200 in the plane y = 0, facing +Y."""
    corners = np.array([(-100, 0, 100), (100, 0, 100), (100, 0, -100), (-100, 0, -100)], dtype=np.float32)
    return corners, Material(path="/floor", diffuse_color=(albedo, albedo, albedo), lambertian=True)


def lit_floor(*lights: Light) -> Scene:
    """A floor of albedo 0.5, of which the camera sees next to the origin alone."""
    corners, material = floor()
    return scene(quads([(corners, 0)]), [material], list(lights), camera((3, 3, 0), (0, 0, 0), half_width=0.002))


def mitsuba_mean(scene: Scene, *, spp: int = 256, max_depth: int = 1) -> Image:
    return reference_image(scene, spp=spp, max_depth=max_depth, width=8, height=8).mean(axis=(0, 1))


def rect(radiance: float, height: float, half: float = 1.0) -> RectLight:
    """A square light at the given height that shines down: half_v x half_u = -Y."""
    u, v = np.array([half, 0.0, 0.0]), np.array([0.0, 0.0, -half])
    return RectLight("/rect", np.array([0.0, height, 0.0]), u, v, np.full(3, radiance))


def rect_irradiance(radiance: float, height: float, half: float = 1.0) -> float:
    """On the floor below the centre of a square light: four times a corner's form factor, times pi L."""
    side = half / math.hypot(half, height)
    return 4.0 * radiance * side * math.atan(side)


def test_constant_dome_gives_the_albedo() -> None:
    dome = DomeLight("/dome", np.eye(3), np.ones(3))
    assert mitsuba_mean(lit_floor(dome), spp=4096) == pytest.approx(0.5, rel=5e-3)


def test_sphere_light_gives_its_irradiance() -> None:
    light = SphereLight("/sphere", np.array([0.0, 2.0, 0.0]), 0.5, np.full(3, 4.0))
    assert mitsuba_mean(lit_floor(light), spp=1024) == pytest.approx(0.5 * 4.0 * (0.5 / 2.0) ** 2, rel=5e-3)


def test_point_light_gives_its_irradiance() -> None:
    light = SphereLight("/point", np.array([0.0, 2.0, 0.0]), 0.0, np.full(3, 4.0))
    assert mitsuba_mean(lit_floor(light)) == pytest.approx(0.5 / math.pi * 4.0 / 2.0**2, rel=1e-3)


def test_distant_light_gives_its_irradiance() -> None:
    towards = np.array([0.0, 0.8, 0.6])
    light = DistantLight("/sun", towards, 0.0, np.full(3, 2.0))
    assert mitsuba_mean(lit_floor(light)) == pytest.approx(0.5 / math.pi * 2.0 * 0.8, rel=1e-3)


def test_long_cylinder_light_gives_its_irradiance() -> None:
    """An endless cylinder of radius r at distance h: E = pi L r / h."""
    light = CylinderLight("/tube", np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 80.0]), 0.1, np.full(3, 4.0))
    assert mitsuba_mean(lit_floor(light), spp=4096) == pytest.approx(0.5 * 4.0 * 0.1 / 2.0, rel=3e-2)


def test_rect_light_shines_on_one_side() -> None:
    down = rect(3.0, 1.5)
    assert mitsuba_mean(lit_floor(down), spp=1024) == pytest.approx(0.5 / math.pi * rect_irradiance(3.0, 1.5), rel=5e-3)
    assert mitsuba_mean(lit_floor(replace(down, half_u=-down.half_u))).max() == 0.0


def test_lights_do_not_occlude_each_other() -> None:
    """A lamp in front of another: their sum, on the floor and in view."""
    lamps = (rect(3.0, 1.5), rect(5.0, 2.5, half=2.0))
    below = rect_irradiance(3.0, 1.5) + rect_irradiance(5.0, 2.5, half=2.0)
    assert mitsuba_mean(lit_floor(*lamps), spp=2048, max_depth=3) == pytest.approx(0.5 / math.pi * below, rel=1e-2)
    upwards = replace(lit_floor(*lamps), camera=camera((0, 0.5, 0), (0, 1, 0), half_width=0.1))
    assert mitsuba_mean(upwards, max_depth=1) == pytest.approx(8.0, rel=1e-5)


def test_depth_0_is_emission_alone() -> None:
    lit = lit_floor(rect(1.0, 1.5))
    assert mitsuba_mean(lit, max_depth=0).max() == 0.0
    upwards = replace(lit, camera=camera((0, 0.5, 0), (0, 1, 0), half_width=0.1))
    assert mitsuba_mean(upwards, max_depth=0) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(("u", "axis"), [(0.25, (1, 0, 0)), (0.5, (0, 0, 1)), (0.75, (-1, 0, 0))])
def test_dome_picture_lies_as_scene_says(u: float, axis: tuple[int, int, int]) -> None:
    """A picture that is lit about one direction alone is seen in that direction, and turns with the dome."""
    picture = np.zeros((64, 128, 3), dtype=np.float32)
    column = int(128 * u)
    picture[28:36, column - 4 : column + 4] = 1.0
    quarter = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # turns +Z to +X
    for to_world in (np.eye(3), quarter):
        dome = DomeLight("/dome", to_world, np.full(3, 2.0), picture)
        view = camera((0, 5, 0), np.array([0, 5, 0]) + to_world @ np.array(axis), half_width=0.05)
        assert mitsuba_mean(replace(lit_floor(dome), camera=view)) == pytest.approx(2.0, rel=1e-3)


def test_camera_has_the_window() -> None:
    """An off-centre window: the directions through the film are those of scene.Camera's formula."""
    base = camera((1, 2, 3), (0, 1, -2))
    view = Camera("/camera", base.position, base.right_axis, base.up_axis, base.forward, (-0.3, 0.7, -0.2, 0.3))
    left, right, bottom, top = view.window
    built = mi.load_dict(sensor(view, sampler="independent", spp=1, width=100, height=50, seed=0))
    for x, y in [(0.0, 0.0), (0.3, 0.8), (1.0, 1.0)]:
        ray, _ = built.sample_ray(0.0, 0.0, [x, y], [0.5, 0.5])
        across = (left + x * (right - left)) * view.right_axis + (top + y * (bottom - top)) * view.up_axis
        expected = view.forward + across
        assert np.array(ray.d) == pytest.approx(expected / np.linalg.norm(expected), abs=1e-5)


def metal_times_cosine(wi: Image, wo: Image, base: Image, roughness: float) -> Image:
    """GGX with alpha = roughness^2, separable Smith, Schlick from the base colour to white; times |cos wo|."""
    alpha2 = roughness**4
    half = (wi + wo) / np.linalg.norm(wi + wo)
    density = alpha2 / math.pi / (half[2] ** 2 * (alpha2 - 1.0) + 1.0) ** 2
    g_i, g_o = (2.0 / (1.0 + math.sqrt(1.0 + alpha2 * (1.0 - w[2] ** 2) / w[2] ** 2)) for w in (wi, wo))
    fresnel = base + (1.0 - base) * (1.0 - wi @ half) ** 5
    return fresnel * density * g_i * g_o / (4.0 * wi[2])


@pytest.mark.parametrize("roughness", [0.08, 0.22, 0.4, 1.0])
def test_principled_metal_is_our_metal_without_compensation(roughness: float) -> None:
    base = np.array([0.9, 0.5, 0.0])
    built = mi.load_dict(bsdf(Material(diffuse_color=(0.9, 0.5, 0.0), metallic=1.0, roughness=roughness)))
    rng = np.random.default_rng(1)
    for side in (1.0, -1.0):  # both sides of the lamina
        for _ in range(50):
            wi = rng.normal(size=3)
            wo = wi * np.array([-1.0, -1.0, 1.0]) + rng.normal(scale=0.3, size=3)
            wi, wo = (w / np.linalg.norm(w) * np.array([1.0, 1.0, side * np.sign(w[2])]) for w in (wi, wo))
            at = mi.SurfaceInteraction3f()
            at.wi, at.n, at.sh_frame = wi.tolist(), [0.0, 0.0, 1.0], mi.Frame3f([0.0, 0.0, 1.0])
            found = np.array(built.eval(mi.BSDFContext(), at, wo.tolist()))
            flip = np.array([1.0, 1.0, side])
            assert found == pytest.approx(metal_times_cosine(wi * flip, wo * flip, base, roughness), rel=1e-3, abs=1e-6)


@pytest.mark.parametrize(
    "material",
    [
        Material(path="/plastic"),
        replace(Material(path="/coat"), metallic=1.0, clearcoat=1.0),
        Material(metallic=1.0, roughness=0.0),
    ],
    ids=["plastic", "clearcoat", "mirror"],
)
def test_what_has_no_counterpart_is_refused(material: Material) -> None:
    with pytest.raises(NoCounterpartError):
        bsdf(material)


def test_a_scene_with_a_wide_distant_light_is_refused() -> None:
    sun = DistantLight("/sun", np.array([0.0, 1.0, 0.0]), 0.1, np.ones(3))
    with pytest.raises(NoCounterpartError, match="/sun"):
        to_mitsuba(lit_floor(sun), spp=1, max_depth=1, width=8, height=8)
