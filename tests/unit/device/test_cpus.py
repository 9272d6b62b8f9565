"""CPUs by the quota of control groups, as containers have it: folders stand for the kernel's."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from warpmis.device import cpus
from warpmis.device.cpus import available_cpus, cpu_quota


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


@pytest.fixture
def membership(tmp_path: Path) -> Path:
    """As /proc/self/cgroup of a container that has a name space of its own."""
    write(tmp_path / "proc" / "cgroup", "0::/\n")
    return tmp_path / "proc" / "cgroup"


@pytest.mark.parametrize(
    ("text", "quota"),
    [("150000 100000\n", 1.5), ("max 100000\n", None), ("400000 200000\n", 2.0), ("", None), ("nonsense\n", None)],
)
def test_version_two(text: str, quota: float | None, tmp_path: Path, membership: Path) -> None:
    write(tmp_path / "cpu.max", text)
    assert cpu_quota(tmp_path, membership) == quota


@pytest.mark.parametrize(("quota", "cpus"), [("250000", 2.5), ("-1", None)])
@pytest.mark.parametrize("folder", ["cpu", "cpu,cpuacct"])
def test_version_one(folder: str, quota: str, cpus: float | None, tmp_path: Path, membership: Path) -> None:
    membership.write_text(f"4:{folder}:/docker/abc\n3:memory:/docker/abc\n")
    write(tmp_path / folder / "docker" / "abc" / "cpu.cfs_quota_us", f"{quota}\n")
    write(tmp_path / folder / "docker" / "abc" / "cpu.cfs_period_us", "100000\n")
    assert cpu_quota(tmp_path, membership) == cpus
    # As containers mount it: their group is the root that they see.
    os.rename(tmp_path / folder / "docker" / "abc", tmp_path / "own")
    os.rename(tmp_path / folder, tmp_path / "gone")
    os.rename(tmp_path / "own", tmp_path / folder)
    assert cpu_quota(tmp_path, membership) == cpus


def test_the_least_of_the_groups_above_counts(tmp_path: Path, membership: Path) -> None:
    membership.write_text("0::/kube/pod/one\n")
    for folder, text in (("kube", "800000 100000"), ("kube/pod", "300000 100000"), ("kube/pod/one", "max 100000")):
        write(tmp_path / folder / "cpu.max", text)
    assert cpu_quota(tmp_path, membership) == 3.0


def test_no_control_groups_are_no_limit(tmp_path: Path) -> None:
    assert cpu_quota(tmp_path / "nowhere", tmp_path / "nothing") is None


@pytest.mark.parametrize(("quota", "expected"), [(None, 4), (0.2, 1), (1.5, 2), (3.0, 3), (64.0, 4)])
def test_a_quota_counts_rounded_up_and_never_adds(
    quota: float | None, expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(4)))
    monkeypatch.setattr(cpus, "cpu_quota", lambda: quota)
    assert available_cpus() == expected
