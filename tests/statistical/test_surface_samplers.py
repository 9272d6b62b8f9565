"""Scattering at a surface: the sampler against its density, the lobes against each other and against exact numbers.

Significance is Sidak-corrected over the file; each chi-square test has the power to find a density that is wrong by
2 % over half of its probability, one way or the other (asserted), each test of a mean to find a bias of 1.1 %.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from stats import (
    DirectionGrid,
    detectable_bias,
    detectable_imbalance,
    fit_directions,
    sidak,
    standard_error,
    z_test,
)

from warpmis.device.albedo import COLUMNS, ROWS, albedo_table
from warpmis.device.upload import DeviceScene, upload
from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.events import MIRROR, PASS, make_events
from warpmis.kernels.bsdf.surface import make_surface
from warpmis.kernels.intersect import make_intersect
from warpmis.scene import Camera, Material, Prim, Scene
from warpmis.scene.features import Features
from warpmis.scene.geometry import Geometry
from warpmis.scene.material import SMOOTH_ALPHA, is_smooth

COUNT = 1 << 19
PILOT = 1 << 15
SIGNIFICANCE = sidak(0.01, 80)
DETECTABLE = 0.02
DETECTABLE_BIAS = 0.011

EVERY = Features.all()
surface = make_surface(EVERY)
intersect = make_intersect(EVERY)
events = make_events(EVERY, intersect.transparency)

SAMPLE = 0
EVALUATE = 1
EVENT = 2


@wp.struct
class Probe:
    f_cos: wp.vec3
    pdf: float
    kind: int
    weight: wp.vec3


@wp.kernel(module="unique", enable_backward=False)
def probe(
    scene: SceneView,
    material: int,
    mode: int,
    seed: int,
    wos: wp.array(dtype=wp.vec3),
    wis: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=Probe),
):
    i = wp.tid()
    m = scene.materials[2 * material]
    wo = wos[i % wos.shape[0]]
    p = Probe()
    if mode == EVENT:
        # Equally spaced numbers: the mean over the launch is the expectation.
        event = events.choose(scene, m, wo[2], (float(i) + 0.5) / float(out.shape[0]))
        p.kind = event.kind
        p.weight = event.weight
    else:
        s = surface.prepare(scene, m, wo)
        if mode == SAMPLE:
            key = rng.RngKey()
            key.seed = wp.uint32(seed)
            key.sample = wp.uint32(i)
            wis[i] = surface.sample(s, rng.uniform4(key, 0))
        scattering = surface.evaluate(s, wis[i])
        p.f_cos = scattering.f_cos
        p.pdf = scattering.pdf_solid_angle
    out[i] = p


WHITE = (1.0, 1.0, 1.0)
BLACK = (0.0, 0.0, 0.0)
GOLD = (1.0, 0.78, 0.34)


def ggx(roughness: float) -> Material:
    """Nothing but one GGX lobe that reflects all: F = 1."""
    return Material(use_specular_workflow=True, specular_color=WHITE, diffuse_color=BLACK, roughness=roughness)


MATERIALS: dict[str, Material] = {
    "lambert": Material(lambertian=True, diffuse_color=WHITE),
    "ggx_0.1": ggx(0.1),
    "ggx_0.3": ggx(0.3),
    "ggx_0.6": ggx(0.6),
    "ggx_1.0": ggx(1.0),
    "plastic": Material(diffuse_color=WHITE, roughness=0.3),
    "glossy_plastic": Material(diffuse_color=(0.9, 0.2, 0.1), roughness=0.1),
    "no_interface": Material(diffuse_color=WHITE, roughness=0.5, ior=1.0),
    "gold": Material(diffuse_color=GOLD, metallic=1.0, roughness=0.3),
    "half_metal": Material(diffuse_color=WHITE, metallic=0.5, roughness=0.6),
    "coated_plastic": Material(diffuse_color=WHITE, roughness=0.6, clearcoat=1.0, clearcoat_roughness=0.2),
    "coated_gold": Material(diffuse_color=GOLD, metallic=1.0, roughness=0.5, clearcoat=0.5, clearcoat_roughness=0.1),
    "thick_coat": Material(diffuse_color=WHITE, roughness=0.3, clearcoat=1.0, clearcoat_roughness=0.6, ior=3.0),
    "coat_alone": Material(diffuse_color=BLACK, roughness=0.0, clearcoat=1.0, clearcoat_roughness=0.3),
    "bright_specular": Material(
        use_specular_workflow=True, specular_color=(0.2, 0.9, 0.5), diffuse_color=WHITE, roughness=0.4
    ),
    "mirror": Material(diffuse_color=GOLD, metallic=1.0, roughness=0.0),
    "smooth_plastic": Material(diffuse_color=WHITE, roughness=0.0),
    "smooth_coat": Material(diffuse_color=WHITE, roughness=0.4, clearcoat=1.0),
    "bare_plastic": Material(diffuse_color=WHITE, roughness=0.4),  # smooth_coat's base
    "bare_specular": Material(diffuse_color=BLACK, roughness=0.4),  # and its specular lobe alone
    "smooth_on_smooth": Material(diffuse_color=(0.5, 0.2, 0.8), roughness=0.0, clearcoat=0.7, clearcoat_roughness=0.0),
    "veil": Material(diffuse_color=WHITE, roughness=0.4, opacity=0.3, opacity_mode="presence"),
    "lambert_veil": Material(lambertian=True, diffuse_color=WHITE, opacity=0.6),
    "film": Material(diffuse_color=WHITE, roughness=0.3, opacity=0.3),
    "window": Material(diffuse_color=WHITE, roughness=0.0, opacity=0.0),
    "coated_window": Material(diffuse_color=WHITE, roughness=0.0, opacity=0.2, clearcoat=0.8, ior=2.0),
    "mirror_veil": Material(diffuse_color=GOLD, metallic=1.0, roughness=0.0, opacity=0.5, opacity_mode="presence"),
    "black": Material(lambertian=True, diffuse_color=BLACK),
    "matt": Material(use_specular_workflow=True, specular_color=BLACK, diffuse_color=WHITE, roughness=0.5),
    "coated_white": Material(
        diffuse_color=WHITE, metallic=1.0, roughness=0.5, clearcoat=1.0, clearcoat_roughness=0.5, ior=2.0
    ),
}
NAMES = list(MATERIALS)
COSINES = (0.98, 0.6, 0.25, 0.05)


@cache
def device_scene() -> DeviceScene:
    x, y, z = np.eye(3)
    geometry = Geometry(
        points=np.eye(3, dtype=np.float32),
        triangles=np.array([[0, 1, 2]], np.int32),
        normals=np.zeros((0, 3), np.float32),
        normal_indices=np.full((1, 3), -1, np.int32),
        materials=np.zeros(1, np.int32),
        prims=np.zeros(1, np.int32),
    )
    camera = Camera("/camera", np.zeros(3), x, y, -z, (-1.0, 1.0, -1.0, 1.0))
    return upload(Scene("surfaces", camera, (1, 1), geometry, tuple(MATERIALS.values()), (Prim("/p"),), ()), "cpu")


def outgoing(cos_theta: float) -> NDArray[np.float64]:
    sin_theta = np.sqrt(1.0 - cos_theta**2)
    return np.array([0.8 * sin_theta, -0.6 * sin_theta, cos_theta])


def mirrored(cos_theta: float) -> NDArray[np.float64]:
    return outgoing(cos_theta) * np.array([-1.0, -1.0, 1.0])


def run(
    name: str, mode: int, wo: NDArray[Any], wi: NDArray[Any] | int, seed: int = 1
) -> tuple[NDArray[np.float32], NDArray[Any]]:
    """Launch `probe`; wi is the number of directions to draw, or the directions to evaluate."""
    wos = wp.array(np.atleast_2d(wo).astype(np.float32), dtype=wp.vec3)
    wis = wp.zeros(wi, dtype=wp.vec3) if isinstance(wi, int) else wp.array(wi.astype(np.float32), dtype=wp.vec3)
    out = wp.zeros(len(wis), dtype=Probe)
    wp.launch(probe, len(wis), [device_scene().view, NAMES.index(name), mode, seed, wos, wis, out])
    return wis.numpy(), out.numpy()


def evaluate(name: str, cos_theta: float, wi: NDArray[np.float32]) -> NDArray[Any]:
    return run(name, EVALUATE, outgoing(cos_theta), wi)[1]


# Rings that narrow towards the mirror direction by a constant factor resolve every lobe.
RINGS = np.concatenate([[0.0], np.geomspace(1e-8, 2.0, 100)])


@cache
def albedo(name: str, cos_theta: float) -> NDArray[np.float64]:
    """Integral of f cos over the hemisphere, the mirror's part left out, shape (3,): by quadrature."""
    grid = DirectionGrid.about(mirrored(cos_theta), RINGS, 96)
    return grid.integrals(evaluate(name, cos_theta, grid.points(4))["f_cos"], 4).sum(axis=0)


SAMPLED = [
    ("lambert", 0.6), ("ggx_0.1", 0.98), ("ggx_0.1", 0.05), ("ggx_0.3", 0.98), ("ggx_0.3", 0.05), ("ggx_0.6", 0.98),
    ("ggx_0.6", 0.05), ("ggx_1.0", 0.98), ("ggx_1.0", 0.05), ("plastic", 0.6), ("plastic", 0.05),
    ("glossy_plastic", 0.6), ("gold", 0.25), ("half_metal", 0.25), ("coated_plastic", 0.6), ("coated_plastic", 0.05),
    ("coated_gold", 0.6), ("thick_coat", 0.25), ("coat_alone", 0.6), ("smooth_coat", 0.25), ("smooth_plastic", 0.05),
    ("film", 0.6), ("veil", 0.25),
]  # fmt: skip


# Rings of a tenth of the samples; of ever fewer in the tail, over which the density falls by orders of magnitude, and
# in the middle, where a sharp lobe may stand in a wide one.
LEVELS = np.concatenate(
    [[0.0, 0.003, 0.01, 0.03], np.linspace(0.1, 0.9, 9), 1.0 - 0.1 * 3.0 ** -np.arange(1.0, 7.0), [1.0]]
)


@pytest.mark.parametrize(("name", "cos_theta"), SAMPLED)
def test_directions_have_the_density_that_is_evaluated(name: str, cos_theta: float) -> None:
    wo = outgoing(cos_theta)
    pilot = run(name, SAMPLE, wo, PILOT, seed=2)[0]
    grid = DirectionGrid.fitted(pilot[pilot[:, 2] > 0.0], LEVELS, sectors=12, axis=mirrored(cos_theta))
    wi, out = run(name, SAMPLE, wo, COUNT)
    above = wi[:, 2] > 0.0
    np.testing.assert_allclose(np.linalg.norm(wi[above], axis=1), 1.0, atol=1e-5)
    assert (out["pdf"][above] > 0.0).all()
    # A GGX sample may be reflected below the surface, and is none then: half of them for alpha = 1.
    assert above.mean() > 0.5
    fit, integral = fit_directions(
        wi[above], lambda d: evaluate(name, cos_theta, d)["pdf"], grid, 40, missing=int((~above).sum())
    )
    assert fit.p_value > SIGNIFICANCE, fit
    assert detectable_imbalance(fit.count, fit.dof, SIGNIFICANCE) < DETECTABLE
    assert integral == pytest.approx(above.mean(), abs=5e-3)


@pytest.mark.parametrize(("name", "cos_theta"), SAMPLED)
def test_mean_of_the_samples_weights_is_the_albedo(name: str, cos_theta: float) -> None:
    wi, out = run(name, SAMPLE, outgoing(cos_theta), COUNT, seed=3)
    exact = albedo(name, cos_theta)
    for channel in range(3):
        if exact[channel] == 0.0:
            assert not out["f_cos"][:, channel].any()
            continue
        weights = np.where(wi[:, 2] > 0.0, out["f_cos"][:, channel] / np.maximum(out["pdf"], 1e-30), 0.0)
        # With the quadrature's own error.
        error = float(np.hypot(standard_error(weights), 3e-4 * exact[channel]))
        assert z_test(weights.mean(), error, exact[channel]) > SIGNIFICANCE / 3
        assert detectable_bias(error, SIGNIFICANCE / 3) < DETECTABLE_BIAS * exact[channel]


def random_pairs() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Pairs of directions, half of them near mirror directions of each other."""
    random = np.random.default_rng(1)
    count = 20_000
    wo, wi = random.normal(size=(2, count, 3))
    near = count // 2
    wi[:near] = wo[:near] * [-1.0, -1.0, 1.0] + 0.05 * random.normal(size=(near, 3))
    wo[:, 2], wi[:, 2] = np.abs(wo[:, 2]) + 1e-2, np.abs(wi[:, 2]) + 1e-2
    unit = (w / np.linalg.norm(w, axis=1)[:, None] for w in (wo, wi))
    return next(unit).astype(np.float32), next(unit).astype(np.float32)


@pytest.mark.parametrize("name", ["lambert", "no_interface", "smooth_plastic", "lambert_veil"])
def test_matt_surfaces_scatter_reciprocally_below_smooth_interfaces(name: str) -> None:
    """f(wo, wi) = f(wi, wo)."""
    wo, wi = random_pairs()
    there = run(name, EVALUATE, wo, wi)[1]["f_cos"] / wi[:, 2:]
    back = run(name, EVALUATE, wi, wo)[1]["f_cos"] / wo[:, 2:]
    np.testing.assert_allclose(there, back, rtol=1e-3, atol=1e-6)
    assert there.any()


@pytest.mark.parametrize("name", ["ggx_0.1", "ggx_0.3", "ggx_0.6", "ggx_1.0"])
def test_lobes_scatter_reciprocally_but_for_the_compensation_of_the_view(name: str) -> None:
    """f(wo, wi) E(wo) = f(wi, wo) E(wi): what multiple scattering adds depends on wo alone (Turquin 2019)."""
    roughness = MATERIALS[name].roughness
    wo, wi = random_pairs()
    there = run(name, EVALUATE, wo, wi)[1]["f_cos"] / wi[:, 2:] * masked(roughness, wo)
    back = run(name, EVALUATE, wi, wo)[1]["f_cos"] / wo[:, 2:] * masked(roughness, wi)
    np.testing.assert_allclose(there, back, rtol=1e-3, atol=1e-6)
    assert there.any()


def masked(roughness: Any, w: NDArray[np.float32]) -> NDArray[np.float64]:
    """What a white lobe reflects in all without compensation, shape (n, 1)."""
    return white_albedo(roughness, w[:, 2])[:, :1]


def white_albedo(roughness: Any, cosines: NDArray[Any]) -> NDArray[np.float64]:
    """The table's E and B between its entries, in NumPy, shape (n, 2)."""
    row = np.clip(np.sqrt(roughness) * (ROWS - 1), 0.0, ROWS - 1.0001)
    column = np.clip(np.sqrt(cosines) * (COLUMNS - 1), 0.0, COLUMNS - 1.0001)
    r, c = int(row), column.astype(int)
    table = albedo_table().astype(float)
    low, high = (table[i, c] + (table[i, c + 1] - table[i, c]) * (column - c)[:, None] for i in (r, r + 1))
    albedos: NDArray[np.float64] = low + (high - low) * (row - r)
    return albedos


def test_nothing_is_scattered_below_the_surface() -> None:
    wi = np.array([[0.0, 0.6, -0.8], [0.6, 0.8, 0.0]], dtype=np.float32)
    for name in NAMES:
        out = evaluate(name, 0.6, wi)
        assert not out["f_cos"].any()
        assert not out["pdf"].any()


@pytest.mark.parametrize("cos_theta", COSINES)
def test_white_lambert_reflects_exactly_what_arrives(cos_theta: float) -> None:
    np.testing.assert_allclose(albedo("lambert", cos_theta), 1.0, atol=5e-4)


@pytest.mark.parametrize("cos_theta", (*COSINES, 0.01))
@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6, 1.0])
def test_white_metal_reflects_exactly_what_arrives(roughness: float, cos_theta: float) -> None:
    """White furnace: single scattering by Walter et al. (2007), and what masking loses brought back."""
    np.testing.assert_allclose(albedo(f"ggx_{roughness}", cos_theta), 1.0, atol=6e-3)


@pytest.mark.parametrize("cos_theta", (*COSINES, 0.01))
@pytest.mark.parametrize("name", ["plastic", "no_interface", "bare_plastic", "coated_plastic", "coated_white"])
def test_white_layers_reflect_exactly_what_arrives(name: str, cos_theta: float) -> None:
    """What a lobe or a coat does not reflect reaches a white base, and comes back."""
    np.testing.assert_allclose(albedo(name, cos_theta), 1.0, atol=4e-3)


def test_a_specular_color_of_0_is_purely_matt() -> None:
    wi = random_pairs()[1]
    for cos_theta in COSINES:
        matt = evaluate("lambert", cos_theta, wi)["f_cos"]
        np.testing.assert_allclose(evaluate("matt", cos_theta, wi)["f_cos"], matt, rtol=1e-6)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6, 1.0])
def test_the_table_is_the_lobes_albedo(roughness: float) -> None:
    """Against Walter et al. (2007), equations 33 and 34, in float64 over microfacet normals, not over directions."""
    cosines = np.array(COSINES)
    w = np.stack([np.sqrt(1.0 - cosines**2), np.zeros(len(cosines)), cosines], axis=-1).astype(np.float32)
    exact = [masking_albedo(roughness**2, outgoing(cos_theta)) for cos_theta in COSINES]
    np.testing.assert_allclose(masked(roughness, w)[:, 0], exact, rtol=4e-3)


def masking_albedo(alpha: float, wo: NDArray[Any]) -> float:
    # tan(theta_h) = alpha tan(t), with equal steps of t: the steps follow the distribution.
    t = (np.arange(2000) + 0.5) / 2000 * (np.pi / 2)
    phi = (np.arange(400) + 0.5) / 400 * 2.0 * np.pi
    theta = np.arctan(alpha * np.tan(t))
    d_theta = alpha / (np.cos(t) ** 2 + (alpha * np.sin(t)) ** 2) * (np.pi / 2 / 2000)
    cos_h = np.cos(theta)[:, None]
    h = np.stack(np.broadcast_arrays(np.sin(theta)[:, None] * np.cos(phi), np.sin(theta)[:, None] * np.sin(phi), cos_h))
    d = alpha**2 / (np.pi * cos_h**4 * (alpha**2 + np.tan(theta)[:, None] ** 2) ** 2)

    def g1(cosine: NDArray[Any]) -> NDArray[Any]:
        squared = np.maximum(cosine, 1e-12) ** 2
        return np.where(cosine > 0.0, 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * (1.0 - squared) / squared)), 0.0)

    projected = np.maximum(np.tensordot(wo, h, 1), 0.0)
    wi_z = 2.0 * projected * cos_h - wo[2]
    d_h = np.sin(theta)[:, None] * d_theta[:, None] * (2.0 * np.pi / 400)
    return float((d * g1(wo[2]) * g1(wi_z) * projected / wo[2] * d_h).sum())


# What the specification makes of a material, in NumPy.


def lobe_albedo(f0: NDArray[np.float64], roughness: Any, cos_theta: float, is_compensated: bool) -> NDArray[np.float64]:
    """What a lobe of reflectance f0 reflects in all."""
    white, grazing = white_albedo(roughness, np.array([cos_theta]))[0]
    if is_smooth(roughness):
        white, grazing = 1.0, (1.0 - cos_theta) ** 5
    found = f0 * (white - grazing) + min(50.0 * f0.max(), 1.0) * grazing
    return found * (1.0 + f0 * (1.0 - white) / white) if is_compensated else found


def albedos(material: Material, cos_theta: float) -> tuple[NDArray[np.float64], float]:
    """What the base's lobe and the coat reflect."""
    f0 = ((1.0 - material.ior) / (1.0 + material.ior)) ** 2
    base = np.full(3, f0) * (1.0 - material.metallic) + np.array(material.diffuse_color) * material.metallic
    if material.use_specular_workflow:
        base = np.array(material.specular_color)
    if material.lambertian:
        return np.zeros(3), 0.0
    coat = lobe_albedo(np.array([f0]), material.clearcoat_roughness, cos_theta, False)[0]
    return lobe_albedo(base, material.roughness, cos_theta, True), material.clearcoat * coat


def analytic_shares(material: Material, cos_theta: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Passed straight through, reflected as by mirrors, and the factor on the remaining scattering."""
    base, coat = albedos(material, cos_theta)
    smooth_base = 0.0 if material.lambertian or not is_smooth(material.roughness) else 1.0
    smooth_coat = 1.0 if is_smooth(material.clearcoat_roughness) else 0.0
    mirror = smooth_base * base * (1.0 - coat) + smooth_coat * coat
    if material.lambertian or material.opacity_mode == "presence":
        return np.full(3, 1.0 - material.opacity), material.opacity * mirror, material.opacity
    return (1.0 - material.opacity) * (1.0 - base) * (1.0 - coat), mirror, 1.0


def expected_events(name: str, cos_theta: float) -> tuple[NDArray[np.float64], ...]:
    """Mean of the event's weight where it passes, where it is a mirror, and where it is neither, shape (3,) each."""
    _, out = run(name, EVENT, outgoing(cos_theta), np.zeros((1 << 16, 3)))
    kinds = (PASS, MIRROR, 0)
    return tuple(np.where(out["kind"][:, None] == kind, out["weight"], 0.0).mean(axis=0, dtype=float) for kind in kinds)


@pytest.mark.parametrize("name", NAMES)
def test_events_bring_their_analytic_shares_on_average(name: str) -> None:
    """The probability of each choice times its weight."""
    material = MATERIALS[name]
    assert SMOOTH_ALPHA == 1e-3
    for cos_theta in COSINES:
        through, mirror, rest = expected_events(name, cos_theta)
        want_through, want_mirror, want_rest = analytic_shares(material, cos_theta)
        np.testing.assert_allclose(through, want_through, atol=2e-4)
        np.testing.assert_allclose(mirror, want_mirror, atol=2e-4)
        # Where nothing is left to scatter there is no choice of it.
        scatters = albedo(name, cos_theta).any()
        np.testing.assert_allclose(rest, want_rest if scatters else 0.0, atol=2e-4)


@pytest.mark.parametrize("name", NAMES)
def test_no_material_creates_energy(name: str) -> None:
    """White furnace: what passes, mirrors and scatters is no more than what arrives, from any direction."""
    for cos_theta in (*COSINES, 0.01):
        through, mirror, rest = expected_events(name, cos_theta)
        scattered = albedo(name, cos_theta) * rest
        total = through + mirror + scattered
        # The albedos are interpolated from a table.
        assert (total <= 1.0 + 2e-3).all(), (cos_theta, total)
        if name != "black":
            assert total.max() > 0.03


def test_lobes_below_a_coat_get_what_it_leaves_over() -> None:
    """f = (1 - E_c(wo)) times the base's; below the base's own lobe, the matt one as a smooth interface shapes it."""
    coated, bare = MATERIALS["smooth_coat"], MATERIALS["bare_plastic"]
    assert is_smooth(coated.clearcoat_roughness)
    wi = random_pairs()[1]
    for cos_theta in COSINES:
        below = 1.0 - albedos(coated, cos_theta)[1]
        assert below < 0.97
        base = evaluate("bare_plastic", cos_theta, wi)["f_cos"]
        np.testing.assert_allclose(evaluate("smooth_coat", cos_theta, wi)["f_cos"], base * below, rtol=1e-4)
        specular = evaluate("bare_specular", cos_theta, wi)["f_cos"]
        f0, m5 = 0.04, (1.0 - wi[:, 2:].astype(float)) ** 5
        shape = (1.0 - f0 - (1.0 - f0) * m5) / (1.0 - f0 - (1.0 - f0) / 21.0)
        matt = (1.0 - albedos(bare, cos_theta)[0]) * shape * wi[:, 2:] / np.pi
        # The lobe is subtracted from a sum in float32.
        np.testing.assert_allclose(base - specular, matt, rtol=2e-3, atol=2e-5 * (1.0 + specular.max()))
