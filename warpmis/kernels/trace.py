"""The trace kernel: a stretch of pixels, a stretch of samples, one thread a pixel."""

from functools import cache
from zlib import crc32

import warp as wp

from warpmis.device.views import CameraView, FilmView, SceneView
from warpmis.kernels import lattice, rng
from warpmis.kernels.camera import make_camera
from warpmis.kernels.moments import SHADOW_RAY_COST, Layout, make_moments
from warpmis.kernels.path import make_path
from warpmis.kernels.sampler import make_sampler
from warpmis.kernels.shading_frame import luminance
from warpmis.scene.features import Features


@wp.func
def widened(luminance: wp.vec2d, count: int, y: wp.float64) -> wp.vec2d:
    """(mean, M2) of `count` samples joined by one more.

    Reference: Welford (1962), "Note on a Method for Calculating Corrected Sums of Squares and Products".
    """
    apart = y - luminance[0]
    mean = luminance[0] + apart / wp.float64(count + 1)
    return wp.vec2d(mean, luminance[1] + apart * (y - mean))


@wp.func
def merged(luminance: wp.vec2d, count: int, more: wp.vec2d, more_count: int) -> wp.vec2d:
    """(mean, M2) of `count` samples joined by that of `more_count` others.

    Reference: Chan, Golub, LeVeque (1983), "Algorithms for Computing the Sample Variance", equation 2.1.
    """
    if more_count == 0:
        return luminance
    n = wp.float64(count)
    m = wp.float64(more_count)
    apart = more[0] - luminance[0]
    mean = luminance[0] + apart * m / (n + m)
    return wp.vec2d(mean, luminance[1] + more[1] + apart * apart * n * m / (n + m))


@cache
def make_trace(features: Features) -> wp.Kernel:
    """The trace kernel for one set of effects. Equal features return the same kernel."""
    path = make_path(features)
    camera_ray = make_camera(features)
    sampler = make_sampler(features)
    Li = path.Li
    vec_s = path.strategies.vec_s
    count = path.strategies.count
    # Warp names a module by its source and its static values, but leaves out those that depend on a loop's variable,
    # such as the strategies' names: two kernels would share one name, and the second would run as the first.
    signature = crc32(repr(features).encode()) >> 1
    layout = Layout(count if count > 1 else 0, features.statistics)
    moments = make_moments(layout)
    learns = layout.size > 0
    vec_k = moments.vec_k

    @wp.kernel(module="unique", enable_backward=False)
    def trace(
        scene: SceneView,
        camera: CameraView,
        first: int,
        stride: int,
        pilot: int,
        sequence: int,
        lattice_length: int,
        lattice_steps: rng.vec_lattice,
        first_sample: int,
        end_sample: int,
        seed: wp.uint32,
        max_depth: int,
        stratified: int,
        direct_only: int,
        groups: wp.array(dtype=wp.uint8),
        group: int,
        allocation: wp.array(dtype=vec_s),
        film: FilmView,
        moment_sums: wp.array(dtype=vec_k),
    ):
        """A thread a pixel of this group, if there are any groups; in a pilot (pilot < 0) one a cell of stride x
        stride pixels, which is its first pixel. After a pilot these have so many samples already."""
        if wp.static(signature) < 0:
            return
        index = first + wp.tid()
        if groups.shape[0] > 0:
            if int(groups[index]) != group:
                return
        pixel = index
        begin = first_sample
        if stride > 1:
            if pilot < 0:
                across = (camera.width + stride - 1) / stride
                pixel = index / across * stride * camera.width + index % across * stride
            elif pixel % camera.width % stride == 0 and pixel / camera.width % stride == 0:
                begin = wp.max(first_sample, pilot)
        key = rng.RngKey()
        key.seed = seed
        key.pixel = wp.uint32(pixel)
        key.lattice = lattice_steps
        a = vec_s()
        if wp.static(count > 0):
            a = allocation[index]
        color = wp.vec3d()
        lum = wp.vec2d()
        albedo = wp.vec3d()
        normal = wp.vec3d()
        depth = wp.float64(0.0)
        alpha = wp.float64(0.0)
        hits = int(0)
        rays = wp.int64(0)
        shadow_rays = wp.int64(0)
        rejected = int(0)
        sums = vec_k()
        for k in range(begin, end_sample):
            key.sample = wp.uint32(k)
            key.round = wp.uint32(k - (k - sequence) % lattice_length)
            u = sampler.of_pixel(key, rng.CAMERA)
            ray = camera_ray(camera, key, pixel, u[0], u[1])
            u_strategy = float(0.0)
            if stratified != 0:
                u_strategy = lattice.choice(key)
            else:
                u_strategy = rng.uniform4(key, rng.CHOICE)[0]
            sample = Li(scene, ray.origin, ray.direction, ray.reach, key, a, u_strategy, max_depth)
            rays += wp.int64(sample.rays)
            shadow_rays += wp.int64(sample.shadow_rays)
            radiance = sample.seen + sample.mixed
            brightness = luminance(radiance)
            if not wp.isfinite(brightness):
                rejected += 1
                continue
            color += wp.vec3d(radiance)
            lum = widened(lum, k - begin - rejected, wp.float64(brightness))
            albedo += wp.vec3d(sample.albedo)
            normal += wp.vec3d(sample.normal)
            depth += wp.float64(
                (sample.distance + ray.near * float(sample.hit)) * wp.dot(ray.direction, camera.forward)
            )
            alpha += wp.float64(sample.alpha)
            hits += sample.hit
            if wp.static(learns):
                sums = moments.add(sums, wp.where(direct_only != 0, sample.direct, sample.mixed), sample.q)
                if wp.static(len(features.statistics) > 0):
                    # Those of a path that the mixture took no part in are the same whatever the shares are.
                    cost = float(sample.rays) + SHADOW_RAY_COST * float(sample.shadow_rays)
                    early = float(sample.early_rays) + SHADOW_RAY_COST * float(sample.early_shadow_rays)
                    if wp.static(path.paired):
                        indirect = sample.mixed - sample.light - sample.direct
                        s_bsdf = sample.q[wp.static(path.strategies.bsdf)]
                        sums = moments.add_pair(
                            sums,
                            sample.light,
                            sample.light_share,
                            sample.direct,
                            indirect,
                            sample.late,
                            sample.throughput,
                            s_bsdf,
                            early - SHADOW_RAY_COST * float(sample.light_rays),
                            cost - early,
                            sample.light_rays,
                        )
                    else:
                        sums = moments.add_statistics(
                            sums, sample.mixed, sample.late, sample.throughput, early, cost - early, sample.q, a
                        )
        taken = wp.max(end_sample - begin, 0)
        film.color[index] = film.color[index] + color
        accepted = film.accepted[index]
        film.luminance[index] = merged(film.luminance[index], accepted, lum, taken - rejected)
        film.albedo[index] = film.albedo[index] + albedo
        film.normal[index] = film.normal[index] + normal
        film.depth[index] = film.depth[index] + depth
        film.hits[index] = film.hits[index] + hits
        film.alpha[index] = film.alpha[index] + alpha
        film.accepted[index] = accepted + taken - rejected
        film.rejected[index] = film.rejected[index] + rejected
        film.rays[index] = film.rays[index] + rays
        film.shadow_rays[index] = film.shadow_rays[index] + shadow_rays
        if wp.static(learns):
            moment_sums[index] = moment_sums[index] + sums

    return trace
