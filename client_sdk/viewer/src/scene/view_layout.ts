import type {PageRect} from './camera.js';

/**
 * Divides the page among views: side by side, or above each other if the area that panels leave
 * free (`free`, in CSS pixels) is taller than wide. Each view gets an equal part of this area.
 * Viewports also extend beneath the panels, so that together they cover the page.
 */
export function layOutViews(
  views: readonly {freeArea: PageRect; viewport: PageRect}[],
  free: {readonly x0: number; readonly x1: number; readonly y0: number; readonly y1: number},
  width: number, height: number): void {
  const {x0, x1, y0, y1} = free;
  const n = views.length;
  const across = x1 - x0 >= y1 - y0;
  views.forEach((view, i) => {
    const from = i / n;
    const to = (i + 1) / n;
    if (across) {
      Object.assign(view.freeArea, {
        x: x0 + (x1 - x0) * from, y: y0, width: (x1 - x0) / n, height: y1 - y0});
      const left = i === 0 ? 0 : view.freeArea.x;
      const end = i === n - 1 ? width : x0 + (x1 - x0) * to;
      Object.assign(view.viewport, {x: left, y: 0, width: end - left, height});
    } else {
      Object.assign(view.freeArea, {
        x: x0, y: y0 + (y1 - y0) * from, width: x1 - x0, height: (y1 - y0) / n});
      const start = i === 0 ? 0 : view.freeArea.y;
      const end = i === n - 1 ? height : y0 + (y1 - y0) * to;
      Object.assign(view.viewport, {x: 0, y: start, width, height: end - start});
    }
  });
}
