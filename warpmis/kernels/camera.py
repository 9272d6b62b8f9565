"""Camera rays."""

import warp as wp

from warpmis.device.views import CameraView

wp.set_module_options({"enable_backward": False})


@wp.func
def camera_ray_direction(camera: CameraView, pixel: int, u: float, v: float) -> wp.vec3:
    """Unit direction through a point of the pixel: (u, v) in [0, 1) spreads over its area (box filter)."""
    column = pixel % camera.width
    row = pixel / camera.width
    x = (float(column) + u) / float(camera.width)
    y = (float(row) + v) / float(camera.height)
    return wp.normalize(camera.corner + camera.across * x + camera.down * y)
