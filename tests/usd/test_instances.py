"""Transforms, visibility, purposes, native instances and point instancers."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import SQUARE, area, check_invariants, corners, load, mentions, shading_normals, vector_areas, volume

from warpmis.errors import ConfigError, StageError


def centers(scene):
    """Middle of each prim's box, by path, for prims that appear once."""
    points, prims = corners(scene), scene.geometry.prims
    return {
        prim.path: (points[prims == i].min(axis=(0, 1)) + points[prims == i].max(axis=(0, 1))) / 2
        for i, prim in enumerate(scene.prims)
    }


def placed(ops: str, order: str, inside: str = 'def Cube "C"\n{\n}\n') -> str:
    return f'def Xform "X"\n{{\n{ops}\nuniform token[] xformOpOrder = {order}\n{inside}}}\n'


def test_transforms_of_all_ancestors_apply_in_order():
    inner = placed("double3 xformOp:scale = (2, 1, 1)", '["xformOp:scale"]')
    scene = load(placed("double3 xformOp:translate = (3, 0, 0)", '["xformOp:translate"]', inner))
    np.testing.assert_allclose(corners(scene).reshape(-1, 3).min(axis=0), [1, -1, -1])
    np.testing.assert_allclose(corners(scene).reshape(-1, 3).max(axis=0), [5, 1, 1])


def test_xform_op_stack_with_pivot_and_inverse():
    ops = "double3 xformOp:translate:pivot = (1, 0, 0)\nfloat xformOp:rotateZ = 90"
    order = '["xformOp:translate:pivot", "xformOp:rotateZ", "!invert!xformOp:translate:pivot"]'
    scene = load(placed(ops, order))
    np.testing.assert_allclose(centers(scene)["/X/C"], [1, -1, 0], atol=1e-6)  # turned about (1, 0, 0)


def test_reset_xform_stack_drops_the_ancestors():
    inner = placed("double3 xformOp:translate = (0, 7, 0)", '["!resetXformStack!", "xformOp:translate"]')
    scene = load(placed("double3 xformOp:translate = (3, 0, 0)", '["xformOp:translate"]', inner))
    np.testing.assert_allclose(centers(scene)["/X/X/C"], [0, 7, 0])


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -2, 1), (-1, -1, -3), (-1, -1, 1)])
def test_mirrored_solid_keeps_its_outside_out_and_its_normals_true(scale):
    ops = f"double3 xformOp:scale = {scale}"
    scene = load(placed(ops, '["xformOp:scale"]', 'def Sphere "S"\n{\n}\n'))
    check_invariants(scene)
    factors = np.array(scale, float)
    assert volume(scene) == pytest.approx(4 / 3 * np.pi * abs(np.prod(factors)), rel=0.01)
    gradient = corners(scene) / factors**2  # of the ellipsoid x^2/a^2 + y^2/b^2 + z^2/c^2
    expected = gradient / np.linalg.norm(gradient, axis=-1, keepdims=True)
    np.testing.assert_allclose(shading_normals(scene), expected, atol=1e-5)


def test_mirrored_single_sided_square_fronts_where_its_normal_is_carried():
    # mirrored in x: the winding turns over, but the front stays towards +Z; in z: the front goes to -Z
    for scale, front in (("(-1, 1, 1)", 1), ("(1, 1, -1)", -1)):
        mesh = f'def Mesh "M"\n{{{SQUARE}\nnormal3f[] normals = [(0, 0, 1)] (interpolation = "constant")\n}}\n'
        scene = load(placed(f"double3 xformOp:scale = {scale}", '["xformOp:scale"]', mesh))
        np.testing.assert_allclose(vector_areas(scene).sum(axis=0), [0, 0, front])
        np.testing.assert_allclose(shading_normals(scene), np.broadcast_to([0, 0, front], (2, 3, 3)))


def test_sheared_sphere_has_inverse_transpose_normals():
    matrix = "( (1, 0, 0, 0), (2, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )"
    scene = load(placed(f"matrix4d xformOp:transform = {matrix}", '["xformOp:transform"]', 'def Sphere "S"\n{\n}\n'))
    p = corners(scene)
    local = np.stack([p[..., 0] - 2 * p[..., 1], p[..., 1], p[..., 2]], axis=-1)
    gradient = np.stack([local[..., 0], local[..., 1] - 2 * local[..., 0], local[..., 2]], axis=-1)
    expected = gradient / np.linalg.norm(gradient, axis=-1, keepdims=True)
    np.testing.assert_allclose(shading_normals(scene), expected, atol=1e-5)


def test_flattening_scale_leaves_a_sheet_and_no_invalid_normals():
    scene = load(placed("double3 xformOp:scale = (1, 1, 0)", '["xformOp:scale"]', 'def Sphere "S"\n{\n}\n'))
    check_invariants(scene)
    assert area(scene) == pytest.approx(2 * np.pi, rel=0.01)


@pytest.mark.parametrize(
    ("ops", "words"),
    [
        ("double3 xformOp:translate = (nan, 0, 0)", ("/X", "transform is not finite")),
        ("double3 xformOp:translate = (inf, 0, 0)", ("/X", "transform is not finite")),
        ("double3 xformOp:translate = (1e30, 0, 0)", ("/X/C", "too far")),
    ],
)
def test_impossible_transforms_leave_the_prim_out_with_a_warning(ops, words):
    scene = load(placed(ops, '["xformOp:translate"]') + 'def Cube "Sound"\n{\n}\n')
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 12
    assert mentions(scene, *words)


ANIMATED = placed(
    "double3 xformOp:translate.timeSamples = {\n10: (1, 0, 0),\n20: (3, 0, 0),\n}", '["xformOp:translate"]'
)


@pytest.mark.parametrize(("time", "x"), [(None, 1), (10, 1), (15, 2), (20, 3), (99, 3), (0, 1)])
def test_time_samples_are_read_at_the_time(time, x):
    scene = load(ANIMATED, time=time)
    np.testing.assert_allclose(centers(scene)["/X/C"], [x, 0, 0])


def test_time_none_is_the_stages_start_time_code():
    scene = load("(\n    startTimeCode = 15\n    endTimeCode = 20\n)\n" + ANIMATED)
    np.testing.assert_allclose(centers(scene)["/X/C"], [2, 0, 0])


def test_points_with_samples_alone_are_read_without_a_time():
    square = SQUARE.replace(
        "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]",
        "point3f[] points.timeSamples = {\n5: [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)],\n}",
    )
    assert area(load(f'def Mesh "M"\n{{{square}}}\n')) == pytest.approx(2.0)


def test_invisible_prims_hide_everything_below_and_samples_decide():
    text = """def Xform "Hidden"
{
    token visibility = "invisible"
    def Cube "A"
    {
        token visibility = "inherited"
    }
    def SphereLight "L"
    {
    }
}
def Cube "Blinking"
{
    token visibility.timeSamples = {
        1: "invisible",
        2: "inherited",
    }
}
def Cube "Shown"
{
}
"""
    assert [prim.path for prim in load(text, time=1).prims] == ["/Shown"]
    scene = load(text, time=2)
    assert [prim.path for prim in scene.prims] == ["/Blinking", "/Shown"]
    assert not any(light.path == "/Hidden/L" for light in scene.lights)


PURPOSES = """def Cube "Default"
{
}
def Xform "Group"
{
    uniform token purpose = "proxy"
    def Cube "Proxy"
    {
    }
    def SphereLight "ProxyLight"
    {
    }
}
def Cube "Render"
{
    uniform token purpose = "render"
}
def Cube "Guide"
{
    uniform token purpose = "guide"
}
"""


@pytest.mark.parametrize(
    ("purposes", "expected"),
    [
        (("render",), ["/Default", "/Render"]),
        ((), ["/Default"]),
        (("proxy",), ["/Default", "/Group/Proxy"]),
        (("render", "proxy", "guide"), ["/Default", "/Group/Proxy", "/Render", "/Guide"]),
    ],
)
def test_purposes_are_inherited_and_default_is_always_rendered(purposes, expected):
    scene = load(PURPOSES, purposes=purposes)
    assert [prim.path for prim in scene.prims] == expected
    assert any(light.path == "/Group/ProxyLight" for light in scene.lights) == ("proxy" in purposes)


def test_unknown_purpose_is_a_config_error():
    with pytest.raises(ConfigError, match="proxies"):
        load(PURPOSES, purposes=("proxies",))


def test_inactive_abstract_and_undefined_prims_are_not_rendered():
    text = """def Cube "Off" (
    active = false
)
{
}
class Cube "Class"
{
}
over "Over"
{
    def Cube "C"
    {
    }
}
"""
    scene = load(text + 'def Cube "On"\n{\n}\n')
    assert [prim.path for prim in scene.prims] == ["/On"]


NESTED_INSTANCES = """class Xform "Leaf"
{
    def Cube "C"
    {
    }
    def SphereLight "L"
    {
    }
}
class Xform "Branch"
{
    def "Left" (
        instanceable = true
        inherits = </Leaf>
    )
    {
        double3 xformOp:translate = (0, 10, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def "Right" (
        instanceable = true
        inherits = </Leaf>
    )
    {
        double3 xformOp:translate = (0, 20, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
def "One" (
    instanceable = true
    inherits = </Branch>
)
{
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def "Two" (
    instanceable = true
    inherits = </Branch>
)
{
    double3 xformOp:scale = (-1, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}
"""


def test_nested_native_instances_stand_at_their_proxies_with_their_lights():
    scene = load(NESTED_INSTANCES)
    check_invariants(scene)
    found = centers(scene)
    assert list(found) == ["/One/Left/C", "/One/Right/C", "/Two/Left/C", "/Two/Right/C"]
    np.testing.assert_allclose(list(found.values()), [[100, 10, 0], [100, 20, 0], [0, 10, 0], [0, 20, 0]])
    assert volume(scene) == pytest.approx(4 * 8, rel=1e-4)
    assert [(light.path, light.center.tolist()) for light in scene.lights] == [
        ("/One/Left/L", [100, 10, 0]),
        ("/One/Right/L", [100, 20, 0]),
        ("/Two/Left/L", [0, 10, 0]),
        ("/Two/Right/L", [0, 20, 0]),
    ]


def instancer(more: str, prototypes: str = '["P"]', name: str = "I") -> str:
    return f"""def PointInstancer "{name}"
{{
    {more}
    rel prototypes = [</{name}/Protos/A>, </{name}/Protos/B>]
    def Scope "Protos"
    {{
        def Cube "A"
        {{
            double size = 1
            double3 xformOp:translate = (0, 0, 5)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
        def Xform "B"
        {{
            def Sphere "S"
            {{
            }}
            def SphereLight "L"
            {{
            }}
        }}
    }}
}}
"""


FOUR = """int[] protoIndices = [0, 1, 0, 0]
    point3f[] positions = [(1, 0, 0), (2, 0, 0), (3, 0, 0), (4, 0, 0)]
"""


def instance_centers(scene, path: str) -> np.ndarray:
    """Centres of the cubes of one prototype, shape (k, 3)."""
    index = [prim.path for prim in scene.prims].index(path)
    points = corners(scene)[scene.geometry.prims == index]
    return points.reshape(-1, 12 * 3, 3).mean(axis=1)


def test_point_instancer_places_its_prototypes_and_nothing_else():
    scene = load(instancer(FOUR))
    check_invariants(scene)
    assert [prim.path for prim in scene.prims] == ["/I/Protos/A", "/I/Protos/B/S"]
    points = corners(scene)[scene.geometry.prims == 0]
    assert len(points) == 3 * 12  # three instances of A, and no cube of its own
    lows = points.reshape(3, 36, 3).min(axis=1)
    np.testing.assert_allclose(lows, [[0.5, -0.5, 4.5], [2.5, -0.5, 4.5], [3.5, -0.5, 4.5]])
    assert [light.center.tolist() for light in scene.lights] == [[2, 0, 0]]


def test_point_instancer_orientations_scales_and_its_own_transform():
    more = """int[] protoIndices = [0]
    point3f[] positions = [(1, 0, 0)]
    quath[] orientations = [(0.70710678, 0.70710678, 0, 0)]
    float3[] scales = [(1, 1, 2)]
    double3 xformOp:translate = (0, 0, 100)
    uniform token[] xformOpOrder = ["xformOp:translate"]
"""
    scene = load(instancer(more))
    points = corners(scene).reshape(-1, 3)
    # 90 degrees about x takes the prototype's (0, 0, 5), scaled to (0, 0, 10), to (0, -10, 0)
    np.testing.assert_allclose(points.min(axis=0), [0.5, -11, 99.5], atol=0.02)
    np.testing.assert_allclose(points.max(axis=0), [1.5, -9, 100.5], atol=0.02)


def test_invisible_and_inactive_ids_are_left_out():
    more = FOUR + "int64[] ids = [10, 11, 12, 13]\nint64[] invisibleIds = [12]\n"
    scene = load(instancer(more).replace('def PointInstancer "I"', 'def PointInstancer "I" (\ninactiveIds = [13]\n)'))
    assert (scene.geometry.prims == 0).sum() == 12
    assert corners(scene)[scene.geometry.prims == 0][..., 0].min() == 0.5


def test_prototypes_may_stand_elsewhere_under_an_over_or_hidden():
    text = """def PointInstancer "I"
{
    int[] protoIndices = [0, 1]
    point3f[] positions = [(5, 0, 0), (9, 0, 0)]
    rel prototypes = [</Library/A>, </Hidden/B>]
}
over "Library"
{
    def Cube "A"
    {
    }
}
def Xform "Hidden"
{
    token visibility = "invisible"
    def Cube "B"
    {
    }
}
"""
    found = centers(load(text))
    np.testing.assert_allclose(found["/Library/A"], [5, 0, 0])
    np.testing.assert_allclose(found["/Hidden/B"], [9, 0, 0])


def test_nested_point_instancers_multiply():
    inner = """def PointInstancer "In"
            {
                int[] protoIndices = [0, 0, 0]
                point3f[] positions = [(0, 1, 0), (0, 2, 0), (0, 3, 0)]
                rel prototypes = [</Out/In/C>]
                def Cube "C"
                {
                    double size = 0.5
                }
            }
"""
    text = f"""def PointInstancer "Out"
{{
    int[] protoIndices = [0, 0]
    point3f[] positions = [(10, 0, 0), (20, 0, 0)]
    rel prototypes = [</Out/In>]
    {inner}
}}
"""
    scene = load(text)
    assert [prim.path for prim in scene.prims] == ["/Out/In/C"]
    lows = corners(scene).reshape(6, 36, 3).min(axis=1) + 0.25
    expected = [[x, y, 0] for x in (10, 20) for y in (1, 2, 3)]
    np.testing.assert_allclose(sorted(lows.tolist()), expected, atol=1e-6)


def test_native_instances_inside_prototypes_are_found():
    text = """class Xform "Leaf"
{
    def Cube "C"
    {
    }
}
def PointInstancer "I"
{
    int[] protoIndices = [0]
    point3f[] positions = [(4, 0, 0)]
    rel prototypes = [</I/P>]
    def Xform "P"
    {
        def "Use" (
            instanceable = true
            inherits = </Leaf>
        )
        {
        }
    }
}
"""
    np.testing.assert_allclose(centers(load(text))["/I/P/Use/C"], [4, 0, 0])


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("int[] protoIndices = [0, 7]\npoint3f[] positions = [(1, 0, 0), (2, 0, 0)]", ("1 instances", "2 prototypes")),
        ("int[] protoIndices = [0, 0]\npoint3f[] positions = [(1, 0, 0), (nan, 0, 0)]", ("1 instances", "not finite")),
        ("int[] protoIndices = [0, 0]\npoint3f[] positions = [(1, 0, 0), (1e30, 0, 0)]", ("1 of its instances", "far")),
    ],
)
def test_broken_instances_are_left_out_with_a_warning(more, words):
    scene = load(instancer(more))
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 12
    assert mentions(scene, "/I", *words), scene.warnings


def test_instancer_with_positions_missing_is_left_out_with_a_warning():
    scene = load(instancer("int[] protoIndices = [0, 0]\npoint3f[] positions = [(1, 0, 0)]") + 'def Cube "C"\n{\n}\n')
    assert [prim.path for prim in scene.prims] == ["/C"]
    assert mentions(scene, "/I:", "2 protoIndices")


def test_instancer_that_is_its_own_prototype_ends():
    text = instancer(FOUR).replace("</I/Protos/B>", "</I>")
    scene = load(text)
    assert mentions(scene, "/I", "own prototypes")
    assert [prim.path for prim in scene.prims] == ["/I/Protos/A"]


def test_instances_beyond_32_bit_indices_are_an_error_not_a_crash():
    text = f"""def PointInstancer "I"
{{
    int[] protoIndices = {[0] * 4000}
    point3f[] positions = {[(i, 0, 0) for i in range(4000)]}
    rel prototypes = [</I/P>]
    def Xform "P"
    {{
        def Cube "C"
        {{
        }}
    }}
}}
"""
    assert len(load(text).geometry.triangles) == 48000
    import warpmis.usd.placing as placing

    with pytest.MonkeyPatch.context() as patch, pytest.raises(StageError, match=r"/I/P/C.*flattened"):
        patch.setattr(placing, "MAX_ROWS", 10000)
        load(text)
