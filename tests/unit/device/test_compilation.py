"""Kernels are compiled beside the run, in order, and those that it never needs not at all; torn ones anew."""

from __future__ import annotations

import os
import shutil
import signal
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
import scenes
import warp as wp

import warpmis
from warpmis.device import compilation, kernel_cache
from warpmis.device.compilation import Compiler, load_kernels
from warpmis.device.start import start_warp
from warpmis.errors import WarpmisError
from warpmis.rendering.specialise import features_of, kernels_of

pytestmark = pytest.mark.own_kernels


def kernel_of(value: float) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def fill(values: wp.array(dtype=float)):
        values[wp.tid()] = wp.static(value)

    fill.module.unload()  # Warp gives equal kernels one module, which another test may have compiled
    return fill


def filled(kernel: wp.Kernel) -> float:
    values = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(kernel, dim=1, inputs=[values], device="cpu")
    return float(values.numpy()[0])


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for kernels; what becomes of it is forgotten afterwards."""
    start_warp()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "cache"))
    monkeypatch.setattr(kernel_cache, "_temporary", [])
    monkeypatch.setattr(kernel_cache, "_notes", [])
    (tmp_path / "cache").mkdir()
    return tmp_path / "cache"


# ---- in order, and beside the run -----------------------------------------------------------------------------------


def test_a_run_waits_for_what_it_launches_alone(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One compiling thread at work on the second of three kernels holds up no launch of the first."""
    monkeypatch.setattr(compilation, "_threads", single_thread())
    kernels = [kernel_of(value) for value in (1.0, 2.0, 3.0)]
    gate, order = threading.Event(), []
    make_ready = compilation._make_ready

    def slow(kernel: wp.Kernel, device: str, is_cpu: bool) -> bool:
        order.append(kernel)
        if kernel is kernels[1]:
            assert gate.wait(60.0)
        return make_ready(kernel, device, is_cpu)

    monkeypatch.setattr(compilation, "_make_ready", slow)
    said: list[str] = []
    with Compiler("cpu", said.append) as compiler:
        compiler.begin(kernels)
        assert compiler.absent == 3
        compiler.wait(kernels[:1])
        assert filled(kernels[0]) == 1.0
        loads = [compiler.loads[kernel.module] for kernel in kernels]
        assert [load.future.done() for load in loads] == [True, False, False]
        threading.Timer(0.5, gate.set).start()
        compiler.wait(kernels[1:])
    assert order == kernels
    assert [filled(kernel) for kernel in kernels] == [1.0, 2.0, 3.0]
    assert any(line.startswith("1 of 3 kernels, ") and line.endswith(" s: fill") for line in said)
    assert said[-1] == ""  # it goes on
    assert compiler.outcome().compiled == 3


def single_thread() -> Callable[[], compilation.ThreadPoolExecutor]:
    pool = compilation.ThreadPoolExecutor(1)
    return lambda: pool


def test_what_was_not_begun_is_not_compiled_once_the_run_has_ended(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compilation, "_threads", single_thread())
    first, second = kernel_of(4.0), kernel_of(5.0)
    with Compiler("cpu") as compiler:
        compiler.begin([first, second])
        compiler.wait([first])
        gate = compilation._threads().submit(lambda: None)
    gate.result()
    later = Compiler("cpu")
    later.wait([first])
    assert (later.outcome().compiled, later.outcome().cached) == (0, 1)
    assert compiler.loads[second.module].future.cancelled() or compiler.loads[second.module].future.done()
    later.wait([second])  # and if it is wanted after all, it is there
    assert filled(second) == 5.0


def test_the_mixture_s_kernel_is_compiled_only_where_a_pixel_needs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """After so few samples of this room no pixel has found a mixture that is better than next-event estimation."""
    scene = scenes.room()
    begun: set[wp.Kernel] = set()
    begin = Compiler.begin
    monkeypatch.setattr(Compiler, "begin", lambda self, kernels: (begun.update(kernels), begin(self, kernels))[1])

    def render(**settings: float) -> None:
        config = warpmis.RenderConfig(spp=32, **settings)
        result = warpmis.render(scene, config=config)
        assert result.stats["next_event_pixels"] == 1.0
        kernels = kernels_of(features_of(scene, config), config)
        # A render with a time limit has all kernels before it looks at its clock.
        assert begun == set(kernels.all if "time_limit" in settings else kernels.sure)
        assert set(kernels.perhaps) == set(kernels.all) - set(kernels.sure) != set()

    render()
    begun.clear()
    render(target_error=0.5)
    begun.clear()
    render(time_limit=60.0)


def test_a_kernel_that_fails_and_is_not_needed_costs_nothing(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    needed, broken = kernel_of(11.0), kernel_of(12.0)
    make_ready = compilation._make_ready

    def failing(kernel: wp.Kernel, device: str, is_cpu: bool) -> bool:
        if kernel is broken:
            raise WarpmisError("no room")
        return make_ready(kernel, device, is_cpu)

    monkeypatch.setattr(compilation, "_make_ready", failing)
    compiler = Compiler("cpu")
    compiler.begin([broken, needed])
    compiler.wait([needed])
    assert filled(needed) == 11.0
    assert compiler.outcome().compiled == 1
    with pytest.raises(WarpmisError, match="no room"):
        compiler.wait([broken])


def test_a_forked_process_has_compiling_threads_of_its_own(cache: Path) -> None:
    load_kernels([kernel_of(13.0)], "cpu")  # the parent's threads are there
    later = kernel_of(14.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python 3.12 warns of forks among threads
        child = os.fork()
    if child == 0:
        os._exit(0 if load_kernels([later], "cpu").compiled == 1 else 1)
    for _ in range(300):
        finished, status = os.waitpid(child, os.WNOHANG)
        if finished:
            break
        time.sleep(0.1)
    else:
        os.kill(child, signal.SIGKILL)
        pytest.fail("the child waits for its parent's threads")
    assert os.waitstatus_to_exitcode(status) == 0


def test_what_another_process_compiles_is_waited_for(cache: Path, tmp_path: Path) -> None:
    """And taken from the cache: here as it was put aside before."""
    kernel = kernel_of(15.0)
    load_kernels([kernel], "cpu")
    folder = kernel_cache.folder_of(kernel.module, is_cpu=True)
    folder.rename(tmp_path / "aside")
    kernel.module.unload()
    with kernel_cache.claimed(folder):
        (load,) = Compiler("cpu").begin([kernel])
        with pytest.raises(TimeoutError):
            load.result(0.5)
        (tmp_path / "aside").rename(folder)
    assert not load.result(60.0), "it was not compiled"
    assert filled(kernel) == 15.0


# ---- the folder of kernels ------------------------------------------------------------------------------------------


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def zero(path: Path) -> None:
    path.write_bytes(bytes(path.stat().st_size))


def flip(path: Path) -> None:
    """Bytes in the middle, where the code is: Warp would run it."""
    content = bytearray(path.read_bytes())
    content[100:140] = bytes(value ^ 0xFF for value in content[100:140])
    path.write_bytes(content)


@pytest.mark.parametrize("damage", [truncate, zero, flip])
@pytest.mark.parametrize("with_checksum", [True, False])
def test_a_torn_object_is_compiled_anew(damage: Callable[[Path], None], with_checksum: bool, cache: Path) -> None:
    if damage is flip and not with_checksum:
        pytest.skip("nothing tells")
    kernel = kernel_of(7.0)
    load_kernels([kernel], "cpu")
    (binary,) = kernel_cache.binaries(kernel_cache.folder_of(kernel.module, is_cpu=True), is_cpu=True)
    if not with_checksum:
        kernel_cache._checksum_file(binary).unlink()
    damage(binary)
    kernel.module.unload()
    assert load_kernels([kernel], "cpu").compiled == 1
    assert filled(kernel) == 7.0
    kernel.module.unload()
    assert load_kernels([kernel], "cpu").cached == 1


@pytest.mark.parametrize("content", ["", '{"half'])
def test_a_torn_description_is_compiled_anew(content: str, cache: Path) -> None:
    kernel = kernel_of(8.0)
    load_kernels([kernel], "cpu")
    (description,) = kernel_cache.folder_of(kernel.module, is_cpu=True).glob("*.meta")
    description.write_text(content)
    kernel.module.unload()
    assert load_kernels([kernel], "cpu").compiled == 1
    assert filled(kernel) == 8.0


def test_without_room_kernels_go_to_a_temporary_folder(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_cache, "ROOM", 1 << 62)
    kernel = kernel_of(9.0)
    load_kernels([kernel], "cpu")
    assert filled(kernel) == 9.0
    assert not list(cache.glob("*/*.o"))
    (note,) = kernel_cache.notes()
    assert f"{cache} cannot be written (no space left): set WARP_CACHE_PATH" in note
    with pytest.raises(WarpmisError, match="temporary folder"):
        kernel_cache.check_cache()
    shutil.rmtree(wp.config.kernel_cache_dir)


def test_what_is_compiled_already_needs_no_room(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in an image that a build machine made, and another user runs."""
    kernel = kernel_of(10.0)
    load_kernels([kernel], "cpu")
    kernel.module.unload()
    monkeypatch.setattr(kernel_cache, "ROOM", 1 << 62)
    assert load_kernels([kernel], "cpu").cached == 1
    assert kernel_cache.notes() == ()
