// Helpers that create elements. They use no inline styles or scripts, so that the page can have a
// strict content security policy.

type Child = Node | string | null;

/** Creates an HTML element. Omits attributes that are false and children that are null. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Readonly<Record<string, string | number | boolean>> = {},
  ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === false) continue;
    element.setAttribute(name, value === true ? '' : String(value));
  }
  for (const child of children) if (child !== null) element.append(child);
  return element;
}

/** Creates an SVG element. */
export function svg(
  tag: string, attributes: Readonly<Record<string, string | number>> = {},
  ...children: Child[]): SVGElement {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  for (const child of children) if (child !== null) element.append(child);
  return element;
}

/** Paths of 24 x 24 pixel icons, drawn with strokes. */
const icons: Readonly<Record<string, string>> = {
  pause: 'M8 5v14M16 5v14',
  play: 'M7 4.5v15l12-7.5z',
  frame: 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5',
  follow: 'M12 3v4M12 17v4M3 12h4M17 12h4M12 8a4 4 0 1 0 0 8a4 4 0 0 0 0-8',
  commands: 'M5 21c-1-3 1-4 1-7s-1-4 1-6s4 0 3 4s-1 6-2 9z' +
    'M15 15c-1-3 0-4-1-7s2-5 4-3s1 4 1 6s1 3 0 5z',
  inspect: 'M12 4a2.2 2.2 0 1 0 .01 0M12 9v6M12 10l-5 3M12 10l5 3M12 15l-4 6M12 15l4 6',
  plots: 'M3 20h18M4 15l4-5l4 3l5-8l3 4',
  view: 'M2 12c3-5 6-7 10-7s7 2 10 7c-3 5-6 7-10 7s-7-2-10-7zM12 9a3 3 0 1 0 .01 0',
  moon: 'M20 14A8.5 8.5 0 1 1 10 4a7 7 0 0 0 10 10z',
  sun: 'M12 8a4 4 0 1 0 .01 0M12 2v3M12 19v3M2 12h3M19 12h3M5 5l2 2M17 17l2 2M19 5l-2 2M7 17l-2 2',
  help: 'M9 9a3 3 0 1 1 4.5 2.6c-1 .6-1.5 1.2-1.5 2.4M12 18v.01',
  close: 'M6 6l12 12M18 6L6 18',
  randomWalk: 'M4 19c6 0 2-7 8-7s2-7 8-7M16 3l4 2l-2 4',
};

export function icon(name: string): SVGElement {
  return svg('svg', {viewBox: '0 0 24 24', class: 'icon', 'aria-hidden': 'true'},
    svg('path', {d: icons[name] ?? ''}));
}

/** Creates a button. `key` is shown as its keyboard shortcut; `text: false` shows the icon only. */
export function button(
  label: string, options: {icon?: string; key?: string; class?: string; text?: boolean},
  onClick: (event: MouseEvent) => void): HTMLButtonElement {
  const title = options.key ? `${label} (${options.key})` : label;
  const element = h('button',
    {type: 'button', title, 'aria-label': label, class: options.class ?? ''});
  if (options.icon) element.append(icon(options.icon));
  if (options.text !== false) element.append(h('span', {}, label));
  if (options.key) element.setAttribute('aria-keyshortcuts', options.key);
  element.addEventListener('click', onClick);
  return element;
}

/** Marks a toggle button as pressed or not. */
export function setPressed(element: HTMLElement, pressed: boolean): void {
  element.setAttribute('aria-pressed', String(pressed));
}

/** A labelled slider that shows its value. */
export class Slider {
  readonly element: HTMLElement;
  readonly input: HTMLInputElement;
  private readonly output: HTMLOutputElement;

  constructor(
    id: string, label: string, min: number, max: number, step: number, value: number,
    private readonly format: (value: number) => string, onInput?: (value: number) => void) {
    this.input = h('input', {type: 'range', id, min, max, step, value});
    this.output = h('output', {for: id});
    this.element =
      h('div', {class: 'slider'}, h('label', {for: id}, label), this.input, this.output);
    this.input.addEventListener('input', () => {
      this.show();
      onInput?.(this.value);
    });
    this.show();
  }

  get value(): number {
    return Number(this.input.value);
  }
  set value(value: number) {
    this.input.value = String(value);
    this.show();
  }
  private show(): void {
    this.output.textContent = this.format(this.value);
    this.input.setAttribute('aria-valuetext', this.format(this.value));
  }
}

/** Sets an element's text, unless it is unchanged, which avoids layout work. */
export function setText(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** Formats an angle in whole degrees. */
export function degrees(rad: number): string {
  return `${(rad * 180 / Math.PI).toFixed(0)}°`;
}

/** Formats a point on the ground, for example "x 0.35 m, z 1.20 m". */
export function pointText(atM: readonly [number, number, number]): string {
  return `x ${atM[0].toFixed(2)} m, z ${atM[2].toFixed(2)} m`;
}
