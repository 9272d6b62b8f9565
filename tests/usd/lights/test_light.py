"""UsdLux lights: radiance and shape in world space against the schema's formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from usd.stages import area, check_invariants, load, mentions, shading_normals, vector_areas, volume

from warpmis.scene import CylinderLight, DiskLight, DistantLight, DomeLight, RectLight, SphereLight


def light(kind: str, attributes: str = "", scale: str = "", apis: str = "") -> str:
    ops = f'double3 xformOp:scale = {scale}\nuniform token[] xformOpOrder = ["xformOp:scale"]' if scale else ""
    head = f" (\nprepend apiSchemas = [{apis}]\n)" if apis else ""
    return f'def {kind} "L"{head}\n{{\n{attributes}\n{ops}\n}}\n'


CUBE = 'def Cube "C"\n{\n}\n'


def only(text: str):
    """The one light of a stage with a cube besides."""
    scene = load(text + CUBE)
    assert len(scene.lights) == 1, (scene.lights, scene.warnings)
    return scene.lights[0]


def test_rect_light_is_unit_radiance_and_emits_along_minus_z():
    found = only(light("RectLight", "float inputs:width = 4\nfloat inputs:height = 2"))
    assert isinstance(found, RectLight)
    assert found.path == "/L"
    np.testing.assert_allclose(found.half_u, [2, 0, 0])
    np.testing.assert_allclose(found.half_v, [0, 1, 0])
    np.testing.assert_allclose(np.cross(found.half_v, found.half_u), [0, 0, -2])
    np.testing.assert_allclose(found.radiance, [1, 1, 1])


@pytest.mark.parametrize("kind", ["RectLight", "DiskLight"])
@pytest.mark.parametrize(
    ("scale", "side"), [("(-2, 3, 1)", -1), ("(2, -3, 1)", -1), ("(2, 3, -1)", 1), ("(-2, -3, -1)", 1)]
)
def test_mirrored_one_sided_lights_emit_where_minus_z_is_carried(kind, scale, side):
    found = only(light(kind, scale=scale))
    normal = np.cross(found.half_v, found.half_u)
    assert np.sign(normal[2]) == side
    np.testing.assert_allclose(np.abs(normal), [0, 0, 6 * 0.25])


def test_exposure_color_and_intensity_multiply():
    found = only(
        light("RectLight", "float inputs:intensity = 3\nfloat inputs:exposure = 2\ncolor3f inputs:color = (1, 0.5, 0)")
    )
    np.testing.assert_allclose(found.radiance, [12, 6, 0])


def test_color_temperature_counts_only_when_enabled():
    warm = "float inputs:colorTemperature = 3000\ncolor3f inputs:color = (1, 1, 0.5)"
    np.testing.assert_allclose(only(light("RectLight", warm)).radiance, [1, 1, 0.5])
    found = only(light("RectLight", warm + "\nbool inputs:enableColorTemperature = 1"))
    from pxr import UsdLux

    expected = np.array(UsdLux.BlackbodyTemperatureAsRgb(3000)) * [1, 1, 0.5]
    np.testing.assert_allclose(found.radiance, expected, rtol=1e-6)
    assert found.radiance[0] > found.radiance[1] > found.radiance[2]


# (kind, attributes, scale, world-space area)
AREAS = [
    ("RectLight", "float inputs:width = 4\nfloat inputs:height = 2", "(2, 3, 5)", 8 * 6),
    ("DiskLight", "float inputs:radius = 2", "(2, 3, 5)", math.pi * 4 * 6),
    ("SphereLight", "float inputs:radius = 2", "(3, 3, 3)", 4 * math.pi * 36),
    ("CylinderLight", "float inputs:radius = 2\nfloat inputs:length = 5", "(2, 3, 3)", 2 * math.pi * 6 * 10),
]


@pytest.mark.parametrize(("kind", "attributes", "scale", "expected"), AREAS, ids=[case[0] for case in AREAS])
def test_normalize_divides_by_the_world_space_area(kind, attributes, scale, expected):
    plain = only(light(kind, attributes + "\nfloat inputs:intensity = 7", scale))
    np.testing.assert_allclose(plain.radiance, 7.0)
    found = only(light(kind, attributes + "\nfloat inputs:intensity = 7\nbool inputs:normalize = 1", scale))
    np.testing.assert_allclose(found.radiance, 7.0 / expected, rtol=1e-9)


def test_disk_becomes_an_ellipse_and_sphere_and_cylinder_scale():
    disk = only(light("DiskLight", "float inputs:radius = 2", "(2, 3, 5)"))
    assert isinstance(disk, DiskLight)
    np.testing.assert_allclose([disk.half_u, disk.half_v], [[4, 0, 0], [0, 6, 0]])
    sphere = only(light("SphereLight", "float inputs:radius = 2", "(-3, 3, 3)"))
    assert isinstance(sphere, SphereLight)
    assert sphere.radius == pytest.approx(6.0)
    cylinder = only(light("CylinderLight", "float inputs:radius = 2\nfloat inputs:length = 5", "(2, 3, 3)"))
    assert isinstance(cylinder, CylinderLight)
    np.testing.assert_allclose(cylinder.half_axis, [5, 0, 0])
    assert cylinder.radius == pytest.approx(6.0)


def test_rotated_and_moved_light_stands_in_world_space():
    text = """def RectLight "L"
{
    double3 xformOp:translate = (1, 2, 3)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
"""
    found = only(text)
    np.testing.assert_allclose(found.center, [1, 2, 3])
    np.testing.assert_allclose(np.cross(found.half_v, found.half_u), [0, -0.25, 0], atol=1e-9)  # shines down


def test_stretched_sphere_is_an_emissive_ellipsoid_of_the_right_area():
    intensity = "float inputs:radius = 1\nfloat inputs:intensity = 5"
    scene = load(light("SphereLight", intensity, "(2, 1, 1)"))
    check_invariants(scene)
    assert scene.lights == ()
    assert [prim.path for prim in scene.prims] == ["/L"]
    assert not scene.prims[0].double_sided
    (material,) = scene.materials
    assert (material.emissive_color, material.diffuse_color, material.lambertian) == ((5, 5, 5), (0, 0, 0), True)
    eccentricity = math.sqrt(3) / 2
    exact = 2 * math.pi * (1 + 2 / eccentricity * math.asin(eccentricity))  # prolate spheroid
    assert area(scene) == pytest.approx(exact, rel=0.005)
    assert volume(scene) > 0
    assert shading_normals(scene).shape[0] > 1000
    normalized = load(light("SphereLight", intensity + "\nbool inputs:normalize = 1", "(2, 1, 1)"))
    assert normalized.materials[0].emissive_color[0] == pytest.approx(5 / exact, rel=1e-6)


@pytest.mark.parametrize("scale", ["(1, 2, 1)", "(1, 1, 3)"])
def test_cylinder_of_elliptic_section_is_emissive_triangles_without_caps(scale):
    scene = load(
        light("CylinderLight", "float inputs:radius = 1\nfloat inputs:length = 2\nbool inputs:normalize = 1", scale)
    )
    check_invariants(scene)
    assert scene.lights == ()
    assert (np.abs(vector_areas(scene)[:, 0]) < 1e-6).all()  # no caps: no triangle faces along the axis
    assert scene.materials[0].emissive_color[0] == pytest.approx(1 / area(scene), rel=0.005)
    assert np.einsum("fi,fi->f", vector_areas(scene), scene.geometry.points[scene.geometry.triangles[:, 0]]).min() > 0


def test_point_light_keeps_the_power_of_the_small_sphere():
    point = "bool treatAsPoint = 1\nfloat inputs:radius = 0.1\nfloat inputs:intensity = 8"
    found = only(light("SphereLight", point))
    assert found.radius == 0
    np.testing.assert_allclose(found.radiance, 8 * math.pi * 0.01, rtol=1e-6)  # L pi r^2
    np.testing.assert_allclose(only(light("SphereLight", point + "\nbool inputs:normalize = 1")).radiance, 2.0)  # I / 4
    zero = point.replace("radius = 0.1", "radius = 0") + "\nbool inputs:normalize = 1"
    np.testing.assert_allclose(only(light("SphereLight", zero)).radiance, 2.0)


@pytest.mark.parametrize(
    ("attributes", "intensity"),
    [
        ("bool treatAsPoint = 1", 2.0),
        ("bool treatAsPoint = 1\nfloat inputs:exposure = 1", 4.0),
        ("bool inputs:normalize = 1", 2.0),
        ("bool treatAsPoint = 1\nbool inputs:normalize = 1", 2.0),
    ],
)
def test_sphere_of_radius_0_is_a_point_of_its_intensity(attributes, intensity):
    """The limit of normalised spheres of intensity 8: power 2 pi 8 / 2, thus 8 / 4 in every direction."""
    found = only(light("SphereLight", f"float inputs:intensity = 8\nfloat inputs:radius = 0\n{attributes}"))
    assert found.radius == 0
    np.testing.assert_allclose(found.radiance, intensity)


@pytest.mark.parametrize("attribute", ["bool treatAsLine = 1", "bool inputs:normalize = 1"])
def test_cylinder_of_radius_0_is_a_line_of_its_intensity(attribute):
    """Its radiance times its area is what that of any normalised cylinder is, its intensity."""
    found = only(light("CylinderLight", f"float inputs:intensity = 8\nfloat inputs:radius = 0\n{attribute}"))
    length = 2.0 * np.linalg.norm(found.half_axis)
    assert length == pytest.approx(1.0)
    assert 0.0 < found.radius < 0.01
    np.testing.assert_allclose(found.radiance * 2.0 * math.pi * found.radius * length, 8.0, rtol=1e-6)


def test_sphere_of_radius_0_that_is_neither_a_point_nor_normalised_is_left_out():
    scene = load(light("SphereLight", "float inputs:radius = 0") + CUBE)
    assert scene.lights == ()
    assert mentions(scene, "/L", "area is zero")


def test_distant_light_points_back_along_its_z_axis():
    found = only(light("DistantLight", "float inputs:intensity = 2\nfloat inputs:angle = 10", "(1, 1, 4)"))
    assert isinstance(found, DistantLight)
    np.testing.assert_allclose(found.direction, [0, 0, 1])
    assert found.half_angle == pytest.approx(math.radians(5))
    np.testing.assert_allclose(found.radiance, 2.0)


def test_default_distant_light_gives_its_known_irradiance():
    found = only(light("DistantLight"))
    assert math.pi * math.sin(found.half_angle) ** 2 * found.radiance[0] == pytest.approx(3.360, abs=5e-4)


@pytest.mark.parametrize("angle", [0.53, 30.0, 180.0, 270.0])
def test_normalized_distant_light_has_its_intensity_as_irradiance(angle):
    text = light("DistantLight", f"float inputs:intensity = 3\nfloat inputs:angle = {angle}\nbool inputs:normalize = 1")
    found = only(text)
    half = math.radians(angle) / 2
    # the schema's sizeFactor: the irradiance of radiance 1, above 90 degrees with the absolute cosine
    cosines = np.cos((np.arange(200000) + 0.5) / 200000 * half)
    sines = np.sin((np.arange(200000) + 0.5) / 200000 * half)
    irradiance = 2 * math.pi * float((np.abs(cosines) * sines).mean()) * half
    np.testing.assert_allclose(found.radiance * irradiance, 3.0, rtol=1e-5)


@pytest.mark.parametrize("normalize", [0, 1])
def test_distant_light_of_angle_zero_is_a_delta_light_of_its_irradiance(normalize):
    found = only(
        light(
            "DistantLight", f"float inputs:intensity = 3\nfloat inputs:angle = 0\nbool inputs:normalize = {normalize}"
        )
    )
    assert found.half_angle == 0
    np.testing.assert_allclose(found.radiance, 3.0)


def test_dome_ignores_normalize():
    found = only(light("DomeLight", "float inputs:intensity = 3\nbool inputs:normalize = 1"))
    assert isinstance(found, DomeLight)
    np.testing.assert_allclose(found.radiance, 3.0)


@pytest.mark.parametrize("attributes", ["float inputs:intensity = 0", "color3f inputs:color = (0, 0, 0)"])
def test_light_that_emits_nothing_is_left_out_silently_and_is_no_reason_for_a_dome(attributes):
    scene = load(light("RectLight", attributes) + CUBE)
    assert scene.lights == ()
    assert scene.warnings == ()
    assert not any("dome" in note for note in scene.notes)


@pytest.mark.parametrize(
    ("kind", "attributes", "word"),
    [
        ("RectLight", "float inputs:intensity = -1", "intensity -1"),
        ("RectLight", "float inputs:intensity = nan", "intensity nan"),
        ("RectLight", "float inputs:intensity = inf", "intensity inf"),
        ("RectLight", "float inputs:exposure = 5000", "exposure 5000"),
        ("DomeLight", "color3f inputs:color = (nan, 1, 1)", "finite"),
        ("RectLight", "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = nan", "finite"),
        ("RectLight", "float inputs:width = 0", "area is zero"),
        ("RectLight", "float inputs:width = nan", "not finite"),
        ("DiskLight", "float inputs:radius = 0", "area is zero"),
        ("SphereLight", "float inputs:radius = 0", "area is zero"),
        ("CylinderLight", "float inputs:length = 0\nbool inputs:normalize = 1", "area is zero"),
    ],
)
def test_impossible_lights_are_left_out_with_one_warning(kind, attributes, word):
    scene = load(light(kind, attributes) + CUBE)
    assert scene.lights == ()
    assert mentions(scene, "/L", word), scene.warnings
    assert len(scene.warnings) == 1


def test_light_scaled_to_nothing_is_left_out():
    scene = load(light("RectLight", scale="(1, 0, 1)") + CUBE)
    assert scene.lights == ()
    assert mentions(scene, "/L", "area is zero")


def test_negative_color_component_becomes_zero_with_a_warning():
    scene = load(light("RectLight", "color3f inputs:color = (1, -2, 1)") + CUBE)
    np.testing.assert_allclose(scene.lights[0].radiance, [1, 0, 1])
    assert mentions(scene, "/L", "negative")


SHAPING, SHADOW = '"ShapingAPI"', '"ShadowAPI"'
UNHONOURED = {
    "cone of a sun": (light("DistantLight", "float inputs:shaping:cone:angle = 30", apis=SHAPING), "shaping"),
    "ies": (light("RectLight", "asset inputs:shaping:ies:file = @a.ies@", apis=SHAPING), "profile a.ies"),
    "shadow": (light("RectLight", "float inputs:shadow:distance = 2", apis=SHADOW), "shadow color, distance"),
    "filters": (light("RectLight", "rel light:filters = </F>"), "filters"),
}


@pytest.mark.parametrize("case", UNHONOURED)
def test_what_a_light_asks_for_in_vain_is_one_warning_and_the_light_stays(case):
    text, word = UNHONOURED[case]
    scene = load(text + CUBE)
    assert len(scene.lights) == 1
    assert mentions(scene, "/L", word), scene.warnings
    assert len(scene.warnings) == 1


@pytest.mark.parametrize(
    "text",
    [
        light("RectLight", "float inputs:shaping:cone:angle = 90", apis=SHAPING),
        light("SphereLight", "float inputs:shaping:cone:angle = 180", apis=SHAPING),
        light(
            "RectLight", "float inputs:shaping:focus = 3\ncolor3f inputs:shaping:focusTint = (1, 1, 1)", apis=SHAPING
        ),
        light("RectLight", "bool inputs:shadow:enable = 1", apis=SHADOW),
        light("RectLight", "rel light:filters = None"),
    ],
)
def test_controls_that_change_nothing_are_no_warning(text):
    assert load(text + CUBE).warnings == ()


@pytest.mark.parametrize("kind", ["GeometryLight", "PluginLight"])
def test_unsupported_lights_are_left_out_with_one_warning_and_the_default_dome_comes(kind):
    scene = load(light(kind) + CUBE)
    assert [type(found) for found in scene.lights] == [DomeLight]
    assert mentions(scene, "/L", kind, "not supported")


def test_portals_are_one_note_and_no_light():
    scene = load(light("PortalLight") + light("PortalLight").replace('"L"', '"M"') + CUBE)
    assert [type(found) for found in scene.lights] == [DomeLight]
    assert scene.warnings == ()
    assert len([note for note in scene.notes if "portals" in note]) == 1
