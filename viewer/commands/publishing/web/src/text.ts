// Numbers as a person reads them.

import type { SceneData } from "./scene";

// "3.998 ± 0.006 m": as many digits as the uncertainty supports; metres in millimetres or centimetres where that reads better is
// left to the reader: one unit everywhere.
export function withUncertainty(value: number, uncertainty: number, unit: string): string {
  const digits = uncertainty > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(uncertainty)), 0), 6) - (firstDigit(uncertainty) > 2 ? 1 : 0) : 3;
  const shown = Math.max(digits, 0);
  return `${value.toFixed(shown)} ± ${ceiled(uncertainty, shown)} ${unit}`;
}

function firstDigit(value: number): number {
  return Math.floor(value / 10 ** Math.floor(Math.log10(value)));
}

// An uncertainty is never rounded to less than it is.
function ceiled(value: number, digits: number): string {
  const scale = 10 ** digits;
  return (Math.ceil(value * scale - 1e-9) / scale).toFixed(digits);
}

export function far(scene: SceneData, distance: number): string {
  return `${distance.toFixed(distance < 10 * scene.metre ? 1 : 0)} ${scene.unit}`;
}
