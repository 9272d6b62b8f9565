"""What UsdLux asks of lights beside their shape, from USD text to pixel, against integrals: within 0.5 %.

As in test_closed_forms.py the camera looks at one point of a floor through a window so narrow that the picture is one
color.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd
from usd.lights.test_ies import profile
from usd.pictures import write

import warpmis

RHO = 0.5
STAGE = """#usda 1.0
(upAxis = "Y")
def Mesh "Floor" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-100, 0, 100), (100, 0, 100), (100, 0, -100), (-100, 0, -100)]
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
def Camera "Camera" {
    float focalLength = 1
    float horizontalAperture = 0.001
    float verticalAperture = 0.001
    double3 xformOp:translate = (0, 1, 1)
    float xformOp:rotateX = -45
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
"""
SHAPING = 'prepend apiSchemas = ["ShapingAPI"]'


def light(kind: str, attributes: str, at: tuple[float, float, float], turn: float = -90, head: str = SHAPING) -> str:
    """A light that shines down where `turn` is -90."""
    return f"""def {kind} "Light" ({head}) {{
        {attributes}
        double3 xformOp:translate = {at}
        float xformOp:rotateX = {turn}
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}
"""


def irradiance(text: str, method: str = "nee", spp: int = 16384, stage_text: str = STAGE, **settings) -> np.ndarray:
    """Mean irradiance of the floor at the origin, shape (3,)."""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(stage_text + text)
    scene = warpmis.load_stage(stage, width=8)
    result = warpmis.render(scene, spp=spp, method=method, max_depth=1, **settings)
    assert result.stats["rejected_samples"] == 0
    assert not result.warnings
    return result.image.astype(np.float64).mean(axis=(0, 1)) * math.pi / RHO


def shaped(theta: np.ndarray, angle: float, softness: float, focus: float, tint: np.ndarray) -> np.ndarray:
    """The schema's formulas, shape (n, 3)."""
    cutoff = math.radians(angle)
    t = np.clip((theta - (1.0 - softness) * cutoff) / max(softness * cutoff, 1e-12), 0.0, 1.0)
    cone = np.where(theta > cutoff, 0.0, 1.0 - t * t * (3.0 - 2.0 * t))
    share = (np.abs(np.cos(theta)) ** focus)[:, None]
    return cone[:, None] * (tint * (1.0 - share) + share)


@pytest.mark.parametrize("method", ["nee", "balance", "bsdf"])
def test_disk_with_cone_and_focus_on_its_axis(method: str) -> None:
    """E = 2 pi integral of L(t) cos t sin t over the disk's angle, t being the angle at the light too."""
    text = light(
        "DiskLight",
        """float inputs:radius = 2
        float inputs:intensity = 4
        float inputs:shaping:cone:angle = 50
        float inputs:shaping:cone:softness = 0.5
        float inputs:shaping:focus = 3
        color3f inputs:shaping:focusTint = (0, 0.5, 1)""",
        (0, 1.5, 0),
    )
    widest = math.atan(2.0 / 1.5)
    theta = (np.arange(20000) + 0.5) / 20000 * widest
    factor = shaped(theta, 50.0, 0.5, 3.0, np.array([0.0, 0.5, 1.0]))
    expected = 2 * math.pi * 4.0 * (factor * (np.cos(theta) * np.sin(theta))[:, None]).mean(axis=0) * widest
    np.testing.assert_allclose(irradiance(text, method), expected, rtol=0.005)


@pytest.mark.parametrize("degrees", [0.0, 20.0, 35.0, 41.0])
def test_point_with_a_soft_cone_and_focus_off_its_axis(degrees: float) -> None:
    """E = I cos^3 t / h^2 times the factors of t, below a point light at height h that shines down."""
    theta = math.radians(degrees)
    attributes = """bool treatAsPoint = 1
        bool inputs:normalize = 1
        float inputs:intensity = 8
        float inputs:shaping:cone:angle = 40
        float inputs:shaping:cone:softness = 0.4
        float inputs:shaping:focus = 5"""
    found = irradiance(light("SphereLight", attributes, (2.0 * math.tan(theta), 2.0, 0.0)), spp=16)
    factor = shaped(np.array([theta]), 40.0, 0.4, 5.0, np.zeros(3))[0]
    np.testing.assert_allclose(found, 2.0 * math.cos(theta) ** 3 / 4.0 * factor, rtol=1e-3)


@pytest.mark.parametrize("kind", ["SphereLight", "CylinderLight"])
def test_sphere_and_cylinder_with_the_api_alone_shine_forwards_only(kind: str) -> None:
    """Applying ShapingAPI gives them a cone of 90 degrees; a point ahead sees what it saw before."""
    size = "float inputs:radius = 0.02\nfloat inputs:intensity = 4"
    assert irradiance(light(kind, size, (0.3, 1.5, 0), turn=90), spp=256).max() == 0.0
    plain, ahead = (irradiance(light(kind, size, (0.3, 1.5, 0), head=head), spp=256) for head in ("", SHAPING))
    np.testing.assert_allclose(ahead, plain, rtol=0.005)


def test_a_stretched_sphere_is_shaped_as_triangles() -> None:
    """Far away it is a point: the ratio to the unshaped one is the factor."""
    stretched = """float inputs:radius = 0.01
        double3 xformOp:translate = (1, 1, 0)
        float xformOp:rotateX = -90
        double3 xformOp:scale = (1, 1, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX", "xformOp:scale"]
        float inputs:shaping:cone:angle = 180
        float inputs:shaping:focus = %s"""
    shape = 'def SphereLight "Light" (' + SHAPING + ") {\n" + stretched + "\n}\n"
    plain, focused = (irradiance(shape % focus, spp=4096) for focus in (0, 2))
    np.testing.assert_allclose(focused / plain, 0.5, rtol=0.02)


@pytest.mark.parametrize("method", ["nee", "balance", "bsdf"])
def test_rect_light_with_a_picture_of_two_halves(method: str, tmp_path: Path) -> None:
    """E of each half is the integral of L cos cos / d^2 over it: red shines from the light's +X, green from its -X."""
    halves = np.zeros((4, 64, 3))
    halves[:, :32, 0], halves[:, 32:, 1] = 1.0, 0.5
    path = write(tmp_path / "halves.exr", halves)
    size = "float inputs:width = 3\nfloat inputs:height = 2\nfloat inputs:intensity = 4"
    text = light("RectLight", f"{size}\nasset inputs:texture:file = @{path}@", (0.5, 1.2, 0.0), head="")
    x, z = np.meshgrid((np.arange(600) + 0.5) / 200 - 1.5, (np.arange(400) + 0.5) / 200 - 1.0)
    form = 1.2**2 / ((x + 0.5) ** 2 + 1.2**2 + z**2) ** 2 * 200.0**-2
    expected = [4.0 * form[x > 0].sum(), 2.0 * form[x < 0].sum(), 0.0]
    np.testing.assert_allclose(irradiance(text, method, spp=32768), expected, rtol=0.005)


def ies(path: Path, vertical: list[float], horizontal: list[float], candela: list[float]) -> str:
    path.write_text(profile(vertical, horizontal, candela))
    return f"asset inputs:shaping:ies:file = @{path}@\nfloat inputs:shaping:cone:angle = 180\n"


POINT = "bool treatAsPoint = 1\nbool inputs:normalize = 1\nfloat inputs:intensity = 8\n"
# I / h^2 of that point at height 2
OF_POINT = 2.0 / 4.0


def test_profiles_that_are_alike_everywhere_or_shine_downwards_alone(tmp_path: Path) -> None:
    alike = ies(tmp_path / "alike.ies", [0, 180], [0], [1, 1])
    down = ies(tmp_path / "down.ies", [0, 90], [0], [1, 1])
    for attributes, turn, share in ((alike, -90, 1.0), (alike, 90, 1.0), (down, -90, 1.0), (down, 90, 0.0)):
        found = irradiance(light("SphereLight", POINT + attributes, (0, 2, 0), turn), spp=16)
        np.testing.assert_allclose(found, share * OF_POINT, rtol=1e-4)
    normalized = down + "bool inputs:shaping:ies:normalize = 1"  # half of the sphere gets all of the power
    found = irradiance(light("SphereLight", POINT + normalized, (0, 2, 0)), spp=16)
    np.testing.assert_allclose(found, 2.0 * OF_POINT, rtol=1e-3)


@pytest.mark.parametrize(("scale", "degrees"), [(0.0, 30.0), (0.5, 15.0), (2.0, 60.0), (-2.0, 30.0)])
def test_a_profile_is_linear_between_its_angles_and_scaled(scale: float, degrees: float, tmp_path: Path) -> None:
    """I = 1 - t / 90 at the profile's angle t, which is the light's over the scale, counted from 180 if negative."""
    theta = math.radians(degrees)
    text = ies(tmp_path / "a.ies", [0, 90, 180], [0], [1, 0, 2]) + f"float inputs:shaping:ies:angleScale = {scale}\n"
    found = irradiance(light("SphereLight", POINT + text, (2.0 * math.tan(theta), 2.0, 0.0)), spp=16)
    at = degrees / (scale or 1.0) if scale >= 0.0 else 180.0 - (180.0 - degrees) / -scale
    expected = OF_POINT * math.cos(theta) ** 3 * np.interp(at, [0, 90, 180], [1, 0, 2])
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize(("x", "z", "candela"), [(1, 0, 3.0), (-1, 0, 1.0), (0, 1, 2.0), (0, -1, 4.0)])
def test_horizontal_angles_run_from_x_to_y_of_the_light(x: int, z: int, candela: float, tmp_path: Path) -> None:
    """The light is turned about X: its Y looks along the world's -Z. The floor sees what leaves towards it."""
    values = np.repeat([1.0, 2.0, 3.0, 4.0, 1.0], 2).tolist()
    text = ies(tmp_path / "a.ies", [0, 180], [0, 90, 180, 270, 360], values)
    found = irradiance(light("SphereLight", POINT + text, (x, 1.0, z)), spp=16)
    np.testing.assert_allclose(found, 2.0 * candela * 2.0**-1.5, rtol=2e-3)
