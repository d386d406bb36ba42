// Draws what the monitor says. It comes as a stream of events from the same address, and nothing is asked of any other.
"use strict";

const SVG = "http://www.w3.org/2000/svg";
const EFFECTS = ["coulomb", "viscous", "armature", "bias"];
const LEGS = ["FR", "FL", "RR", "RL"];
let page = "robot";
let state = null;
let everything = false;

const at = (id) => document.getElementById(id);

// An element with text or children; text is never taken for markup.
function make(name, content, attributes = {}) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...[content].flat());
  return element;
}

function draw(name, attributes, content = []) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...[content].flat());
  return element;
}

function table(id, heading, rows) {
  const cells = (row, name) => make("tr", row.map((cell) => {
    if (cell instanceof Element) return cell;
    // A heading without words is no heading.
    const kind = name === "th" && cell === "" ? "td" : name;
    return make(kind, String(cell), cell === "" || Number.isNaN(parseFloat(cell)) ? {} : { class: "number" });
  }));
  at(id).replaceChildren(make("thead", cells(heading, "th")), make("tbody", rows.map((row) => cells(row, "td"))));
}

const number = (x, digits = 3) => (x === null || x === undefined ? "–" : x.toFixed(digits));
const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
const quiet = (text) => make("td", text, { class: "number quiet" });

function ask(wish) {
  fetch("/ask", { method: "POST", body: wish }).catch(() => lost());
}

function lost() {
  at("state").textContent = "the monitor has ended";
}

// A residual over time with the band in which it should lie.
function residualPlot(joint) {
  const [width, height, left] = [240, 80, 34];
  const values = joint.residuals;
  const top = 1.15 * Math.max(0.01, ...values, ...(joint.band ?? []));
  const x = (n) => left + ((width - left) * (n + 1)) / Math.max(values.length, 2);
  const y = (value) => height - (height * value) / top;
  const parts = [];
  if (joint.band) {
    const [lower, upper] = joint.band;
    parts.push(draw("rect", { class: "band", x: left, width: width - left, y: y(upper), height: y(lower) - y(upper) }));
  }
  const points = values.map((value, n) => `${x(n).toFixed(1)},${y(value).toFixed(1)}`);
  parts.push(draw("polyline", { class: "line", points: points.join(" ") }));
  parts.push(draw("text", { x: 2, y: 10 }, number(top, 2)), draw("text", { x: 2, y: height - 2 }, "0"));
  const picture = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "img",
    "aria-label": `residual of ${joint.name}`, class: joint.above ? "above" : "" }, parts);
  const newest = joint.residual === null ? "–" : `${joint.above ? "▲ " : ""}${number(joint.residual)} N m`;
  const caption = make("figcaption", [make("span", joint.name), make("span", newest, { class: joint.above ? "wrong" : "number" })]);
  return make("figure", [caption, picture], { id: `residual-${joint.name}` });
}

// A value and its error on a scale from -1 to 1, clipped there.
function errorBar(value, error, description) {
  const place = (x) => 100 * Math.min(1, Math.max(-1, x));
  const parts = [draw("line", { class: "cad", x1: 0, x2: 0, y1: -8, y2: 8 })];
  if (Number.isFinite(value) && Number.isFinite(error)) {
    parts.push(draw("line", { class: "error", x1: place(value - error), x2: place(value + error), y1: 0, y2: 0 }));
    parts.push(draw("circle", { class: "dot", cx: place(value), cy: 0, r: 3.5 }));
  }
  const picture = draw("svg", { viewBox: "-104 -8 208 16", role: "img", "aria-label": description }, parts);
  return make("td", picture, { class: "bar" });
}

function robotPage() {
  const joints = state.legs.flatMap((leg) => leg.joints.map((joint) => ({ leg, joint })));
  const units = Object.fromEntries(state.legs.flatMap((leg) => leg.parameters.map((p) => [p.name.split(":")[0], p.unit])));
  const heading = ["joint", ...EFFECTS.map((effect) => `${effect}, ${units[effect] ?? ""}`), "residual, N m", "band"];
  table("joints", heading, joints.map(({ leg, joint }) => {
    const cells = EFFECTS.map((effect) => {
      const found = leg.parameters.find((p) => p.name === `${effect}:${joint.name}`);
      if (!found) return quiet("–");
      return found.status === "identified" ? make("td", found.text, { class: "number" }) : quiet(found.text);
    });
    const band = joint.band ? joint.band.map((x) => number(x, 2)).join("–") : "";
    const residual = make("td", number(joint.residual), { class: joint.above ? "number wrong" : "number" });
    return [joint.name, ...cells, residual, quiet(band)];
  }));
  at("residuals").replaceChildren(...joints.map(({ joint }) => residualPlot(joint)));
  // What is about to be pressed stays where it is.
  if (!at("ranking").matches(":hover, :focus-within")) ranking();
  at("events").replaceChildren(...state.events.map((event) => make("li", [make("time", clock(event.seconds)), event.text])));
}

// What is missing and the nearest candidates: a phone's screen. The rest gains nothing, or is the model's already, and is folded.
const NEAREST = 6;
function ranking() {
  const first = state.ranking.filter((r, n) => r.missing || (!r.active && n < NEAREST));
  const shown = everything ? state.ranking : first;
  at("all").hidden = first.length === state.ranking.length;
  at("all").textContent = everything ? "show fewer" : `show all ${state.ranking.length}`;
  at("all").setAttribute("aria-expanded", String(everything));
  table("ranking", ["", "effect", "gain, %", "", "value", ""], shown.map((r) => {
    const name = `${r.effect}:${r.joint}`;
    const verb = r.active ? "drop" : "add";
    const button = make("button", verb, { "aria-label": `${verb} ${name}` });
    button.addEventListener("click", () => ask(`${verb} ${r.at.join(" ")}`));
    const kind = r.active ? "has" : r.missing ? "MISSING" : "";
    return [make("td", kind, { class: r.missing ? "wrong" : "quiet" }), name, make("td", r.gain_text, { class: "number" }),
      errorBar(r.gain, r.gain_error, `gain of ${name}`), `${r.text} ${r.unit}`, make("td", button)];
  }));
}

function legPage() {
  const leg = state.legs.find((leg) => leg.leg === page);
  const rows = (leg?.parameters ?? []).map((p) => {
    const value = p.status === "identified" ? make("td", p.text, { class: "number" }) : quiet(p.text);
    const reach = 3 * p.prior_std;
    const description = `${p.name} against the CAD`;
    const bar = errorBar((p.value - p.prior) / reach, p.std / reach, description);
    return [p.name, p.unit, value, quiet(p.prior_text), bar, quiet(p.status)];
  });
  const heading = ["parameter", "unit", "estimate", "CAD", "", "known from"];
  table("parameters", heading, rows.length > 0 ? rows : [["no data of this leg yet"]]);
}

function link() {
  table("buses", ["leg", "samples/s", "windows", "solution", "lost"], state.buses.map((bus) => [
    bus.leg, number(bus.rate, 0), bus.windows, bus.placed ? bus.solution : make("td", "zero unknown", { class: "wrong" }), make("td", String(bus.lost), { class: bus.lost > 0 ? "number wrong" : "number" })]));
  const { messages, missed, bad, load } = state.link;
  const cost = load === null ? "" : ` · ${load.unit} a step: ${load.mean}, worst ${load.worst}, ${load.over_budget} over budget`;
  at("link").textContent = `${messages} messages, ${missed} missed, ${bad} bad${cost}`;
  const counts = state.counters?.legs ?? [];
  const names = Object.keys(counts[0] ?? {});
  table("counters", ["", ...LEGS], names.map((name) => [name.replaceAll("_", " "), ...counts.map((leg) => leg[name])]));
}

function show() {
  at("source").textContent = state.source;
  at("device").textContent = state.device ?? "waiting for the device";
  at("clock").textContent = clock(state.seconds);
  at("state").textContent = state.ended ? "ended" : state.paused ? "paused" : "";
  at("pause").textContent = state.paused ? "go on" : "pause";
  at("robot").hidden = page !== "robot";
  at("leg").hidden = page === "robot";
  page === "robot" ? robotPage() : legPage();
  link();
  document.documentElement.dataset.ready = "yes";
}

function turn(to) {
  page = to;
  for (const tab of document.querySelectorAll("[role=tab]")) {
    tab.setAttribute("aria-selected", String(tab.id === `tab-${to}`));
  }
  at("leg").setAttribute("aria-labelledby", `tab-${to}`);
  if (state) show();
}

for (const name of ["robot", ...LEGS]) at(`tab-${name}`).addEventListener("click", () => turn(name));
for (const name of ["pause", "save", "factors", "keep"]) at(name).addEventListener("click", () => ask(name));
// Once asks, twice does it.
at("reset").addEventListener("click", () => {
  const sure = at("reset").textContent !== "forget all data";
  at("reset").textContent = sure ? "forget all data" : "sure?";
  if (sure) ask("reset");
});
at("reset").addEventListener("blur", () => { at("reset").textContent = "forget all data"; });

at("all").addEventListener("click", () => {
  everything = !everything;
  ranking();
});

const stream = new EventSource("/events");
stream.onmessage = (event) => {
  state = JSON.parse(event.data);
  show();
};
stream.onerror = lost;
