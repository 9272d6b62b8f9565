"""What a medium that absorbs and does not scatter leaves of light over a distance."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def transmittance(absorption: wp.vec3, distance: float) -> wp.vec3:
    """absorption [1/scene unit], per colour. Reference: Beer's law."""
    return wp.vec3(
        wp.exp(-absorption[0] * distance), wp.exp(-absorption[1] * distance), wp.exp(-absorption[2] * distance)
    )
