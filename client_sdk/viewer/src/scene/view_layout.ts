import type {Box} from './camera.js';

/**
 * Divides the scene among views, side by side or, where it is higher than wide, one above the other: each
 * gets an equal part of what panels leave `free`, and draws in a `box` that goes on beneath them to the edges.
 */
export function shareOut(
  views: readonly {free: Box; box: Box}[],
  free: {readonly x0: number; readonly x1: number; readonly y0: number; readonly y1: number},
  width: number, height: number): void {
  const {x0, x1, y0, y1} = free;
  const n = views.length;
  const across = x1 - x0 >= y1 - y0;
  views.forEach((view, i) => {
    const from = i / n;
    const to = (i + 1) / n;
    if (across) {
      Object.assign(view.free, {
        x: x0 + (x1 - x0) * from, y: y0, width: (x1 - x0) / n, height: y1 - y0});
      const left = i === 0 ? 0 : view.free.x;
      const end = i === n - 1 ? width : x0 + (x1 - x0) * to;
      Object.assign(view.box, {x: left, y: 0, width: end - left, height});
    } else {
      Object.assign(view.free, {
        x: x0, y: y0 + (y1 - y0) * from, width: x1 - x0, height: (y1 - y0) / n});
      const start = i === 0 ? 0 : view.free.y;
      const end = i === n - 1 ? height : y0 + (y1 - y0) * to;
      Object.assign(view.box, {x: 0, y: start, width, height: end - start});
    }
  });
}
