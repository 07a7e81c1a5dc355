"use strict";
// What a script adds to report.html: zoom and pan, sorted tables.
// Everything is drawn without it; a plot's data are the points of its SVG paths.

const CLOSEST = 1 / 400; // least visible share of a plot
const FARTHEST = { x: 1, xy: 4 }; // times the whole plot
const STEP = 1.4; // of a button or a key
const SETTLED = 300; // ms after the page scrolled in which the wheel belongs to the page
const TICKS = 6; // about, per axis

// Round numbers between low and high, as `ticks` in bench/html/plots.py.
function ticks(low, high, logarithmic) {
  if (logarithmic) {
    const steps = high - low > 2.5 ? [1] : [1, 2, 5];
    const values = [];
    for (let k = Math.floor(low); k <= Math.ceil(high); k++) {
      values.push(...steps.map((step) => step * 10 ** k));
    }
    const inside = values.map(asLogarithm).filter(([at]) => at >= low && at <= high);
    if (inside.length > 1) return inside;
    return ticks(10 ** low, 10 ** high).filter(([v]) => v > 0).map(([v]) => asLogarithm(v));
  }
  const step = roundStep((high - low) / TICKS);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k <= Math.floor(high / step + 1e-9); k++) {
    found.push([k * step, short(k * step)]);
  }
  return found;
}

const asLogarithm = (value) => [Math.log10(value), short(value)];
const short = (value) => String(Number(value.toPrecision(6)));

function roundStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((f) => f * power).find((step) => step >= rough * (1 - 1e-9));
}

// A plot's visible part {x, y, w, h} is the view box of its SVG: in the units of the data, y
// downward. Plots of one group show the same part of the axes they zoom.
class Plot {
  static groups = new Map();

  constructor(box) {
    this.box = box;
    this.svg = box.querySelector("svg");
    this.axes = box.dataset.zoom;
    const [x, y, w, h] = this.svg.getAttribute("viewBox").split(" ").map(Number);
    this.home = { x, y, w, h };
    this.view = { ...this.home };
    this.group = Plot.groups.get(box.dataset.group) ?? [];
    this.group.push(this);
    if (box.dataset.group) Plot.groups.set(box.dataset.group, this.group);
    this.pointers = new Map();
    this.addControls();
    this.listen();
  }

  addControls() {
    const controls = document.createElement("div");
    controls.className = "controls";
    const actions = {
      "+": ["zoom in", () => this.zoom(1 / STEP)],
      "\u2212": ["zoom out", () => this.zoom(STEP)],
      "\u21ba": ["show all", () => this.reset()],
    };
    for (const [sign, [name, act]] of Object.entries(actions)) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = sign;
      button.title = name;
      button.setAttribute("aria-label", `${name}: ${this.svg.getAttribute("aria-label")}`);
      button.addEventListener("click", act);
      controls.append(button);
    }
    this.readout = document.createElement("span");
    this.readout.className = "readout";
    this.readout.hidden = true;
    this.box.append(controls, this.readout);
  }

  listen() {
    const svg = this.svg;
    svg.tabIndex = 0;
    svg.addEventListener("wheel", (event) => this.onWheel(event), { passive: false });
    svg.addEventListener("pointerdown", (event) => this.onDown(event));
    svg.addEventListener("pointermove", (event) => this.onMove(event));
    for (const name of ["pointerup", "pointercancel"]) {
      svg.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
    svg.addEventListener("pointerleave", () => (this.readout.hidden = true));
    svg.addEventListener("dblclick", () => this.reset());
    svg.addEventListener("keydown", (event) => this.onKey(event));
  }

  // A wheel that scrolls the page goes on scrolling it, also over a plot, and zooming out of
  // the whole plot scrolls on.
  onWheel(event) {
    const pixels = event.deltaY * (event.deltaMode ? 30 : 1);
    const whole = pixels > 0 && this.view.w >= this.home.w * FARTHEST[this.axes] * 0.999;
    if (!pixels || whole || event.timeStamp - lastScroll < SETTLED) return;
    event.preventDefault();
    this.zoom(Math.exp(Math.max(-1, Math.min(1, pixels / 400))), ...this.place(event));
  }

  onDown(event) {
    if (event.button) return;
    this.svg.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.place(event));
  }

  onMove(event) {
    const at = this.place(event);
    this.tell(at);
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId);
    this.pointers.set(event.pointerId, at);
    if (others.length === 0) {
      this.pan(before[0] - at[0], before[1] - at[1]);
    } else if (others.length === 1) {
      this.pinch(before, at, others[0][1]);
    }
  }

  // Two fingers: their distance zooms, their middle pans.
  pinch(before, at, other) {
    const { width, height } = this.svg.getBoundingClientRect();
    const apart = (a) => Math.hypot((a[0] - other[0]) * width, (a[1] - other[1]) * height);
    const middle = (a) => [(a[0] + other[0]) / 2, (a[1] + other[1]) / 2];
    const [from, to] = [middle(before), middle(at)];
    this.pan(from[0] - to[0], from[1] - to[1]);
    this.zoom(Math.max(apart(before), 1) / Math.max(apart(at), 1), ...to);
  }

  onKey(event) {
    const actions = {
      "+": () => this.zoom(1 / STEP),
      "=": () => this.zoom(1 / STEP),
      "-": () => this.zoom(STEP),
      0: () => this.reset(),
      ArrowLeft: () => this.pan(-0.1, 0),
      ArrowRight: () => this.pan(0.1, 0),
      ArrowUp: () => this.pan(0, -0.1),
      ArrowDown: () => this.pan(0, 0.1),
    };
    if (event.ctrlKey || event.metaKey || !(event.key in actions)) return;
    event.preventDefault();
    actions[event.key]();
  }

  // Where in the plot a pointer is, as shares of its width and height.
  place(event) {
    const { left, top, width, height } = this.svg.getBoundingClientRect();
    return [(event.clientX - left) / width, (event.clientY - top) / height];
  }

  zoom(factor, px = 0.5, py = 0.5) {
    const [view, home] = [this.view, this.home];
    const share = Math.max(CLOSEST, Math.min(FARTHEST[this.axes], (view.w / home.w) * factor));
    const next = { ...view, w: home.w * share };
    next.x += px * (view.w - next.w);
    if (this.axes === "xy") {
      next.h = home.h * share;
      next.y += py * (view.h - next.h);
    }
    this.show(next);
  }

  pan(dx, dy) {
    const { x, y, w, h } = this.view;
    this.show({ x: x + dx * w, y: this.axes === "xy" ? y + dy * h : y, w, h });
  }

  reset() {
    this.show(this.home);
  }

  // Show a part in all plots of the group; it never leaves the whole plot altogether.
  show(view) {
    const home = this.home;
    const [x, y] = [
      within(view.x, view.w, home.x, home.w),
      within(view.y, view.h, home.y, home.h),
    ];
    for (const plot of this.group) {
      const part = plot.axes === "xy" ? { ...view, x, y } : { ...plot.view, x, w: view.w };
      plot.draw(part);
    }
  }

  draw(view) {
    this.view = { ...view };
    this.svg.setAttribute("viewBox", `${view.x} ${view.y} ${view.w} ${view.h}`);
    this.box.classList.toggle("zoomed", view.w < this.home.w * 0.999);
    const across = ticks(view.x, view.x + view.w, this.box.dataset.x);
    const upward = ticks(-view.y - view.h, -view.y, this.box.dataset.y);
    label(this.box.querySelector(".x-ticks"), "left", across, view.x, view.w);
    label(this.box.querySelector(".y-ticks"), "bottom", upward, -view.y - view.h, view.h);
    const lines = [
      ...across.map(([at]) => `M${at} ${-view.y - view.h}v${view.h}`),
      ...upward.map(([at]) => `M${view.x} ${at}h${view.w}`),
    ];
    this.svg.querySelector(".grid").setAttribute("d", lines.join(""));
  }

  // The values under the pointer.
  tell([px, py]) {
    const number = (value, logarithmic) => (logarithmic ? 10 ** value : value).toPrecision(4);
    const x = number(this.view.x + px * this.view.w, this.box.dataset.x);
    const y = number(-this.view.y - py * this.view.h, this.box.dataset.y);
    this.readout.textContent = `${x}, ${y}`;
    this.readout.hidden = false;
  }
}

function label(box, side, marks, low, span) {
  const spans = marks.map(([at, text]) => {
    const mark = document.createElement("span");
    mark.textContent = text;
    mark.style[side] = `${(100 * (at - low)) / span}%`;
    return mark;
  });
  box.replaceChildren(...spans);
}

// The start of a part, moved so that the part overlaps the whole.
function within(start, length, wholeStart, whole) {
  if (length <= whole) {
    return Math.max(wholeStart, Math.min(wholeStart + whole - length, start));
  }
  return Math.max(wholeStart + whole - length, Math.min(wholeStart, start));
}

let lastScroll = -Infinity;
addEventListener("scroll", (event) => (lastScroll = event.timeStamp), { passive: true });

for (const box of document.querySelectorAll(".plot[data-zoom]")) new Plot(box);
for (const hint of document.querySelectorAll(".hint")) hint.hidden = false;

// Tables: a button in each heading sorts by its column: numbers, then words, dashes last.

function sortBy(table, column, ascending) {
  const kind = (text) => (text === "-" ? 2 : Number.isNaN(Number(text)) ? 1 : 0);
  const rows = [...table.tBodies[0].rows];
  rows.sort((a, b) => {
    const [x, y] = [a, b].map((row) => row.cells[column].textContent);
    if (kind(x) !== kind(y)) return kind(x) - kind(y);
    return (kind(x) ? x.localeCompare(y) : x - y) * (ascending ? 1 : -1);
  });
  table.tBodies[0].append(...rows);
}

for (const heading of document.querySelectorAll("thead th")) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = heading.textContent;
  heading.replaceChildren(button);
  button.addEventListener("click", () => {
    const ascending = heading.getAttribute("aria-sort") !== "ascending";
    for (const other of heading.parentNode.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", ascending ? "ascending" : "descending");
    sortBy(heading.closest("table"), heading.cellIndex, ascending);
  });
}

// Paper cannot be unfolded.

addEventListener("beforeprint", () => {
  for (const folded of document.querySelectorAll("details")) folded.open = true;
});
