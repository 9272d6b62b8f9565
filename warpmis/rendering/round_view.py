"""What all launches of a round have in common, as the trace kernel reads it."""

from __future__ import annotations

from warpmis.config import RenderConfig
from warpmis.device.views import RoundView, vec_lattice
from warpmis.learn.schedule import Round
from warpmis.rendering.generating_vector import lattice_length, lattice_steps

# Points of the lattices of a watched render.
WATCHED_LATTICE = 16


def round_view(config: RenderConfig, part: Round, samples: range) -> RoundView:
    """Of some or all samples of a round."""
    view = RoundView()
    view.first_sample, view.end_sample = samples.start, samples.stop
    view.seed = config.seed
    view.max_depth = config.max_depth
    view.stratified = config.strategy_choice == "stratified"
    set_lattice(view, *_lattice(config, part, samples))
    view.stride = part.stride
    view.direct_only = part.learn and config.how.direct_only
    return view


def set_lattice(view: RoundView, start: int, length: int) -> None:
    """Lattices of so many points, one after another from the sample `start` on."""
    view.lattice_start, view.lattice_length = start, length
    view.lattice_steps = vec_lattice(*lattice_steps(length))


def _lattice(config: RenderConfig, part: Round, samples: range) -> tuple[int, int]:
    """The sample at which the first lattice begins, and the points of each lattice.

    The error of a watched render comes from how much its pieces differ: each piece has lattices of its own. They are of
    one length, so that the error falls as if samples were independent, and can be predicted.
    """
    if config.stops:
        return samples.start, min(WATCHED_LATTICE, len(samples))
    return part.first_sample, lattice_length(part.samples)
