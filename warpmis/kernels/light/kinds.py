"""One light by its kind: a sampler of directions towards it, and the hit that tells that sampler's density."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import CYLINDER, DISK, DISTANT, DOME, MESH, RECT, SPHERE, LightView, SceneView
from warpmis.kernels.light.cylinder import hit_cylinder, sample_cylinder
from warpmis.kernels.light.disk import hit_disk, sample_disk
from warpmis.kernels.light.distant import hit_distant, sample_distant
from warpmis.kernels.light.dome import sample_dome_constant, sample_dome_picture
from warpmis.kernels.light.mesh_light import make_mesh
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.light.rect import hit_rect, sample_rect
from warpmis.kernels.light.sphere import hit_sphere, sample_sphere
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_kinds(features: Features) -> SimpleNamespace:
    """Functions for the kinds in `features`: sample_light, hit."""
    mesh = make_mesh(features)

    @wp.func
    def sample_light(
        scene: SceneView, light: LightView, emitter: int, instance: int, x: wp.vec3, n: wp.vec3, u: wp.vec4
    ) -> LightSample:
        """A direction towards one light, or one of its triangles in a place. Density: given that it was chosen."""
        s = LightSample()
        if wp.static(features.rect_light):
            if light.kind == RECT:
                s = sample_rect(light, x, u[1], u[2])
        if wp.static(features.disk_light):
            if light.kind == DISK:
                s = sample_disk(light, x, u[1], u[2])
        if wp.static(features.sphere_light):
            if light.kind == SPHERE:
                s = sample_sphere(light, x, u[1], u[2])
        if wp.static(features.cylinder_light):
            if light.kind == CYLINDER:
                s = sample_cylinder(light, x, u[1], u[2])
        if wp.static(features.distant_light):
            if light.kind == DISTANT:
                s = sample_distant(light, u[1], u[2])
        if wp.static(features.dome_picture):
            if light.kind == DOME and scene.dome.rows > 0:
                s = sample_dome_picture(scene.dome, u[1], u[2])
        if wp.static(features.dome_constant):
            if light.kind == DOME and scene.dome.rows == 0:
                s = sample_dome_constant(scene.dome, n, u[1], u[2])
        if wp.static(features.mesh_light):
            if light.kind == MESH:
                s = mesh.sample(scene, light, emitter, instance, x, u)
        return s

    @wp.func
    def hit(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
        """Where the line from x along wi meets an analytic light, and that light's own density for wi."""
        h = LightHit()
        h.distance = -1.0
        if wp.static(features.rect_light):
            if light.kind == RECT:
                h = hit_rect(light, x, wi)
        if wp.static(features.disk_light):
            if light.kind == DISK:
                h = hit_disk(light, x, wi)
        if wp.static(features.sphere_light):
            if light.kind == SPHERE:
                h = hit_sphere(light, x, wi)
        if wp.static(features.cylinder_light):
            if light.kind == CYLINDER:
                h = hit_cylinder(light, x, wi)
        if wp.static(features.distant_light):
            if light.kind == DISTANT:
                h = hit_distant(light, wi)
        return h

    return SimpleNamespace(sample_light=sample_light, hit=hit)
