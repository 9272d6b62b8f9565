"""Lights that are instances: probabilities that sum to 1 and that samples have, none of them 0 where a triangle brings
light, and the same picture as flattened.

Significance is Sidak-corrected over the file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
import warp as wp
from hard.every import effects_of
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from statistical.estimates import REGIONS, block_means, caught_bias, paired_p_values
from statistical.lights import LOOK, SAMPLE, TURN, Probe, lights, make_scene, probe, some_response
from stats import chi_square, detectable_imbalance, sidak
from usd.pictures import write
from usd.stages import load

import warpmis
import warpmis.usd.placing as placing
from warpmis.device.upload import DeviceScene, upload
from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.light.choice import make_choice
from warpmis.scene import Prim, Scene, SphereLight
from warpmis.scene.features import Features, detect
from warpmis.scene.geometry import Geometry, Prototype
from warpmis.scene.light_control import LightControl

SEEDS = 12
SAMPLES = 1 << 18
WAYS: dict[str, dict[str, Any]] = {
    "next-event": {"method": "nee"},
    "light": {"method": "balance"},
    "area and dome": {"method": "balance", "strategies": ("bsdf", "area", "dome")},
}
STAGES = ("textured lamps", "links and tints")
LEVEL = sidak(0.01, 2 + len(STAGES) * len(WAYS) * REGIONS)
choice = make_choice(Features.all())


@wp.kernel(module="unique", enable_backward=False)
def probabilities(
    scene: SceneView,
    xs: wp.array(dtype=wp.vec3),
    ns: wp.array(dtype=wp.vec3),
    prims: wp.array(dtype=int),
    instances: wp.array(dtype=int),
    emitters: wp.array(dtype=int),
    total: wp.array(dtype=float),
    pmf: wp.array2d(dtype=float),
    brings: wp.array2d(dtype=int),
):
    """For each receiver and each pair of instance and emitter its probability, and whether it brings light."""
    i, k = wp.tid()
    r = lights.receiver(scene, xs[i], ns[i], prims[i], 0.5, 0.5, some_response(ns[i], i))
    instance = instances[k]
    emitter = emitters[k]
    total[i] = r.total
    pmf[i, k] = choice.emitter_importance(scene, r, emitter, instance) / wp.max(r.total, 1.0e-35)
    light = lights.light_of_emitter(scene, emitter, instance)
    key = rng.RngKey()
    for sample in range(32):
        key.sample = wp.uint32(sample)
        u = rng.uniform4(key, i)
        s = lights.sample_light(scene, scene.lights[light], emitter, instance, r.x, r.n, u)
        arrives = s.pdf_solid_angle > 0.0 and wp.dot(s.wi, r.n) > 1.0e-4
        if arrives and wp.max(lights.control.factor(scene, light, r, s.wi)) > 1.0e-6:
            brings[i, k] = 1


@wp.kernel(module="unique", enable_backward=False)
def choices(
    scene: SceneView, x: wp.vec3, n: wp.vec3, which: int, pairs: wp.array(dtype=wp.vec3i), pmfs: wp.array(dtype=float)
):
    """By the receiver `which` of those that `probabilities` asks."""
    i = wp.tid()
    key = rng.RngKey()
    key.sample = wp.uint32(i)
    u = rng.uniform4(key, 0)
    r = lights.receiver(scene, x, n, 0, u[0], u[1], some_response(n, which))
    pairs[i] = wp.vec3i(r.choice.instance, r.choice.emitter, r.choice.light)
    pmfs[i] = r.choice.importance / r.total


def unit(random: np.random.Generator, count: int) -> NDArray[np.float64]:
    found = random.normal(size=(count, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def of_prototype(random: np.random.Generator, triangles: int, places: int, prim: int, stretch: float) -> Prototype:
    """Triangles in a ball, some of them dark, in places that turn, scale, stretch and mirror."""
    points = np.repeat(random.normal(size=(triangles, 3)), 3, axis=0) + 0.3 * random.normal(size=(3 * triangles, 3))
    turns = np.linalg.qr(random.normal(size=(2, places, 3, 3)))[0]
    scales = random.choice([-1.0, 1.0], (places, 1, 3)) * stretch ** random.uniform(-1.0, 1.0, (places, 1, 3))
    linear = 0.1 * turns[0] * scales @ turns[1]
    geometry = Geometry(
        points=points.astype(np.float32),
        triangles=np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3),
        normals=np.zeros((0, 3), np.float32),
        normal_indices=np.full((triangles, 3), -1, np.int32),
        materials=(np.arange(triangles) % 4).astype(np.int32),
        prims=np.full(triangles, prim, np.int32),
    )
    prims = np.full(places, prim, np.int32)
    prims[places // 2 :] += 1
    return Prototype(geometry, linear, random.normal(size=(places, 3)), prims, np.arange(places, dtype=np.int32))


def crowd(triangles: int, places: int, seed: int, stretch: float) -> Scene:
    """Two prototypes that emit, one of them on both sides, one prim's places with a link; triangles in world space and
    two lamps beside."""
    random = np.random.default_rng(seed)
    sides = (True, True, False, False, False)
    points, faces = random.normal(size=(9, 3)), np.arange(9).reshape(-1, 3)
    lamps = [SphereLight(f"/s{k}", random.normal(size=3), 0.05, np.full(3, 2.0)) for k in range(2)]
    made = make_scene(*lamps, points=points, triangles=faces, prims=[0, 1, 4], double=sides)
    reached = np.array([True, False, True, True, True])
    linked = replace(made.prims[3], control=LightControl(illuminates=reached))
    dark = replace(made.materials[3], emissive_color=(0.0, 0.0, 0.0))
    return replace(
        made,
        prims=(*made.prims[:3], linked, Prim("/world")),
        materials=(*made.materials[:3], dark, made.materials[4]),
        prototypes=tuple(of_prototype(random, triangles, places, prim, stretch) for prim in (0, 2)),
    )


def pairs_of(scene: Scene, device: DeviceScene) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Instances and emitters of all pairs; -1 for an emitter in world space."""
    triangles, count = device.view.emitter_triangles.numpy(), scene.instance_count
    first = np.cumsum([len(part.triangles) for part in scene.parts])
    part = np.searchsorted(first, triangles, side="right")
    places = np.cumsum([0, *(len(one.prims) for one in scene.prototypes)])
    found = [(-1, row) for row in np.flatnonzero(part == 0)]
    for number in range(len(scene.prototypes)):
        rows = np.flatnonzero(part == number + 1)
        found += [(place, row) for place in range(places[number], places[number + 1]) for row in rows]
    assert places[-1] == count
    instances, emitters = np.array(found, np.int32).T
    return instances, emitters


def asked(scene: Scene, device: DeviceScene, xs: Any, ns: Any, prims: Any) -> tuple[NDArray[Any], ...]:
    instances, emitters = pairs_of(scene, device)
    count = len(xs)
    total, pmf = wp.zeros(count, dtype=float), wp.zeros((count, len(instances)), dtype=float)
    brings = wp.zeros((count, len(instances)), dtype=int)
    where = [wp.array(np.asarray(a, np.float32), dtype=wp.vec3) for a in (xs, ns)]
    whole = [wp.array(np.asarray(a, np.int32), dtype=int) for a in (prims, instances, emitters)]
    wp.launch(probabilities, (count, len(instances)), [device.view, *where, *whole, total, pmf, brings])
    return total.numpy(), pmf.numpy().astype(float), brings.numpy() != 0


def without_lamps(scene: Scene) -> Scene:
    return replace(scene, lights=())


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 12),
    st.integers(1, 20),
    st.integers(0, 2**16),
    st.sampled_from([1.0, 2.0, 8.0]),
    st.sampled_from([0.3, 2.0, 50.0]),
)
def test_what_brings_light_can_be_chosen(triangles: int, places: int, seed: int, stretch: float, spread: float) -> None:
    """Receivers among the lights and far away, facing anywhere, of both prims; probabilities sum to 1."""
    scene = without_lamps(crowd(triangles, places, seed, stretch))
    random = np.random.default_rng(seed)
    xs, ns, prims = spread * random.normal(size=(48, 3)), unit(random, 48), np.arange(48) % 2
    total, pmf, brings = asked(scene, upload(scene, "cpu"), xs, ns, prims)
    assert np.isfinite(total).all() and np.isfinite(pmf).all()
    assert (pmf[brings] > 0.0).all()
    np.testing.assert_allclose(pmf.sum(axis=1), np.where(total > 0.0, 1.0, 0.0), atol=1e-5)


@pytest.mark.parametrize("which", [0, 1], ids=["matte", "glossy"])
def test_pairs_are_chosen_with_their_probability(which: int) -> None:
    scene = crowd(12, 30, 3, 3.0)
    device = upload(scene, "cpu")
    instances, emitters = pairs_of(scene, device)
    x, n = np.array([0.4, -0.3, 0.2]), TURN[:, 2]
    _, pmf, _ = asked(scene, device, [x, x], [n, n], [0, 0])
    found, pmfs = wp.zeros(SAMPLES, dtype=wp.vec3i), wp.zeros(SAMPLES, dtype=float)
    wp.launch(choices, SAMPLES, [device.view, wp.vec3(*x.tolist()), wp.vec3(*n.tolist()), which, found, pmfs])
    instance, emitter, _ = found.numpy().T
    of_mesh = emitter >= 0
    row = {pair: k for k, pair in enumerate(zip(instances.tolist(), emitters.tolist(), strict=True))}
    chosen = np.array([row[pair] for pair in zip(instance[of_mesh].tolist(), emitter[of_mesh].tolist(), strict=True)])
    counts = np.append(np.bincount(chosen, minlength=len(instances)), (~of_mesh).sum()).astype(float)
    expected = np.append(pmf[which], 1.0 - pmf[which].sum())
    assert expected[-1] > 0.0  # that of the lamps
    fit = chi_square(counts, expected * SAMPLES)
    assert fit.p_value > LEVEL, fit
    assert detectable_imbalance(fit.count, fit.dof, LEVEL) < 0.1
    np.testing.assert_allclose(pmfs.numpy()[of_mesh], pmf[which][chosen], rtol=1e-4)


def test_a_samples_density_is_that_of_the_triangles_on_its_line() -> None:
    """Asked for the direction alone, as a ray is; where triangles overlap, the line has that of all of them."""
    scene = crowd(6, 20, 5, 3.0)
    device = upload(scene, "cpu")
    xs, ns = (wp.array(a.astype(np.float32)[None], dtype=wp.vec3) for a in (np.array([0.2, 0.1, -0.3]), TURN[:, 2]))
    wi, out = wp.zeros(1 << 14, dtype=wp.vec3), wp.zeros(1 << 14, dtype=Probe)
    for mode in (SAMPLE, LOOK):
        wp.launch(probe, 1 << 14, [device.view, xs, ns, mode, 1, 0.0, 1e30, wi, out])
        found = out.numpy()
        if mode == SAMPLE:
            sampled = found["sampled_pdf"].copy()
    drawn = sampled > 0.0
    ratio = found["pdf"][drawn] / sampled[drawn]
    assert drawn.mean() > 0.5
    assert (ratio > 0.999).mean() > 0.999  # the rest go through an edge, rounded
    assert (np.abs(ratio - 1.0) < 1e-3).mean() > 0.3


TURNS = """quatf[] orientations = [(1, 0, 0, 0), (0.8, 0.6, 0, 0), (0.6, 0, 0.8, 0), (0.8, 0, 0, 0.6), (0, 0.6, 0, 0.8),
        (0.5, 0.5, 0.5, 0.5)]
    float3[] scales = [(0.3, 0.3, 0.3), (0.4, -0.4, 0.4), (0.3, 0.1, 0.5), (-0.3, -0.5, -0.3), (0.5, 0.4, -0.3),
        (0.3, 0.3, 0.06)]
    point3f[] positions = [(-1.4, 0.5, 0), (0, 0.8, 0), (1.4, 0.5, 0), (-1.4, 1.2, -1.4), (0, 0.6, -1.4),
        (1.4, 1, -1.4)]
"""
WALLS = """def Mesh "Walls"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 3, 2, 4, 5]
    point3f[] points = [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2), (2, 3, -2), (-2, 3, -2)]
    color3f[] primvars:displayColor = [(0.7, 0.7, 0.7)]
}
def Sphere "Ball"
{
    double radius = 0.35
    double3 xformOp:translate = (0.6, 0.4, 0.6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    color3f[] primvars:displayColor = [(0.6, 0.3, 0.2)]
}
def Camera "C"
{
    double3 xformOp:translate = (0, 1.5, 5)
    double3 xformOp:rotateXYZ = (-8, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""
OCTAHEDRON = """uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3, 3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 0, 3, 5]
        point3f[] points = [(1, 0, 0), (-1, 0, 0), (0, 0.8, 0), (0, -0.8, 0), (0, 0, 0.7), (0, 0, -0.7)]"""
TEXTURED = """def Material "Glow"
{
    token outputs:surface.connect = </Glow/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.1, 0.1, 0.1)
        color3f inputs:emissiveColor.connect = </Glow/T.outputs:rgb>
        token outputs:surface
    }
    def Shader "T"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @FILE@
        float4 inputs:scale = (8, 8, 8, 1)
        float2 inputs:st.connect = </Glow/R.outputs:result>
        float3 outputs:rgb
    }
    def Shader "R"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
"""


def textured(file: Path) -> str:
    """One-sided and two-sided lamps with a picture, turned, stretched and mirrored."""

    def lamp(name: str, sided: str) -> str:
        sts = [(0, 0), (1, 0), (0.5, 1)] * 5
        return f"""def Mesh "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {{
        rel material:binding = </Glow>
        uniform bool doubleSided = {sided}
        {OCTAHEDRON}
        texCoord2f[] primvars:st = {sts} ( interpolation = "faceVarying" )
    }}
"""

    return f"""{TEXTURED.replace("FILE", str(file))}{WALLS}
def PointInstancer "I"
{{
    int[] protoIndices = [0, 1, 0, 1, 0, 1]
    {TURNS}
    rel prototypes = [</I/Lamp>, </I/Pane>]
    {lamp("Lamp", "false")}
    {lamp("Pane", "true")}
}}
"""


def linked() -> str:
    """Native instances of a light made of geometry, tinted, that does not reach the ball or shine through it; one of
    them is turned, stretched and mirrored."""
    text = f"""{WALLS}
class "Lamp"
{{
    def Mesh "Glass" ( prepend apiSchemas = ["LightAPI"] )
    {{
        {OCTAHEDRON}
        float inputs:intensity = 5
        color3f inputs:color = (1, 0.8, 0.4)
        rel collection:lightLink:excludes = </Ball>
    }}
}}
"""
    for k, (x, y, z) in enumerate([(-1.2, 1.0, 0.0), (1.2, 1.4, -0.6), (0.1, 0.9, -1.0)]):
        scale = (0.2, 0.2, 0.2) if k else (0.3, -0.15, 0.2)
        text += f"""def "L{k}" ( instanceable = true
    inherits = </Lamp> )
{{
    double3 xformOp:translate = ({x}, {y}, {z})
    double3 xformOp:rotateXYZ = ({40 * k}, 30, 0)
    double3 xformOp:scale = {scale}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
}}
"""
    return text


def loaded(text: str, most: int) -> Scene:
    """The stage with at most so many copies of triangles flattened."""
    with mock.patch.object(placing, "MAX_COPIES", most), mock.patch.object(placing, "MAX_EMISSIVE_COPIES", most):
        return load(text, width=24, height=18)


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Scene, Scene]]:
    """Flattened, and traced through transforms."""
    random = np.random.default_rng(5)
    file = write(tmp_path_factory.mktemp("pictures") / "glow.exr", random.random((4, 4, 3)) ** 3)
    texts = dict(zip(STAGES, (textured(file), linked()), strict=True))
    return {name: (loaded(text, 10**9), loaded(text, 0)) for name, text in texts.items()}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("stage", STAGES)
def test_instances_light_as_flattened(stage: str, way: str, stages: dict[str, tuple[Scene, Scene]]) -> None:
    flat, shared = stages[stage]
    assert detect(shared).emissive_instances and not flat.prototypes
    assert detect(shared).light_links == (stage == "links and tints")
    every = effects_of(scene for pair in stages.values() for scene in pair)  # one kernel a way for all
    pictures = [
        [block_means(warpmis.render(scene, spp=32, seed=k, features=every, **WAYS[way]).image) for k in range(SEEDS)]
        for scene in (flat, shared)
    ]
    flattened, through = np.array(pictures)
    assert (flattened != through).any()
    assert paired_p_values(flattened, through).min() > LEVEL
    assert caught_bias(flattened, through, LEVEL) < 0.03
