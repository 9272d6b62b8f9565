"""Which samples are spent on which allocation."""

from __future__ import annotations

from dataclasses import dataclass

from warpmis.config import RenderConfig


@dataclass(frozen=True)
class Round:
    """Samples per pixel traced with one frozen allocation; `learn`: its moments then give the next one.

    pilot: so many of the samples have been taken in the pixels that learning looked at, one in several (RenderConfig:
    learn_stride). sequence: the samples that are spread evenly together: those of the round, or for a pilot also those
    after it, since its pixels go on as they began. following: samples per pixel of the round after it, 0 for none;
    label: for those who watch. is_kept: the picture holds its samples. may_be_left_out: where time is short, the render
    goes on without it.
    """

    first_sample: int
    samples: int
    learn: bool
    pilot: int = 0
    after: int = 0
    following: int = 0
    label: str = ""
    is_kept: bool = True
    may_be_left_out: bool = False

    @property
    def sequence(self) -> range:
        return range(self.first_sample, self.first_sample + self.samples + self.after)


def schedule(config: RenderConfig) -> tuple[Round, ...]:
    """The learn rounds, then everything that the budget leaves in one round; every sample enters the image."""
    rounds: list[Round] = []
    spent = 0
    if config.how.learns:
        count, spp = config.learn_rounds(), config.learn_spp()
        if config.how.next_event:
            # Its statistics are of pairs alone: pixels that have gone over to a mixture would add none.
            count, spp = 1, count * spp
        if config.learn_stride > 1:
            pilot = Round(0, spp, learn=True, after=config.spp - spp, following=config.spp, label="round 1/1")
            return (pilot, Round(0, config.spp, learn=False, pilot=spp))
        for _ in range(count):
            spent += spp
            following = min(spp, config.spp - spent) if len(rounds) + 1 < count else config.spp - spent
            label = f"round {len(rounds) + 1}/{count}"
            rounds.append(Round(spent - spp, spp, learn=True, following=following, label=label))
    if spent < config.spp:
        rounds.append(Round(spent, config.spp - spent, learn=False))
    return tuple(rounds)
