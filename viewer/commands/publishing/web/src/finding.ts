// Goes to where something can be seen, turns to it, and shows notes.

import { loadNotePicture, picture as decoded } from "./loader";
import { length, minus, type NoteData, times, type Vector } from "./scene";
import { far } from "./text";
import type { View } from "./view";

const ASKED = 4; // places whose depth is asked, the nearest first
const SEEN = 0.93; // share of the distance from which on what is shown there is the thing itself

const by = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

// The place from where a point is seen: the present one, else the nearest one that sees it, else the nearest.
async function placeFor(view: View, point: Vector): Promise<number> {
  if (view.sees(point)) return view.index;
  const nearest = view.scene.places
    .map(({ position }, index) => ({ index, way: minus(point, position) }))
    .sort((a, b) => length(a.way) - length(b.way));
  for (const { index, way } of nearest.slice(0, ASKED)) {
    const distance = length(way), place = await view.visits.get(index).catch(() => null); // one that cannot be loaded sees nothing
    if (place && (distance < 1e-6 || place.depth.distance(times(way, 1 / distance)) >= SEEN * distance)) return index;
  }
  return nearest[0].index;
}

// Returns how far it is from there.
export async function lookAt(view: View, point: Vector): Promise<number> {
  const index = await placeFor(view, point);
  if (index !== view.index) await view.go(index);
  const [x, y, z] = minus(point, view.eye);
  view.turn(Math.atan2(y, x), Math.atan2(z, Math.hypot(x, y)));
  return Math.hypot(x, y, z);
}

// Goes to a place that sees a note, looks at it and shows its text.
export async function openNote(view: View, index: number): Promise<void> {
  const away = await lookAt(view, view.scene.notes[index].position);
  showNote(view.scene.notes, index, ` · ${far(view.scene, away)} away`);
}

let shown = -1;

export function showNote(notes: NoteData[], index: number, more = ""): void {
  const note = notes[index];
  shown = index;
  by("note-title").textContent = note.title;
  by("note-status").textContent = note.status + more;
  by("note-dot").style.background = note.colour;
  const [first, ...rest] = note.text.trim().split("\n");
  by("note-text").textContent = first.trim() === note.title ? rest.join("\n") : note.text; // the title is its first line
  const link = by<HTMLAnchorElement>("note-link");
  link.hidden = !/^https?:\/\//i.test(note.link);
  link.textContent = note.link;
  if (link.hidden) link.removeAttribute("href");
  else link.href = note.link;
  by("note-picture").hidden = true;
  if (note.picture) void attach(note, index);
  if (!document.body.classList.contains("noted")) opener = document.activeElement;
  document.body.classList.add("noted");
  by("note-title").focus({ preventScroll: true }); // a screen reader reads on from there
}

let opener: Element | null = null;

// Back to where one was.
export function closeNote(): void {
  document.body.classList.remove("noted");
  const back = opener instanceof HTMLElement && opener.isConnected && !opener.hidden ? opener : by("picture");
  back.focus({ preventScroll: true });
}

const pictures = new Map<number, Promise<ImageBitmap | HTMLImageElement>>();

// Loads the picture of a note when it is first shown.
async function attach(note: NoteData, index: number): Promise<void> {
  if (!pictures.has(index)) pictures.set(index, loadNotePicture(index).then((data) => decoded(data.pictures![0])));
  const image = await pictures.get(index)!.catch(() => null);
  if (!image || shown !== index) return;
  for (const canvas of [by<HTMLCanvasElement>("note-small"), by<HTMLCanvasElement>("photo-large")]) {
    [canvas.width, canvas.height] = note.picture!;
    canvas.getContext("2d")!.drawImage(image, 0, 0);
  }
  by("photo-large").setAttribute("aria-label", `Picture attached to ${note.title}`);
  by("note-picture").hidden = false;
}

export function listenToNote(): void {
  by("note-close").addEventListener("click", closeNote);
  by("note-picture").addEventListener("click", () => by<HTMLDialogElement>("photo").showModal());
  by("photo").addEventListener("click", () => by<HTMLDialogElement>("photo").close());
}
