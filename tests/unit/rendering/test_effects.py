"""What a scene does not call for is absent from its kernel, and the kernel with everything traces the same paths."""

from __future__ import annotations

import importlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
import warp as wp
from hard.checks import scene_of

import warpmis
from warpmis.config import RenderConfig
from warpmis.device.compilation import load_kernels
from warpmis.device.kernel_cache import folder_of
from warpmis.kernels.trace import make_trace
from warpmis.rendering.specialise import features_of
from warpmis.scene import DomeLight, Material
from warpmis.scene.features import Features, detect
from warpmis.scene.texture import Texture, TextureLookup

pytestmark = pytest.mark.own_kernels

BALANCE = RenderConfig(method="balance")

# Functions that the effect alone calls, by their names in the generated source.
FUNCTIONS = {
    "disk_light": ("sample_disk", "hit_disk"),
    "sphere_light": ("sample_sphere", "hit_sphere"),
    "cylinder_light": ("sample_cylinder", "hit_cylinder"),
    "distant_light": ("sample_distant", "hit_distant"),
    "dome_constant": ("sample_dome_constant", "pdf_dome_constant"),
    "dome_picture": ("sample_dome_picture", "dome_radiance"),
    "mesh_light": ("make_mesh__locals__sample", "make_on_ray__locals__pdf_emitter_triangles"),
    "light_tree": ("make_light_tree__locals__choose_leaf", "make_light_tree__locals__leaf_pmf", "boxes_on_ray"),
    "glossy_choice": ("towards", "response_of"),
    "delta_light": ("make_direct_light__locals__from_delta_light",),
    "shaping": ("shaping_factor",),
    "ies": ("ies_factor",),
    "light_pictures": ("picture_factor",),
    "light_response": ("make_control__locals__response",),
    "light_links": ("make_control__locals__factor",),
    "shadow_links": ("has_shadow_link",),
    "clearcoat": ("coat_albedo",),
    "smooth": ("make_events__locals__choose",),
    "emissive_instances": (
        "make_choice__locals__choose_in_place",
        "receiver_in_place",
        "make_on_ray__locals__pdf_emitters_of_places",
    ),
    "instances": (
        "make_instances__locals__closest_hit_of_all",
        "make_instances__locals__instance_surface",
        "normal_to_world",
    ),
    "opacity": ("make_transmittance__locals__is_opaque", "make_intersect__locals__transparency"),
    "transmission": ("sample_interface", "pane_transmittance"),
    "rough_transmission": ("evaluate_side", "make_interface__locals__add_light_and_choose_side"),
    "absorption": ("make_emission__locals__arriving",),
    "textures": ("picture_value", "footprint", "filtered"),
    "normal_maps": ("make_intersect__locals__apply_normal_map",),
    "clipping": ("clipped",),
}


def source_of(features: Features) -> str:
    """The trace kernel's source as generated."""
    kernel = make_trace(features)
    load_kernels([kernel], "cpu")
    (source,) = folder_of(kernel.module, is_cpu=True).glob("*.cpp")
    return source.read_text()


def functions_in(source: str) -> set[str]:
    """Names of the device functions, as far as they have a body."""
    return set(re.findall(r"^static [^\n(]*?(\w+)_\d+\($", source, re.MULTILINE))


def draws_in(source: str) -> int:
    """Places where a step of a path draws random numbers; one more is the sampler's own, for later steps."""
    return len(re.findall(r"= (?:uniform4|point4)_of_step_\d+\(", source)) - 1


@pytest.fixture(scope="module")
def universal() -> str:
    return source_of(features_of(scenes.room(), BALANCE, Features.all()))


@pytest.fixture(scope="module")
def special() -> str:
    return source_of(features_of(scenes.room(), BALANCE))


@pytest.mark.parametrize("effect", FUNCTIONS)
def test_an_absent_effect_is_absent_from_the_source(effect: str, special: str, universal: str) -> None:
    assert not getattr(detect(scenes.room()), effect)
    assert set(FUNCTIONS[effect]) <= functions_in(universal)
    assert not set(FUNCTIONS[effect]) & functions_in(special)


def test_paths_of_one_bounce_take_no_light_samples_beside_the_mixture(special: str) -> None:
    """Direct light alone, and the mixture's vertex is the only one."""
    assert "make_direct_light__locals__light_sample" in functions_in(special)
    short = features_of(scenes.room(), replace(BALANCE, max_depth=1))
    assert not short.indirect
    assert "make_direct_light__locals__light_sample" not in functions_in(source_of(short))


def test_random_numbers_of_absent_effects_are_not_drawn(special: str, universal: str) -> None:
    """Of a light, a direction, roulette; of delta lights, events, interfaces and what a rough one takes as well;
    without indirect light not of roulette."""
    assert draws_in(special) == 3
    assert draws_in(universal) == 10
    assert draws_in(source_of(features_of(scenes.room(), replace(BALANCE, max_depth=1)))) == 2


def test_indirect_light_needs_a_surface_that_reflects_and_two_bounces() -> None:
    black = Material(path="/black", diffuse_color=(0.0, 0.0, 0.0), lambertian=True)
    assert detect(scenes.room()).indirect
    assert not detect(replace(scenes.room(), materials=(black,) * 3)).indirect
    assert detect(replace(scenes.room(), materials=(black, black, scenes.METAL))).indirect
    assert [features_of(scenes.room(), replace(BALANCE, max_depth=depth)).indirect for depth in (0, 1, 2)] == [
        False,
        False,
        True,
    ]
    assert features_of(scenes.room(), replace(BALANCE, max_depth=0), Features.all()).indirect


def hard_cases() -> dict[str, Any]:
    """The stages of tests/hard, by name."""
    tests = Path(__file__).parents[2]
    modules = [importlib.import_module(f"hard.{path.stem}") for path in sorted((tests / "hard").glob("*_cases.py"))]
    return {case.name: case for module in modules for case in getattr(module, module.__name__[5:].upper())}


HARD_CASES = hard_cases()


def assert_same_paths(scene: warpmis.Scene, **settings: Any) -> None:
    """All but a thousandth of the pixels to 1e-4, and the mean: compilers may round differently, paths are equal."""
    settings = {"method": "balance", "spp": 16, "seed": 3, **settings}
    mine = warpmis.render(scene, **settings).image.astype(float)
    theirs = warpmis.render(scene, features=Features.all(), **settings).image.astype(float)
    close = np.isclose(mine, theirs, rtol=1e-4, atol=0.0).all(axis=-1)
    assert close.mean() >= 0.999
    assert mine.mean() == pytest.approx(theirs.mean(), rel=1e-4)


@pytest.mark.parametrize("name", sorted(path.parent.name for path in scenes.USD_SCENES.glob("*/scene.usda")))
def test_universal_kernel_traces_the_same_paths(name: str) -> None:
    assert_same_paths(warpmis.load_stage(scenes.USD_SCENES / name / "scene.usda", width=64))


@pytest.mark.slow
@pytest.mark.parametrize("name", HARD_CASES)
def test_universal_kernel_traces_the_same_paths_of_hard_cases(name: str) -> None:
    case = HARD_CASES[name]
    settings = {key: value for key, value in case.settings.items() if not key.startswith("learn")}  # for `balance`
    assert_same_paths(scene_of(case), **settings)


@pytest.mark.parametrize(("roughnesses", "light_samples"), [((0, 20), False), ((0, 255), True), ((128, 255), True)])
def test_glass_whose_picture_is_rough_anywhere_takes_light_samples(
    roughnesses: tuple[int, int], light_samples: bool
) -> None:
    """Roughness 20 / 255 is an alpha of 0.006."""
    picture = Texture({1001: np.array([[[value] for value in roughnesses]], np.uint8)})
    glass = Material(path="/glass", transmission=1.0, roughness=TextureLookup(picture, channels="r"))
    scene = scenes.room(8)
    scene = replace(scene, materials=(glass, *scene.materials[1:]))
    assert detect(scene).transmission
    assert detect(scene).rough_transmission == light_samples


def test_arrays_of_absent_effects_are_not_uploaded() -> None:
    plain = warpmis.render(scenes.room(), method="balance", spp=1).stats["bytes"]["scene"]
    assert set(plain) == {"geometry", "materials", "lights"}
    sky = DomeLight("/sky", np.eye(3), np.ones(3), np.ones((4, 8, 3), np.float32))
    open_room = replace(scenes.room(), lights=(sky,))
    with_dome = warpmis.render(open_room, method="balance", spp=1).stats["bytes"]["scene"]
    # Picture (12 bytes a texel), rows (4), and within them cumulative shares and density (4 each); half as many parts
    # of the rows and of each row's columns, and one more.
    assert with_dome["dome"] == 4 * 8 * 12 + 4 * 4 + 2 * 4 * 8 * 4 + 4 * (2 + 1) + 4 * 4 * (4 + 1)
    assert set(with_dome) == {*plain, "dome"}


def test_what_is_compiled_is_counted_and_announced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    @wp.kernel(module="unique", enable_backward=False)
    def fill(values: wp.array(dtype=float)):
        values[wp.tid()] = 47.0

    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    announced: list[int] = []
    first = load_kernels([fill, fill], "cpu", announced.append)
    again = load_kernels([fill], "cpu", announced.append)
    assert (first.compiled, first.cached, again.compiled, again.cached) == (1, 0, 0, 1)
    assert announced == [1]
    assert first.seconds > again.seconds > 0.0
