// The list beside the picture: places, viewpoints, notes, measurements.

import type { Measuring } from "./measure";
import type { ViewpointData } from "./scene";
import type { View } from "./view";

const AT_PLACE = 0.001; // metres from a place within which a viewpoint of the same name is that place
const HERE = "Measured here";

export class Panel {
  private readonly sections = new Map<string, HTMLElement>();

  constructor(private readonly view: View, private readonly measuring: Measuring, private readonly root: HTMLElement) {
    const { scene } = view;
    const look = ({ place, yaw, pitch, fov }: ViewpointData) => () => {
      const radians = Math.PI / 180;
      void view.go(place, { yaw: yaw * radians, pitch: pitch * radians, fov });
    };
    // A place that was made from a viewpoint is listed once: its entry also turns as the viewpoint looks.
    const own = scene.places.map(({ name }, index) =>
      scene.viewpoints.find((point) => point.place === index && point.name === name && point.away < AT_PLACE * scene.metre));
    this.list("Places", scene.places.map(({ name }, index) => {
      const viewpoint = own[index];
      return { text: name, act: viewpoint ? look(viewpoint) : () => void view.go(index), place: index };
    }));
    this.list("Viewpoints", scene.viewpoints.filter((point) => !own.includes(point)).map((point) => ({ text: point.name, act: look(point) })));
    this.list("Notes", scene.notes.map((note, index) => ({ text: note.title, act: () => this.openNote(index), colour: note.colour })));
    this.given();
    view.arrived.push(() => this.mark());
  }

  openNote: (index: number) => void = () => undefined;
  openMeasurement: (index: number) => void = () => undefined;
  showMeasurements: (on: boolean) => void = () => undefined;

  // The project's measurements, with a switch for their lines in the picture.
  private given(): void {
    const { measurements } = this.view.scene;
    if (measurements.length === 0) return;
    const list = this.section("Measurements");
    const eye = document.createElement("button");
    eye.type = "button";
    eye.className = "eye";
    const set = (on: boolean) => {
      eye.setAttribute("aria-pressed", String(on));
      eye.textContent = on ? "in the picture" : "not in the picture";
    };
    eye.setAttribute("aria-label", "Draw the measurements in the picture");
    eye.addEventListener("click", () => {
      const on = eye.getAttribute("aria-pressed") !== "true";
      set(on);
      this.showMeasurements(on);
    });
    set(true);
    list.previousElementSibling!.append(eye);
    measurements.forEach((made, index) => {
      const item = document.createElement("li"), button = document.createElement("button");
      button.type = "button";
      button.className = "given";
      const name = document.createElement("span"), value = document.createElement("b"), more = document.createElement("small");
      name.textContent = made.name;
      value.textContent = made.text;
      more.textContent = made.more;
      button.append(name, value);
      if (made.more) button.append(more);
      button.title = made.kind;
      button.addEventListener("click", () => this.openMeasurement(index));
      item.append(button);
      list.append(item);
    });
  }

  private list(title: string, rows: { text: string; act: () => void; place?: number; colour?: string }[]): void {
    if (rows.length === 0) return;
    const list = this.section(title);
    for (const row of rows) {
      const item = document.createElement("li");
      const button = document.createElement("button");
      button.type = "button";
      if (row.colour) {
        const dot = document.createElement("i");
        dot.style.background = row.colour;
        button.append(dot);
      }
      button.append(row.text);
      if (row.place !== undefined) button.dataset.place = String(row.place);
      button.addEventListener("click", row.act);
      item.append(button);
      list.append(item);
    }
  }

  private section(title: string): HTMLElement {
    const known = this.sections.get(title);
    if (known) return known;
    const section = document.createElement("section");
    const heading = document.createElement("h2");
    heading.textContent = title;
    const list = document.createElement("ul");
    section.append(heading, list);
    this.root.append(section);
    this.sections.set(title, list);
    return list;
  }

  private mark(): void {
    for (const button of this.root.querySelectorAll<HTMLElement>("[data-place]")) {
      if (Number(button.dataset.place) === this.view.index) button.setAttribute("aria-current", "location");
      else button.removeAttribute("aria-current");
    }
  }

  // Writes the measurements again.
  measured(): void {
    const done = this.measuring.made.filter(({ points }) => points.length === 2);
    if (done.length === 0 && !this.sections.has(HERE)) return;
    const list = this.section(HERE);
    list.parentElement!.hidden = done.length === 0;
    list.replaceChildren();
    for (const made of done) {
      const item = document.createElement("li");
      item.className = "measured";
      const words = document.createElement("span");
      const value = document.createElement("b"), parts = document.createElement("small");
      value.textContent = made.text;
      parts.textContent = made.parts;
      words.append(value, parts);
      const remove = document.createElement("button");
      remove.type = "button";
      remove.className = "remove";
      remove.textContent = "×";
      remove.setAttribute("aria-label", `Remove the measurement ${made.text}`);
      remove.addEventListener("click", () => this.measuring.remove(this.measuring.made.indexOf(made)));
      item.append(words, remove);
      list.append(item);
    }
  }
}
