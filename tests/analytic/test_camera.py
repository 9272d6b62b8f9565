"""Cameras from USD text to pixels: which pixels a known shape covers, blurred how widely, and how bright."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd
from superset import effects_of

import warpmis
from warpmis.scene.features import detect

SKY = 'def DomeLight "Sky" {}\n'


def quad(low: tuple[float, float], high: tuple[float, float], z: float, name: str = "Quad") -> str:
    """A black rectangle across the z axis."""
    (x0, y0), (x1, y1) = low, high
    points = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return f"""
def Mesh "{name}" {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = {points}
    color3f[] primvars:displayColor = [(0, 0, 0)]
}}
"""


def camera(body: str, aperture: float = 80.0) -> str:
    """At the origin, looking along -Z; a window of 8 x 8 units at a distance of 1, or of an orthographic camera."""
    return f"""
def Camera "Camera" {{
    float horizontalAperture = {aperture}
    float verticalAperture = {aperture}
    float focalLength = 10
    {body}
}}
"""


def load(text: str, width: int = 16) -> warpmis.Scene:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString('#usda 1.0\n(upAxis = "Y")\n' + text)
    return warpmis.load_stage(stage, width=width)


def render(text: str, width: int = 16, spp: int = 4, **settings) -> warpmis.RenderResult:
    return warpmis.render(load(text, width), spp=spp, method="nee", max_depth=0, **settings)


ORTHOGRAPHIC = 'token projection = "orthographic"'


@pytest.mark.parametrize("z", [-0.5, -3, -1000])
def test_orthographic_quad_covers_the_same_pixels_at_any_depth(z: float) -> None:
    """Pixels of half a unit: x from -3 to 1 is columns 2 to 10, y from 0.5 to 2 is rows 4 to 7 from the top."""
    result = render(SKY + quad((-3, 0.5), (1, 2), z) + camera(ORTHOGRAPHIC))
    expected = np.ones((16, 16))
    expected[4:7, 2:10] = 0.0
    np.testing.assert_array_equal(result.image[..., 0], expected)
    np.testing.assert_array_equal(result.alpha, 1.0 - expected)
    np.testing.assert_allclose(result.depth[4:7, 2:10], -z, rtol=1e-5)


def test_orthographic_offset_moves_the_window() -> None:
    body = ORTHOGRAPHIC + "\nfloat horizontalApertureOffset = 20\nfloat verticalApertureOffset = -10"
    result = render(SKY + quad((-3, 0.5), (1, 2), -5) + camera(body))
    expected = np.ones((16, 16))
    expected[2:5, 0:6] = 0.0  # four columns to the left, two rows up
    np.testing.assert_array_equal(result.image[..., 0], expected)


def edge(z: float, body: str, width: int = 32, spp: int = 512) -> np.ndarray:
    """Mean sky over the rows, shape (width,), beside a half plane that ends at x = 0, seen 1 : 1 in units of x / z."""
    text = SKY + quad((-1000, -1000), (0, 1000), z) + camera(body, aperture=20)
    return render(text, width=width, spp=spp).image[..., 0].mean(axis=0)


def test_edge_out_of_focus_is_blurred_over_the_circle_of_confusion() -> None:
    """A lens of radius R, focus at f, an edge at z: on the focus plane the circle's radius is r = R |f - z| / z.

    The edge's profile across it is the disk's area on one side: 1/2 + (t sqrt(1 - t^2) + asin t) / pi, t = x / r.
    """
    radius, focus, z = 0.5, 4.0, 2.0
    body = f"float fStop = {10 * 0.1 / (2 * radius)}\nfloat focusDistance = {focus}"
    r = radius * (focus - z) / z
    fine = ((np.arange(32 * 64) + 0.5) / (32 * 64) * 2 - 1) * focus  # positions on the focus plane
    t = np.clip(fine / r, -1, 1)
    expected = (0.5 + (t * np.sqrt(1 - t**2) + np.arcsin(t)) / np.pi).reshape(32, 64).mean(axis=1)
    blurred = (expected > 1e-9) & (expected < 1 - 1e-9)
    assert blurred.sum() * 2 * focus / 32 == pytest.approx(2 * r)  # the circle is 4 pixels wide: else nothing is shown
    # 32 x 512 samples a column: a standard error of 0.004 at most.
    np.testing.assert_allclose(edge(-z, body), expected, atol=0.016)


def test_edge_in_focus_is_sharp() -> None:
    body = "float fStop = 1\nfloat focusDistance = 4"
    np.testing.assert_array_equal(edge(-4, body, spp=16), np.repeat([0.0, 1.0], 16))


def test_point_out_of_focus_is_a_disk_of_the_known_area() -> None:
    """A square of side s, far out of focus, covers (s f / z)^2 of the focus plane in the mean, whatever the lens."""
    square = quad((-0.1, -0.1), (0.1, 0.1), -2)
    result = render(SKY + square + camera("float fStop = 0.5\nfloat focusDistance = 4", 20), width=32, spp=256)
    shade = 1.0 - result.image[..., 0].astype(float)
    pixel = 2 * 4.0 / 32
    assert shade.sum() * pixel**2 == pytest.approx(0.4**2, rel=0.03)
    x = (np.arange(32) + 0.5) * pixel - 4.0
    distance = np.hypot(x[:, None], x[None])
    assert shade[distance > 1.0 + 0.2 * np.sqrt(2) + pixel].max() == 0.0  # circle of confusion, and half the square
    # Uniform over a disk of radius 1 and the square: the variances along x add up, 1/4 + s^2 / 12 + the pixel's.
    assert np.average(x**2, weights=shade.sum(axis=0)) == pytest.approx(0.25 + (0.4**2 + pixel**2) / 12, rel=0.05)


@pytest.mark.parametrize(
    ("body", "factor"),
    [
        ("float exposure = 3", 8.0),
        ("float exposure:iso = 400", 4.0),
        ("float exposure:time = 0.25\nfloat exposure:responsivity = 2", 0.5),
        ("float exposure:fStop = 4", 1 / 16),
        ("float exposure:iso = 0", 0.0),
    ],
)
def test_exposure_is_exactly_a_factor(body: str, factor: float) -> None:
    lit = (
        SKY
        + 'def Sphere "Ball" {\ndouble3 xformOp:translate = (0, 0, -3)\n'
        + ('uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n')
    )
    plain, exposed = (render(lit + camera(text), spp=8) for text in ("", body))
    np.testing.assert_array_equal(exposed.image, plain.image * np.float32(factor))
    np.testing.assert_array_equal(exposed.variance, plain.variance * np.float32(factor**2))


def features_of(text: str) -> set[str]:
    return {"orthographic", "depth_of_field", "clipping"} & effects_of(detect(load(text)))


BEHIND_ONE_ANOTHER = SKY + quad((-9, -9), (0, 9), -1, "Near") + quad((-99, 0), (99, 99), -5, "Far")


@pytest.mark.parametrize(
    ("body", "near", "far"),
    [
        ("", True, True),
        ("float2 clippingRange = (0.5, 10)", True, True),
        ("float2 clippingRange = (2, 10)", False, True),
        ("float2 clippingRange = (0.5, 3)", True, False),
        ("float2 clippingRange = (2, 3)", False, False),
        ("float2 clippingRange = (5, 1)", True, True),  # no range
        ("float4[] clippingPlanes = [(0, 0, -2, -4)]", False, True),  # keeps z <= -2
        ("float4[] clippingPlanes = [(0, 0, 1, 3), (0, 0, 0, 1)]", True, False),  # keeps z >= -3; the second is none
        ("float2 clippingRange = (2, 10)\n" + ORTHOGRAPHIC, False, True),
        ("float4[] clippingPlanes = [(0, 0, 1, 3)]\n" + ORTHOGRAPHIC, True, False),
    ],
)
def test_what_lies_beyond_a_clipping_plane_is_not_seen(body: str, near: bool, far: bool) -> None:
    """The near quad covers the left half, the far one the upper half: what shows through is what is left."""
    result = render(BEHIND_ONE_ANOTHER + camera(body))
    depth = np.zeros((16, 16))
    if far:
        depth[:8] = 5.0
    if near:
        depth[:, :8] = 1.0
    np.testing.assert_allclose(result.depth, depth, rtol=1e-5)
    np.testing.assert_array_equal(result.image[..., 0], depth == 0.0)
    assert ("clipping" in features_of(BEHIND_ONE_ANOTHER + camera(body))) == (not (near and far))


def test_slanted_plane_and_lights_before_the_near_plane() -> None:
    """x + z + 2.5 >= 0 at z = -5 keeps x >= 2.5; a lamp nearer than the near plane is not in view."""
    result = render(SKY + quad((-99, -99), (99, 99), -5) + camera("float4[] clippingPlanes = [(1, 0, 1, 2.5)]"))
    x = 5 * ((np.arange(16) + 0.5) / 2 - 4)
    np.testing.assert_array_equal(result.alpha, np.broadcast_to(x > 2.5, (16, 16)))
    lamp = 'def SphereLight "Lamp" {\nfloat inputs:radius = 0.5\ndouble3 xformOp:translate = (0, 0, -2)\n' + (
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    )
    assert render(lamp + camera("")).image.max() > 0.0
    clipped = lamp + camera("float2 clippingRange = (3, 10)")
    assert render(clipped).image.max() == 0.0
    assert features_of(clipped) == {"clipping"}


def test_clipping_cuts_the_view_and_not_the_light() -> None:
    """A floor under a sky, shaded by a quad that the camera does not see: as dark as with the quad in view."""
    # Along -Z.
    sun = 'def DistantLight "Sun" {\nfloat inputs:angle = 0\nfloat inputs:intensity = 1\nbool inputs:normalize = 1\n}\n'
    wall = quad((-99, -99), (99, 99), -5).replace("(0, 0, 0)]", "(1, 1, 1)]")
    shade = quad((-99, 0), (99, 99), -1, "Shade")
    stage = Usd.Stage.CreateInMemory()
    text = sun + wall + shade + camera("float2 clippingRange = (2, 10)", 20)
    assert stage.GetRootLayer().ImportFromString('#usda 1.0\n(upAxis = "Y")\n' + text)
    image = warpmis.render(stage, width=8, spp=4, method="nee", max_depth=1).image[..., 0]
    np.testing.assert_allclose(image[:4], 0.0)
    np.testing.assert_allclose(image[4:], 1 / np.pi, rtol=1e-5)


def test_a_pinhole_in_a_room_of_its_range_compiles_as_one_without() -> None:
    room = SKY + quad((-9, -9), (9, 9), -5) + quad((-9, -9), (9, 9), 5, "Behind")
    assert features_of(room + camera("float2 clippingRange = (0.01, 100)")) == set()
