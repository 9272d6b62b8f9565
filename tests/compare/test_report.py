"""The report as a file and in a browser."""

from __future__ import annotations

import base64
import html
import importlib.util
import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compare.fakes import SCENE, TRUTH, FakeRender

import warpmis
from warpmis.compare.flip import flip
from warpmis.compare.measure import Settings, run_experiment
from warpmis.compare.variants import chosen_variants, swept
from warpmis.compare.write import write_comparison
from warpmis.output.exr import read_exr
from warpmis.output.report.pixels import DIVERGING, exposure_for, packed, ratio_map
from warpmis.output.report.plot import Axes, error_plot
from warpmis.output.report.text import percent, ratio_text, seconds_text

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
HAS_FLIP = importlib.util.find_spec("flip_evaluator") is not None


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of three methods and a sweep, of a stage with a wicked name."""
    path = tmp_path_factory.mktemp("report")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(vars(warpmis), "render", FakeRender(bias={1: -0.3}))
        variants = [*chosen_variants(["nee", "murray20"]), *swept("max-depth", [1, 4])]
        experiment = run_experiment(SCENE, variants, Settings(spp=64))
        write_comparison(experiment, "<script>alert(1)</script>/a&b.usda", path)
    return path


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


# ---- the file -------------------------------------------------------------------------------------------------------


def test_the_page_needs_nothing_from_outside(page: str) -> None:
    # The first argument of a namespace is no address that is fetched, but the page can do without one too.
    assert not re.findall(r"https?:|//[a-z]+\.[a-z]+/", page)
    sources = re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", page)
    assert sources and all(source.startswith("data:") for source in sources)
    assert "default-src 'none'; img-src data:" in page, "and the browser holds it to that"


def test_names_are_text_not_markup(page: str) -> None:
    assert "<script>alert" not in page
    assert html.escape("<script>alert(1)</script>/a&b.usda") in page


def test_the_page_tells_the_numbers(page: str, folder: Path) -> None:
    summary = json.loads((folder / "report.json").read_text())
    for method in summary["methods"]:
        low, high = (percent(method["equal_time"]["relative_error"][end]) for end in ("low", "high"))
        assert low == high or f"{low} – {high}" in page
    assert "never: bias 30 %" in page
    assert page.count('<svg class="plot"') == 2, "the methods, and the sweep"
    assert "What max-depth costs and buys" in page


def test_packed_pixels_come_back() -> None:
    image = np.array([[[0.0, 1.0, 70000.0], [-1.0, np.nan, 0.1]]])
    planes = np.frombuffer(zlib.decompress(base64.b64decode(packed(image))), np.uint8).reshape(2, -1)
    values = np.ascontiguousarray(planes.T).view("<f2").ravel()
    np.testing.assert_allclose(values, [0.0, 1.0, 65504.0, 0.0, 0.0, 0.1], rtol=1e-3)


def test_ratio_map_is_white_at_one_and_full_at_eight() -> None:
    colors = ratio_map(np.array([[0.0, 1.0 / 8.0, 1.0, 8.0, 100.0]]))
    np.testing.assert_array_equal(colors[0], DIVERGING[[0, 0, 2, 4, 4]])


def test_exposure_brings_the_bright_parts_below_white() -> None:
    image = np.full((10, 10, 3), 0.01)
    assert 0.5 < 0.01 * 2.0 ** exposure_for(image) < 1.1
    assert exposure_for(np.zeros((2, 2, 3))) == 0.0


def test_plot_is_logarithmic_and_holds_everything() -> None:
    axes = Axes((1.0, 100.0), (0.01, 1.0))
    assert axes.x(10.0) == pytest.approx((axes.x(1.0) + axes.x(100.0)) / 2)
    assert axes.y(0.1) == pytest.approx((axes.y(1.0) + axes.y(0.01)) / 2)
    assert axes.y(1.0) < axes.y(0.01), "more error is further up"
    spread = {"low": 0.09, "median": 0.1, "high": 0.12}
    method: dict[str, Any] = {
        "label": "a",
        "runs": [{"spp": 4, "seconds": {"median": 2.0}, "relative_error": spread, "below_reference": False}],
        "denoised": None,
        "time_to": [
            {"kind": "predicted", "relative_error": 0.05, "seconds": {"median": 8.0}},
            {"kind": "predicted", "relative_error": 0.001, "seconds": {"median": 2e4}},
        ],
    }
    svg = error_plot([method], [0.05, 0.001], 0.06)
    assert svg.count('class="line predicted"') == 1
    places = [float(x) for x in re.findall(r"translate\(([\d.]+) [\d.]+\) scale", svg)]
    assert len(places) == 1 and 74.0 < places[0] < 842.0
    assert "5 %</text>" in svg and "0.1 %" not in svg, "what is too far away is not shown"
    better = [{**method["runs"][0], "relative_error": dict.fromkeys(spread, 0.01), "below_reference": True}]
    method["denoised"] = {"label": "a, denoised", "runs": better, "time_to": []}
    svg = error_plot([method], [0.05, 0.001], 0.06)
    assert svg.count('class="series denoised s0"') == 1 and "a, denoised, 4 spp: &lt; 1 % after" in svg
    _, lower = (float(y) for y in re.findall(r"translate\([\d.]+ ([\d.]+)\) scale", svg))
    assert lower < 470.0 - 52.0, "the axis reaches down to it"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (percent(0.02), "2 %"), (percent(0.0234), "2.3 %"), (percent(0.005), "0.5 %"), (percent(1.1), "110 %"),
        (percent(0.1), "10 %"), (percent(0.0), "0 %"), (seconds_text(0.0123), "0.012 s"), (seconds_text(12.34), "12 s"),
        (seconds_text(99.0), "99 s"), (seconds_text(9.96), "10 s"), (seconds_text(100.0), "1.7 min"),
        (seconds_text(7200.0), "2.0 h"),
        (seconds_text(864000.0), "10 days"), (ratio_text(1.234), "1.23"), (ratio_text(123.4), "123"),
    ],
)  # fmt: skip
def test_numbers_as_people_read_them(text: str, expected: str) -> None:
    assert text == expected


# ---- denoising ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def denoised_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of three methods with denoising, and a sweep."""
    pytest.importorskip("pyoidn")
    path = tmp_path_factory.mktemp("denoised")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(vars(warpmis), "render", FakeRender())
        variants = [*chosen_variants(["nee", "murray20"]), *swept("max-depth", [4])]
        experiment = run_experiment(SCENE, variants, Settings(spp=64, denoise=True))
        write_comparison(experiment, "fake.usda", path)
    return path


def test_the_page_tells_what_denoising_does(page: str, denoised_folder: Path) -> None:
    summary = json.loads((denoised_folder / "report.json").read_text())
    denoised = (denoised_folder / "report.html").read_text(encoding="utf-8")
    for words in ("With and without denoising", 'data-set="denoised"', "Hollow points", "</b> denoised</span>"):
        assert words in denoised and words not in page, words
    assert denoised.count('class="series denoised') == 3, "one for each method; the sweep has none"
    for method in summary["methods"][:3]:
        with_it = method["denoised"]
        assert percent(with_it["equal_time"]["relative_error"]["median"]) in denoised
        if HAS_FLIP:
            assert with_it["flip"] < method["flip"] and with_it["flip_equal_samples"] < method["flip_equal_samples"]
            assert f"<br><b>{with_it['flip_equal_samples']:.3f}</b>" in denoised
    assert summary["methods"][3]["denoised"] is None


def test_denoised_pictures_are_files(denoised_folder: Path) -> None:
    summary = json.loads((denoised_folder / "report.json").read_text())
    files = summary["methods"][1]["denoised"]["files"]
    assert files["equal_time"] == "nee-denoised.exr" and files["equal_samples_png"] == "nee-denoised-samples.png"
    channels, _ = read_exr(denoised_folder / files["equal_samples"])
    picture = np.stack([channels[f"denoised.{name}"] for name in "RGB"], axis=-1)
    error = np.sqrt(np.mean((picture / TRUTH - 1.0) ** 2))
    assert error == pytest.approx(0.25 / np.sqrt(64), rel=0.05)


# ---- FLIP -----------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not HAS_FLIP, reason="needs flip-evaluator")
def test_flip_of_the_same_and_of_the_different() -> None:
    same, other = flip(TRUTH, TRUTH), flip(TRUTH[::-1, ::-1] ** 4, TRUTH)
    assert same is not None and other is not None
    assert same.mean == 0.0 and other.mean > 0.2
    assert other.colors.shape == TRUTH.shape and other.colors.dtype == np.uint8


def test_without_flip_the_report_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(vars(warpmis), "render", FakeRender())
    monkeypatch.setitem(__import__("sys").modules, "flip_evaluator", None)
    summary = write_comparison(run_experiment(SCENE, chosen_variants([]), Settings(spp=4)), "a.usda", tmp_path)
    assert summary["methods"][0]["flip"] is None
    assert "The FLIP view is left out: install the package flip-evaluator" in (tmp_path / "report.html").read_text()


# ---- in a browser ---------------------------------------------------------------------------------------------------

# Before the page's own script: what goes wrong is collected. After it: clicks, and what they did.
LISTEN = """<script>
window.found = {errors: []};
addEventListener("error", (event) => found.errors.push(event.message || String(event.target)), true);
addEventListener("unhandledrejection", (event) => found.errors.push(String(event.reason)));
addEventListener("securitypolicyviolation", (event) => found.errors.push(event.blockedURI));
console.error = console.warn = (...all) => found.errors.push(all.join(" "));
</script>"""

CLICK = """<script>(async () => {
while (!document.body.dataset.ready && !found.errors.length) await new Promise((done) => setTimeout(done, 20));
try {
  const $ = (selector) => document.querySelector(selector), name = () => $("#name").textContent;
  const shot = () => $("#canvas").toDataURL();
  const look = (selector) => { $(selector).click(); return shot(); };
  found.first = name();
  const image = shot();
  $("#canvas").click();
  found.flipped = name();
  found.changed = shot() !== image;
  $("#canvas").click();
  found.back = name() === found.first && shot() === image;
  found.zoomed = look("#in") !== image && $("#zoom").textContent;
  found.fit = look("#fit") === image;
  found.difference = look("[data-mode=difference]") !== image;
  $("#stops").value = 3; $("#stops").dispatchEvent(new Event("input"));
  found.gain = $("#exposure").textContent;
  found.flipOff = $("[data-mode=flip]").disabled;
  found.flip = found.flipOff || look("[data-mode=flip]") !== image;
  found.image = look("[data-mode=image]") === image;
  $("#stops").value = -8; $("#stops").dispatchEvent(new Event("input"));
  found.dark = shot() !== image;
  look("[data-set=samples]");
  found.pictures = [...document.querySelectorAll("#strip button")].map((button) => button.childNodes[1].textContent);
  document.querySelectorAll("#strip button")[3].click();
  found.selected = name();
  const denoised = $("[data-set=denoised]");
  const differs = denoised && look("[data-set=samples]") !== look("[data-set=denoised]");
  found.denoised = denoised && [name(), differs, $("#about").textContent];
  found.requests = performance.getEntriesByType("resource").map((entry) => entry.name)
    .filter((address) => !/^(data|blob):/.test(address));
} catch (error) { found.errors.push(String(error)); }
const out = document.createElement("pre");
out.id = "found";
out.textContent = JSON.stringify(found);
document.body.append(out);
})()</script>"""


def looked_at(page: str, tmp_path: Path) -> dict[str, Any]:
    """What a browser finds when it clicks through the page."""
    probed = tmp_path / "probed.html"
    probed.write_text(page.replace("<title>", LISTEN + "<title>").replace("</body>", CLICK + "</body>"))
    command = [
        str(CHROMIUM), "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
        f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1200,1600", "--virtual-time-budget=20000",
        "--dump-dom", probed.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    match = re.search(r'<pre id="found">(.*?)</pre>', done.stdout)
    assert match, done.stderr[-2000:]
    found: dict[str, Any] = json.loads(html.unescape(match[1]))
    return found


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_in_a_browser(page: str, tmp_path: Path) -> None:
    """No error, no request, and the viewer answers."""
    found = looked_at(page, tmp_path)
    assert found["errors"] == [] and found["requests"] == []
    assert (found["first"], found["flipped"]) == ("balance", "reference")
    assert found["zoomed"] == "2×"
    assert found["gain"] == "full colour at ±6.3 %"
    for answer in ("changed", "back", "fit", "difference", "flip", "image", "dark"):
        assert found[answer], answer
    assert found["flipOff"] != HAS_FLIP
    assert found["pictures"] == ["reference", "balance", "nee", "murray20"]
    assert found["selected"] == "murray20"
    assert found["denoised"] is None


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_denoised_pictures_in_a_browser(denoised_folder: Path, tmp_path: Path) -> None:
    """The sampled and the denoised picture of a method differ, and the caption has the denoised one's figures."""
    found = looked_at((denoised_folder / "report.html").read_text(encoding="utf-8"), tmp_path)
    assert found["errors"] == []
    name, differs, about = found["denoised"]
    assert (name, differs) == ("murray20", True)
    assert "59\N{NO-BREAK SPACE}spp" in about
