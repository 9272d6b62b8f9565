"""Where light samples lie: on the light, by its own equation, and what that makes of the solid angle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from statistical.light_cases import CASES, SINGLE, device_scene, sampled
from statistical.lights import COUNT, LOOK, RECEIVER, SAMPLE, SAMPLE_FIRST, TURN, make_scene, rect, run

from warpmis.device.upload import upload
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.scene import CylinderLight, DiskLight, RectLight, SphereLight
from warpmis.scene.features import detect


@pytest.mark.parametrize("name", [name for name in SINGLE if not name.startswith(("dome", "sun", "distant"))])
def test_sampled_points_lie_on_the_light(name: str) -> None:
    """In float64 and by the light's equation alone."""
    wi, out = sampled(name)
    has_sample = out["sampled_pdf"] > 0.0
    wi, distance = wi[has_sample].astype(float), out["sampled_distance"][has_sample].astype(float)
    light = CASES[name].scene().lights[0]
    p = RECEIVER + wi * distance[:, None] - light.center
    scale = float(np.abs(RECEIVER - light.center).max()) + 1.0
    if isinstance(light, SphereLight):
        # The near side: at a distance that is known to the tangent's length.
        off = np.linalg.norm(p, axis=1) - light.radius
        assert (np.einsum("ij,ij->i", p, wi) < 2e-6 * scale).all()
    elif isinstance(light, CylinderLight):
        half_length = np.linalg.norm(light.half_axis)
        along = p @ light.half_axis / half_length
        off = np.sqrt((p**2).sum(axis=1) - along**2) - light.radius
        assert (np.abs(along) < half_length + 2e-6 * scale).all()
        # All of the length is sampled.
        assert np.abs(along).max() > 0.999 * half_length
    else:
        assert isinstance(light, RectLight | DiskLight)
        basis = np.stack([light.half_u, light.half_v, np.cross(light.half_v, light.half_u)], axis=1)
        a, b, height = np.linalg.solve(basis, p.T)
        off = height * np.linalg.norm(basis[:, 2])
        radius = np.maximum(np.abs(a), np.abs(b)) if isinstance(light, RectLight) else np.hypot(a, b)
        assert 0.998 < radius.max() < 1.0 + 1e-4
    assert np.abs(off).max() < 2e-6 * scale


@pytest.mark.parametrize("name", ["sun", "distant_wide", "dome", "dome_picture"])
def test_lights_at_infinity_are_infinitely_far(name: str) -> None:
    assert (sampled(name)[1]["sampled_distance"] == np.float32(INFINITE_DISTANCE)).all()


@pytest.mark.parametrize("double_sided", [False, True])
def test_mesh_samples_lie_on_its_triangles_and_on_the_side_that_shines(double_sided: bool) -> None:
    name = "mesh_two_sided" if double_sided else "mesh_one_sided"
    wi, out = sampled(name)
    geometry = CASES[name].scene().geometry
    corners = geometry.points[geometry.triangles].astype(float)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(e1, e2)
    front = np.einsum("ij,ij->i", normals, RECEIVER - corners[:, 0]) > 0.0
    assert 0 < front.sum() < len(front)
    has_sample = out["sampled_pdf"] > 0.0
    p = RECEIVER + wi[has_sample].astype(float) * out["sampled_distance"][has_sample, None]
    on = np.zeros((len(corners), len(p)), dtype=bool)
    for k in range(len(corners)):
        solution = np.linalg.solve(np.stack([e1[k], e2[k], normals[k]], axis=1), (p - corners[k, 0]).T)
        on[k] = (solution[:2] > -1e-5).all(axis=0) & (solution[:2].sum(axis=0) < 1.0 + 1e-5)
        on[k] &= np.abs(solution[2]) * np.linalg.norm(normals[k]) < 1e-5
    shines = front | double_sided
    assert on[shines].any(axis=0).all()
    assert on[shines].any(axis=1).all()
    # Each triangle by its area. The last one is the fourth turned round: a sample of either lies on both.
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    for k in np.flatnonzero(shines[:-1]):
        share = areas[k] * (2.0 if k == 3 and double_sided else 1.0) / areas.sum()
        share += areas[5] / areas.sum() if k == 3 and not double_sided and front[5] else 0.0
        assert on[k].sum() / COUNT == pytest.approx(share, abs=4.0 * np.sqrt(share / COUNT))


def test_solid_angle_of_a_rect_is_exact_down_to_grazing_views() -> None:
    """1 / pdf against van Oosterom and Strackee (1983) in float64, wherever the solid angle is sampled: from the height
    of a tenth of the farthest corner's distance up.
    """
    light = rect((0.0, 0.0, 0.0), (0.5, 0, 0), (0, 0.5, 0))
    assert isinstance(light, RectLight)
    random = np.random.default_rng(4)
    count = 1 << 15
    local = random.uniform(-1.2, 1.2, (count, 3))
    local[:, 2] = -(10.0 ** random.uniform(-3.0, 0.0, count))
    x = (light.center + local @ TURN.T).astype(np.float32)
    _, out = run(upload(make_scene(light), "cpu"), SAMPLE_FIRST, x, -TURN[:, 2], count)
    corners = [light.center + a * light.half_u + b * light.half_v - x for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    exact = triangle_solid_angle(*corners[:3]) + triangle_solid_angle(corners[0], corners[2], corners[3])
    farthest = np.hypot(np.abs(local[:, 0]) + 0.5, np.abs(local[:, 1]) + 0.5)
    by_solid_angle = (exact > 0.0101) & (np.abs(local[:, 2]) > 0.101 * farthest)
    assert by_solid_angle.mean() > 0.2
    assert np.abs(exact * out["sampled_pdf"] - 1.0)[by_solid_angle].max() < 5e-4


def triangle_solid_angle(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> NDArray[Any]:
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    numerator = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    return 2.0 * np.arctan2(numerator, la * lb * lc + ab * lc + bc * la + ca * lb)


def test_a_stage_of_lights_alone_and_one_of_degenerate_emitters_upload() -> None:
    """No materials at all; and a mesh light with no area, which Features still names, has neither samples nor hits."""
    _, out = run(device_scene("sphere"), SAMPLE, RECEIVER, TURN[:, 2], 16)
    assert (out["sampled_pdf"] > 0.0).all()
    points = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [2.0, 0.0, 2.0]])
    scene = make_scene(points=points, triangles=[[0, 1, 2]], prims=[0], double=(True,))
    assert detect(scene).mesh_light
    _, out = run(upload(scene, "cpu"), SAMPLE, np.zeros(3), np.eye(3)[2], 16)
    assert not out["sampled_pdf"].any()
    assert not run(upload(scene, "cpu"), LOOK, np.zeros(3), np.eye(3)[2], np.eye(3, dtype=np.float32))[1]["pdf"].any()
