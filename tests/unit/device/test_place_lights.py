"""Lights that are instances, on the device: memory by places, the same lights as flattened, and slivers far away."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest
from usd.stages import load

import warpmis.usd.placing as placing
from warpmis.device.footprint import scene_bytes
from warpmis.device.light_nodes import EMPTY, light_nodes
from warpmis.device.place_lights import emitter_nodes, place_leaves, place_lights, two_levels
from warpmis.device.upload import upload, upload_solids
from warpmis.inspection import inspect_scene
from warpmis.scene import Scene

GLOW = """def Material "Glow"
{
    token outputs:surface.connect = </Glow/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (4, 2, 1)
        token outputs:surface
    }
}
"""


def lamps(count: int, kind: str = "Sphere", more: str = "", offset: float = 0.0) -> str:
    """Spheres that emit, by a PointInstancer: every second one is mirrored and stretched."""
    positions = [(offset + 3.0 * (k % 40), 0.0, offset + 3.0 * (k // 40)) for k in range(count)]
    scales = [(1.0, 1.0, 1.0) if k % 2 == 0 else (0.5, -1.0, 2.0) for k in range(count)]
    return f"""{GLOW}
def PointInstancer "I"
{{
    int[] protoIndices = {[0] * count}
    point3f[] positions = {positions}
    float3[] scales = {scales}
    rel prototypes = [</I/Lamp>]
    def {kind} "Lamp" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {{
        rel material:binding = </Glow>
        {more}
    }}
}}
"""


def loaded(text: str, most: int) -> Scene:
    with mock.patch.object(placing, "MAX_COPIES", most), mock.patch.object(placing, "MAX_EMISSIVE_COPIES", most):
        return load(text)


def test_memory_grows_by_places_not_by_their_triangles() -> None:
    few, many = (scene_bytes(upload(load(lamps(count)), "cpu")) for count in (50, 1050))
    assert many["geometry"] == few["geometry"]
    assert 0 < many["lights"] - few["lights"] < 1000 * 300  # a flattened lamp's triangles would take 800,000 each


def test_inspection_tells_the_power_of_all_places() -> None:
    flat, shared = (inspect_scene(loaded(lamps(6), most)) for most in (10**9, 0))
    (one,), (same,) = flat.lights, shared.lights
    assert (one.path, one.kind, one.emitted) == (same.path, same.kind, same.emitted)
    assert one.power is not None
    assert same.power == pytest.approx(one.power, rel=1e-5)
    assert [effect.prim for effect in shared.effects if effect.name == "emissive_instances"] == ["/I/Lamp"]


def test_lights_of_places_are_grouped_as_flattened_ones() -> None:
    flat, shared = (upload(loaded(lamps(6), most), "cpu") for most in (10**9, 0))
    assert flat.light_groups == shared.light_groups == (None,)
    api = 'float inputs:intensity = 2\nstring inputs:unused = ""'
    text = lamps(6, more=api).replace('"MaterialBindingAPI"', '"MaterialBindingAPI", "LightAPI"')
    flat, shared = (upload(loaded(text, most), "cpu") for most in (10**9, 0))
    assert shared.view.emitter_places.shape[0] == 6
    assert set(flat.light_groups) == set(shared.light_groups)


def test_a_two_level_tree_leads_to_every_leaf_once() -> None:
    scene = loaded(lamps(7), 0)
    solids = upload_solids(scene, "cpu")
    lights = place_lights(scene, solids.geometry, solids.first)
    luminance, links = np.ones(len(lights.records)), np.full(len(lights.records), 1, np.uint32)
    (leaves,) = place_leaves(lights, luminance, links)
    lower = [emitter_nodes(one, lights.records, luminance) for one in lights.prototypes]
    tree, roots = two_levels(light_nodes(leaves, 0, 0), 0, lower)
    emitters = len(lights.triangles)
    assert len(tree.paths) == emitters + 7

    def below(root: int) -> list[int]:
        found, pending = [], [root]
        while pending:
            children = tree.children[pending.pop()]
            pending += children[children >= 0].tolist()
            found += (-1 - children[(children < 0) & (children != EMPTY)]).tolist()
        return sorted(found)

    assert below(0) == list(range(emitters, emitters + 7))
    assert below(int(roots[0])) == list(range(emitters))
    for leaf, root in ((0, roots[0]), (emitters - 1, roots[0]), (emitters + 6, 0)):
        node, path = int(root), int(tree.paths[leaf])
        while node >= 0:
            node, path = int(tree.children[node, path & 7]), path >> 3
        assert -1 - node == leaf


def test_slivers_far_from_the_origin_are_sound() -> None:
    more = """uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 3, 4]
        point3f[] points = [(0, -1, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (1e-25, 0.5, 1e-25)]"""
    scene = loaded(lamps(4, "Mesh", more, offset=100.0), 0)
    solids = upload_solids(scene, "cpu")
    lights = place_lights(scene, solids.geometry, solids.first)
    (leaves,) = place_leaves(lights, np.ones(len(lights.records)), np.ones(len(lights.records), np.uint32))
    assert len(lights.triangles) == 2
    assert all(np.isfinite(column).all() for column in vars(leaves).values())
    assert (leaves.weight > 0.0).all()
    assert np.isfinite(upload(scene, "cpu").view.light_tree.rows.numpy()).all()
