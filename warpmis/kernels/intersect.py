"""Rays against the surfaces: the closest one, with its frame and its transparency."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import FLAT, MaterialView, SceneView
from warpmis.kernels.bsdf.albedo import coat_albedo, lobe_albedo, white_albedo
from warpmis.kernels.bsdf.dielectric import is_clear_pane, pane_transmittance
from warpmis.kernels.hit import NO_INSTANCE, Hit, make_hit
from warpmis.kernels.instances import make_instances, normal_to_world
from warpmis.kernels.material import make_material
from warpmis.kernels.shading_frame import Frame, frame_from_normal
from warpmis.kernels.shadow import make_transmittance
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# A mapped normal that the ray's origin sees at a smaller cosine is turned towards it.
MIN_MAPPED_COSINE = wp.constant(0.01)


def make_intersect(features: Features) -> SimpleNamespace:
    """Functions for the surfaces in `features`: closest_hit, shading_frame, transparency, prim_at, material_at and
    transmittance."""
    materials = make_material(features)
    hits = make_hit(features)
    closest = make_instances(hits) if features.instances else hits.closest_hit

    @wp.func
    def apply_normal_map(scene: SceneView, hit: Hit, material: MaterialView, wi: wp.vec3, n: wp.vec3) -> wp.vec3:
        """The normal `n`, on the ray's side, turned by a normal map, but not so far that it faces away from the ray."""
        if wp.length_sq(material.normal) == 0.0:
            return n
        side = wp.where(hit.is_front, 1.0, -1.0)
        turned = materials.mapped_normal(scene, hit, material, n * side) * side
        cos_theta = -wp.dot(turned, wi)
        if cos_theta < MIN_MAPPED_COSINE:
            turned = wp.normalize(turned - wi * (MIN_MAPPED_COSINE - cos_theta))
        return wp.where(wp.dot(turned, hit.ng) > 0.0, turned, n)

    @wp.func
    def shading_frame(scene: SceneView, hit: Hit, material: MaterialView, wi: wp.vec3) -> Frame:
        """The frame of the shading normal on the ray's side; of the geometric one where the former faces away."""
        n = hit.ng
        if wp.static(features.shading_normals):
            rows = scene.triangles[hit.triangle].normals
            if rows[0] != FLAT:
                n0 = scene.normals[rows[0]]
                n1 = scene.normals[rows[1]]
                n2 = scene.normals[rows[2]]
                if wp.static(features.instances):
                    if hit.instance != NO_INSTANCE:
                        n0 = wp.normalize(normal_to_world(scene, hit.instance, n0))
                        n1 = wp.normalize(normal_to_world(scene, hit.instance, n1))
                        n2 = wp.normalize(normal_to_world(scene, hit.instance, n2))
                shading = n0 * hit.u + n1 * hit.v + n2 * (1.0 - hit.u - hit.v)
                if not hit.is_front:
                    shading = -shading
                shading = wp.normalize(shading)
                if wp.dot(shading, wi) < -1.0e-4 and wp.dot(shading, hit.ng) > 0.0:
                    n = shading
        if wp.static(features.normal_maps):
            n = apply_normal_map(scene, hit, material, wi, n)
        return frame_from_normal(n)

    @wp.func
    def transparency(scene: SceneView, material: MaterialView, cos_theta: float) -> wp.vec3:
        """Share of the light that goes straight through a surface.

        In UsdPreviewSurface's opacityMode "transparent" the specular lobes reflect first, "presence" cuts them too.
        """
        share = wp.vec3(1.0, 1.0, 1.0) * (1.0 - material.opacity)
        if wp.static(features.specular):
            if not material.opacity_is_presence:
                white = white_albedo(scene.albedos, cos_theta, material.alpha)
                share = wp.cw_mul(share, wp.vec3(1.0, 1.0, 1.0) - lobe_albedo(material.specular_f0, white))
                if wp.static(features.clearcoat):
                    f0, alpha = material.coat_f0, material.coat_alpha
                    share = share * (1.0 - coat_albedo(scene.albedos, material.coat, f0, alpha, cos_theta))
        if wp.static(features.transmission):
            if is_clear_pane(material):
                share += pane_transmittance(material, cos_theta) * material.opacity
        return share

    @wp.func
    def prim_at(scene: SceneView, instance: int, triangle: int) -> int:
        """Row in Scene.prims of the surface that a triangle is of."""
        if wp.static(features.instances):
            if instance != NO_INSTANCE:
                return scene.instances[instance].prim
        return scene.prims[triangle]

    surfaces = SimpleNamespace(
        closest_hit=closest,
        shading_frame=shading_frame,
        transparency=transparency,
        prim_at=prim_at,
        material_at=materials.at,
    )
    surfaces.transmittance = make_transmittance(features, surfaces)
    return surfaces
