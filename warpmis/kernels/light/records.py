"""What a light answers: a sampled direction, or a direction's hit on it."""

import warp as wp


@wp.struct
class LightSample:
    """A direction towards a light. pdf_solid_angle is 0 where there is no sample; distance ends the shadow ray."""

    wi: wp.vec3
    distance: float
    pdf_solid_angle: float
    radiance: wp.vec3


@wp.struct
class LightHit:
    """Where a ray's line meets a light: distance (negative: it does not) and the density with which the light's own
    sampler, called at the ray's origin, draws the ray's direction."""

    distance: float
    pdf_solid_angle: float
