"""MaterialX's glTF and unlit surfaces, and surfaces of BSDF nodes, beside the same materials in other terms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from usd.networks import image, node, square, the
from usd.pictures import write
from usd.points import seen_at
from usd.stages import mentions

from warpmis.scene import Scene

GLTF = "ND_gltf_pbr_surfaceshader"
STANDARD = "ND_standard_surface_surfaceshader"


def seen(scene: Scene, name: str) -> np.ndarray:
    assert scene.warnings == ()
    return seen_at(scene, [(0.5, 0.5)])[name][0]


def bsdf(name: str, kind: str, inputs: str = "") -> str:
    """A node whose output is a BSDF or an EDF, which USD writes as a token."""
    return node(name, f"ND_{kind}", inputs).replace("color3f outputs:out", "token outputs:out")


def surface(nodes: str, inputs: str = "token inputs:bsdf.connect = </M/B.outputs:out>") -> Scene:
    return square("ND_surface", inputs, nodes)


def test_gltf_of_constants() -> None:
    gltf = """color3f inputs:base_color = (0.25, 0.125, 0.5)
        float inputs:metallic = 0.25
        float inputs:roughness = 0.375
        float inputs:clearcoat = 0.75
        float inputs:clearcoat_roughness = 0.125
        color3f inputs:emissive = (1, 0.5, 0)
        float inputs:emissive_strength = 4
        float inputs:alpha = 0.5
        int inputs:alpha_mode = 2"""
    standard = """float inputs:base = 1
        color3f inputs:base_color = (0.25, 0.125, 0.5)
        float inputs:metalness = 0.25
        float inputs:specular_roughness = 0.375
        float inputs:coat = 0.75
        float inputs:coat_roughness = 0.125
        color3f inputs:emission_color = (1, 0.5, 0)
        float inputs:emission = 4
        color3f inputs:opacity = (0.5, 0.5, 0.5)"""
    assert the(square(GLTF, gltf)) == the(square(STANDARD, standard))


def test_gltf_as_it_comes_is_a_rough_white_metal() -> None:
    material = the(square(GLTF))
    assert (material.diffuse_color, material.metallic, material.roughness) == ((1.0, 1.0, 1.0), 1.0, 1.0)


@pytest.mark.parametrize("mode, alpha, opacity", [(0, 0.25, 1.0), (1, 0.25, 0.0), (1, 0.75, 1.0), (2, 0.25, 0.25)])
def test_gltf_alpha_modes(mode: int, alpha: float, opacity: float) -> None:
    material = the(square(GLTF, f"int inputs:alpha_mode = {mode}\nfloat inputs:alpha = {alpha}"))
    assert material.opacity == opacity


def test_gltf_mask_of_a_picture(tmp_path) -> None:
    texels = np.array([[0.2, 0.4], [0.6, 0.8]])[..., None]
    inputs = "int inputs:alpha_mode = 1\nfloat inputs:alpha.connect = </M/A.outputs:out>"
    scene = square(GLTF, inputs, image("A", write(tmp_path / "a.exr", texels), "float"))
    assert the(scene).opacity_threshold == 0.5
    found = seen_at(scene, [(0.25, 0.25), (0.25, 0.75)])["opacity"]
    np.testing.assert_allclose(found, [1.0, 0.0])


def test_gltf_glass_is_thin_without_thickness_and_absorbs_with_it() -> None:
    inputs = "float inputs:transmission = 1\nfloat inputs:metallic = 0\ncolor3f inputs:base_color = (0.5, 1, 0.75)"
    thin = the(square(GLTF, inputs))
    assert thin.thin_walled and thin.transmission == 1.0 and thin.transmission_color == (0.5, 1.0, 0.75)
    within = """
        float inputs:thickness = 1
        float inputs:attenuation_distance = 2
        color3f inputs:attenuation_color = (1, 0.5, 0.5)"""
    solid = the(square(GLTF, inputs + within))
    assert (solid.thin_walled, solid.transmission_depth, solid.transmission_color) == (False, 2.0, (1.0, 0.5, 0.5))


def test_gltf_specular_color_and_weight() -> None:
    inputs = "float inputs:metallic = 0\nfloat inputs:specular = 0.5\ncolor3f inputs:specular_color = (1, 0.5, 0.25)"
    np.testing.assert_allclose(seen(square(GLTF, inputs), "specular_f0"), 0.02 * np.array([1, 0.5, 0.25]), rtol=1e-5)


def test_unlit_emits_and_reflects_nothing() -> None:
    scene = square("ND_surface_unlit", "float inputs:emission = 2\ncolor3f inputs:emission_color = (1, 0.5, 0.25)")
    np.testing.assert_allclose(seen(scene, "emission"), [2, 1, 0.5])
    np.testing.assert_allclose(seen(scene, "diffuse"), 0)
    np.testing.assert_allclose(seen(scene, "specular_f0"), 0)


def test_unlit_transmission_does_not_dim_what_it_emits() -> None:
    scene = square("ND_surface_unlit", "float inputs:transmission = 0.75")
    assert seen(scene, "opacity") == 0.25
    np.testing.assert_allclose(seen(scene, "emission"), 1.0)


@pytest.mark.parametrize("kind", ["oren_nayar_diffuse_bsdf", "burley_diffuse_bsdf"])
def test_a_diffuse_node_is_diffuse_alone(kind: str) -> None:
    scene = surface(bsdf("B", kind, "color3f inputs:color = (0.5, 0.25, 1)\nfloat inputs:weight = 0.5"))
    np.testing.assert_allclose(seen(scene, "diffuse"), [0.25, 0.125, 0.5])
    np.testing.assert_allclose(seen(scene, "specular_f0"), 0)


def test_a_layer_of_dielectric_over_diffuse_is_a_preview_surface() -> None:
    nodes = bsdf("D", "oren_nayar_diffuse_bsdf", "color3f inputs:color = (0.5, 0.25, 1)")
    nodes += bsdf("T", "dielectric_bsdf", "float inputs:ior = 1.5\nfloat2 inputs:roughness = (0.25, 0.25)")
    nodes += bsdf("B", "layer_bsdf", "token inputs:top.connect = </M/T.outputs:out>\n"
                  "token inputs:base.connect = </M/D.outputs:out>")  # fmt: skip
    found = the(surface(nodes))
    expected = the(square("UsdPreviewSurface", """color3f inputs:diffuseColor = (0.5, 0.25, 1)
        float inputs:roughness = 0.5
        float inputs:ior = 1.5
        token inputs:opacityMode = "presence" """, context=""))  # fmt: skip
    assert found.ior == pytest.approx(1.5)
    assert replace(found, ior=1.5) == expected


def test_a_conductor_reflects_by_fresnels_formula() -> None:
    n, k = np.array([0.2, 1.5, 1.0]), np.array([3.9, 0.0, 1.0])
    inputs = f"color3f inputs:ior = {tuple(n.tolist())}\ncolor3f inputs:extinction = {tuple(k.tolist())}"
    scene = surface(bsdf("B", "conductor_bsdf", inputs + "\nfloat2 inputs:roughness = (0.25, 0.25)"))
    expected = ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)
    np.testing.assert_allclose(seen(scene, "specular_f0"), expected, rtol=1e-5)
    np.testing.assert_allclose(seen(scene, "alpha"), 0.25, rtol=1e-5)


def test_artistic_ior_gives_the_reflectivity_back() -> None:
    color = np.array([0.944, 0.776, 0.373])
    ior = node("I", "ND_artistic_ior", f"color3f inputs:reflectivity = {tuple(color.tolist())}", out="ior")
    ior = ior.replace("color3f outputs:ior", "color3f outputs:ior\ncolor3f outputs:extinction")
    inputs = (
        "color3f inputs:ior.connect = </M/I.outputs:ior>\ncolor3f inputs:extinction.connect = </M/I.outputs:extinction>"
    )
    scene = surface(ior + bsdf("B", "conductor_bsdf", inputs))
    np.testing.assert_allclose(seen(scene, "specular_f0"), color, rtol=1e-4)


def test_mixed_and_multiplied_nodes() -> None:
    nodes = bsdf("D", "oren_nayar_diffuse_bsdf", "color3f inputs:color = (0.5, 0.25, 1)")
    nodes += bsdf("C", "generalized_schlick_bsdf", "color3f inputs:color0 = (0.8, 0.4, 0.2)")
    nodes += bsdf("X", "mix_bsdf", "token inputs:fg.connect = </M/C.outputs:out>\n"
                  "token inputs:bg.connect = </M/D.outputs:out>\nfloat inputs:mix = 0.25")  # fmt: skip
    nodes += bsdf("B", "multiply_bsdfC", "token inputs:in1.connect = </M/X.outputs:out>\n"
                  "color3f inputs:in2 = (0.5, 1, 1)")  # fmt: skip
    scene = surface(nodes)
    np.testing.assert_allclose(seen(scene, "diffuse"), 0.75 * np.array([0.25, 0.25, 1]), rtol=1e-5)
    np.testing.assert_allclose(seen(scene, "specular_f0"), 0.25 * np.array([0.4, 0.4, 0.2]), rtol=1e-5)


def test_added_lobes() -> None:
    nodes = bsdf("D", "burley_diffuse_bsdf", "color3f inputs:color = (0.5, 0.25, 0)")
    nodes += bsdf("E", "oren_nayar_diffuse_bsdf", "color3f inputs:color = (0.25, 0.25, 0.5)")
    nodes += bsdf("B", "add_bsdf", "token inputs:in1.connect = </M/D.outputs:out>\n"
                  "token inputs:in2.connect = </M/E.outputs:out>")  # fmt: skip
    np.testing.assert_allclose(seen(surface(nodes), "diffuse"), [0.75, 0.5, 0.5])


def test_a_dielectric_over_a_metal_is_a_coat() -> None:
    nodes = bsdf("C", "conductor_bsdf", "float2 inputs:roughness = (0.25, 0.25)")
    nodes += bsdf("T", "dielectric_bsdf", "float inputs:weight = 0.5\nfloat inputs:ior = 1.6\n"
                  "float2 inputs:roughness = (0.04, 0.04)")  # fmt: skip
    nodes += bsdf("B", "layer_bsdf", "token inputs:top.connect = </M/T.outputs:out>\n"
                  "token inputs:base.connect = </M/C.outputs:out>")  # fmt: skip
    material = the(surface(nodes))
    assert material.clearcoat == pytest.approx(0.5) and material.clearcoat_roughness == pytest.approx(0.2)
    assert material.ior == pytest.approx(1.6) and material.roughness == pytest.approx(0.5)


def test_a_dielectric_that_scatters_both_ways_is_glass() -> None:
    scene = surface(bsdf("B", "dielectric_bsdf", """token inputs:scatter_mode = "RT"
        color3f inputs:tint = (0.5, 1, 0.75)
        float inputs:ior = 1.25"""))  # fmt: skip
    material = the(scene)
    assert (material.transmission, material.ior, material.transmission_color) == (1.0, 1.25, (0.5, 1.0, 0.75))


def test_half_glass_half_diffuse() -> None:
    nodes = bsdf("D", "oren_nayar_diffuse_bsdf", "color3f inputs:color = (0.5, 0.25, 1)")
    nodes += bsdf("G", "dielectric_bsdf", 'token inputs:scatter_mode = "T"\ncolor3f inputs:tint = (0.5, 1, 0.75)')
    nodes += bsdf("B", "mix_bsdf", "token inputs:fg.connect = </M/G.outputs:out>\n"
                  "token inputs:bg.connect = </M/D.outputs:out>\nfloat inputs:mix = 0.5")  # fmt: skip
    material = the(surface(nodes))
    assert material.transmission == 0.5 and material.transmission_color == (0.5, 1.0, 0.75)
    np.testing.assert_allclose(material.diffuse_color, (0.5, 0.25, 1.0))


def test_emission_of_edf_nodes() -> None:
    nodes = bsdf("U", "uniform_edf", "color3f inputs:color = (4, 2, 1)")
    nodes += bsdf("E", "multiply_edfC", "token inputs:in1.connect = </M/U.outputs:out>\n"
                  "color3f inputs:in2 = (1, 0.5, 0.5)")  # fmt: skip
    scene = surface(nodes, "token inputs:edf.connect = </M/E.outputs:out>\nfloat inputs:opacity = 0.5")
    np.testing.assert_allclose(seen(scene, "emission"), 0.5 * np.array([4, 1, 0.5]))


def test_a_normal_map_of_bsdf_nodes(tmp_path) -> None:
    tilt = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    nodes = image("I", write(tmp_path / "n.exr", np.broadcast_to(0.5 + 0.5 * tilt, (2, 2, 3))), "vector3")
    nodes += node("N", "ND_normalmap_float", "float3 inputs:in.connect = </M/I.outputs:out>", "vector3")
    nodes += bsdf("T", "dielectric_bsdf", "float3 inputs:normal.connect = </M/W.outputs:out>")
    nodes += node("W", "ND_normal_vector3", "", "vector3")
    nodes += bsdf("D", "oren_nayar_diffuse_bsdf", "float3 inputs:normal.connect = </M/N.outputs:out>")
    nodes += bsdf("B", "layer_bsdf", "token inputs:top.connect = </M/T.outputs:out>\n"
                  "token inputs:base.connect = </M/D.outputs:out>")  # fmt: skip
    np.testing.assert_allclose(seen(surface(nodes), "normal"), tilt, atol=1e-5)


def test_what_does_not_map_is_named_once() -> None:
    nodes = bsdf("T", "sheen_bsdf") + bsdf("D", "oren_nayar_diffuse_bsdf", "float inputs:roughness = 1")
    nodes += bsdf("B", "layer_bsdf", "token inputs:top.connect = </M/T.outputs:out>\n"
                  "token inputs:base.connect = </M/D.outputs:out>")  # fmt: skip
    scene = surface(nodes)
    assert mentions(scene, "/M", "ND_sheen_bsdf") and mentions(scene, "/M", "roughness", "oren_nayar_diffuse_bsdf")
    assert len(scene.warnings) == 2
    np.testing.assert_allclose(scene.materials[0].diffuse_color, 0.18)


def test_a_circle_of_layers_ends() -> None:
    both = "token inputs:{}.connect = </M/B.outputs:out>\ntoken inputs:{}.connect = </M/B.outputs:out>"
    assert mentions(surface(bsdf("B", "layer_bsdf", both.format("base", "top"))), "/M/B", "circle")
    emitting = surface(bsdf("B", "add_edf", both.format("in1", "in2")), "token inputs:edf.connect = </M/B.outputs:out>")
    assert mentions(emitting, "/M/B", "circle")


def test_a_node_that_is_shared_is_read_once() -> None:
    """Forty additions of a node to itself would be 2^40 nodes."""
    nodes = bsdf("N0", "oren_nayar_diffuse_bsdf", "color3f inputs:color = (1e-13, 1e-13, 1e-13)")
    for k in range(40):
        both = f"token inputs:in1.connect = </M/N{k}.outputs:out>\ntoken inputs:in2.connect = </M/N{k}.outputs:out>"
        nodes += bsdf(f"N{k + 1}", "add_bsdf", both)
    scene = surface(nodes, "token inputs:bsdf.connect = </M/N40.outputs:out>")
    np.testing.assert_allclose(seen(scene, "diffuse"), 2.0**40 * 1e-13, rtol=1e-5)


@pytest.mark.parametrize(
    "kind",
    [STANDARD, "ND_standard_surface_surfaceshader_100", "ND_open_pbr_surface_surfaceshader", GLTF, "ND_surface_unlit"],
)
@pytest.mark.parametrize(
    "weights",
    [
        (),
        ("coat", "coat_weight", "clearcoat", "emission", "emission_luminance"),
        ("transmission", "transmission_weight"),
    ],
)
def test_defaults_are_those_of_the_library(kind: str, weights: tuple[str, ...]) -> None:
    """Nothing authored, and all of the library's defaults authored, are one material; also with coat or with glass."""
    library = pytest.importorskip("MaterialX")
    document = library.createDocument()
    library.loadLibraries(library.getDefaultDataLibraryFolders(), library.getDefaultDataSearchPath(), document)
    numbers = {"float": ("float", 1), "color3": ("color3f", 3), "integer": ("int", 1), "boolean": ("bool", 1)}
    authored, weighted = "", ""
    for each in document.getNodeDef(kind).getActiveInputs():
        if each.getType() not in numbers or not each.getValueString():
            continue
        usd, width = numbers[each.getType()]
        value = {"true": "1", "false": "0"}.get(each.getValueString(), each.getValueString())
        value = "0.5" if each.getName() in weights else f"({value})" if width == 3 else value
        authored += f"{usd} inputs:{each.getName()} = {value}\n"
        weighted += f"{usd} inputs:{each.getName()} = 0.5\n" if each.getName() in weights else ""
    assert authored.count("inputs:") >= 5
    found, expected = square(kind, authored), square(kind, weighted)
    assert found.warnings == expected.warnings
    # The cached mean is the material again.
    for name, one in ((name, one) for name, one in vars(found.materials[0]).items() if name != "mean"):
        other = getattr(expected.materials[0], name)
        if isinstance(one, str | bool | type(None)):
            assert one == other, name
        else:
            np.testing.assert_allclose(one, other, rtol=1e-5, err_msg=name)


def test_nodes_of_the_library_are_their_graphs(tmp_path) -> None:
    """A surface, a node of pictures, and one of BSDFs that nobody but the library knows."""
    pytest.importorskip("MaterialX")
    disney = "color3f inputs:baseColor = (0.5, 0.25, 1)\nfloat inputs:metallic = 0.25\nfloat inputs:specular = 1"
    scene = square("ND_disney_principled", disney)
    assert mentions(scene, "roughness of ND_burley_diffuse_bsdf") and len(scene.warnings) == 1
    found = seen_at(scene, [(0.5, 0.5)])
    np.testing.assert_allclose(found["diffuse"][0], 0.75**2 * np.array([0.5, 0.25, 1]), rtol=1e-4)
    np.testing.assert_allclose(found["specular_f0"][0], 0.75 * 0.08 + 0.25 * np.array([0.5, 0.25, 1]), rtol=1e-4)
    file = write(tmp_path / "c.exr", np.broadcast_to(np.array([0.25, 0.5, 0.75]), (2, 2, 3)).copy())
    inputs = f"asset inputs:file = @{file}@\ncolor4f inputs:color = (1, 0.5, 0.25, 1)"
    nodes = node("I", "ND_gltf_colorimage", inputs, out="outcolor")
    connected = "color3f inputs:base_color.connect = </M/I.outputs:outcolor>"
    np.testing.assert_allclose(seen(square(STANDARD, connected, nodes), "diffuse"), [0.25, 0.25, 0.1875], rtol=1e-3)
    lama = surface(bsdf("B", "lama_diffuse", "color3f inputs:color = (0.5, 0.25, 1)\nfloat inputs:roughness = 0"))
    assert all("roughness of ND_oren_nayar_diffuse_bsdf" in line for line in lama.warnings)
    np.testing.assert_allclose(seen_at(lama, [(0.5, 0.5)])["diffuse"][0], [0.5, 0.25, 1], rtol=1e-5)


def test_without_materialx_such_a_node_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpmis.usd.materials.library_graphs.library_graph", lambda kind: None)
    scene = square("ND_disney_principled")
    assert mentions(scene, "/M", "ND_disney_principled", "not supported")


def test_a_long_chain_of_bsdf_nodes_ends_with_a_warning() -> None:
    nodes = bsdf("N0", "oren_nayar_diffuse_bsdf")
    for k in range(1500):
        nodes += bsdf(f"N{k + 1}", "multiply_bsdfF", f"token inputs:in1.connect = </M/N{k}.outputs:out>")
    scene = surface(nodes, "token inputs:bsdf.connect = </M/N90.outputs:out>")
    np.testing.assert_allclose(seen(scene, "diffuse"), 0.18, rtol=1e-6)
    assert len(surface(nodes, "token inputs:bsdf.connect = </M/N1500.outputs:out>").warnings) == 1
