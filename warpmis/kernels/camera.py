"""Camera rays."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import CameraView
from warpmis.kernels import rng
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.sampler import make_sampler
from warpmis.kernels.warps import square_to_disk
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.struct
class CameraRay:
    """A ray from `origin`, which lies `near` behind the first clipping plane; surfaces beyond `reach` are not
    visible."""

    origin: wp.vec3
    direction: wp.vec3
    near: float
    reach: float


@wp.func
def window_point(camera: CameraView, pixel: int, u: float, v: float) -> wp.vec3:
    """A point of the pixel: (u, v) in [0, 1) spreads over its area (box filter)."""
    column = pixel % camera.width
    row = pixel / camera.width
    x = (float(column) + u) / float(camera.width)
    y = (float(row) + v) / float(camera.height)
    return camera.corner + camera.across * x + camera.down * y


@wp.func
def clipped(camera: CameraView, ray: CameraRay) -> CameraRay:
    """The part of a ray that lies before all planes: each cuts off one end of it, or all."""
    near = float(0.0)
    far = float(INFINITE_DISTANCE)
    for i in range(camera.planes.shape[0]):
        plane = camera.planes[i]
        n = wp.vec3(plane[0], plane[1], plane[2])
        height = wp.dot(n, ray.origin - camera.position) + plane[3]
        slope = wp.dot(n, ray.direction)
        if slope > 0.0:
            near = wp.max(near, -height / slope)
        elif slope < 0.0:
            far = wp.min(far, -height / slope)
        elif height < 0.0:
            far = -1.0
    ray.near = wp.min(near, INFINITE_DISTANCE)
    ray.reach = far - ray.near
    ray.origin = ray.origin + ray.direction * ray.near
    return ray


def make_camera(features: Features, sampler: SimpleNamespace | None = None) -> wp.Function:
    """The function camera_ray for one set of effects; sampler: functions in place of make_sampler's."""
    sampler = sampler or make_sampler(features)

    @wp.func
    def camera_ray(camera: CameraView, key: rng.RngKey, pixel: int, u: float, v: float) -> CameraRay:
        """The ray of one sample.

        A thin lens bends all rays of a picture point to one point of the plane in focus.

        Reference: Kolb, Mitchell, Hanrahan (1995), "A Realistic Camera Model for Computer Graphics", section 2.
        """
        ray = CameraRay()
        ray.reach = INFINITE_DISTANCE
        point = window_point(camera, pixel, u, v)
        ray.origin = camera.position
        ray.direction = wp.normalize(point)
        if wp.static(features.depth_of_field):
            u_lens = sampler.of_pixel(key, rng.LENS)
            disk = square_to_disk(u_lens[0], u_lens[1])
            offset = camera.lens_u * disk[0] + camera.lens_v * disk[1]
            ray.origin = camera.position + offset
            if camera.focus_distance > 0.0:
                ray.direction = wp.normalize(point - offset / camera.focus_distance)
        if wp.static(features.orthographic):
            if camera.is_orthographic:
                ray.origin = camera.position + point
                ray.direction = camera.forward
        if wp.static(features.clipping):
            ray = clipped(camera, ray)
        return ray

    return camera_ray
