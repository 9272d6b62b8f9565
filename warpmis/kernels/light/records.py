"""What a light answers, a sampled direction or a direction's hit on it, and the point that asks."""

import warp as wp


@wp.struct
class LightSample:
    """A direction towards a light. pdf_solid_angle is 0 where there is no sample; distance ends the shadow ray.

    light: 1 + the index of the light, 0 for none; pdf_of_light: the density given that this light was chosen.
    """

    wi: wp.vec3
    distance: float
    pdf_solid_angle: float
    radiance: wp.vec3
    light: int
    pdf_of_light: float


@wp.struct
class LightChoice:
    """A light's index, or -1; its importance; and what is left of the number that chose it, in [0, 1) again."""

    light: int
    importance: float
    left: float


@wp.struct
class LightHit:
    """Where a ray's line meets a light: distance (negative: it does not) and the density with which the light's own
    sampler, called at the ray's origin, draws the ray's direction."""

    distance: float
    pdf_solid_angle: float


@wp.struct
class Receiver:
    """The point that asks for light, with a light chosen for it and what normalises that choice.

    total, finite, infinite: sums of the importances of all lights, of those at a distance, of those at infinity; 0
    where none of them can be seen. chosen: a light in proportion to importance, or -1; left: what is left of the number
    that chose it, in [0, 1) again. A single light needs no choice: its importance counts as 1.

    drawn: 1 + the index of the light that the ray from x was drawn towards, 0 for none; drawn_distance, drawn_pdf:
    where it meets that light, and with which density the light's sampler drew it. The ray's direction is rounded, and a
    light that is small or seen edge-on would be missed: what was drawn counts as hit.

    prim: 1 + the index of the prim at x where anything is asked of lights, 0 for the camera; diffuse: the share of what
    the surface scatters from the ray's direction that its diffuse lobe does, per color.
    """

    x: wp.vec3
    n: wp.vec3
    total: float
    finite: float
    infinite: float
    chosen: int
    chosen_importance: float
    left: float
    drawn: int
    drawn_distance: float
    drawn_pdf: float
    prim: int
    diffuse: wp.vec3
