"""Samples into a pixel: a launch takes its sums from the film, adds to them, and puts them back.

The spread of a pixel's luminance is kept as mean and sum of squared deviations, which lose no digits where the mean is
large against the spread.
"""

import warp as wp

from warpmis.device.views import CameraView, FilmView
from warpmis.kernels.camera import CameraRay
from warpmis.kernels.path.state import FirstHit
from warpmis.kernels.shading_frame import luminance

wp.set_module_options({"enable_backward": False})


@wp.func
def add_value(spread: wp.vec2d, count: int, y: wp.float64) -> wp.vec2d:
    """(mean, sum of squared deviations) of `count` values and one more.

    Reference: Welford (1962), "Note on a Method for Calculating Corrected Sums of Squares and Products".
    """
    delta = y - spread[0]
    mean = spread[0] + delta / wp.float64(count + 1)
    return wp.vec2d(mean, spread[1] + delta * (y - mean))


@wp.struct
class PixelSums:
    """A pixel of the film while a launch adds samples to it: FilmView's fields."""

    color: wp.vec3d
    luminance: wp.vec2d
    albedo: wp.vec3d
    normal: wp.vec3d
    depth: wp.float64
    alpha: wp.float64
    hits: int
    accepted: int
    rejected: int
    rays: wp.int64
    shadow_rays: wp.int64


@wp.func
def add_rays(sums: wp.ref[PixelSums], rays: int, shadow_rays: int):
    sums.rays += wp.int64(rays)
    sums.shadow_rays += wp.int64(shadow_rays)


@wp.func
def add_sample(sums: wp.ref[PixelSums], radiance: wp.vec3, first: FirstHit, depth: float) -> bool:
    """Add a sample. depth: of its first hit, along the camera's axis. False for a radiance that is not finite: it is
    counted as rejected, and nothing else of it is added."""
    y = luminance(radiance)
    if not wp.isfinite(y):
        sums.rejected += 1
        return False
    sums.color += wp.vec3d(radiance)
    sums.luminance = add_value(sums.luminance, sums.accepted, wp.float64(y))
    sums.albedo += wp.vec3d(first.albedo)
    sums.normal += wp.vec3d(first.normal)
    sums.depth += wp.float64(depth)
    sums.alpha += wp.float64(first.alpha)
    sums.hits += first.is_surface
    sums.accepted += 1
    return True


@wp.func
def depth_of(camera: CameraView, ray: CameraRay, first: FirstHit) -> float:
    """Distance of the first hit along the camera's axis; 0 where there is none and the ray begins at the camera."""
    return (first.distance + ray.near * float(first.is_surface)) * wp.dot(ray.direction, camera.forward)


@wp.func
def sums_in_film(film: FilmView, pixel: int) -> PixelSums:
    """What the film holds of a pixel.

    A launch goes on from there sample by sample, so that no bit of the sums tells how samples were cut into launches.
    """
    sums = PixelSums()
    sums.color = film.color[pixel]
    sums.luminance = film.luminance[pixel]
    sums.albedo = film.albedo[pixel]
    sums.normal = film.normal[pixel]
    sums.depth = film.depth[pixel]
    sums.alpha = film.alpha[pixel]
    sums.hits = film.hits[pixel]
    sums.accepted = film.accepted[pixel]
    sums.rejected = film.rejected[pixel]
    sums.rays = film.rays[pixel]
    sums.shadow_rays = film.shadow_rays[pixel]
    return sums


@wp.func
def put_into_film(film: FilmView, pixel: int, sums: wp.ref[PixelSums]):
    """Replace a pixel's sums, which no other thread writes."""
    film.color[pixel] = sums.color
    film.luminance[pixel] = sums.luminance
    film.albedo[pixel] = sums.albedo
    film.normal[pixel] = sums.normal
    film.depth[pixel] = sums.depth
    film.alpha[pixel] = sums.alpha
    film.hits[pixel] = sums.hits
    film.accepted[pixel] = sums.accepted
    film.rejected[pixel] = sums.rejected
    film.rays[pixel] = sums.rays
    film.shadow_rays[pixel] = sums.shadow_rays
