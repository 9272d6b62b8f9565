"""What a light answers, a sampled direction or a direction's hit on it, and the point that asks."""

import warp as wp

from warpmis.device.views import NO_LIGHT as NO_LIGHT


@wp.struct
class LightSample:
    """A direction towards a light. pdf_solid_angle is 0 where there is no sample; distance ends the shadow ray.

    light: index of the light; pdf_of_light: the density given that this light was chosen.
    """

    wi: wp.vec3
    distance: float
    pdf_solid_angle: float
    radiance: wp.vec3
    light: int
    pdf_of_light: float


@wp.struct
class LightChoice:
    """A light's index, or NO_LIGHT; its importance; and the number that chose it, remapped to [0, 1).

    emitter: where a triangle of a mesh light was chosen, its row in SceneView.emitter_triangles, else -1; instance: the
    row in SceneView.instances of the place that it stands in, or NO_INSTANCE.
    """

    light: int
    emitter: int
    instance: int
    importance: float
    u_remapped: float


@wp.struct
class LightHit:
    """Where a ray's line meets a light: distance (negative: it does not) and the density with which the light's own
    sampler, called at the ray's origin, draws the ray's direction."""

    distance: float
    pdf_solid_angle: float


@wp.struct
class RayStretch:
    """The part (near, far] of a ray along wi from a receiver; far is INFINITE_DISTANCE where no surface ends it.

    pdf: the density of the strategy that drew wi; whole_line: whether the density of all lights on the line is asked
    for, hidden or not.
    """

    wi: wp.vec3
    near: float
    far: float
    pdf: float
    whole_line: bool


@wp.struct
class Response:
    """The lobes of the receiver's surface, as far as the choice among lights goes by them (response.py).

    wo: unit direction to the viewer; matte, gloss, coat: weights of the diffuse lobe, of the specular one and of the
    coat; alpha2, coat_alpha2: squared roughness of the latter two. All 0: the choice does not ask.
    """

    wo: wp.vec3
    matte: float
    gloss: float
    alpha2: float
    coat: float
    coat_alpha2: float


@wp.struct
class Receiver:
    """The point that asks for light, with a light chosen for it and what normalises that choice.

    total, finite, infinite: sums of the importances of all lights, of those at a distance, of those at infinity; 0
    where none of them can be seen. choice: a light in proportion to importance; u_fine: what lies between the
    steps of the number that chose it, in units of these. A single light needs no choice: its importance counts as 1.

    drawn: index of the light that the ray from x was drawn towards; drawn_distance, drawn_pdf: where it meets that
    light, and with which density the light's sampler drew it, 0 for a ray that was drawn otherwise. The ray's direction
    is rounded, and a light that is small or seen edge-on would be missed: what was drawn counts as hit.

    is_surface: False for the camera; prim: index of the prim at x, set where lights are controlled; links: bits of the
    lights that may reach it, as in LightLeaves. absorption: of the medium that rays leave x through [1/scene unit].
    diffuse: the diffuse lobe's share of what the surface scatters from the
    ray's direction, per color. response: the surface, where lights are chosen by it.

    place, weighs_emission: where light is kept apart by its path, PathState's.
    """

    x: wp.vec3
    n: wp.vec3
    total: float
    finite: float
    infinite: float
    choice: LightChoice
    u_fine: float
    drawn: int
    drawn_distance: float
    drawn_pdf: float
    is_surface: bool
    prim: int
    links: int
    absorption: wp.vec3
    diffuse: wp.vec3
    response: Response
    place: int
    weighs_emission: bool
