"""What is compared: a list of labels with the settings that each stands for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from warpmis.config import CELL_STRATEGIES, LearnConfig, RenderConfig
from warpmis.errors import ConfigError
from warpmis.methods import METHODS

BASELINE = "balance"

# What learns by settings of its own.
LEARNER = "murray20"

# A label is a method's name, and its strategies if they are not the default ones.
DEFAULT_LABELS = (
    BASELINE, "nee", "murray20 bsdf,light", "murray20 bsdf,light,uniform", "lpg13", "sbert19", "auto",
)  # fmt: skip

MOST_SPP = 1 << 20

# What can be swept: the option's name, and the setting of RenderConfig or (learn) of LearnConfig.
KNOBS = {
    "learn-spp": ("learn", "spp"),
    "learn-rounds": ("learn", "rounds"),
    "max-depth": ("render", "max_depth"),
}


@dataclass(frozen=True)
class Variant:
    """One line of the comparison.

    Attributes:
        label: what it is called.
        render, learn: settings of RenderConfig and LearnConfig that set it apart.
        knob, value: what is swept and its value here; "" and 0 outside a sweep.
        denoise: whether its picture is the denoised one.
    """

    label: str
    render: Mapping[str, Any] = field(default_factory=dict)
    learn: Mapping[str, Any] = field(default_factory=dict)
    knob: str = ""
    value: int = 0
    denoise: bool = False

    def denoised(self) -> Variant:
        """The same, denoised."""
        return replace(self, label=f"{self.label}, denoised", denoise=True)

    def config(self, common: Mapping[str, Any], spp: int, seed: int) -> RenderConfig:
        """The settings of one run; ConfigError where the variant needs more samples.

        Rounds of a given length are as many as the budget has room for, up to the default number.
        """
        learn = dict(self.learn)
        if "spp" in learn and "rounds" not in learn:
            default = RenderConfig(**{**common, **self.render}, spp=spp).learn_rounds()
            learn["rounds"] = max(1, min(default, spp // learn["spp"]))
        config = RenderConfig(**{**common, **self.render}, learn=LearnConfig(**learn), spp=spp, seed=seed)
        if self.denoise:
            replace(config, spp=spp // 2)  # denoising renders two halves, and each must be possible
        return config

    def least_spp(self, common: Mapping[str, Any]) -> int:
        """The first of 4, 8, 16, ... samples per pixel that is enough for the variant's learn rounds."""
        spp = 4
        while True:
            try:
                self.config(common, spp, seed=0)
                return spp
            except ConfigError:
                if spp >= MOST_SPP:  # something else is wrong, and its message tells what
                    raise
            spp *= 2


def variant(label: str) -> Variant:
    """The variant that a label such as "nee" or "murray20 bsdf,light" stands for."""
    method, _, strategies = label.partition(" ")
    names = tuple(name.strip() for name in strategies.split(",") if name.strip())
    settings: dict[str, Any] = {"method": method, **({"strategies": names} if names else {})}
    RenderConfig(**settings)  # speaks up now rather than in the middle of a measurement
    return Variant(label, settings)


def default_variants() -> list[Variant]:
    """Every method of DEFAULT_LABELS that this version has, strategies named only where there is a choice."""
    labels = [label for label in DEFAULT_LABELS if _exists(label)]
    methods = [label.partition(" ")[0] for label in labels]
    return [variant(label if methods.count(name) > 1 else name) for label, name in zip(labels, methods, strict=True)]


def chosen_variants(labels: Sequence[str]) -> list[Variant]:
    """The labels' variants, behind the baseline, which everything is measured against."""
    if len(set(labels)) < len(labels):
        raise ConfigError(f"methods to compare must differ, got {'; '.join(labels)}")
    return [variant(label) for label in (BASELINE, *(label for label in labels if label != BASELINE))]


def swept(knob: str, values: Sequence[int]) -> list[Variant]:
    """The default method once for each value of one setting; of a learn setting, the published method that has it."""
    if knob not in KNOBS:
        raise ConfigError(f"cannot sweep '{knob}'; choose from {', '.join(KNOBS)}")
    part, name = KNOBS[knob]
    method = RenderConfig().method if part == "render" else LEARNER
    variants = []
    for value in values:
        render = {"method": method, **({name: value} if part == "render" else {})}
        learn = {name: value} if part == "learn" else {}
        variants.append(Variant(f"{method}, {knob} {value}", render, learn, knob, value))
        variants[-1].least_spp({})  # refuses now what no number of samples makes right
    return variants


def _exists(label: str) -> bool:
    method, _, strategies = label.partition(" ")
    return method in METHODS and all(name in CELL_STRATEGIES for name in strategies.split(",") if name)
