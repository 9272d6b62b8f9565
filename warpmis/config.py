"""What a render is asked for: frozen settings, checked where they are built."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from warpmis.aovs import checked_aovs
from warpmis.errors import ConfigError
from warpmis.methods import METHODS, Method
from warpmis.whole_numbers import checked_integer

STRATEGIES = ("bsdf", "light", "uniform", "cosine", "area", "dome", "diffuse", "specular")
# And what a spatial cache has learned, for the methods that have one.
CELL_STRATEGIES = (*STRATEGIES, "guide")
DEFAULT_STRATEGIES = ("bsdf", "light")
STRATEGY_CHOICES = ("stratified", "random")
SAMPLERS = ("lattice", "independent")

# Strategies whose densities are positive wherever the integrand is: a mixture needs one of them. The guide's is, but a
# thousandth of the BSDF's where nothing was seen yet: alone it would leave a few samples with most of the light.
COMPLETE = ("bsdf", "uniform", "cosine", "diffuse", "specular")

# Samples per pixel where none are asked for: of a plain render, and the most of one that a stopping rule ends.
DEFAULT_SPP = 256
CEILING = 1 << 18

# About 30 years: a longer time limit is a mistake.
MAX_SECONDS = 1e9

# Shares typed by hand (0.333,0.333,0.334) or stored in half precision still count as summing to one.
SUM_TOLERANCE = 1e-4


class LearnSettings(TypedDict):
    """The learn settings of a render as plain values, with the numbers that were used."""

    rounds: int
    spp: int
    initial_allocation: list[float] | None


class SettingsDict(TypedDict, total=False):
    """The settings of a render as plain values: RenderConfig's, and what the render adds to them.

    Keys:
        allocation: shares of method "fixed"; a picture of them is named by its shape.
        camera: path of the camera, "" where one was supplied.
        shutter_samples: number of times within the shutter's interval, if there were several.
        denoise: whether there is a denoised picture.
        interrupted: of a picture with fewer samples than were asked for, how many it has; missing from others.
    """

    width: int | None
    spp: int
    method: str
    strategies: list[str]
    allocation: list[float] | str | None
    strategy_choice: str
    sampler: str
    mis_compensation: bool
    max_depth: int
    seed: int
    ids: bool
    aov: list[str]
    cryptomatte: bool
    target_error: float | None
    time_limit: float | None
    device: str
    threads: int | None
    learn: LearnSettings
    camera: str
    shutter_samples: int
    denoise: bool
    interrupted: str


@dataclass(frozen=True, kw_only=True)
class LearnConfig:
    """How a method learns its allocation.

    Attributes:
        rounds: number of learn rounds; each ends with one step of the method's solver. None takes 1 below 256 samples
            per pixel and one more for every doubling, up to the method's limit. A step from few samples is worse than
            none (scripts/bench/learning.py).
        spp: samples per pixel and round; None spends the method's share of the budget on learning.
        initial_allocation: share of each strategy before the first round, or None for equal shares.
        keep_maps: keep the allocation of every round in RenderResult.round_allocations.
    """

    rounds: int | None = None
    spp: int | None = None
    initial_allocation: tuple[float, ...] | None = None
    keep_maps: bool = False

    def __post_init__(self) -> None:
        _check_boolean("keep_maps", self.keep_maps)
        if self.rounds is not None:
            object.__setattr__(self, "rounds", checked_integer("learn_rounds", self.rounds))
        if self.spp is not None:
            object.__setattr__(self, "spp", checked_integer("learn_spp", self.spp))
        if self.initial_allocation is not None:
            shares = _checked_shares("initial allocation", self.initial_allocation)
            if shares.ndim != 1 or shares.min() <= 0.0:
                # A strategy that is never sampled gives the first round nothing to learn from.
                raise ConfigError("initial allocation must be one positive share per strategy, such as 0.5,0.5")
            object.__setattr__(self, "initial_allocation", tuple(shares.tolist()))


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderConfig:
    """The settings of one render.

    Attributes:
        width: image width [pixel]; the height follows from the stage's aspect. None takes the stage's resolution.
        spp: samples per pixel, learning included; None takes 256. With a target error or a time limit: at most this
            many, and None takes 262144.
        method: one of METHODS; `warpmis render --help` explains them.
        strategies: the sampling strategies of the mixture, in the order of the allocation's last axis.
            Method "bsdf" makes it ("bsdf",).
        allocation: for method "fixed": shares, shape (S,) or (H, W, S); kept as a float32 copy that sums to 1.
        max_depth: bounces after the camera ray's hit; 0 is emission alone, 1 direct light.
        seed: from 0 to 2^32 - 1; the same scene, settings and seed give the same image.
        device: a Warp device, "cpu" or "cuda:0".
        target_error: render until the relative error is below this with 95 % confidence; 0.01 is 1 %.
        time_limit: stop learning and rendering after this time [s].
        threads: CPU threads; None takes all that the process may use.
        strategy_choice: "stratified" spreads each pixel's samples evenly over strategies, lights and lobes at the first
            vertex; "random" chooses anew for each sample.
        sampler: "lattice" uses evenly spread numbers up to the first vertex; "independent" uses independent ones.
        ids: also find the prim, the instance and the face that the middle of each pixel sees.
        aov: further pictures, by the names of aovs.NAMES or as NAME=EXPRESSION, a light path expression.
        cryptomatte: also find which prims and materials each pixel shows, and how much of each.
        mis_compensation: sample a dome's picture only where it exceeds its mean; BSDF sampling finds the rest.
        learn: settings of the methods that learn.
    """

    width: int | None = None
    spp: int = None  # type: ignore[assignment]  # a number from __post_init__ on
    method: str = "auto"
    strategies: tuple[str, ...] = DEFAULT_STRATEGIES
    allocation: NDArray[np.float32] | tuple[float, ...] | None = None
    strategy_choice: str = "stratified"
    sampler: str = "lattice"
    mis_compensation: bool = False
    max_depth: int = 8
    seed: int = 0
    ids: bool = False
    aov: tuple[str, ...] = ()
    cryptomatte: bool = False
    target_error: float | None = None
    time_limit: float | None = None
    device: str = "cpu"
    threads: int | None = None
    learn: LearnConfig = field(default_factory=LearnConfig)

    def __post_init__(self) -> None:
        self._check_stopping()
        asked: object = self.spp
        if asked is None:
            object.__setattr__(self, "spp", CEILING if self.stops else DEFAULT_SPP)
        self._check_numbers()
        self._check_types()
        if self.method not in METHODS:
            raise ConfigError(f"unknown method '{self.method}'; choose one of {', '.join(METHODS)}")
        if not re.fullmatch(r"cpu|cuda(:\d+)?", self.device):
            raise ConfigError(f"unknown device '{self.device}'; choose cpu, cuda or cuda:0")
        object.__setattr__(self, "strategies", _checked_strategies(self.strategies, self.method))
        if self.how.is_of_pair and self.strategies != DEFAULT_STRATEGIES:
            raise ConfigError(f"method '{self.method}' is for the strategies bsdf,light; take pooled for others")
        object.__setattr__(self, "allocation", self._checked_allocation())
        object.__setattr__(self, "aov", checked_aovs(self.aov))
        if self.strategy_choice not in STRATEGY_CHOICES:
            choices = ", ".join(STRATEGY_CHOICES)
            raise ConfigError(f"unknown strategy choice '{self.strategy_choice}'; choose one of {choices}")
        if self.sampler not in SAMPLERS:
            raise ConfigError(f"unknown sampler '{self.sampler}'; choose one of {', '.join(SAMPLERS)}")
        if self.how.learns:
            self._check_learning()
        elif self.learn != LearnConfig(keep_maps=self.learn.keep_maps and self.how.cache):
            raise ConfigError(f"method '{self.method}' takes no learn settings: drop them, or take murray20")
        if not self.how.has_strategies and self.strategies != DEFAULT_STRATEGIES:
            raise ConfigError(f"method '{self.method}' is for the strategies bsdf,light; take cells for others")

    @property
    def how(self) -> Method:
        """What the method's name stands for."""
        return METHODS[self.method]

    @property
    def stops(self) -> bool:
        """Whether something else than the number of samples may end the render."""
        return self.target_error is not None or self.time_limit is not None

    @property
    def learn_budget(self) -> int:
        """Samples per pixel that learning takes its share of: where their number is not known, a plain render's."""
        return min(self.spp, DEFAULT_SPP) if self.stops else self.spp

    def learn_rounds(self) -> int:
        """Number of learn rounds: as set, or 1 for a budget below 256 samples and one more for each doubling."""
        if self.learn.rounds is not None:
            return self.learn.rounds
        if self.how.rounds is not None:
            return min(self.how.rounds, self.learn_budget)
        return min(max(self.learn_budget.bit_length() - 7, 1), self.how.max_rounds)

    def learn_spp(self) -> int:
        """Samples per pixel of one learn round: as set, or so that all rounds take the method's share of the budget."""
        if self.learn.spp is not None:
            return self.learn.spp
        return max(1, int(self.learn_budget * self.how.learn_share) // self.learn_rounds())

    def to_dict(self) -> SettingsDict:
        """The settings as plain values, ready for JSON."""
        allocation: list[float] | str | None = None
        if isinstance(self.allocation, np.ndarray):
            is_picture = self.allocation.ndim > 1
            allocation = f"per pixel {self.allocation.shape}" if is_picture else self.allocation.tolist()
        initial = self.learn.initial_allocation
        return {
            "width": self.width,
            "spp": self.spp,
            "method": self.method,
            "strategies": list(self.strategies),
            "allocation": allocation,
            "strategy_choice": self.strategy_choice,
            "sampler": self.sampler,
            "mis_compensation": bool(self.mis_compensation),
            "max_depth": self.max_depth,
            "seed": self.seed,
            "ids": bool(self.ids),
            "aov": list(self.aov),
            "cryptomatte": bool(self.cryptomatte),
            "target_error": self.target_error,
            "time_limit": self.time_limit,
            "device": self.device,
            "threads": self.threads,
            "learn": {
                "rounds": self.learn_rounds(),
                "spp": self.learn_spp(),
                "initial_allocation": None if initial is None else list(initial),
            },
        }

    def _check_stopping(self) -> None:
        error, limit = self.target_error, self.time_limit
        if error is not None:
            if not (_is_number(error) and 0.0 < error <= 1.0):
                raise ConfigError(f"target error must be above 0 and at most 1 (100 %), got {error}")
            object.__setattr__(self, "target_error", float(error))
        if limit is not None:
            if not (_is_number(limit) and 0.0 < limit <= MAX_SECONDS):
                raise ConfigError(f"time limit must be above 0 and at most {MAX_SECONDS:g} seconds, got {limit}")
            object.__setattr__(self, "time_limit", float(limit))

    def _check_types(self) -> None:
        for name in ("method", "device", "strategy_choice", "sampler"):
            if not isinstance(getattr(self, name), str):
                raise ConfigError(f"{name.replace('_', ' ')} must be a name as text, got {getattr(self, name)!r}")
        for name in ("ids", "cryptomatte", "mis_compensation"):
            _check_boolean(name, getattr(self, name))
        if not isinstance(self.learn, LearnConfig):
            raise ConfigError(f"learn must be a LearnConfig, got {self.learn!r}")

    def _check_numbers(self) -> None:
        for name in ("spp", "max_depth", "seed", "width", "threads"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, checked_integer(name, value))

    def _checked_allocation(self) -> NDArray[np.float32] | None:
        if self.method != "fixed":
            if self.allocation is not None:
                raise ConfigError(
                    f"method '{self.method}' finds its own allocation; drop the allocation, or take method 'fixed'"
                )
            return None
        if self.allocation is None:
            raise ConfigError(f"method 'fixed' needs an allocation: one share for each of {', '.join(self.strategies)}")
        shares = _checked_shares("allocation", self.allocation)
        count = len(self.strategies)
        if shares.ndim not in (1, 3) or shares.shape[-1] != count:
            raise ConfigError(
                f"allocation must have shape ({count},) or (H, W, {count}), a share for each of "
                f"{', '.join(self.strategies)}, got shape {shares.shape}"
            )
        complete = [self.strategies.index(name) for name in self.strategies if name in COMPLETE]
        if shares[..., complete].sum(axis=-1).min() <= 0.0:
            names = " or ".join(self.strategies[i] for i in complete)
            raise ConfigError(f"shares of lights only find no indirect light: give {names} a part of every pixel")
        return shares

    def _check_learning(self) -> None:
        count = len(self.strategies)
        if count < 2:
            raise ConfigError(f"method '{self.method}' shares samples between strategies: name two, such as bsdf,light")
        if self.how.two_strategies and count > 2:
            raise ConfigError(f"method '{self.method}' is for two strategies; take pooled for {count}")
        if self.how.rounds is not None and self.learn.rounds not in (None, self.how.rounds):
            plural = "s" if self.how.rounds > 1 else ""
            raise ConfigError(
                f"method '{self.method}' has {self.how.rounds} learn round{plural}; drop the number of rounds"
            )
        initial = self.learn.initial_allocation
        if initial is not None and self.how.is_of_pair:
            raise ConfigError(f"method '{self.method}' learns as next-event estimation: drop the initial allocation")
        if initial is not None and len(initial) != count:
            raise ConfigError(
                f"initial allocation must have {count} shares, one for each of {', '.join(self.strategies)}, "
                f"got {len(initial)}"
            )
        rounds, learn_spp = self.learn_rounds(), self.learn_spp()
        if rounds * learn_spp > self.spp:
            raise ConfigError(
                f"{rounds} learn rounds of {learn_spp} samples per pixel exceed the budget of {self.spp}; "
                f"raise spp to {rounds * learn_spp} or more, or take fewer learn rounds or samples"
            )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _check_boolean(name: str, value: object) -> None:
    if not isinstance(value, bool):
        raise ConfigError(f"{name.replace('_', ' ')} must be True or False, got {value!r}")


def _checked_strategies(strategies: Sequence[str], method: str) -> tuple[str, ...]:
    given: object = strategies
    if isinstance(given, str) or not isinstance(given, Collection) or not all(isinstance(name, str) for name in given):
        raise ConfigError(f"strategies must be a tuple of names, such as ('bsdf', 'light'), got {strategies!r}")
    names = tuple(strategies)
    known = CELL_STRATEGIES if method == "cells" else STRATEGIES
    for name in names:
        if name not in CELL_STRATEGIES:
            raise ConfigError(f"unknown strategy '{name}'; choose from {', '.join(known)}")
        if name not in known:
            raise ConfigError(f"method '{method}' has no strategy '{name}': take method cells, or drop it")
    if not names:
        raise ConfigError(f"name at least one strategy; choose from {', '.join(known)}")
    if len(set(names)) < len(names):
        raise ConfigError(f"strategies must differ, got {', '.join(names)}; name each once")
    if not set(names) & set(COMPLETE):
        raise ConfigError(f"strategies {', '.join(names)} find no indirect light: add bsdf, which reaches every path")
    return ("bsdf",) if method == "bsdf" else names


def _checked_shares(name: str, shares: object) -> NDArray[np.float32]:
    """Shares that sum to exactly one along the last axis, as a float32 copy."""
    try:
        values = np.array(shares, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigError(f"{name} must be numbers, one share per strategy, such as 0.5,0.5") from None
    if values.size == 0 or values.ndim == 0:
        raise ConfigError(f"{name} must have one share per strategy, such as 0.5,0.5, got shape {values.shape}")
    if not np.isfinite(values).all() or values.min() < 0.0:
        raise ConfigError(f"{name} must be finite and not negative; set every share from 0 to 1")
    total = values.sum(axis=-1, keepdims=True)
    worst = total.flat[np.abs(total - 1.0).argmax()]
    if abs(worst - 1.0) > SUM_TOLERANCE:
        raise ConfigError(f"{name} must sum to 1, got {worst:.6g}; divide the shares by their sum")
    return np.asarray(values / total, dtype=np.float32)
