"""The material at a point: its record as it is, or resolved from inputs that vary over the surface."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from warpmis.device.views import InputsView, MaterialView, SceneView
from warpmis.features import Features
from warpmis.kernels.texture import make_texture, picture_value, texture_coordinates

wp.set_module_options({"enable_backward": False})

# Alpha 0 would divide by 0 (device/upload.py has the same bound for constant inputs).
MIN_ALPHA = wp.constant(1.0e-6)


@wp.func
def clamped(color: wp.vec3, high: float) -> wp.vec3:
    return wp.vec3(wp.clamp(color[0], 0.0, high), wp.clamp(color[1], 0.0, high), wp.clamp(color[2], 0.0, high))


@wp.func
def resolved(base: MaterialView, inputs: InputsView) -> MaterialView:
    """`base` with what its inputs say, each within its range: device/upload.py's resolution of constant inputs."""
    m = base
    m.diffuse = inputs.diffuse
    if base.has_specular != 0:
        m.specular_f0 = inputs.specular
        if inputs.use_specular_workflow == 0:
            # coat_f0 is the reflectance of the index of refraction, whether there is a coat or not.
            dielectric = base.coat_f0 * (1.0 - inputs.metallic)
            m.specular_f0 = wp.vec3(dielectric, dielectric, dielectric) + inputs.diffuse * inputs.metallic
            m.diffuse = inputs.diffuse * (1.0 - inputs.metallic)
    m.alpha = wp.max(inputs.roughness * inputs.roughness, MIN_ALPHA)
    m.coat = inputs.coat
    m.coat_alpha = wp.max(inputs.coat_roughness * inputs.coat_roughness, MIN_ALPHA)
    m.opacity = inputs.opacity
    m.emission = inputs.emissive
    if base.presence != 0:
        m.emission = inputs.emissive * inputs.opacity
    return m


@cache
def make_material(features: Features) -> SimpleNamespace:
    """Material functions for what varies in `features`: at, tilted."""
    texture = make_texture(features)

    @wp.func
    def inputs_at(scene: SceneView, row: int, triangle: int, u: float, v: float) -> InputsView:
        """The inputs with their lookups done; u weighs the triangle's first corner, v the second."""
        i = scene.inputs[row]
        if i.diffuse_lookup >= 0:
            i.diffuse = clamped(texture.color(scene, i.diffuse_lookup, triangle, u, v), 1.0)
        if i.opacity_lookup >= 0:
            i.opacity = texture.number(scene, i.opacity_lookup, triangle, u, v)
            if i.opacity_threshold > 0.0:
                i.opacity = wp.where(i.opacity >= i.opacity_threshold, 1.0, 0.0)
        if i.emissive_lookup >= 0:
            i.emissive = clamped(texture.color(scene, i.emissive_lookup, triangle, u, v), 3.0e38)
        if wp.static(features.specular):
            if i.specular_lookup >= 0:
                i.specular = clamped(texture.color(scene, i.specular_lookup, triangle, u, v), 1.0)
            if i.metallic_lookup >= 0:
                i.metallic = texture.number(scene, i.metallic_lookup, triangle, u, v)
            if i.roughness_lookup >= 0:
                i.roughness = texture.number(scene, i.roughness_lookup, triangle, u, v)
        if wp.static(features.clearcoat):
            if i.coat_lookup >= 0:
                i.coat = texture.number(scene, i.coat_lookup, triangle, u, v)
            if i.coat_roughness_lookup >= 0:
                i.coat_roughness = texture.number(scene, i.coat_roughness_lookup, triangle, u, v)
        return i

    @wp.func
    def at(scene: SceneView, triangle: int, u: float, v: float) -> MaterialView:
        """The material at a point of a triangle; u weighs its first corner, v the second."""
        material = scene.materials[scene.triangles[triangle].material]
        if wp.static(features.textures or features.vertex_colors):
            if material.inputs >= 0:
                material = resolved(material, inputs_at(scene, material.inputs, triangle, u, v))
        return material

    @wp.func
    def tilted(scene: SceneView, triangle: int, u: float, v: float, n: wp.vec3) -> wp.vec3:
        """The unit normal `n` (on the front) turned by the material's normal map; `n` where it has none.

        The map's x and y go along the surface in the directions in which the texture coordinates grow:
        dp/ds and dp/dt from the triangle's edges, made orthogonal to n.
        Reference: Lengyel (2019), "Foundations of Game Engine Development 2", section 7.5.
        """
        row = scene.materials[scene.triangles[triangle].material].inputs
        if row < 0:
            return n
        row = scene.inputs[row].normal_lookup
        if row < 0:
            return n
        lookup = scene.lookups[row]
        corners = scene.indices[triangle]
        p2 = scene.points[corners[2]]
        e0 = scene.points[corners[0]] - p2
        e1 = scene.points[corners[1]] - p2
        st2 = texture_coordinates(scene, lookup, triangle, 0.0, 0.0)
        d0 = texture_coordinates(scene, lookup, triangle, 1.0, 0.0) - st2
        d1 = texture_coordinates(scene, lookup, triangle, 0.0, 1.0) - st2
        determinant = d0[0] * d1[1] - d1[0] * d0[1]
        if determinant == 0.0:
            return n
        along_s = (e0 * d1[1] - e1 * d0[1]) * wp.sign(determinant)
        along_t = (e1 * d0[0] - e0 * d1[0]) * wp.sign(determinant)
        tangent = along_s - n * wp.dot(n, along_s)
        length = wp.length(tangent)
        if length == 0.0:
            return n
        tangent = tangent / length
        bitangent = wp.cross(n, tangent)
        if wp.dot(bitangent, along_t) < 0.0:
            bitangent = -bitangent
        value = picture_value(scene, lookup, texture_coordinates(scene, lookup, triangle, u, v))
        turned = tangent * value[0] + bitangent * value[1] + n * value[2]
        length = wp.length(turned)
        return wp.where(length > 0.0, turned / wp.max(length, 1.0e-20), n)

    return SimpleNamespace(at=at, tilted=tilted)
