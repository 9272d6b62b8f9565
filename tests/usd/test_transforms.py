"""Transforms of prims and their time samples."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import (
    SQUARE,
    area,
    centers,
    check_invariants,
    corners,
    load,
    mentions,
    shading_normals,
    vector_areas,
    volume,
)


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
