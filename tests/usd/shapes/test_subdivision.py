"""Refinement against closed forms: limits, creases, borders, and the way of primvars. No stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from warpmis.usd.shapes.refined_mesh import equal_rows
from warpmis.usd.shapes.subdiv.masks import BILINEAR, CATMULL_CLARK, CATMULL_CLARK_SMOOTH_TRIANGLES, LOOP
from warpmis.usd.shapes.subdiv.normals import smooth_sectors
from warpmis.usd.shapes.subdiv.refinement import Refinement
from warpmis.usd.shapes.subdiv.topology import edge_table

CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
CUBE_QUADS = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
RNG = np.random.default_rng(7)


def cage_of(faces, points, sharp_edges=(), sharp_vertices=()):
    """A topology of equal faces; sharp_edges holds (vertex, vertex, sharpness), sharp_vertices (vertex, sharpness)."""
    faces = np.asarray(faces)
    cage = edge_table(np.full(len(faces), faces.shape[1]), faces.reshape(-1), points)
    edges, vertices = cage.edge_sharpness.copy(), cage.vertex_sharpness.copy()
    for a, b, sharpness in sharp_edges:
        edges[(np.sort(cage.ends, axis=1) == sorted((a, b))).all(axis=1)] = sharpness
    for vertex, sharpness in sharp_vertices:
        vertices[vertex] = sharpness
    return replace(cage, edge_sharpness=edges, vertex_sharpness=vertices)


def grid(n):
    """Quads of an n x n grid of vertices, vertex number x + n y, and their positions (x, y, 0)."""
    i = np.arange(n * n).reshape(n, n)
    quads = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4)
    y, x = np.divmod(np.arange(n * n), n)
    return quads, np.stack([x, y, 0 * x], axis=-1).astype(float)


def star(n):
    """n quads about vertex 0: neighbours 1..n, corners opposite n+1..2n."""
    k = np.arange(n)
    return np.stack([0 * k, 1 + k, 1 + n + k, 1 + (k + 1) % n], axis=-1)


def fan(n):
    """n triangles about vertex 0."""
    k = np.arange(n)
    return np.stack([0 * k, 1 + k, 1 + (k + 1) % n], axis=-1)


# ---- Catmull-Clark ------------------------------------------------------------------------------------------------


def test_cube_after_one_step():
    cage = cage_of(CUBE_QUADS, 8)
    refined = CATMULL_CLARK.refine(cage, CUBE)
    np.testing.assert_allclose(refined[0], [2 / 9] * 3)  # (Q + 2R + (n - 3)S) / n with Q = 1/3, R = 1/6, S = 0
    edge = 8 + int(np.flatnonzero((cage.ends == [0, 1]).all(axis=1))[0])
    np.testing.assert_allclose(refined[edge], [1 / 2, 1 / 8, 1 / 8])
    np.testing.assert_allclose(refined[20], [0.5, 0.5, 0.0])


@pytest.mark.parametrize("levels", [1, 2, 4])
def test_cube_converges_to_the_same_points_from_every_level(levels):
    refinement = Refinement(cage_of(CUBE_QUADS, 8), CATMULL_CLARK, levels)
    limit = refinement.points(CUBE)
    np.testing.assert_allclose(limit[:8], 0.25 + 0.5 * CUBE)
    assert len(refinement.finest.counts) == 6 * 4**levels
    assert np.linalg.norm(limit - 0.5, axis=1).min() == pytest.approx(0.4197530864)  # 34/81, at the faces' middles


def test_regular_vertex_has_the_limit_of_a_bicubic_spline():
    quads, points = grid(5)
    points[:, 2] = RNG.random(25)
    limit = Refinement(cage_of(quads, 25), CATMULL_CLARK, 2).points(points)
    window = points[:, 2].reshape(5, 5)[1:4, 1:4]
    spline = np.array([1, 4, 1]) / 6
    assert limit[12, 2] == pytest.approx(spline @ window @ spline)


@pytest.mark.parametrize("n", [3, 5, 7, 12])
@pytest.mark.parametrize("levels", [1, 3])
def test_extraordinary_vertex_has_its_limit_mask(n, levels):
    points = RNG.random((2 * n + 1, 3))
    limit = Refinement(cage_of(star(n), 2 * n + 1), CATMULL_CLARK, levels).points(points)
    mask = (n**2 * points[0] + 4 * points[1 : n + 1].sum(axis=0) + points[n + 1 :].sum(axis=0)) / (n * (n + 5))
    np.testing.assert_allclose(limit[0], mask)


def test_normals_inside_are_those_of_the_spline():
    """Heights x^2 at the control points give the surface x^2 + 1/3, whose normal is (-2x, 0, 1)."""
    quads, points = grid(7)
    points[:, 2] = points[:, 0] ** 2
    refinement = Refinement(cage_of(quads, 49), CATMULL_CLARK, 2)
    limit, (normals, rows) = refinement.surface(points)
    np.testing.assert_array_equal(rows, refinement.finest.indices)
    inside = ((limit[:, :2] > 1.5) & (limit[:, :2] < 4.5)).all(axis=1)
    assert inside.sum() > 100
    np.testing.assert_allclose(limit[inside, 2], limit[inside, 0] ** 2 + 1 / 3)
    slopes = normals[inside] / normals[inside, 2:]
    np.testing.assert_allclose(slopes[:, 0], -2 * limit[inside, 0], atol=1e-9)
    np.testing.assert_allclose(slopes[:, 1], 0, atol=1e-9)
    assert (normals[inside, 2] > 0).all()


@pytest.mark.parametrize("n", [3, 5, 8])
@pytest.mark.parametrize("scheme", [CATMULL_CLARK, LOOP])
def test_normal_of_an_extraordinary_vertex_is_the_same_from_every_level(scheme, n):
    """Only the true tangents are: any other weights of the ring turn with the levels."""
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = RNG.random((2 * n + 1, 3)) * 0.6
    points[1 : n + 1, :2] += ring
    points[n + 1 :, :2] += 1.5 * ring
    faces, used = (star(n), points) if scheme is CATMULL_CLARK else (fan(n), points[: n + 1])
    normals = []
    for levels in (1, 2, 5):
        _, (values, _) = Refinement(cage_of(faces, len(used)), scheme, levels).surface(used)
        normals.append(values[0] / np.linalg.norm(values[0]))
    assert normals[0][2] > 0.5
    np.testing.assert_allclose(normals[1:], [normals[0]] * 2, atol=1e-9)


def test_smooth_triangle_rule_weighs_a_triangles_middle_at_its_edges_by_047():
    cage = cage_of([[0, 1, 2], [1, 0, 3]], 4)
    points = np.eye(4)
    edge = 4 + int(np.flatnonzero((cage.ends == [0, 1]).all(axis=1))[0])
    refined = CATMULL_CLARK_SMOOTH_TRIANGLES.refine(cage, points)
    # (1 - 2 * 0.47) / 2 for each end, 0.47 for each of the two means over three corners
    np.testing.assert_allclose(refined[edge], [0.03 + 0.94 / 3, 0.03 + 0.94 / 3, 0.47 / 3, 0.47 / 3])
    np.testing.assert_allclose(CATMULL_CLARK.refine(cage, points)[edge], [5 / 12, 5 / 12, 1 / 12, 1 / 12])


# ---- Loop ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "beta"), [(3, 3 / 16), (4, 31 / 256), (6, 1 / 16)])
@pytest.mark.parametrize("levels", [1, 3])
def test_loop_vertex_has_its_limit_mask(n, beta, levels):
    points = RNG.random((n + 1, 3))
    limit = Refinement(cage_of(fan(n), n + 1), LOOP, levels).points(points)
    share = 1 / (n + 3 / (8 * beta))
    np.testing.assert_allclose(limit[0], (1 - n * share) * points[0] + share * points[1:].sum(axis=0))


def test_loop_edge_is_three_eighths_of_its_ends():
    cage = cage_of([[0, 1, 2], [1, 0, 3]], 4)
    edge = 4 + int(np.flatnonzero((cage.ends == [0, 1]).all(axis=1))[0])
    np.testing.assert_allclose(LOOP.refine(cage, np.eye(4))[edge], [3 / 8, 3 / 8, 1 / 8, 1 / 8])


# ---- creases, corners, borders ------------------------------------------------------------------------------------


def test_sharp_crease_is_the_spline_of_its_own_vertices():
    top = [4, 5, 7, 6]
    creases = [(a, b, np.inf) for a, b in zip(top, top[1:] + top[:1], strict=True)]
    limit = Refinement(cage_of(CUBE_QUADS, 8, creases), CATMULL_CLARK, 3).points(CUBE)
    np.testing.assert_allclose(limit[4], [1 / 6, 1 / 6, 1])  # (4 P + the two neighbours on the crease) / 6
    assert (limit[:4, 2] > 0.2).all()  # the other end is as round as before


def test_semi_sharp_edge_is_mixed_by_its_sharpness():
    def edge_point(sharpness):
        cage = cage_of(CUBE_QUADS, 8, [(0, 1, sharpness)])
        return CATMULL_CLARK.refine(cage, CUBE)[8 + int(np.flatnonzero((cage.ends == [0, 1]).all(axis=1))[0])]

    np.testing.assert_allclose(edge_point(0.25), 0.25 * edge_point(5.0) + 0.75 * edge_point(0.0))
    np.testing.assert_allclose(edge_point(5.0), [0.5, 0, 0])


def test_semi_sharp_vertex_is_mixed_by_the_sharpness_it_loses():
    def vertex(first, second, own=0.0):
        cage = cage_of(CUBE_QUADS, 8, [(0, 1, first), (0, 2, second)], [(0, own)])
        return CATMULL_CLARK.refine(cage, CUBE)[0]

    smooth, crease = np.full(3, 2 / 9), np.array([1 / 8, 1 / 8, 0])
    np.testing.assert_allclose(vertex(3.0, 3.0), crease)
    np.testing.assert_allclose(vertex(0.4, 0.8), 0.6 * crease + 0.4 * smooth)
    np.testing.assert_allclose(vertex(3.0, 0.5), 0.5 * crease + 0.5 * smooth)  # a dart is smooth
    np.testing.assert_allclose(vertex(3.0, 3.0, own=0.25), 0.75 * crease)  # the corner is the origin
    np.testing.assert_allclose(vertex(0.4, 3.0, own=0.8), 0.4 * smooth)  # (0.4 + 0.8) / 2 is lost


def test_semi_sharpness_lasts_as_many_levels_as_it_has():
    """Sharpness 2 does for two levels what an infinite one does, and then the edge is smooth."""
    edges = [(a, b) for a in range(8) for b in range(a) if np.abs(CUBE[a] - CUBE[b]).sum() == 1]

    def refined(sharpness, levels):
        cage, points = cage_of(CUBE_QUADS, 8, [(*edge, sharpness) for edge in edges]), CUBE
        for _ in range(levels):
            points, cage = CATMULL_CLARK.refine(cage, points), CATMULL_CLARK.split(cage)
        return points

    np.testing.assert_allclose(refined(2.0, 2), refined(np.inf, 2))
    np.testing.assert_allclose(refined(2.0, 3)[0], [2 / 9 / 4] * 3)  # a cube's corner of quarter the size


def test_sharp_vertex_and_a_vertex_of_three_creases_stay():
    three = [(0, 1, np.inf), (0, 2, np.inf), (0, 4, np.inf)]
    for cage in (cage_of(CUBE_QUADS, 8, (), [(0, np.inf)]), cage_of(CUBE_QUADS, 8, three)):
        limit = Refinement(cage, CATMULL_CLARK, 3).points(CUBE)
        np.testing.assert_allclose(limit[0], [0, 0, 0])
        np.testing.assert_allclose(limit[7], [0.75] * 3, atol=1e-2)


@pytest.mark.parametrize("scheme", [CATMULL_CLARK, LOOP])
def test_border_is_a_cubic_spline(scheme):
    quads, points = grid(6)
    points += RNG.random(points.shape) * 0.4
    faces = quads if scheme is CATMULL_CLARK else quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    refinement = Refinement(cage_of(faces, 36), scheme, 3)
    limit, finest = refinement.points(points), refinement.finest
    on_border = np.unique(finest.ends[finest.edge_faces == 1])
    spline = BSpline(np.arange(10.0), points[:6], 3)(np.linspace(4, 5, 9))  # vertex 1 is at 3, vertex 2 at 4
    distance = np.linalg.norm(limit[on_border, None] - spline, axis=-1).min(axis=0)
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)


def test_edges_of_three_faces_and_of_faces_wound_against_each_other_are_sharp():
    book = cage_of([[0, 1, 2, 3], [1, 0, 4, 5], [1, 0, 6, 7]], 8)
    assert book.edge_sharpness[(book.ends == [0, 1]).all(axis=1)] == np.inf
    wrong = cage_of([[0, 1, 2, 3], [0, 1, 4, 5]], 6)
    assert wrong.edge_sharpness[(wrong.ends == [0, 1]).all(axis=1)] == np.inf


def test_normals_break_at_creases():
    edges = [(a, b, np.inf) for a in range(8) for b in range(a) if np.abs(CUBE[a] - CUBE[b]).sum() == 1]
    refinement = Refinement(cage_of(CUBE_QUADS, 8, edges), CATMULL_CLARK, 2)
    _, (normals, rows) = refinement.surface(CUBE)
    fronts = np.array([[0, 0, -1], [0, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]])
    corners = normals[rows] / np.linalg.norm(normals[rows], axis=1, keepdims=True)
    np.testing.assert_allclose(corners, fronts[refinement.parents[refinement.finest.faces]], atol=1e-12)


def test_a_crease_that_ends_does_not_part_the_corners_at_its_end():
    quads, _ = grid(5)
    cage = cage_of(quads, 25, [(11, 12, np.inf), (12, 13, np.inf)])
    sectors, _ = smooth_sectors(cage)
    number = [len(np.unique(sectors[cage.indices == vertex])) for vertex in (11, 12, 13, 7)]
    assert number == [1, 2, 1, 1]


# ---- values other than points -------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [CATMULL_CLARK, CATMULL_CLARK_SMOOTH_TRIANGLES, LOOP, BILINEAR])
def test_weights_sum_to_one(scheme):
    """Ones stay ones and an affine map of the cage is one of the limit, creases and borders and all."""
    quads, points = grid(5)
    faces = quads if scheme is BILINEAR else quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    points = RNG.random(points.shape)
    creases = [(6, 7, 1.3), (7, 8, 0.4), (12, 13, np.inf), (13, 18, 2.0)]
    refinement = Refinement(cage_of(faces, 25, creases, [(7, 0.7), (22, 1.5)]), scheme, 3)
    np.testing.assert_allclose(refinement.points(np.ones((25, 1))), 1.0)
    matrix = RNG.random((3, 3))
    np.testing.assert_allclose(refinement.points(points @ matrix + 1), refinement.points(points) @ matrix + 1)


def test_varying_is_linear_where_points_are_smooth():
    quads, points = grid(3)
    refinement = Refinement(cage_of(quads, 9), CATMULL_CLARK, 2)
    values = np.zeros((9, 1))
    values[4] = 1.0  # a tent in bilinear, (4/6)^2 of a spline
    assert refinement.varying(values).max() == 1.0
    assert refinement.points(values).max() == pytest.approx(16 / 36)
    middle = refinement.varying(points)
    np.testing.assert_allclose(np.unique(middle[:, 0]), np.arange(9) / 4)


def corners_of(refinement, values, rows):
    refined, at = refinement.face_varying(values, rows)
    assert at.shape == refinement.finest.indices.shape
    return refined[at]


@pytest.mark.parametrize("linear", ["none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries"])
def test_face_varying_without_seams_is_refined_as_the_points_are(linear):
    cage = cage_of(CUBE_QUADS, 8, [(0, 1, 1.5)], [(7, np.inf)])
    refinement = Refinement(cage, CATMULL_CLARK, 2, linear)
    expected = refinement.points(CUBE)[refinement.finest.indices]
    np.testing.assert_allclose(corners_of(refinement, CUBE, cage.indices), expected)


def test_face_varying_all_is_bilinear_in_every_face():
    quads, _ = grid(4)
    refinement = Refinement(cage_of(quads, 16), CATMULL_CLARK, 2, "all")
    values = RNG.random((9 * 4, 1))
    refined = corners_of(refinement, values, np.arange(36)).reshape(9, 16, 4)
    np.testing.assert_allclose(refined[:, 0, 0], values.reshape(9, 4)[:, 0])
    np.testing.assert_allclose(refined[:, 0, 2], (np.array([9, 3, 1, 3]) / 16 * values.reshape(9, 4)).sum(axis=1))


@pytest.mark.parametrize("linear", ["cornersOnly", "cornersPlus1", "cornersPlus2"])
def test_seams_keep_two_islands_apart(linear):
    """Texture coordinates of a regular grid, moved by 10 right of a seam, stay affine on both sides."""
    quads, points = grid(5)
    right = quads.min(axis=1) % 5 >= 2
    values = np.concatenate([points[:, :2], points[:, :2] + 10])
    cage = cage_of(quads, 25, (), [(corner, np.inf) for corner in (0, 4, 20, 24)])
    refinement = Refinement(cage, CATMULL_CLARK, 2, linear)
    refined = corners_of(refinement, values, (quads + 25 * right[:, None]).reshape(-1))
    expected = refinement.points(points)[refinement.finest.indices][:, :2]
    moved = right[refinement.parents[refinement.finest.faces]]
    np.testing.assert_allclose(refined - 10 * moved[:, None], expected, atol=1e-12)


# What a value of 1 at the middle of a 3 x 3 grid has as its limit there, by the faces that share it there.
ISLANDS = {
    # two rows of two faces: a seam through the middle
    "seam": ([0, 0, 1, 1], {"none": 4 / 6, "cornersOnly": 4 / 6, "cornersPlus1": 4 / 6, "boundaries": 1.0}),
    # one face against three: a corner, and a concave one
    "corner": ([0, 1, 1, 1], {"none": 4 / 6, "cornersOnly": 1.0, "cornersPlus1": 1.0, "cornersPlus2": 1.0}),
    "concave": ([1, 0, 0, 0], {"cornersOnly": 4 / 6, "cornersPlus1": 4 / 6, "cornersPlus2": 1.0, "boundaries": 1.0}),
    # three islands, of which the first has two faces
    "junction": ([0, 0, 1, 2], {"cornersOnly": 4 / 6, "cornersPlus1": 1.0, "cornersPlus2": 1.0}),
}


@pytest.mark.parametrize(("name", "linear"), [(name, key) for name, (_, limits) in ISLANDS.items() for key in limits])
def test_face_varying_rule_at_the_ends_of_seams(name, linear):
    islands, limits = ISLANDS[name]
    quads, _ = grid(3)
    rows = (quads + 9 * np.array(islands)[:, None]).reshape(-1)
    values = np.zeros((27, 1))
    values[4] = 1.0  # the middle, on the island 0
    refinement = Refinement(cage_of(quads, 9), CATMULL_CLARK, 3, linear)
    refined = corners_of(refinement, values, rows)
    here = (refinement.finest.indices == 4) & (np.array(islands)[refinement.parents[refinement.finest.faces]] == 0)
    np.testing.assert_allclose(refined[here], limits[linear])


@pytest.mark.parametrize(("linear", "limit"), [("cornersPlus1", 4 / 6), ("cornersPlus2", 1.0)])
def test_face_varying_rule_at_a_dart(linear, limit):
    """A seam that goes from the border to the middle of a 3 x 3 grid and ends there."""
    quads, _ = grid(3)
    rows = quads.copy()
    rows[0][rows[0] == 1] = 9  # the seam's end at the border has a value for each side
    values = np.zeros((10, 1))
    values[4] = 1.0
    refinement = Refinement(cage_of(quads, 9), CATMULL_CLARK, 2, linear)
    refined = corners_of(refinement, values, rows.reshape(-1))
    np.testing.assert_allclose(refined[refinement.finest.indices == 4], limit)  # the slit's two sides are one crease


def test_equal_values_are_one():
    values = np.array([[0.0, 1.0], [2.0, 1.0], [0.0, 1.0], [0.0, 2.0], [2.0, 1.0]])
    np.testing.assert_array_equal(equal_rows(values), [0, 1, 0, 3, 1])
    assert len(equal_rows(np.empty((0, 2)))) == 0


def test_edges_of_every_level_are_those_of_its_faces():
    """The child's edges are numbered from the parent's: they must be what a search in its faces finds."""
    for scheme, faces in ((CATMULL_CLARK, CUBE_QUADS), (LOOP, CUBE_QUADS[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))):
        for level in Refinement(cage_of(faces, 8), scheme, 3).topologies[1:]:
            ends = np.stack([level.indices, level.indices[level.following]], axis=-1)
            np.testing.assert_array_equal(np.sort(level.ends[level.edges]), np.sort(ends))
            assert len(level.ends) == len(edge_table(level.counts, level.indices, len(level.vertex_sharpness)).ends)
            assert (level.edge_faces == 2).all()
