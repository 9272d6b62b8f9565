"""Native instances and point instancers."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import (
    centers,
    check_invariants,
    corners,
    load,
    mentions,
    volume,
)

from warpmis.errors import StageError

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
