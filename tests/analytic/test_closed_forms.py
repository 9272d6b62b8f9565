"""Pictures whose radiance is known in closed form, from USD text to pixel: within 0.5 % unless stated.

Each case is rendered by three methods (nee, balance, bsdf where the light has an extent), for each has its own way to
lose a factor. The camera looks at one point through a window so narrow that the picture is one number.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from pxr import Usd

import warpmis

FLOOR = """
def Mesh "Floor" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-100, 0, 100), (100, 0, 100), (100, 0, -100), (-100, 0, -100)]
    color3f[] primvars:displayColor = [(%s, %s, %s)]
}
"""
RHO = 0.5


def camera(position: tuple[float, float, float], rotate_x: float, aperture: float = 0.001) -> str:
    return f"""
def Camera "Camera" {{
    float focalLength = 1
    float horizontalAperture = {aperture}
    float verticalAperture = {aperture}
    double3 xformOp:translate = {position}
    float xformOp:rotateX = {rotate_x}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}}
"""


# Aside of the point below the lights, looking down at it: lights above the floor stand not in the way.
LOOK_AT_ORIGIN = camera((0, 1, 1), -45)


def mean(text: str, spp: int = 4096, width: int = 8, **settings) -> float:
    """Mean radiance of the picture, all three channels being equal."""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString('#usda 1.0\n(upAxis = "Y")\n' + text)
    scene = warpmis.load_stage(stage, width=width)
    result = warpmis.render(scene, spp=spp, **settings)
    assert result.stats["rejected_samples"] == 0
    assert np.ptp(result.image, axis=-1).max() <= 1e-4 * result.image.max()
    return float(result.image[..., 0].astype(np.float64).mean())


def floor_radiance(lights: str, **settings) -> float:
    return mean(FLOOR % (RHO, RHO, RHO) + lights + LOOK_AT_ORIGIN, max_depth=1, **settings)


EXTENDED = pytest.mark.parametrize("method", ["nee", "balance", "bsdf"])


@EXTENDED
def test_constant_dome_over_a_convex_body_is_the_albedo(method: str) -> None:
    text = """
def Sphere "Ball" {
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
def DomeLight "Sky" {
    float inputs:intensity = 2
}
""" + camera((0, 0, 5), 0)
    assert mean(text, method=method) == pytest.approx(2.0 * 0.5, rel=0.005)


@pytest.mark.parametrize("angle", [0.0, 0.53, 20.0])
@pytest.mark.parametrize("method", ["nee", "balance"])
def test_normalized_distant_light_gives_its_intensity_as_irradiance(method: str, angle: float) -> None:
    """The normalisation is by pi sin^2(angle / 2), which is the irradiance of the cone at any angle."""
    light = f"""def DistantLight "Sun" {{
        float inputs:intensity = 3
        bool inputs:normalize = 1
        float inputs:angle = {angle}
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:rotateX"]
    }}"""
    assert floor_radiance(light, method=method) == pytest.approx(RHO * 3.0 / math.pi, rel=0.005)


def test_default_distant_light() -> None:
    """0.53 degrees at 50,000 nit: E = 50000 pi sin^2(0.265 degrees) = 3.360."""
    light = """def DistantLight "Sun" {
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:rotateX"]
    }"""
    expected = 50000.0 * math.pi * math.sin(math.radians(0.265)) ** 2
    assert expected == pytest.approx(3.360, abs=1e-3)
    assert floor_radiance(light, method="nee") == pytest.approx(RHO * expected / math.pi, rel=0.005)


@EXTENDED
@pytest.mark.parametrize("radius", [0.5, 2.0])
def test_disk_light_on_axis(method: str, radius: float) -> None:
    """E = pi L r^2 / (r^2 + h^2)."""
    light = f"""def DiskLight "Disk" {{
        float inputs:intensity = 4
        float inputs:radius = {radius}
        double3 xformOp:translate = (0, 1.5, 0)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}"""
    irradiance = math.pi * 4.0 * radius**2 / (radius**2 + 1.5**2)
    spp = 65536 if method == "bsdf" and radius == 0.5 else 8192
    assert floor_radiance(light, method=method, spp=spp) == pytest.approx(RHO * irradiance / math.pi, rel=0.005)


@EXTENDED
@pytest.mark.parametrize("radius", [0.2, 0.7])
def test_sphere_light_faces_the_floor(method: str, radius: float) -> None:
    """E = pi L (r / d)^2."""
    light = f"""def SphereLight "Lamp" {{
        float inputs:intensity = 4
        float inputs:radius = {radius}
        double3 xformOp:translate = (0, 1.2, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}"""
    irradiance = math.pi * 4.0 * (radius / 1.2) ** 2
    spp = 131072 if method == "bsdf" and radius == 0.2 else 32768
    assert floor_radiance(light, method=method, spp=spp) == pytest.approx(RHO * irradiance / math.pi, rel=0.005)


def test_point_light_falls_off_with_the_square() -> None:
    """treatAsPoint, normalised: radiant intensity = intensity / 4 (an eighth of a sphere's flux / (pi / 2))."""
    light = """def SphereLight "Point" {
        float inputs:intensity = 8
        bool inputs:normalize = 1
        bool treatAsPoint = 1
        double3 xformOp:translate = (0, 2, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }"""
    assert floor_radiance(light, method="nee", spp=64) == pytest.approx(RHO / math.pi * (8.0 / 4.0) / 4.0, rel=1e-3)


def rect_irradiance(half: float, height: float) -> float:
    """Of a square parallel to the receiver, centred above it, radiance 1: four corner configuration factors.

    Reference: Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-4.
    """
    a = half / height
    corner = a / math.sqrt(1 + a * a) * math.atan(a / math.sqrt(1 + a * a)) / math.pi
    return math.pi * 4.0 * corner


@EXTENDED
@pytest.mark.parametrize("half", [0.25, 2.0])
def test_rect_light_above_the_floor(method: str, half: float) -> None:
    light = f"""def RectLight "Panel" {{
        float inputs:width = {2 * half}
        float inputs:height = {2 * half}
        float inputs:intensity = 5
        double3 xformOp:translate = (0, 1.3, 0)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}"""
    expected = RHO / math.pi * 5.0 * rect_irradiance(half, 1.3)
    spp = 131072 if method == "bsdf" and half == 0.25 else 8192
    assert floor_radiance(light, method=method, spp=spp) == pytest.approx(expected, rel=0.005)


@EXTENDED
def test_emissive_mesh_is_a_light(method: str) -> None:
    """The same square as a mesh that emits: both triangles of it, and no other side."""
    light = """
def Mesh "Panel" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    rel material:binding = </Glow>
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, 1.3, -2), (2, 1.3, -2), (2, 1.3, 2), (-2, 1.3, 2)]
}
def Material "Glow" {
    token outputs:surface.connect = </Glow/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (5, 5, 5)
        token outputs:surface
    }
}
"""
    expected = RHO / math.pi * 5.0 * rect_irradiance(2.0, 1.3)
    assert floor_radiance(light, method=method, spp=8192) == pytest.approx(expected, rel=0.005)


@pytest.mark.parametrize("method", ["nee", "balance"])
def test_cylinder_light_above_the_floor(method: str) -> None:
    """A thin cylinder parallel to the floor: E = 2 r L [b h / (h^2 + b^2) + atan(b / h)] / h for r << h, half length b.

    From dE = L (2 r cos b') cos(theta) dx / d^2 along the axis, both cosines h / d.
    """
    r, h, b = 0.01, 1.0, 2.0
    light = f"""def CylinderLight "Tube" {{
        float inputs:radius = {r}
        float inputs:length = {2 * b}
        float inputs:intensity = 50
        double3 xformOp:translate = (0, {h}, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}"""
    irradiance = 50.0 * 2.0 * r * (b * h / (h * h + b * b) + math.atan(b / h)) / (2.0 * h) * 2.0
    assert floor_radiance(light, method=method, spp=16384) == pytest.approx(RHO * irradiance / math.pi, rel=0.005)


def test_rect_light_in_view_is_pixel_1() -> None:
    """Seen from its front; from behind it is not there, for it emits from one side."""
    text = """
def RectLight "Panel" {
    float inputs:width = 9
    float inputs:height = 9
}
"""
    assert mean(text + camera((0, 0, -2), 0).replace("rotateX = 0", "rotateX = 180"), spp=4, method="nee") == 1.0
    assert mean(text + camera((0, 0, 2), 0), spp=4, method="nee") == 0.0


@pytest.mark.parametrize("depth", [0, 1, 3, 8])
@pytest.mark.parametrize("method", ["nee", "balance", "murray20"])
def test_closed_emitting_box_sums_the_bounces(method: str, depth: int) -> None:
    """Walls that emit 1 and reflect rho: L = sum_k rho^k over k = 0 .. depth, whatever the directions."""
    text = """
def Cube "Box" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    rel material:binding = </Glow>
    bool doubleSided = 1
}
def Material "Glow" {
    token outputs:surface.connect = </Glow/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.6, 0.6, 0.6)
        color3f inputs:emissiveColor = (1, 1, 1)
        float inputs:ior = 1
        int inputs:useSpecularWorkflow = 0
        token outputs:surface
    }
}
""" + camera((0, 0, 0), 20)
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString("#usda 1.0\n" + text)
    scene = warpmis.load_stage(stage, width=8)
    # The lobe of a UsdPreviewSurface reflects at grazing angles whatever its ior: here a pure Lambertian is wanted.
    lambert = tuple(dataclasses.replace(material, lambertian=True) for material in scene.materials)
    scene = dataclasses.replace(scene, materials=lambert)
    image = warpmis.render(scene, spp=4096, method=method, max_depth=depth).image
    assert image.mean(dtype=np.float64) == pytest.approx(sum(0.6**k for k in range(depth + 1)), rel=0.005)


@pytest.mark.parametrize("roughness", [0.0, 0.02])
def test_white_mirror_in_a_white_world_is_invisible(roughness: float) -> None:
    text = f"""
def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    rel material:binding = </Mirror>
}}
def Material "Mirror" {{
    token outputs:surface.connect = </Mirror/Surface.outputs:surface>
    def Shader "Surface" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 1, 1)
        float inputs:metallic = 1
        float inputs:roughness = {roughness}
        token outputs:surface
    }}
}}
def DomeLight "Sky" {{
}}
""" + camera((0, 0, 5), 0, aperture=0.2)
    assert mean(text, spp=64, method="nee") == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("mode, expected", [("presence", 0.75), ("opaque", 0.0)])
def test_opacity_lets_the_sky_through(mode: str, expected: float) -> None:
    """A black card of opacity 0.25 before a sky of 1, and its shadow, by closed form."""
    opacity = 0.25 if mode == "presence" else 1.0
    text = f"""
def Mesh "Card" {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-100, -100, 0), (100, -100, 0), (100, 100, 0), (-100, 100, 0)]
    color3f[] primvars:displayColor = [(0, 0, 0)]
    float[] primvars:displayOpacity = [{opacity}]
}}
def DomeLight "Sky" {{
}}
""" + camera((0, 0, 5), 0)
    assert mean(text, spp=4096, method="nee") == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("method", ["nee", "balance"])
def test_shadow_of_a_half_transparent_card(method: str) -> None:
    card = """
def Mesh "Card" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, 1.1, -9), (9, 1.1, -9), (9, 1.1, 9), (-9, 1.1, 9)]
    color3f[] primvars:displayColor = [(0, 0, 0)]
    float[] primvars:displayOpacity = [0.6]
}
def SphereLight "Lamp" {
    float inputs:intensity = 4
    float inputs:radius = 0.5
    double3 xformOp:translate = (0, 2, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    expected = 0.4 * RHO * 4.0 * (0.5 / 2.0) ** 2
    assert floor_radiance(card, method=method, spp=16384) == pytest.approx(expected, rel=0.01)
