// Deep links: #place=3&yaw=90&pitch=-5&fov=75, places counted from 1, angles in degrees.

import type { View } from "./view";

const SHOWN = 20; // characters of a place that is not there
const WAIT = 300; // milliseconds without a change before the address is written: browsers limit how often

export interface Target {
  place: number;
  yaw: number;
  pitch: number;
  fov: number;
  unknown: string | null; // what the link names, where there is no such place
}

export function parse(hash: string, places: number, before: Omit<Target, "unknown">): Target {
  const found = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (key: string, otherwise: number) => {
    const text = found.get(key);
    const value = text === null || text.trim() === "" ? NaN : Number(text);
    return Number.isFinite(value) ? value : otherwise;
  };
  const asked = found.get("place"), place = Number(asked || before.place + 1) - 1;
  const known = Number.isInteger(place) && place >= 0 && place < places;
  return {
    place: known ? place : before.place,
    yaw: number("yaw", before.yaw),
    pitch: number("pitch", before.pitch),
    fov: number("fov", before.fov),
    unknown: known ? null : asked!.slice(0, SHOWN),
  };
}

export function text(view: View): string {
  const degrees = (value: number) => ((value * 180) / Math.PI).toFixed(1);
  const yaw = Math.atan2(Math.sin(view.yaw), Math.cos(view.yaw));
  return `#place=${view.index + 1}&yaw=${degrees(yaw)}&pitch=${degrees(view.pitch)}&fov=${view.fov.toFixed(0)}`;
}

export function keepAddress(view: View, changed: (target: Target) => void): void {
  let timer = 0, written = "";
  view.drawn.push(() => {
    window.clearTimeout(timer);
    timer = window.setTimeout(() => {
      if (!view.ready || view.going) return;
      const now = text(view);
      if (now === written) return;
      written = now;
      try {
        history.replaceState(null, "", now);
      } catch {
        // some browsers refuse this by file address; the link is then only made when it is asked for
      }
    }, WAIT);
  });
  window.addEventListener("hashchange", () => {
    if (location.hash === written) return;
    const degrees = 180 / Math.PI;
    changed(parse(location.hash, view.scene.places.length, { place: view.index, yaw: view.yaw * degrees, pitch: view.pitch * degrees, fov: view.fov }));
  });
}
