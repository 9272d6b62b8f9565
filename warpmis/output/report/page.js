"use strict";
// The viewer: half-float pictures are unpacked once, and shown with the exposure, crop and view that the page asks for.
(async () => {
  const $ = (id) => document.getElementById(id);
  const data = JSON.parse($("pixels").textContent);
  const { width, height, images } = data;
  const main = $("canvas");
  const state = { set: "time", mode: "image", selected: 0, previous: 0, zoom: 1, x: 0.5, y: 0.5, stops: { image: 0, difference: 0 } };

  // ---- pixels ----

  const HALF = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const exponent = (bits >> 10) & 31, fraction = bits & 1023;
    HALF[bits] = exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : (2 ** -14 * fraction) / 1024;
  }

  async function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    const count = planes.length / 2;
    const values = new Float32Array(count);
    for (let i = 0; i < count; i++) values[i] = HALF[planes[i] | (planes[count + i] << 8)];
    return values;
  }

  function loaded(uri) {
    return new Promise((resolve) => {
      const picture = new Image();
      picture.onload = () => resolve(picture);
      picture.src = uri;
    });
  }

  await Promise.all(images.map(async (image) => {
    image.values = await unpacked(image.data);
    image.data = null;
    image.flip = image.flip ? await loaded(image.flip) : null;
  }));
  const truth = images[0].values;
  const luminance = (v, i) => 0.2126 * v[i] + 0.7152 * v[i + 1] + 0.0722 * v[i + 2];
  let meanLuminance = 0;
  for (let i = 0; i < truth.length; i += 3) meanLuminance += luminance(truth, i) / (truth.length / 3);

  const ENCODED = new Uint8ClampedArray(4097); // sRGB of 0 to 1
  for (let i = 0; i <= 4096; i++) {
    const value = i / 4096;
    ENCODED[i] = Math.round(255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055));
  }

  function paintImage(values, out, scale) {
    for (let i = 0, o = 0; i < values.length; i += 3, o += 4) {
      for (let c = 0; c < 3; c++) out[o + c] = ENCODED[Math.min(4096, Math.round(4096 * scale * values[i + c]))];
      out[o + 3] = 255;
    }
  }

  // Orange: too dark; violet: too bright; relative to the reference as in relMSE.
  const DARK = [166, 76, 0], BRIGHT = [76, 40, 130], SAME = [245, 245, 245];
  function paintDifference(values, out, gain) {
    for (let i = 0, o = 0; i < values.length; i += 3, o += 4) {
      const right = luminance(truth, i);
      const relative = (luminance(values, i) - right) / Math.hypot(right, 0.1 * meanLuminance);
      const part = Math.min(1, Math.abs(relative) * gain), end = relative < 0 ? DARK : BRIGHT;
      for (let c = 0; c < 3; c++) out[o + c] = SAME[c] + part * (end[c] - SAME[c]);
      out[o + 3] = 255;
    }
  }

  const painted = new Map(); // what each picture looks like in the present mode and exposure
  function picture(image) {
    if (state.mode === "flip" && image.flip) return image.flip;
    const key = images.indexOf(image);
    if (!painted.has(key)) {
      const canvas = document.createElement("canvas");
      canvas.width = width;
      canvas.height = height;
      const pixels = new ImageData(width, height);
      if (state.mode === "difference") paintDifference(image.values, pixels.data, 2 ** (state.stops.difference + 1));
      else paintImage(image.values, pixels.data, 2 ** (data.exposure + state.stops.image));
      canvas.getContext("2d").putImageData(pixels, 0, 0);
      painted.set(key, canvas);
    }
    return painted.get(key);
  }

  // ---- showing ----

  const shown = () => images.filter((image) => image.set === "all" || image.set === state.set);
  const current = () => shown()[Math.min(state.selected, shown().length - 1)];

  function draw(canvas, image, cssWidth) {
    const ratio = window.devicePixelRatio || 1;
    const w = Math.max(1, Math.round(cssWidth * ratio)), h = Math.max(1, Math.round((w * height) / width));
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    const context = canvas.getContext("2d");
    const cropWidth = width / state.zoom, cropHeight = height / state.zoom;
    const half = 0.5 / state.zoom;
    state.x = Math.min(1 - half, Math.max(half, state.x));
    state.y = Math.min(1 - half, Math.max(half, state.y));
    context.imageSmoothingEnabled = w < cropWidth;
    context.drawImage(picture(image), state.x * width - cropWidth / 2, state.y * height - cropHeight / 2,
      cropWidth, cropHeight, 0, 0, w, h);
  }

  function refresh() {
    const image = current();
    draw(main, image, main.clientWidth || 600);
    $("strip").querySelectorAll("button").forEach((button, index) => {
      button.setAttribute("aria-selected", index === Math.min(state.selected, shown().length - 1));
      const canvas = button.querySelector("canvas");
      draw(canvas, shown()[index], canvas.clientWidth || 150);
    });
    $("name").textContent = image.label;
    $("about").textContent = image.about || "";
    $("zoom").textContent = `${+state.zoom.toFixed(1)}×`;
    const sliding = state.mode === "difference" ? "difference" : "image";
    const stops = state.stops[sliding];
    $("slider").textContent = sliding === "difference" ? "gain" : "exposure";
    $("exposure").textContent = sliding === "difference" ? `full colour at ±${+(50 / 2 ** stops).toPrecision(2)} %`
      : `${(data.exposure + stops).toFixed(1)} stops`;
    $("stops").value = stops;
    $("stops").disabled = state.mode === "flip";
    const scale = $("scale");
    scale.hidden = state.mode === "image";
    const [left, right, gradient] = state.mode === "difference"
      ? ["too dark", "too bright", "linear-gradient(90deg, rgb(166 76 0), rgb(245 245 245), rgb(76 40 130))"]
      : ["the same", "as different as can be", "linear-gradient(90deg, #000004, #51127c, #b73779, #fc8961, #fcfdbf)"];
    scale.innerHTML = `<span>${left}</span><span class="gradient" style="background:${gradient}"></span><span>${right}</span>`;
  }

  function fillStrip() {
    $("strip").replaceChildren(...shown().map((image, index) => {
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("role", "option");
      button.append(document.createElement("canvas"), image.label);
      const about = document.createElement("small");
      about.textContent = image.about || "";
      button.append(about);
      button.addEventListener("click", () => select(index));
      return button;
    }));
  }

  function select(index) {
    const count = shown().length;
    index = (index + count) % count;
    if (index !== state.selected) state.previous = state.selected;
    state.selected = index;
    refresh();
  }

  function zoomTo(zoom, x = state.x, y = state.y) {
    state.zoom = Math.min(64, Math.max(1, zoom));
    state.x = x;
    state.y = y;
    refresh();
  }

  // ---- what is clicked, dragged and typed ----

  function choice(box, name, chosen) {
    $(box).addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (!button || button.disabled) return;
      $(box).querySelectorAll("button").forEach((other) => other.setAttribute("aria-pressed", other === button));
      state[name] = button.dataset[name];
      chosen();
    });
  }
  choice("sets", "set", () => { fillStrip(); refresh(); });
  choice("modes", "mode", () => { painted.clear(); refresh(); });
  $("in").addEventListener("click", () => zoomTo(state.zoom * 2));
  $("out").addEventListener("click", () => zoomTo(state.zoom / 2));
  $("fit").addEventListener("click", () => zoomTo(1));
  $("stops").addEventListener("input", (event) => {
    state.stops[state.mode === "difference" ? "difference" : "image"] = +event.target.value;
    painted.clear();
    refresh();
  });

  main.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = main.getBoundingClientRect();
    const u = (event.clientX - box.left) / box.width - 0.5, v = (event.clientY - box.top) / box.height - 0.5;
    const next = Math.min(64, Math.max(1, state.zoom * 2 ** (-event.deltaY / 300)));
    const shift = 1 / state.zoom - 1 / next; // the point under the cursor stays
    zoomTo(next, state.x + u * shift, state.y + v * shift);
  }, { passive: false });

  let drag = null;
  main.addEventListener("pointerdown", (event) => {
    drag = { x: event.clientX, y: event.clientY, moved: false };
    main.setPointerCapture(event.pointerId);
  });
  main.addEventListener("pointermove", (event) => {
    if (!drag) return;
    const dx = event.clientX - drag.x, dy = event.clientY - drag.y;
    if (!drag.moved && Math.hypot(dx, dy) < 4) return;
    const box = main.getBoundingClientRect();
    zoomTo(state.zoom, state.x - dx / box.width / state.zoom, state.y - dy / box.height / state.zoom);
    drag = { x: event.clientX, y: event.clientY, moved: true };
  });
  let dragged = false;
  main.addEventListener("pointerup", () => { dragged = Boolean(drag && drag.moved); drag = null; });
  main.addEventListener("click", () => { if (!dragged) select(state.previous); dragged = false; });
  main.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (step) select(state.selected + step);
    else if (event.key === " ") select(state.previous);
    else if (event.key === "+") zoomTo(state.zoom * 2);
    else if (event.key === "-") zoomTo(state.zoom / 2);
    else return;
    event.preventDefault();
  });
  window.addEventListener("resize", refresh);

  document.querySelector('[data-mode="flip"]').disabled = !images.some((image) => image.flip);
  fillStrip();
  select(Math.min(1, images.length - 1));
  document.body.dataset.ready = "true";
})();
