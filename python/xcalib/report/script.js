"use strict";
(() => {
  const figures = [...document.querySelectorAll("figure.frame")];
  const modes = [...document.querySelectorAll("input[name=mode]")];
  const show = () => {
    const frame = document.getElementById("frame").value;
    const mode = modes.find((radio) => radio.checked).value;
    for (const figure of figures) {
      figure.hidden = figure.dataset.frame !== frame;
      figure.className = "frame show-" + mode;
    }
  };
  document.getElementById("frame").addEventListener("change", show);
  for (const radio of modes) radio.addEventListener("change", show);
  show();

  const cuts = [...document.querySelectorAll(".cut")];
  const cut = (value) => {
    for (const slider of cuts) {
      slider.value = value;
      slider.parentElement.style.setProperty("--cut", value + "%");
    }
  };
  for (const slider of cuts) slider.addEventListener("input", () => cut(slider.value));

  const data = document.getElementById("error-data");
  if (data) {
    const errors = JSON.parse(data.textContent);
    const known = errors.median_px.flat().filter((value) => value !== null);
    const top = known.length ? Math.max(...known) : 1;
    const stops = [[215, 80, 35], [145, 65, 42], [55, 90, 50], [0, 80, 45]];
    const tint = (value) => {
      const at = Math.min(2.999, (3 * value) / top), i = Math.floor(at), f = at - i;
      const [h, s, l] = stops[i].map((v, k) => v + f * (stops[i + 1][k] - v));
      return `hsl(${h} ${s}% ${l}%)`;
    };
    const cells = [...document.querySelectorAll("#error-map rect")];
    const slider = document.getElementById("depth"), out = document.getElementById("depth-out");
    const draw = () => {
      const i = Number(slider.value);
      errors.median_px[i].forEach((value, k) => {
        cells[k].setAttribute("fill", value === null ? "#8888" : tint(value));
      });
      out.textContent = errors.depths_m[i].toPrecision(3) + " m";
    };
    document.getElementById("error-top").textContent = top.toPrecision(2) + " px";
    slider.addEventListener("input", draw);
    draw();
  }

  const rig = document.getElementById("rig");
  const segments = JSON.parse(document.getElementById("rig-data").textContent);
  const middle = [0, 1, 2].map((k) => {
    const all = segments.flatMap(([a, b]) => [a[k], b[k]]);
    return (Math.min(...all) + Math.max(...all)) / 2;
  });
  const reach = Math.max(...segments.flatMap(([a, b]) => [a, b]).map((p) => Math.hypot(...p.map((v, k) => v - middle[k]))));
  let yaw = -0.5, pitch = -0.35;
  const turn = (p) => {
    const [x, y, z] = p.map((v, k) => (v - middle[k]) / reach);
    const a = Math.cos(yaw) * x + Math.sin(yaw) * z, c = -Math.sin(yaw) * x + Math.cos(yaw) * z;
    return [a, Math.cos(pitch) * y + Math.sin(pitch) * c];
  };
  const group = rig.querySelector("g");
  for (const [, , name] of segments) {
    const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
    line.setAttribute("class", name);
    group.append(line);
  }
  const render = () => {
    segments.forEach(([a, b], i) => {
      const [x1, y1] = turn(a), [x2, y2] = turn(b), line = group.children[i];
      line.setAttribute("x1", x1); line.setAttribute("y1", y1);
      line.setAttribute("x2", x2); line.setAttribute("y2", y2);
    });
  };
  rig.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    yaw -= event.movementX * 0.01; pitch += event.movementY * 0.01;
    render();
  });
  rig.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!step) return;
    event.preventDefault();
    yaw += step[0]; pitch += step[1];
    render();
  });
  render();
})();
