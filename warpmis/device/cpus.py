"""How many CPUs there are for this process: by its affinity, and by the quota of its control groups."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

CGROUPS = Path("/sys/fs/cgroup")
MEMBERSHIP = Path("/proc/self/cgroup")


def available_cpus() -> int:
    """CPUs that this process may use: at most as many as a container's quota pays for, rounded up; at least one."""
    affine = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = cpu_quota()
    return affine if quota is None else max(1, min(affine, math.ceil(quota)))


def cpu_quota(root: Path = CGROUPS, membership: Path = MEMBERSHIP) -> float | None:
    """CPUs' worth of time that the control groups of this process allow it; None where there is no limit.

    A group's limit holds for all below it, so the least of them counts. Inside a container the groups above it are out
    of sight, and its own is often mounted as the root.

    Sources: Linux kernel, Documentation/admin-guide/cgroup-v2.rst (cpu.max: quota and period [us]) and
    Documentation/scheduler/sched-bwc.rst (version 1: cpu.cfs_quota_us, cpu.cfs_period_us).
    """
    limits = [limit for folder in _groups(root, membership) if (limit := _limit(folder)) is not None]
    return min(limits, default=None)


def _groups(root: Path, membership: Path) -> Iterator[Path]:
    """Folders of the groups that this process is in, and of those above them, of either version."""
    yield from (root, root / "cpu", root / "cpu,cpuacct")
    try:
        lines = membership.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if controllers and "cpu" not in controllers.split(","):
            continue
        top = root / controllers if controllers else root
        here = top / path.lstrip("/")
        yield from (folder for folder in (here, *here.parents) if folder.is_relative_to(top))


def _limit(group: Path) -> float | None:
    try:
        if (group / "cpu.max").exists():
            quota, period = (group / "cpu.max").read_text().split()
        else:
            quota, period = ((group / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
        cpus = float(quota) / float(period)
    except (OSError, ValueError, ZeroDivisionError):  # no such group, or "max": no limit
        return None
    return cpus if cpus > 0.0 and math.isfinite(cpus) else None  # version 1 says -1 for no limit
