"""Which estimator the paths of a kernel take, and the state that they carry for it."""

from dataclasses import dataclass
from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.path.cell_mixture import make_cell_estimate, make_cell_mixture
from warpmis.kernels.path.contributions import make_contributions, scattering_type
from warpmis.kernels.path.counts import CountsEstimate, make_counts
from warpmis.kernels.path.guided import GUIDED_STRATEGIES, make_guided, make_guided_estimate
from warpmis.kernels.path.mixture import make_densities, make_estimate, make_mixture
from warpmis.kernels.path.next_event import NoEstimate, make_next_event
from warpmis.kernels.path.parts import make_parts, parts_type
from warpmis.kernels.path.record import NoRecord, Record, make_record, no_record
from warpmis.kernels.path.state import make_state
from warpmis.kernels.path.throughput import make_roulette
from warpmis.kernels.path.vertex_records import make_vertex_records
from warpmis.kernels.path.weighted_pair import (
    PairEstimate,
    make_control,
    make_pair_record,
    make_weighted_pair,
    pair_record_type,
)
from warpmis.kernels.shading_frame import Frame
from warpmis.kernels.strategies import make_strategies
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

vec_colors = wp.types.vector(length=3, dtype=wp.float32)


@dataclass(frozen=True)
class Parts:
    """What estimators are made of: the functions of one set of effects."""

    features: Features
    surface: SimpleNamespace
    lights: SimpleNamespace
    direct_light: SimpleNamespace
    sampler: SimpleNamespace

    def strategies(self, names: tuple[str, ...]) -> SimpleNamespace:
        return make_strategies(self.features.with_strategies(names), self.surface, self.lights)

    def state(self, Estimate: type, Record: type) -> tuple[type, SimpleNamespace]:
        """The type PathState, and `contributions` to it."""
        PathState = make_state(Estimate, Record, scattering_type(self.features))
        return PathState, make_contributions(self.features, PathState)

    def survives(self, PathState: type, record: SimpleNamespace) -> wp.Function:
        """Russian roulette by throughput."""
        return make_roulette(self.features, PathState, record, self.sampler).survives

    def next_event(self, PathState: type, vec_s: type, contributions: SimpleNamespace) -> SimpleNamespace:
        return make_next_event(PathState, vec_s, self.surface, self.direct_light, contributions)


def make_estimator(
    features: Features,
    surface: SimpleNamespace,
    lights: SimpleNamespace,
    direct_light: SimpleNamespace,
    sampler: SimpleNamespace,
) -> SimpleNamespace:
    """The estimator's functions (next_event.py), its `record` and `contributions`, the type PathState, and the
    `strategies` among which a pixel shares its samples.

    By the spatial cache where there is one, with strategies by the mixture of them at every vertex; or by counts,
    weights or a control of the pair of samples where pixels have those. Else next-event estimation without strategies,
    and with them their mixture.
    """
    parts = Parts(features, surface, lights, direct_light, sampler)
    if features.cache:
        estimator = _cell_mixture(parts) if features.strategies else _guided(parts)
    elif features.allocation == "counts":
        estimator = _counts(parts)
    elif features.allocation in ("weights", "control"):
        estimator = _weighted_pair(parts)
    else:
        estimator = _mixture(parts) if features.strategies else _next_event(parts)
    if not hasattr(estimator, "arrive"):
        estimator.arrive = _make_arrive(estimator.PathState)
    if not hasattr(estimator, "survives"):
        estimator.survives = parts.survives(estimator.PathState, estimator.record)
    return estimator


def _make_arrive(PathState: type) -> wp.Function:
    @wp.func
    def arrive(scene: SceneView, path: wp.ref[PathState], frame: Frame, key: rng.RngKey, step: int):
        """Nothing is chosen before the vertex is known."""

    return arrive


def _cell_mixture(parts: Parts) -> SimpleNamespace:
    strategies = parts.strategies(parts.features.strategies)
    PathState, contributions = parts.state(make_cell_estimate(strategies.vec_s), NoRecord)
    record = make_vertex_records(PathState, strategies.count)
    next_event = parts.next_event(PathState, strategies.vec_s, contributions)
    densities = make_densities(parts.features, PathState, strategies, parts.lights)
    estimator = make_cell_mixture(PathState, strategies, densities, next_event, record)
    # The shares are the cells', not the pixels'.
    return _whole(estimator, PathState, contributions, record, parts.strategies(()))


def _guided(parts: Parts) -> SimpleNamespace:
    strategies = parts.strategies(())
    PathState, contributions = parts.state(make_guided_estimate(), NoRecord)
    record = make_vertex_records(PathState, GUIDED_STRATEGIES)
    estimator = make_guided(PathState, strategies.vec_s, parts.surface, parts.direct_light, record, contributions)
    return _whole(estimator, PathState, contributions, record, strategies)


def _counts(parts: Parts) -> SimpleNamespace:
    strategies = parts.strategies(parts.features.strategies)
    learns = "parts" in parts.features.statistics
    PathState, contributions = parts.state(CountsEstimate, parts_type(learns))
    record = make_parts(PathState, learns)
    next_event = parts.next_event(PathState, strategies.vec_s, contributions)
    survives = parts.survives(PathState, record)
    estimator = make_counts(PathState, strategies, parts.surface, parts.lights, next_event, record, survives)
    return _whole(estimator, PathState, contributions, record, strategies)


def _weighted_pair(parts: Parts) -> SimpleNamespace:
    features, strategies = parts.features, parts.strategies(parts.features.strategies)
    learns, has_control = bool(features.statistics), features.allocation == "control"
    PathState, contributions = parts.state(PairEstimate, pair_record_type(learns))
    record = make_pair_record(PathState, learns)
    control = make_control(features, PathState, parts.surface, parts.lights)
    next_event = parts.next_event(PathState, strategies.vec_s, contributions)
    survives = parts.survives(PathState, record)
    # A weight for each strategy, or a coefficient for each colour.
    allocation = SimpleNamespace(vec_s=vec_colors, count=3) if has_control else strategies
    estimator = make_weighted_pair(
        PathState, allocation.vec_s, strategies, control, has_control, next_event, record, survives, learns
    )
    return _whole(estimator, PathState, contributions, record, allocation)


def _next_event(parts: Parts) -> SimpleNamespace:
    strategies = parts.strategies(())
    PathState, contributions = parts.state(NoEstimate, NoRecord)
    estimator = parts.next_event(PathState, strategies.vec_s, contributions)
    return _whole(estimator, PathState, contributions, no_record(PathState), strategies)


def _mixture(parts: Parts) -> SimpleNamespace:
    strategies = parts.strategies(parts.features.strategies)
    PathState, contributions = parts.state(make_estimate(strategies.vec_s), Record)
    record = make_record(PathState)
    densities = make_densities(parts.features, PathState, strategies, parts.lights)
    next_event = parts.next_event(PathState, strategies.vec_s, contributions)
    # Of paths that end behind the mixture's vertex none comes to a vertex without one, but for glass.
    has_others = parts.features.indirect or parts.features.rough_transmission
    estimator = make_mixture(PathState, strategies, densities, next_event, record, has_others)
    return _whole(estimator, PathState, contributions, record, strategies)


def _whole(
    estimator: SimpleNamespace,
    PathState: type,
    contributions: SimpleNamespace,
    record: SimpleNamespace,
    strategies: SimpleNamespace,
) -> SimpleNamespace:
    """The estimator with all that its paths go with."""
    estimator.PathState = PathState
    estimator.contributions = contributions
    estimator.record = record
    estimator.strategies = strategies
    return estimator
