"""The tree by which lights are chosen: each node's box, cone, weight and bits hold those of the lights below it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpmis.device.light_leaves import ALL_PRIMS, LINK_BITS, LightLeaves, emission_angle, link_bits, triangle_leaves
from warpmis.device.light_nodes import COLUMNS, EMPTY, PATH_BITS, ROWS, WIDTH, light_nodes
from warpmis.device.light_tree import BinaryTree, binary_tree
from warpmis.scene.light_control import IesProfile, LightControl, Shaping


def leaves_of(count: int, seed: int, apart: float, brightness: float) -> LightLeaves:
    """Triangles in clusters, `apart` times farther from each other than large, brighter and dimmer by 10^brightness;
    some in one place, some two-sided, some linked."""
    random = np.random.default_rng(seed)
    place = apart * random.normal(size=(max(1, count // 3), 1, 3))
    corners = place[random.integers(0, len(place), count)] + random.normal(size=(count, 3, 3))
    corners[: count // 4] = corners[0]
    luminance = 10.0 ** random.uniform(-brightness, brightness, count)
    links = np.where(random.random(count) < 0.5, ALL_PRIMS, 1 << random.integers(0, LINK_BITS, count))
    return triangle_leaves(corners, luminance, random.random(count) < 0.3, links.astype(np.uint32))


def below(tree: BinaryTree) -> list[list[int]]:
    """The lights of each node."""
    found: list[list[int]] = [[] for _ in tree.child]
    for node in reversed(range(len(tree.child))):
        child = int(tree.child[node])
        found[node] = [-1 - child] if child < 0 else found[child] + found[child + 1]
    return found


CROWDS = st.tuples(st.integers(1, 60), st.integers(0, 2**16), st.sampled_from([0.0, 1.0, 1e3]), st.floats(0.0, 12.0))


@settings(max_examples=60, deadline=None)
@given(CROWDS)
def test_a_node_holds_its_lights(crowd: tuple[int, int, float, float]) -> None:
    leaves = leaves_of(*crowd)
    tree = binary_tree(leaves)
    lights = below(tree)
    assert sorted(lights[0]) == list(range(len(leaves)))
    for node, held in enumerate(lights):
        assert tree.count[node] == len(held)
        assert (tree.low[node] <= leaves.low[held]).all() and (tree.high[node] >= leaves.high[held]).all()
        assert tree.weight[node] == pytest.approx(leaves.weight[held].sum(), rel=1e-9)
        cosines = np.clip(leaves.axis[held] @ tree.axis[node], -1.0, 1.0)
        reach = np.minimum(np.arccos(cosines) + leaves.cone[held], np.pi)
        assert (reach <= tree.cone[node] + 1e-6).all() or tree.two_sided[node]
        share = leaves.weight[held] / leaves.weight[held].sum()
        mean = share @ leaves.mean[held]
        variance = share @ (leaves.variance[held] + ((leaves.mean[held] - mean) ** 2).sum(axis=1))
        np.testing.assert_allclose(tree.mean[node], mean, rtol=1e-6, atol=1e-6 * np.abs(leaves.mean).max())
        assert tree.variance[node] == pytest.approx(variance, rel=1e-6)
        assert tree.links[node] == np.bitwise_or.reduce(leaves.links[held])
        assert tree.two_sided[node] == leaves.two_sided[held].all()


@settings(max_examples=60, deadline=None)
@given(CROWDS, st.integers(0, 60))
def test_a_path_leads_to_its_light(crowd: tuple[int, int, float, float], analytic: int) -> None:
    leaves = leaves_of(*crowd)
    nodes = light_nodes(leaves, analytic)
    rows = nodes.rows.reshape(-1, ROWS, WIDTH)
    center, half = (rows[:, [COLUMNS.index(f"{name} {axis}") for axis in "xyz"]] for name in ("center", "half"))
    assert len(np.unique(nodes.paths)) == len(leaves)
    for light, whole_path in enumerate(nodes.paths.tolist()):
        node, path = 0, whole_path
        while node >= 0:
            lane = path & (WIDTH - 1)
            assert (center[node, :, lane] - half[node, :, lane] <= leaves.low[light]).all()
            assert (center[node, :, lane] + half[node, :, lane] >= leaves.high[light]).all()
            assert int(nodes.links[node, lane]) & int(leaves.links[light].astype(np.int64)) != 0
            if light < analytic:
                assert int(nodes.analytic[node]) >> lane & 1
            node, path = int(nodes.children[node, lane]), path >> PATH_BITS
        assert (node, path) == (-1 - light, 0)
    empty = nodes.children == EMPTY
    assert (rows[:, COLUMNS.index("weight")][empty] == 0.0).all()
    assert not (nodes.analytic[:, None] >> np.arange(WIDTH) & 1)[empty].any()


def test_a_path_fits_its_bits_however_the_weights_fall_off() -> None:
    """Lights each as far again and a thousandth as bright: a tree divided by variance alone would be a list."""
    corners = np.zeros((3000, 3, 3)) + np.eye(3)
    corners[:, :, 0] += (1.01 ** np.arange(3000.0))[:, None]
    leaves = triangle_leaves(
        corners, 0.9 ** np.arange(3000.0), np.zeros(3000, bool), np.full(3000, ALL_PRIMS, np.uint32)
    )
    nodes = light_nodes(leaves, 0)
    assert len(np.unique(nodes.paths)) == 3000
    assert int(nodes.paths.max()).bit_length() <= 63


def test_lists_of_prims_beyond_the_bits_share_them() -> None:
    prims = LINK_BITS + 9
    controls = [LightControl(illuminates=np.arange(prims) == k) for k in range(prims)] + [LightControl()]
    lights, reached = link_bits(controls, prims)
    for light, control in enumerate(controls):
        reaches = (lights[light] & reached) != 0
        assert reaches[control.illuminates if control.illuminates is not None else slice(None)].all()
    assert ((lights[:LINK_BITS, None] & reached[None, :LINK_BITS]) != 0).sum() == LINK_BITS


def test_a_profile_narrows_the_cone_of_emission() -> None:
    angles = np.radians([0.0, 30.0, 60.0, 180.0])
    candela = np.array([[3.0, 1.0, 0.0, 0.0]] * 2)
    profile = IesProfile(angles, np.radians([0.0, 360.0]), candela)
    shaping = Shaping(np.eye(3), ies=profile)
    assert emission_angle(shaping) == pytest.approx(np.radians(60.0))
    assert emission_angle(Shaping(np.eye(3), cone_angle=0.3, ies=profile)) == 0.3
    assert emission_angle(Shaping(np.eye(3), ies=profile, ies_angle_scale=0.5)) == pytest.approx(np.radians(30.0))
    assert emission_angle(Shaping(np.eye(3), ies=profile, ies_angle_scale=-1.0)) == np.pi
