"""Light kept apart by the path that it took: how often it was scattered, by which lobe first, and from which light.

The path's radiance is summed as ever (PathState.L); here the same contributions go into one more sum each. At its first
vertex a path may have scattered by several lobes at once: each gets its share of the BSDF for the direction.

Kernels that keep no light apart have functions of the same names, which do nothing.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.aov_views import CLASSES, DIFFUSE, DIRECT, EMISSION, INDIRECT, SPECULAR, TRANSMISSION
from warpmis.device.views import FilmView, SceneView
from warpmis.kernels.rng import RngKey
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.struct
class FirstScattering:
    """Of the path's first vertex. place: of the path's sums in AovView; diffuse: share of its throughput from the
    diffuse lobe, per colour; is_transmitted: whether it went on behind the surface."""

    place: int
    diffuse: wp.vec3
    is_transmitted: bool


@wp.struct
class NoScattering:
    """Nothing."""


def scattering_type(features: Features) -> type:
    """The type of PathState.first_scattering."""
    return FirstScattering if features.keeps_light_apart else NoScattering


def make_contributions(features: Features, PathState: type) -> SimpleNamespace:
    """begin: of a path; begin_ray: before the lights on it are gathered; scatter: after a direction is drawn;
    light_sample: of one light; ray: of what was met on a ray; end_sample: once the path has ended."""
    return _kept_apart(PathState) if features.keeps_light_apart else _summed(PathState)


def _summed(PathState: type) -> SimpleNamespace:
    @wp.func
    def begin(path: wp.ref[PathState], key: RngKey):
        pass

    @wp.func
    def begin_ray(path: wp.ref[PathState]):
        pass

    @wp.func
    def scatter(path: wp.ref[PathState], diffuse: wp.vec3, is_transmitted: bool):
        pass

    @wp.func
    def light_sample(scene: SceneView, path: wp.ref[PathState], radiance: wp.vec3, diffuse: wp.vec3, light: int):
        pass

    @wp.func
    def ray(scene: SceneView, path: wp.ref[PathState]):
        pass

    @wp.func
    def end_sample(scene: SceneView, film: FilmView, index: int, pixel: int, is_accepted: bool):
        pass

    return SimpleNamespace(
        begin=begin, begin_ray=begin_ray, scatter=scatter, light_sample=light_sample, ray=ray, end_sample=end_sample
    )


def _kept_apart(PathState: type) -> SimpleNamespace:
    @wp.func
    def begin(path: wp.ref[PathState], key: RngKey):
        path.first_scattering.place = int(key.pixel)

    @wp.func
    def begin_ray(path: wp.ref[PathState]):
        path.receiver.place = path.first_scattering.place
        path.receiver.weighs_emission = path.weighs_emission

    @wp.func
    def scatter(path: wp.ref[PathState], diffuse: wp.vec3, is_transmitted: bool):
        if path.bounces == 1:
            path.first_scattering.diffuse = diffuse
            path.first_scattering.is_transmitted = is_transmitted

    @wp.func
    def put(scene: SceneView, place: int, kind: int, radiance: wp.vec3):
        row = scene.aov[0].rows[kind]
        if row >= 0:
            at = place * scene.aov[0].row_count + row
            scene.aov[0].sample[at] = scene.aov[0].sample[at] + radiance

    @wp.func
    def add(scene: SceneView, path: wp.ref[PathState], radiance: wp.vec3, diffuse: wp.vec3, group: int):
        """radiance: as it reaches the camera; diffuse: the part of it that the first vertex scatters diffusely."""
        place = path.first_scattering.place
        kinds = group * CLASSES
        if path.bounces == 0:
            put(scene, place, kinds + EMISSION, radiance)
            return
        kinds += wp.where(path.bounces == 1, DIRECT, INDIRECT)
        if path.first_scattering.is_transmitted:
            put(scene, place, kinds + TRANSMISSION, radiance)
            return
        put(scene, place, kinds + DIFFUSE, diffuse)
        put(scene, place, kinds + SPECULAR, radiance - diffuse)

    @wp.func
    def light_sample(scene: SceneView, path: wp.ref[PathState], radiance: wp.vec3, diffuse: wp.vec3, light: int):
        """radiance: as it reaches the camera; diffuse: the diffuse lobe's share of what this vertex scatters, per
        colour; light: row of AovView.groups."""
        share = diffuse
        if path.bounces > 1:
            share = path.first_scattering.diffuse
        if wp.max(radiance) > 0.0:
            add(scene, path, radiance, wp.cw_mul(radiance, share), scene.aov[0].groups[light])

    @wp.func
    def ray(scene: SceneView, path: wp.ref[PathState]):
        """What the present ray has met, times the path's throughput."""
        groups = scene.aov[0].group_count
        for group in range(groups):
            at = 2 * (path.first_scattering.place * groups + group)
            emission = scene.aov[0].on_ray[at]
            if wp.max(emission) > 0.0:
                radiance = wp.cw_mul(path.beta, emission)
                diffuse = wp.cw_mul(path.beta, scene.aov[0].on_ray[at + 1])
                if path.bounces > 1:
                    diffuse = wp.cw_mul(radiance, path.first_scattering.diffuse)
                add(scene, path, radiance, diffuse, group)
                scene.aov[0].on_ray[at] = wp.vec3(0.0, 0.0, 0.0)
                scene.aov[0].on_ray[at + 1] = wp.vec3(0.0, 0.0, 0.0)

    @wp.func
    def end_sample(scene: SceneView, film: FilmView, index: int, pixel: int, is_accepted: bool):
        """Take the sample's sums into the film's entry `index`, and begin anew."""
        rows = scene.aov[0].row_count
        for row in range(rows):
            at = pixel * rows + row
            if is_accepted:
                film.aovs[index, row] = film.aovs[index, row] + wp.vec3d(scene.aov[0].sample[at])
            scene.aov[0].sample[at] = wp.vec3(0.0, 0.0, 0.0)
        groups = 2 * scene.aov[0].group_count
        for group in range(groups):  # of a path that has ended before it took what its ray met
            scene.aov[0].on_ray[pixel * groups + group] = wp.vec3(0.0, 0.0, 0.0)

    return SimpleNamespace(
        begin=begin, begin_ray=begin_ray, scatter=scatter, light_sample=light_sample, ray=ray, end_sample=end_sample
    )
