"""The trace kernel: a stretch of pixels, a stretch of samples, one thread a pixel."""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.device.views import CameraView, FilmView, RoundView, SceneView
from warpmis.kernels import lattice, rng
from warpmis.kernels.accumulation import add_rays, add_sample, depth_of, put_into_film, sums_in_film
from warpmis.kernels.camera import make_camera
from warpmis.kernels.learning import make_learning
from warpmis.kernels.path.li import make_path
from warpmis.kernels.sampler import make_sampler
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.func
def first_pixel_of(cell: int, stride: int, width: int) -> int:
    """The first pixel of a cell of stride x stride pixels; cells and pixels are counted row by row."""
    cells_across = (width + stride - 1) / stride
    return cell / cells_across * stride * width + cell % cells_across * stride


@wp.func
def random_key(round: RoundView, pixel: int, sample: int) -> rng.RngKey:
    """What the random numbers of one sample are a function of."""
    key = rng.RngKey()
    key.seed = round.seed
    key.pixel = wp.uint32(pixel)
    key.sample = wp.uint32(sample)
    key.round = wp.uint32(sample - (sample - round.lattice_start) % round.lattice_length)
    key.lattice = round.lattice_steps
    return key


@wp.func
def choice_number(key: rng.RngKey, stratified: bool) -> float:
    """The number that chooses strategy, light and lobe at the first vertex."""
    if stratified:
        return lattice.choice(key)
    return rng.uniform4(key, rng.CHOICE)[0]


@kernel_factory
def make_trace(features: Features) -> KernelFunction:
    """The trace kernel for one set of effects."""
    path_tracer = make_path(features)
    learning = make_learning(features, path_tracer)
    camera_ray = make_camera(features)
    sampler = make_sampler(features)
    Li = path_tracer.Li
    end_sample = path_tracer.contributions.end_sample
    vec_s = path_tracer.strategies.vec_s
    vec_k = learning.vec_k
    has_strategies = path_tracer.strategies.count > 0

    def trace(
        scene: SceneView,
        camera: CameraView,
        round: RoundView,
        first: int,
        traced: wp.array(dtype=wp.uint8),
        allocation: wp.array(dtype=vec_s),
        film: FilmView,
        moment_sums: wp.array(dtype=vec_k),
    ):
        """A thread a pixel from `first` on, or a cell of round.stride x round.stride pixels; `traced`: which ones have
        these samples already; empty where none has."""
        index = first + wp.tid()
        if traced.shape[0] > 0:
            if traced[index] != wp.uint8(0):
                return
        pixel = first_pixel_of(index, round.stride, camera.width)
        shares = vec_s()
        if wp.static(has_strategies):
            shares = allocation[index]

        sums = sums_in_film(film, index)
        moments = vec_k()
        if wp.static(learning.is_on):
            moments = moment_sums[index]
        for k in range(round.first_sample, round.end_sample):
            key = random_key(round, pixel, k)
            u_pixel = sampler.of_pixel(key, rng.CAMERA)
            ray = camera_ray(camera, key, pixel, u_pixel[0], u_pixel[1])
            path = Li(scene, ray, key, shares, choice_number(key, round.stratified), round.max_depth)
            add_rays(sums, path.rays, path.shadow_rays)
            is_accepted = add_sample(sums, path.L, path.first_hit, depth_of(camera, ray, path.first_hit))
            end_sample(scene, film, index, pixel, is_accepted)
            if wp.static(learning.is_on):
                if is_accepted:
                    learning.add(moments, path, round.direct_only)
        put_into_film(film, index, sums)
        if wp.static(learning.is_on):
            moment_sums[index] = moments

    return trace
