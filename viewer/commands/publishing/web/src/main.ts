// Starts the page: loads the scene, goes to the first place, and joins view, tools and lists.

import { followPhone, listen } from "./controls";
import { closeNote, listenToNote, lookAt, openNote, showNote } from "./finding";
import { keepAddress, parse, type Target, text as addressOf } from "./link";
import { loadScene } from "./loader";
import { Measuring } from "./measure";
import { Overlay } from "./overlay";
import { Panel } from "./panel";
import { Panorama } from "./panorama";
import { Plan } from "./plan";
import { direction, dot, length, minus, plus, type SceneData, times, type Vector } from "./scene";
import { View } from "./view";
import { Visits } from "./visit";

const RADIANS = Math.PI / 180;
const PRELOADED = 6; // places whose first pictures are loaded ahead
const AHEAD = 150; // milliseconds that the first pictures' data get before WebGL is begun, at most
const WAITED = 3000; // milliseconds that what is loaded ahead waits for the view to rest, at most
const SAID = 6000; // milliseconds that a message stays

const by = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

let timer = 0;
function say(text: string): void {
  const box = by("message");
  box.textContent = text;
  box.classList.add("shown");
  window.clearTimeout(timer);
  timer = window.setTimeout(() => box.classList.remove("shown"), SAID);
}

function fail(text: string): void {
  by("start").classList.add("failed");
  by("start-text").textContent = text;
}

// A button that is on or off.
function toggle(id: string, on: boolean): void {
  by(id).setAttribute("aria-pressed", String(on));
}

async function start(): Promise<void> {
  const scene = await loadScene();
  document.title = scene.title;
  by("title").textContent = scene.title;
  const visits = new Visits(scene);
  const named = parse(location.hash, scene.places.length, { place: 0, yaw: NaN, pitch: NaN, fov: 75 });
  // The first pictures are read and decoded while the browser makes the WebGL context: the two take longest.
  visits.get(named.place).catch(() => undefined); // told below
  await Promise.race([visits.decoding, new Promise((done) => window.setTimeout(done, AHEAD))]);
  let panorama: Panorama;
  try {
    panorama = new Panorama(by<HTMLCanvasElement>("picture"), scene.metre);
  } catch {
    fail("This browser has no WebGL 2, which draws the panoramas. A current version of Firefox, Chrome, Edge or Safari has it.");
    return;
  }
  const view = new View(scene, panorama, visits);
  view.failed = ({ message }) => say(`${message}. Is the folder complete, and the network there?`);
  const panel: { current?: Panel } = {};
  const measuring = new Measuring(view, say, () => {
    toggle("measure", measuring.on);
    document.body.classList.toggle("measuring", measuring.on);
    panel.current?.measured();
    view.redraw();
  });
  const overlay = new Overlay(view, by("overlay"), () => measuring.made, (index) => showNote(scene.notes, index));
  panel.current = new Panel(view, measuring, by("lists"));
  panel.current.openNote = (index) => (uncover(), void openNote(view, index));
  panel.current.openMeasurement = (index) => (uncover(), void lookAt(view, scene.measurements[index].label));
  panel.current.showMeasurements = (on) => {
    overlay.shown = on;
    view.redraw();
  };
  new Plan(view, by("plan"));
  tools(view, measuring);
  listen(view, by("picture"), {
    click: (x, y) => (measuring.on ? void measuring.click(x, y) : walk(view, x, y)),
    hover: (x, y) => hover(view, measuring, x, y),
    ahead: (sign) => ahead(view, sign),
    key: (key) => pressed(view, measuring, key),
  });
  view.arrived.push(() => {
    by("place").textContent = scene.places[view.index].name;
    by("picture").setAttribute("aria-label", `Panorama: ${scene.places[view.index].name}`);
    later(view, measuring);
  });
  const turn = (target: Target) =>
    view.go(target.place, { yaw: target.yaw * RADIANS, pitch: target.pitch * RADIANS, fov: target.fov });
  const own = scene.places[named.place];
  await turn({ ...named, yaw: Number.isNaN(named.yaw) ? own.yaw : named.yaw, pitch: Number.isNaN(named.pitch) ? own.pitch : named.pitch });
  by("start").remove();
  document.body.classList.add("ready");
  performance.mark("first picture");
  const tell = ({ unknown }: Target) => {
    if (unknown !== null) say(`There is no place ${unknown} here: the places are 1 to ${scene.places.length}.`);
  };
  tell(named);
  keepAddress(view, (target) => void turn(target).then(() => tell(target)));
  Object.assign(window, { pointglass: { view, measuring, panorama } }); // for tests, and the curious
}

// What is loaded once a place is seen: its whole pictures, the depth to measure on, the places around.
function later(view: View, measuring: Measuring): void {
  const place = view.place;
  const nearest = view.scene.places
    .map(({ position }, index) => ({ index, away: length(minus(position, view.eye)) * (view.sees(position) ? 1 : 3) }))
    .filter(({ index }) => index !== place.index)
    .sort((a, b) => a.away - b.away); // to one that is not in sight few go next
  const load = async () => {
    if (view.place !== place) return;
    if (measuring.on) await view.visits.finest(place);
    if (view.tint) await view.visits.masks(place);
    if (view.second >= 0) await view.visits.other(place);
    await view.visits.prepare(place.index);
    await view.stillness(WAITED);
    view.warm();
    if (view.place === place) await view.visits.full(place);
    for (const { index } of nearest.slice(0, PRELOADED)) {
      await view.stillness(WAITED);
      if (view.place === place && !view.going) await view.visits.prepare(index);
    }
  };
  window.setTimeout(() => void load().catch(() => undefined), 60); // what is missing is told when it is asked for
}

// On a phone the list covers what is gone to.
function uncover(): void {
  if (!window.matchMedia("(max-width: 759px)").matches) return;
  document.body.classList.remove("listed");
  toggle("list", false);
}

function tools(view: View, measuring: Measuring): void {
  const press = (id: string, act: () => void) => by(id).addEventListener("click", act);
  const panelIsOpen = () => document.body.classList.contains("listed");
  press("measure", () => void measuring.turn(!measuring.on));
  press("list", () => {
    document.body.classList.toggle("listed");
    toggle("list", panelIsOpen());
  });
  press("map", () => {
    const on = document.body.classList.toggle("planned");
    toggle("map", on);
  });
  press("tint", async () => {
    const on = !view.tint;
    toggle("tint", on);
    if (on) say("Pink: filled in, nothing was measured there.");
    if (on && !(await view.loaded(view.visits.masks(view.place)))) return toggle("tint", false);
    view.tint = on ? 1 : 0;
    view.redraw();
  });
  press("share", async () => {
    const address = location.href.replace(/#.*$/, "") + addressOf(view);
    try {
      await navigator.clipboard.writeText(address);
      say("The link to this view is copied.");
    } catch {
      say(address);
    }
  });
  press("full", () => void (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()));
  by("full").hidden = !document.fullscreenEnabled;
  press("help", () => by<HTMLDialogElement>("keys").showModal());
  handle(view);
  let stop: (() => void) | null = null;
  by("phone").hidden = !("DeviceOrientationEvent" in window && navigator.maxTouchPoints > 0);
  press("phone", async () => {
    if (stop) stop(), (stop = null);
    else if (!(stop = await followPhone(view))) say("This device has no sensor for its position, or it may not be used.");
    toggle("phone", stop !== null);
  });
  if (window.matchMedia("(min-width: 760px)").matches) document.body.classList.add("planned");
  toggle("map", document.body.classList.contains("planned"));
}

// The handle between the second view and the first.
function handle(view: View): void {
  const bar = by("handle"), { second } = view.scene;
  const { change } = view.scene, legend = by("change");
  by("compare").hidden = second === null;
  by("compare").title = `Compare with the ${second === "raw" ? "points" : `${second} view`} (V)`;
  if (change) {
    const [what, ...lines] = change.text.split("\n");
    by("change-what").textContent = what;
    by("change-text").textContent = lines.join("\n");
    by<HTMLImageElement>("change-picture").src = `data:image/png;base64,${change.picture}`;
    by("compare").title = `Compare with the distances: ${what} (V)`;
  }
  const set = (share: number) => {
    view.second = Math.min(Math.max(share, 0), 1);
    bar.style.left = `${100 * view.second}%`;
    const percent = Math.round(100 * view.second);
    bar.setAttribute("aria-valuenow", String(percent));
    bar.setAttribute("aria-valuetext", `${percent} % ${second}, the rest ${view.scene.view}`);
    view.redraw();
  };
  by("compare").addEventListener("click", async () => {
    const on = view.second < 0;
    toggle("compare", on);
    bar.hidden = !on;
    legend.hidden = !(on && change);
    if (!on) {
      view.second = -1;
      view.redraw();
      return;
    }
    by("left").textContent = second!;
    by("right").textContent = view.scene.view;
    if (await view.loaded(view.visits.other(view.place))) return set(0.5);
    toggle("compare", false);
    bar.hidden = legend.hidden = true;
  });
  bar.addEventListener("pointerdown", (event) => bar.setPointerCapture(event.pointerId));
  bar.addEventListener("pointermove", (event) => {
    if (bar.hasPointerCapture(event.pointerId)) set(event.clientX / view.size[0]);
  });
  bar.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
    if (by === undefined) return;
    set(view.second + by);
    event.preventDefault();
  });
}

// To the place nearest to what was clicked.
function walk(view: View, x: number, y: number): void {
  const index = nearestTo(view, x, y);
  if (index >= 0) void view.go(index);
}

function nearestTo(view: View, x: number, y: number): number {
  const ray = view.ray(x, y), reach = view.place.depth.distance(ray);
  if (!Number.isFinite(reach)) return -1;
  const target = plus(view.eye, times(ray, reach));
  const gap = (p: Vector, floor: number) => Math.hypot(p[0] - target[0], p[1] - target[1], 2 * (floor - Math.min(target[2], p[2])));
  let best = -1, least = 0.85 * gap(view.eye, view.scene.places[view.index].floor);
  view.scene.places.forEach(({ position, floor }, index) => {
    if (index !== view.index && gap(position, floor) < least) (best = index), (least = gap(position, floor));
  });
  return best;
}

// To the next place in the direction one looks (or behind).
function ahead(view: View, sign: 1 | -1): void {
  const forward = times(direction(view.yaw, 0), sign);
  let best = -1, least = Infinity;
  view.scene.places.forEach(({ position }, index) => {
    const away = minus(position, view.eye), far = length(away);
    if (index === view.index || dot(away, forward) < 0.6 * far) return;
    const cost = far * (2 - dot(away, forward) / far) * (view.sees(position) ? 1 : 3);
    if (cost < least) (best = index), (least = cost);
  });
  if (best >= 0) void view.go(best);
  else say("There is no place in this direction.");
}

function hover(view: View, measuring: Measuring, x: number, y: number): void {
  const canvas = view.panorama.canvas;
  if (!view.place || view.going) return;
  if (measuring.on) canvas.style.cursor = measuring.at(x, y) ? "crosshair" : "not-allowed";
  else canvas.style.cursor = nearestTo(view, x, y) >= 0 ? "pointer" : "grab";
}

function pressed(view: View, measuring: Measuring, key: string): boolean {
  const clicks: Record<string, string> = { m: "measure", p: "map", l: "list", v: "compare", f: "full", t: "tint", "?": "help" };
  const [width, height] = view.size;
  if (key === "Enter" && measuring.on) void measuring.click(width / 2, height / 2);
  else if (key === "Escape" && document.body.classList.contains("noted")) closeNote();
  else if (key === "Escape" && measuring.on) void measuring.turn(false);
  else if (clicks[key] && !by(clicks[key]).hidden) by(clicks[key]).click();
  else return false;
  return true;
}

listenToNote();
start().catch((error: Error) => fail(`The data of this page cannot be read: ${error.message}. The folder must be complete.`));
export type { SceneData };
