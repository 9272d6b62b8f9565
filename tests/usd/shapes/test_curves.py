"""UsdGeomBasisCurves: segments, positions, widths, tubes and ribbons."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline
from usd.stages import area, check_invariants, corners, load, mentions, shading_normals, vector_areas

from warpmis.usd.shapes import curves as curves_module
from warpmis.usd.shapes.curve_segments import cut, segment_counts
from warpmis.usd.shapes.transported_normals import transported_normals, unit

PIECES, SIDES = 8, 8  # at complexity "high"


def curves(
    points, counts=None, kind="cubic", basis="bspline", wrap="nonperiodic", more="float[] widths = [0.2]"
) -> str:
    points = np.asarray(points, float)
    counts = [len(points)] if counts is None else counts
    return f"""def BasisCurves "C"
{{
    uniform token type = "{kind}"
    uniform token basis = "{basis}"
    uniform token wrap = "{wrap}"
    int[] curveVertexCounts = {counts}
    point3f[] points = {[tuple(p) for p in points.tolist()]}
    {more}
}}
"""


def rings(scene, sides=SIDES):
    """The tube's rings, shape (r, sides, 3)."""
    return scene.geometry.points.reshape(-1, sides, 3).astype(np.float64)


def centres(scene, sides=SIDES):
    return rings(scene, sides).mean(axis=1)


# The schema's table: wrap, type or basis, curveVertexCounts, segments, varying values.
TABLE = [
    ("nonperiodic", "linear", [2, 3, 2, 5], [1, 2, 1, 4], [2, 3, 2, 5]),
    ("nonperiodic", "bezier", [4, 7, 10, 4, 7], [1, 2, 3, 1, 2], [2, 3, 4, 2, 3]),
    ("nonperiodic", "bspline", [5, 4, 6, 7], [2, 1, 3, 4], [3, 2, 4, 5]),
    ("periodic", "bezier", [6, 9, 6], [2, 3, 2], [2, 3, 2]),
    ("periodic", "linear", [3, 7], [3, 7], [3, 7]),
    ("pinned", "catmullRom", [2, 5], [1, 4], [2, 5]),
]


@pytest.mark.parametrize(("wrap", "basis", "counts", "segments", "varying"), TABLE)
def test_segments_and_varying_values_are_the_schemas(wrap, basis, counts, segments, varying):
    np.testing.assert_array_equal(segment_counts(np.array(counts), basis, wrap), segments)
    found = cut(np.array(counts), basis, wrap)
    np.testing.assert_array_equal(np.bincount(found.curve), segments)
    assert found.elements["varying"] == sum(varying)
    assert found.varying_rows.max() == sum(varying) - 1


CONTROL = np.array([[0, 0, 0], [1, 2, 0], [2, -1, 1], [4, 0, 0.5], [5, 1, 0], [6, 1, -1], [7, 0, 0]], float)


def bernstein(p, t):
    return sum(
        weight[:, None] * p[i]
        for i, weight in enumerate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    )


def test_bspline_lies_on_the_spline():
    found = centres(load(curves(CONTROL)))
    t = np.linspace(3, 7, 4 * PIECES + 1)
    np.testing.assert_allclose(found, BSpline(np.arange(11.0), CONTROL, 3)(t), atol=1e-5)


def test_bezier_lies_on_the_curve_and_has_a_ring_on_each_side_of_a_kink():
    found = centres(load(curves(CONTROL, basis="bezier")))
    t = np.linspace(0, 1, PIECES + 1)
    expected = np.concatenate([bernstein(CONTROL[:4], t), bernstein(CONTROL[3:], t)])
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_catmull_rom_passes_its_points_and_pinned_ones_all():
    inner = centres(load(curves(CONTROL, basis="catmullRom")))
    np.testing.assert_allclose(inner[::PIECES], CONTROL[1:-1], atol=1e-5)
    pinned = centres(load(curves(CONTROL, basis="catmullRom", wrap="pinned")))
    np.testing.assert_allclose(pinned[::PIECES], CONTROL, atol=1e-5)


def test_pinned_bspline_begins_and_ends_at_its_points():
    found = centres(load(curves(CONTROL, wrap="pinned")))
    np.testing.assert_allclose(found[[0, -1]], CONTROL[[0, -1]], atol=1e-5)


def test_straight_tube_is_a_prism_with_its_front_outside():
    scene = load(curves([[1, 2, 3], [1, 2, 7]], kind="linear"))
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 2 * SIDES
    assert area(scene) == pytest.approx(4 * SIDES * 2 * 0.1 * np.sin(np.pi / SIDES), rel=1e-6)
    outwards = (corners(scene) - [1, 2, 0])[..., :2] / 0.1
    np.testing.assert_allclose(shading_normals(scene)[..., :2], outwards, atol=1e-5)
    assert (np.einsum("fi,fi->f", vector_areas(scene)[:, :2], outwards.mean(axis=1)) > 0).all()


def test_left_handed_tube_has_its_front_inside():
    right = load(curves([[0, 0, 0], [0, 0, 1]], kind="linear"))
    left = load(
        curves(
            [[0, 0, 0], [0, 0, 1]], kind="linear", more='uniform token orientation = "leftHanded"\nfloat[] widths=[1]'
        )
    )
    inwards = np.einsum("fi,fi->f", vector_areas(left), corners(left).mean(axis=1) - [0, 0, 0.5])
    outwards = np.einsum("fi,fi->f", vector_areas(right), corners(right).mean(axis=1) - [0, 0, 0.5])
    assert inwards.max() < 0 < outwards.min()


@pytest.mark.parametrize(
    ("kind", "basis", "points"),
    [
        ("linear", "bezier", [[1, 0, 0], [0, 1, 0.5], [-1, 0, 0], [0, -1, -0.5]]),
        ("cubic", "bspline", [[1, 0, 0], [0, 1, 1], [-1, 0, 0], [0, -1, 1], [1, -1, 2]]),
        ("cubic", "catmullRom", [[1, 0, 0], [0, 1, 1], [-1, 0, 0], [0, -1, 1]]),
        ("cubic", "bezier", [[1, 0, 0], [1, 1, 1], [-1, 1, 0], [-1, 0, 0], [-1, -1, 0], [1, -1, -1]]),
    ],
)
def test_closed_curve_is_a_closed_surface(kind, basis, points):
    scene = load(curves(points, kind=kind, basis=basis, wrap="periodic"))
    check_invariants(scene)
    t = scene.geometry.triangles
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    _, number = np.unique(edges, axis=0, return_counts=True)
    assert (number == 2).all()
    # no ring is turned against the next: every side stays beside its own
    ring = rings(scene)
    step = np.linalg.norm(np.diff(np.concatenate([ring, ring[:1]]), axis=0), axis=-1)
    centre = np.linalg.norm(np.diff(np.concatenate([ring, ring[:1]]).mean(axis=1), axis=0), axis=-1)
    assert (step < centre[:, None] + 0.15).all()  # a half-turned ring would be 0.2 away


WIDTHS = {
    "constant": ("[0.2]", np.full(2 * PIECES + 1, 0.2)),
    "uniform": ("[0.2]", np.full(2 * PIECES + 1, 0.2)),
    # two segments: values at their ends, linear between
    "varying": ("[0.2, 0.4, 0.2]", np.interp(np.linspace(0, 2, 2 * PIECES + 1), [0, 1, 2], [0.2, 0.4, 0.2])),
    # a straight line of control values is one of the spline
    "vertex": ("[0.1, 0.2, 0.3, 0.4, 0.5]", np.linspace(0.2, 0.4, 2 * PIECES + 1)),
}


@pytest.mark.parametrize("interpolation", WIDTHS)
def test_widths_are_diameters_by_their_interpolation(interpolation):
    values, expected = WIDTHS[interpolation]
    scene = load(
        curves([[k, 0, 0] for k in range(5)], more=f'float[] widths = {values} (interpolation = "{interpolation}")')
    )
    ring = rings(scene)
    np.testing.assert_allclose(np.linalg.norm(ring[..., 1:], axis=-1) * 2, np.tile(expected[:, None], SIDES), atol=1e-6)


def test_uniform_widths_and_triangles_belong_to_their_curves():
    points = [[0, 0, 0], [1, 0, 0], [0, 5, 0], [1, 5, 0], [2, 5, 0]]
    text = curves(points, [2, 3], "linear", more='float[] widths = [0.2, 0.6] (interpolation = "uniform")')
    scene = load(text)
    radius = np.linalg.norm(corners(scene)[..., 1:] - np.round(corners(scene)[..., 1:] / 5) * 5, axis=-1)
    second = corners(scene)[..., 1].mean(axis=1) > 2.5
    np.testing.assert_allclose(radius, np.where(second, 0.3, 0.1)[:, None] * np.ones(3), atol=1e-6)
    assert second.sum() == 2 * (len(second) - second.sum())  # the middle vertex is no kink: one ring


def test_tube_keeps_its_width_at_a_kink():
    """Both arms are whole cylinders, with a bevel between."""
    scene = load(curves([[0, 0, 0], [1, 0, 0], [1, 1, 0]], kind="linear"))
    ring = rings(scene)
    assert len(ring) == 4
    np.testing.assert_allclose(np.linalg.norm(ring[:2, :, 1:], axis=-1), 0.1, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(ring[2:, :, [0, 2]] - [1, 0], axis=-1), 0.1, atol=1e-6)


def test_frames_follow_a_helix_without_twist():
    angle = np.linspace(0, 20, 400)
    tangents = unit(np.stack([-np.sin(angle), np.cos(angle), 0.5 + 0 * angle], axis=-1))
    first = np.zeros(400, np.int64)
    following = np.append(np.arange(1, 400), -1)
    normals = transported_normals(tangents, first, following)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    np.testing.assert_allclose(np.einsum("ij,ij->i", normals, tangents), 0.0, atol=1e-9)
    # parallel transport: what changes of a normal is along the tangent alone
    change = np.diff(normals, axis=0)
    middle = unit(tangents[1:] + tangents[:-1])
    along = np.einsum("ij,ij->i", change, middle)[:, None] * middle
    np.testing.assert_allclose(change, along, atol=1e-9)


def test_frames_of_a_closed_curve_spread_what_is_left_of_the_turn():
    """Tangents round a cone of half angle 45 degrees come back turned by the cone's solid angle, 1.84."""
    angle = 2 * np.pi * np.arange(100) / 100
    tangents = np.stack([np.cos(angle), np.sin(angle), 0 * angle + 1], axis=-1) / np.sqrt(2)
    following = np.append(np.arange(1, 100), 0)
    normals = transported_normals(tangents, np.zeros(100, np.int64), following)
    onwards = np.einsum("ij,ij->i", normals, normals[following])
    ring_step = np.einsum("ij,ij->i", tangents, tangents[following])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert np.arccos(np.clip(onwards, -1, 1)).max() < np.arccos(ring_step.min()) + 1.01 * 1.84 / 100


def test_frame_survives_a_reversal():
    tangents = np.array([[0, 0, 1.0], [0, 0, -1.0], [0, 0, 1.0]])
    normals = transported_normals(tangents, np.zeros(3, np.int64), np.array([1, 2, -1]))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    np.testing.assert_allclose(normals[:, 2], 0.0, atol=1e-12)


def test_normals_make_a_ribbon_that_faces_them():
    more = 'float[] widths = [0.5]\nnormal3f[] normals = [(0, 3, 4)] (interpolation = "constant")'
    scene = load(curves([[0, 0, 0], [1, 0, 0]], kind="linear", more=more))
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 2
    assert area(scene) == pytest.approx(0.5)
    np.testing.assert_allclose(vector_areas(scene), [[0, 0.15, 0.2]] * 2, atol=1e-6)
    np.testing.assert_allclose(shading_normals(scene), np.broadcast_to([0, 0.6, 0.8], (2, 3, 3)), atol=1e-6)


def test_ribbon_turns_with_its_normals():
    normals = "normal3f[] normals = [(0, 1, 0), (0, 0, 1)]"
    more = f'float[] widths = [0.5]\n{normals} (interpolation = "varying")'
    scene = load(curves([[0, 0, 0], [1, 0, 0]], kind="linear", more=more))
    x = corners(scene)[..., 0]
    turning = np.stack([0 * x, 1 - x, x], axis=-1)
    expected = turning / np.linalg.norm(turning, axis=-1, keepdims=True)
    np.testing.assert_allclose(shading_normals(scene), expected, atol=1e-6)


@pytest.mark.parametrize(("complexity", "triangles"), [("low", 2 * 4), ("medium", 4 * 6), ("veryhigh", 12 * 12)])
def test_complexity_says_how_fine(complexity, triangles):
    assert len(load(curves(CONTROL[:4]), complexity=complexity).geometry.triangles) == 2 * triangles


@pytest.mark.parametrize(("most", "triangles"), [(1000, 2 * 8 * 8), (100, 2 * 4 * 6), (20, 2 * 2 * 4), (10, 2 * 3)])
def test_many_curves_are_rendered_in_less_detail(monkeypatch, most, triangles):
    monkeypatch.setattr(curves_module, "MAX_TRIANGLES", most)
    scene = load(curves(CONTROL[:4]))
    assert len(scene.geometry.triangles) == triangles
    assert mentions(scene, "/C", "less detail") == (most < 1000)


BROKEN = {
    "counts": (curves(CONTROL, [4, 4]), ("add up to 8", "first 1 curves"), 1),
    "numbers that do not fit": (curves(CONTROL, [4, 3]), ("1 curves left out", "do not fit"), 1),
    "nan": (curves(np.where(np.arange(7)[:, None] == 5, np.nan, CONTROL), [2, 2, 3], "linear"),
            ("1 curves left out", "not finite"), 2),
    "widths": (curves(CONTROL[:4], more="float[] widths = [1, 2, 3]"), ("3 vertex widths left out: 4",), 1),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_curves_keep_what_is_sound_and_warn(case):
    text, words, number = BROKEN[case]
    scene = load(text)
    check_invariants(scene)
    assert len(scene.geometry.triangles)
    assert mentions(scene, "/C", *words), scene.warnings
    first_ring_only = np.unique(np.round(corners(scene)[..., 0].min(axis=1), 3))
    assert len(first_ring_only) >= number


@pytest.mark.parametrize("points", [[[0, 0, 0]] * 4, [[0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1]]])
@pytest.mark.parametrize("basis", ["bezier", "bspline", "catmullRom"])
def test_points_that_coincide_give_no_nan(basis, points):
    scene = load(curves(points, basis=basis) + 'def Cube "K"\n{\n}\n')
    check_invariants(scene)


def test_curve_that_turns_back_on_itself_keeps_its_normals_in_front():
    """The bevel's slivers are at right angles to their normals, but for rounding."""
    points = [[0, 2, 1], [1, 2, 1], [0, 0, 0], [2, 1, 0], [1, 0, 2], [1, 0, 2], [2, 1, 0]]
    check_invariants(load(curves(points, [1, 6], "linear", more="")))


def test_coinciding_linear_points_change_nothing():
    once = load(curves([[0, 0, 0], [0, 0, 1]], kind="linear"))
    twice = load(curves([[0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1]], kind="linear"))
    np.testing.assert_array_equal(np.unique(once.geometry.points, axis=0), np.unique(twice.geometry.points, axis=0))
