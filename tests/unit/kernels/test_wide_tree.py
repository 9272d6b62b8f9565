"""The CPU's tree holds every triangle once, in boxes that hold it, and finds what a search through all finds."""

from __future__ import annotations

import math

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpmis.device.mesh import padded_boxes
from warpmis.device.views import SceneView, WideTreeView
from warpmis.device.wide_tree import HALVING_LEVEL, WIDTH, wide_trees
from warpmis.kernels.wide_tree import BLOCKED, OPEN, STACK_SIZE, VEILED, closest_in_tree, make_occlusion_in_tree

Soup = tuple[NDArray[np.float32], NDArray[np.int32]]


def soup(count: int, spread: float = 1.0, seed: int = 0) -> Soup:
    """Triangles of all sizes; `spread` 0 puts all centres into one place."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2.0, 0.0, (count, 1, 1))
    corners = rng.normal(size=(count, 3, 3))
    corners -= corners.mean(axis=1, keepdims=True) if spread else 0.5 * (corners.min(1) + corners.max(1))[:, None]
    points = spread * rng.uniform(-1.0, 1.0, (count, 1, 3)) + size * corners
    return points.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def sheets(count: int) -> Soup:
    """Small triangles in planes across the axes, whose boxes have no thickness."""
    points, triangles = soup(count, seed=2)
    corners = (0.2 * points).reshape(-1, 3, 3) + np.random.default_rng(3).uniform(-1.0, 1.0, (count, 1, 3))
    axis = np.arange(count) % 3
    corners[np.arange(count), :, axis] = np.round(3.0 * corners[np.arange(count), :1, axis]) / 3.0
    return corners.reshape(-1, 3).astype(np.float32), triangles


def shrinking(count: int) -> Soup:
    """Each triangle so near to the next, relative to what is left, that every split takes off one of them."""
    at = 0.3 ** np.arange(count)[:, None, None]
    points = at * np.array([[1.0, 0.0, 0.0], [1.1, 0.0, 0.0], [1.0, 0.1, 0.1]])
    return points.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


SOUPS = {
    "one": soup(1),
    "a full leaf": soup(8),
    "one more": soup(9),
    "many": soup(3000),
    "sheets": sheets(3000),
    "in one place": soup(500, spread=0.0),
    "shrinking": shrinking(70),
    "alike": (np.tile(soup(1)[0], (300, 1)), np.arange(900, dtype=np.int32).reshape(-1, 3)),
}


def visited(tree: WideTreeView, low: NDArray[np.float32], high: NDArray[np.float32], node: int = 0) -> tuple[list, int]:
    """The faces below a node, each box held against what is in it; and the levels."""
    bounds = tree.bounds.numpy()[6 * node : 6 * node + 6].reshape(3, 2, WIDTH)
    faces, levels = [], 0
    for k in range(WIDTH):
        if bounds[0, 0, k] > bounds[0, 1, k]:
            continue
        child = int(tree.children.numpy()[WIDTH * node + k])
        inside, below = (
            visited(tree, low, high, child)
            if child >= 0
            else ([*set(tree.faces.numpy().reshape(-1, WIDTH)[-1 - child])], 0)
        )
        assert (bounds[:, 0, k] <= low[inside]).all()
        assert (bounds[:, 1, k] >= high[inside]).all()
        faces, levels = [*faces, *inside], max(levels, below)
    return faces, levels + 1


@pytest.mark.parametrize("name", SOUPS)
def test_every_triangle_is_in_one_leaf_within_its_boxes(name: str) -> None:
    points, triangles = SOUPS[name]
    tree, roots = wide_trees(points, triangles, [0, len(triangles)], [2.0])
    faces, levels = visited(tree, *padded_boxes(points, triangles, 2.0))
    assert roots == [0]
    assert sorted(faces) == list(range(len(triangles)))
    assert levels <= HALVING_LEVEL + math.ceil(math.log(max(len(triangles), 2), WIDTH)) + 1


def test_no_tree_needs_more_than_the_stack() -> None:
    """Seven children of each level wait, and the last level's eighth: of as many triangles as an index can count."""
    most = HALVING_LEVEL + math.ceil(math.log(2**31, WIDTH))
    assert 7 * most + 1 <= STACK_SIZE


@wp.func
def every_third_is_clear(scene: SceneView, light: int, instance: int, face: int) -> bool:
    return face % 3 != 0


occlusion_in_tree = make_occlusion_in_tree(every_third_is_clear)


@wp.kernel(module="unique", enable_backward=False)
def shoot(
    scene: SceneView,
    root: int,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    reach: float,
    found: wp.array(dtype=wp.vec4),
    met: wp.array(dtype=int),
):
    i = wp.tid()
    nearest = closest_in_tree(scene.tree, root, origins[i], directions[i], reach)
    found[i] = wp.vec4(nearest.distance, float(nearest.face), nearest.u, nearest.v)
    met[i] = occlusion_in_tree(scene, 0, 0, root, origins[i], directions[i], reach)


def shot(tree: WideTreeView, root: int, rays: tuple[np.ndarray, np.ndarray], reach: float) -> tuple[np.ndarray, ...]:
    origins, directions = (wp.array(e, dtype=wp.vec3, device="cpu") for e in rays)
    found = wp.zeros(len(rays[0]), dtype=wp.vec4, device="cpu")
    met = wp.zeros(len(rays[0]), dtype=int, device="cpu")
    scene = SceneView()
    scene.tree = tree
    wp.launch(shoot, len(met), [scene, root, origins, directions, reach, found, met], device="cpu")
    return found.numpy(), met.numpy()


def searched(
    soup: Soup, rays: tuple[np.ndarray, np.ndarray], reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """In float64, one after another: distance and face (-1: none) of the closest, which are hit, shape (rays, faces),
    and where all that is beyond doubt.

    Reference: Möller, Trumbore (1997), "Fast, Minimum Storage Ray/Triangle Intersection".
    """
    a, b, c = soup[0][soup[1]].astype(np.float64).swapaxes(0, 1)
    origins, directions = (e.astype(np.float64) for e in rays)
    distances = np.full((len(origins), len(a)), np.inf)
    sure = np.ones(len(origins), bool)
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        across = np.cross(d, c - a)
        det = np.einsum("fk,fk->f", b - a, across)
        det = np.where(np.abs(det) < 1e-300, 1e-300, det)
        u = np.einsum("fk,fk->f", o - a, across) / det
        v = np.cross(o - a, b - a) @ d / det
        t = np.einsum("fk,fk->f", np.cross(o - a, b - a), c - a) / det
        edge = np.minimum(np.minimum(u, v), 1.0 - u - v)
        distances[i, (edge >= 0.0) & (t >= 0.0) & (t < reach)] = t[(edge >= 0.0) & (t >= 0.0) & (t < reach)]
        # Edge-on the distance hangs on the last digit of the direction.
        cosine = np.abs(det) / np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.linalg.norm(d)
        near = np.sort(distances[i])[:2]
        sure[i] = not (np.abs(edge) < 1e-4).any() and (np.abs(t[edge > 0.0] - reach) > 1e-4).all()
        sure[i] &= np.isinf(near[0]) or (near[0] > 1e-4 and cosine[distances[i].argmin()] > 0.01)
        sure[i] &= len(near) < 2 or np.isinf(near[1]) or near[1] - near[0] > 1e-4
    closest = np.where(np.isinf(distances.min(axis=1)), -1, distances.argmin(axis=1))
    return distances.min(axis=1), closest, np.isfinite(distances), sure


@pytest.mark.parametrize(
    ("name", "reach"), [("one", 1e30), ("one more", 1e30), ("many", 1e30), ("many", 0.2), ("sheets", 1e30)]
)
def test_finds_what_a_search_through_all_finds(name: str, reach: float) -> None:
    """Also along the axes, and with directions of any length."""
    rng = np.random.default_rng(1)
    origins = rng.uniform(-1.2, 1.2, (600, 3)).astype(np.float32)
    directions = rng.normal(size=(600, 3)).astype(np.float32)
    directions[::10, :2] = 0.0
    points, triangles = SOUPS[name]
    aimed = points[triangles[rng.integers(len(triangles), size=300)]]
    directions[1::2] = np.einsum("nk,nkc->nc", rng.dirichlet((1.0, 1.0, 1.0), 300), aimed) - origins[1::2]
    # Behind another one's tree, so that nodes, leaves and faces do not begin at 0.
    other, both = soup(40, seed=5), np.concatenate([soup(40, seed=5)[0], points])
    indices = np.concatenate([other[1], triangles + len(other[0])])
    tree, roots = wide_trees(both, indices, [0, 40, 40 + len(triangles)], [3.0, 3.0])
    assert roots[1] > 0
    found, met = shot(tree, roots[1], (origins, directions), reach)
    distance, face, hits, sure = searched(SOUPS[name], (origins, directions), reach)
    assert sure.mean() > 0.5
    assert (found[sure, 1] == face[sure]).all()
    assert (met[sure] != OPEN).tolist() == (face[sure] >= 0).tolist()
    blocked = hits[:, np.arange(len(triangles)) % 3 != 0].any(axis=1)
    assert blocked[sure & (met == BLOCKED)].all()
    # A clear triangle hides those behind it in its leaf.
    assert (met[sure & blocked] == BLOCKED).sum() >= 0.9 * (sure & blocked).sum()
    assert (met[sure & ~blocked & (face >= 0)] == VEILED).all()
    hit = sure & (face >= 0)
    assert hit.sum() > 100
    np.testing.assert_allclose(found[hit, 0], distance[hit], rtol=1e-4, atol=1e-6)
    a, b, c = points[triangles[face[hit]]].swapaxes(0, 1)
    u, v = found[hit, 2:3], found[hit, 3:4]
    at = origins[hit] + directions[hit] * found[hit, :1]
    np.testing.assert_allclose(a * u + b * v + c * (1.0 - u - v), at, atol=1e-4)
