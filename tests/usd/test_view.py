"""The camera of a stage without one: it frames what can be seen, or is the view that Omniverse Kit saved."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from usd.stages import corners, load

from warpmis.scene import Camera

FLOOR = """def Mesh "Floor"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 3, 2, 1]
    point3f[] points = %s
}
"""


def square(normal: int, size: float = 2.0, offset: float = 0.0) -> str:
    """A square that faces along one of the axes."""
    flat = [np.insert([x, y], normal, offset) for x, y in ((-size, -size), (size, -size), (size, size), (-size, size))]
    return FLOOR % [tuple(point.tolist()) for point in flat]


def in_picture(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Where points are seen, as shares of the window, shape (n, 2); all must be in front of the camera."""
    axes = np.stack([camera.right_axis, camera.up_axis, camera.forward])
    seen = (points.reshape(-1, 3) - camera.position) @ axes.T
    assert (seen[:, 2] > 0).all()
    across = seen[:, :2] if camera.orthographic else seen[:, :2] / seen[:, 2:]
    left, right, bottom, top = camera.window
    return (across - [left, bottom]) / [right - left, top - bottom]


def covered(scene) -> float:
    """The share of the picture that the triangles cover, as if none hid another; an eighth may be cut off."""
    seen = in_picture(scene.camera, corners(scene)).reshape(-1, 3, 2)
    assert ((seen > -0.125) & (seen < 1.125)).all()
    edges = seen[:, 1:] - seen[:, :1]
    return float(np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]).sum() / 2)


UP = pytest.mark.parametrize("up", ["Y", "Z"])


@UP
@pytest.mark.parametrize("normal", [0, 1, 2])
@pytest.mark.parametrize("turn", [0.0, 30.0, 45.0, 90.0])
def test_a_flat_scene_is_seen_whichever_way_it_lies(up, normal, turn):
    for axes in ("rotateXYZ", "rotateZ"):
        angles = f"({turn}, {turn}, {turn})" if axes == "rotateXYZ" else f"{turn}"
        kind = "float3" if axes == "rotateXYZ" else "float"
        op = f'{kind} xformOp:{axes} = {angles}\nuniform token[] xformOpOrder = ["xformOp:{axes}"]'
        scene = load(f'(\nupAxis = "{up}"\n)\ndef Xform "X"\n{{\n{op}\n{square(normal)}\n}}\n')
        assert covered(scene) > 0.05


@UP
def test_a_floor_is_seen_from_above_and_upright(up):
    axis = "XYZ".index(up)
    scene = load(f'(\nupAxis = "{up}"\n)\n' + square(axis))
    assert scene.camera.position[axis] > 0
    assert scene.camera.forward[axis] < -0.3
    assert scene.camera.up_axis[axis] > 0.7
    assert scene.camera.right_axis[axis] == pytest.approx(0.0, abs=1e-9)
    assert any("frames the geometry" in note for note in scene.notes)


def test_little_things_on_a_large_floor_are_seen_from_above():
    scene = load(square(1, 20.0) + 'def Cube "C"\n{\n}\n')
    assert scene.camera.position[1] > 0
    assert covered(scene) > 0.1


@UP
def test_what_can_be_seen_from_the_front_is(up):
    """usdrecord's camera: a body, or a wall, upright."""
    front = [0, 0, -1] if up == "Y" else [0, 1, 0]
    for text in ('def Sphere "S"\n{\n}\n', square(2 if up == "Y" else 1)):
        np.testing.assert_allclose(load(f'(\nupAxis = "{up}"\n)\n' + text).camera.forward, front, atol=1e-9)


def test_instances_that_are_traced_through_transforms_count():
    cards = [(x, 0, z) for x, z in itertools.product(range(30), range(30))]
    text = f"""def PointInstancer "Many"
{{
    int[] protoIndices = {[0] * len(cards)}
    point3f[] positions = {cards}
    rel prototypes = [</Many/Floor>]
    {square(1, 0.4)}
}}
"""
    assert load(text).camera.position[1] > 0


@pytest.mark.parametrize("turn", ["0, 0, 0", "180, 0, 0", "-90, 0, 0", "90, 0, 0", "0, 90, 0", "0, -90, 0"])
@pytest.mark.parametrize("kind", ["RectLight", "DiskLight"])
def test_a_light_alone_is_seen_from_where_it_shines_to(kind, turn):
    op = f'float3 xformOp:rotateXYZ = ({turn})\nuniform token[] xformOpOrder = ["xformOp:rotateXYZ"]'
    scene = load(f'def {kind} "L"\n{{\n{op}\n}}\n')
    (light,) = scene.lights
    shines_to = np.cross(light.half_v, light.half_u)
    towards = scene.camera.position - light.center
    cosine = shines_to @ towards / np.linalg.norm(shines_to) / np.linalg.norm(towards)
    assert cosine > 0.3
    ends = [light.center + a * light.half_u + b * light.half_v for a in (-1, 1) for b in (-1, 1)]
    seen = in_picture(scene.camera, np.array(ends))
    assert ((seen > -1e-6) & (seen < 1 + 1e-6)).all()


def test_a_sphere_light_alone_is_framed_from_the_front():
    scene = load('def SphereLight "L"\n{\nfloat inputs:radius = 3\n}\n')
    distance = math.hypot(3, 3) / math.tan(math.atan(20.955 / 2 / 50)) + 3
    np.testing.assert_allclose(scene.camera.position, [0, 0, distance], rtol=1e-6)


def kit(settings: str, up: str = "Y", bound: str = "/OmniverseKit_Persp") -> str:
    return f"""(
    customLayerData = {{
        dictionary cameraSettings = {{
            {settings}
            string boundCamera = "{bound}"
        }}
    }}
    upAxis = "{up}"
)
def Cube "C"
{{
}}
"""


def dictionary(name: str, body: str) -> str:
    return f"dictionary {name} = {{\n{body}\n}}\n"


PERSPECTIVE = dictionary("Perspective", "double3 position = (-4, 5, 4)\ndouble3 target = (0, 1, 0)")


@UP
def test_kits_perspective_looks_from_its_position_at_its_target(up):
    scene = load(kit(PERSPECTIVE, up))
    found = scene.camera
    np.testing.assert_allclose(found.position, [-4, 5, 4])
    np.testing.assert_allclose(found.forward, np.array([4, -4, -4]) / math.sqrt(48), atol=1e-12)
    assert found.up_axis["XYZ".index(up)] > 0.5
    assert found.right_axis["XYZ".index(up)] == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(found.window[1], 20.955 / 2 / 18.147562, rtol=1e-3)
    (note,) = [line for line in scene.notes if "camera" in line]
    assert "Perspective" in note and "Kit" in note


ORTHOGRAPHIC = {
    "Y": {"Front": [0, 0, -1], "Right": [1, 0, 0], "Top": [0, -1, 0]},
    "Z": {"Front": [-1, 0, 0], "Right": [0, 1, 0], "Top": [0, 0, -1]},
}


@UP
@pytest.mark.parametrize("name", ["Front", "Right", "Top"])
def test_kits_other_views_are_orthographic_along_an_axis(up, name):
    forward = np.array(ORTHOGRAPHIC[up][name])
    position = tuple((-500.0 * forward).tolist())
    text = PERSPECTIVE + dictionary(name, f"double3 position = {position}\ndouble radius = 3")
    found = load(kit(text, up, f"/OmniverseKit_{name}")).camera
    assert found.orthographic
    np.testing.assert_allclose(found.position, position)
    np.testing.assert_allclose(found.forward, forward, atol=1e-12)
    np.testing.assert_allclose(found.window[:2], [-3, 3], rtol=1e-3)
    upwards = np.eye(3)["XYZ".index(up)]
    if name != "Top":
        np.testing.assert_allclose(found.up_axis, upwards, atol=1e-12)
    older = PERSPECTIVE + dictionary(name, "double3 target = (0, 0, 0)\ndouble radius = 3")
    np.testing.assert_allclose(load(kit(older, up, f"/OmniverseKit_{name}")).camera.forward, forward, atol=1e-12)


def test_frame_all_frames_a_stage_that_has_cameras():
    scene = load(kit(PERSPECTIVE) + CAMERAS, camera="frame-all")
    assert scene.camera.path == ""
    np.testing.assert_allclose(scene.camera.forward, [0, 0, -1])
    assert covered(scene) > 0.1
    assert any("frames the geometry" in note for note in scene.notes)


def test_an_up_axis_that_is_none_of_usds_is_no_error():
    top = dictionary("Top", "double3 position = (0, 0, 9)\ndouble radius = 3")
    assert load(kit(top, "X", "/OmniverseKit_Top")).camera.orthographic


CAMERAS = 'def Camera "First"\n{\n}\ndef Camera "Second"\n{\n}\n'


def test_a_camera_of_the_stage_goes_before_kits_view():
    assert load(kit(PERSPECTIVE) + CAMERAS).camera.path == "/First"


def test_the_stages_camera_that_kit_was_looking_through_goes_before_the_first():
    scene = load(kit(PERSPECTIVE, bound="/Second") + CAMERAS)
    assert scene.camera.path == "/Second"
    assert any("/Second" in note and "Kit" in note for note in scene.notes)
    assert load(kit(PERSPECTIVE, bound="/Second") + CAMERAS, camera="First").camera.path == "/First"


@pytest.mark.parametrize(
    "settings",
    [
        dictionary("Perspective", "double3 position = (1, 2, 3)\ndouble3 target = (1, 2, 3)"),
        dictionary("Perspective", "double3 position = (1, 2, nan)\ndouble3 target = (0, 0, 0)"),
        dictionary("Perspective", 'string position = "here"\ndouble3 target = (0, 0, 0)'),
        dictionary("Perspective", "double3 target = (0, 0, 0)"),
    ],
)
def test_a_view_that_is_none_is_a_warning_and_the_geometry_is_framed(settings):
    scene = load(kit(settings))
    assert len([line for line in scene.warnings if "cameraSettings" in line]) == 1
    assert any("frames the geometry" in note for note in scene.notes)
    np.testing.assert_allclose(scene.camera.forward, [0, 0, -1])


@pytest.mark.parametrize("settings", ['string Perspective = "no"\n', ""])
def test_settings_without_a_view_are_no_view(settings):
    scene = load(kit(settings))
    assert scene.warnings == ()
    assert any("frames the geometry" in note for note in scene.notes)


def test_kits_view_of_a_scene_far_from_the_origin_moves_with_it():
    far = "double3 position = (1000004, 5, 4)\ndouble3 target = (1000000, 0, 0)"
    op = 'double3 xformOp:translate = (1000000, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = load(kit(dictionary("Perspective", far)).replace('def Cube "C"\n{', f'def Cube "C"\n{{\n{op}'))
    assert scene.origin.any()
    np.testing.assert_allclose(scene.camera.position, np.array([1000004, 5, 4]) - scene.origin)
