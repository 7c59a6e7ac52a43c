// Panels to the left and right of the scene. On narrow pages, only one is open at a time.

import {button, h} from '../dom.js';

export type PanelName = 'commands' | 'view' | 'inspect' | 'statistics';

const narrowPx = 900;

/** Returns whether the page is so narrow that panels cover the lower part of the scene. */
export function isNarrowPage(): boolean {
  return innerWidth < narrowPx;
}

export class SidePanels {
  readonly left = h('div', {class: 'column left'});
  readonly right = h('div', {class: 'column right'});
  /** Buttons that open and close the panels. */
  readonly toggles = h('nav', {class: 'tools', 'aria-label': 'Panels'});
  private readonly panels = new Map<PanelName, {element: HTMLElement; toggle: HTMLButtonElement}>();

  /** `onChange` is called before a panel opens or closes. */
  constructor(private readonly onChange: () => void) {}

  add(
    name: PanelName, title: string, iconName: string, column: 'left' | 'right',
    body: HTMLElement): void {
    const id = `panel-${name}`;
    const toggle = button(title, {icon: iconName, class: 'tool'}, () => {
      this.setOpen(name, this.panels.get(name)!.element.hidden);
    });
    toggle.setAttribute('aria-controls', id);
    const close = button(
      `Close ${title}`, {icon: 'close', text: false, class: 'round small'}, () => {
        this.setOpen(name, false);
        toggle.focus();
      });
    const element = h('section', {id, class: `panel ${name}`, 'aria-label': title},
      h('div', {class: 'panel-head'}, h('h2', {}, title), close), body);
    this.panels.set(name, {element, toggle});
    this.toggles.append(toggle);
    this[column].append(element);
  }

  setOpen(name: PanelName, open: boolean): void {
    this.onChange();
    for (const [other, {element, toggle}] of this.panels) {
      if (other === name) element.hidden = !open;
      else if (open && isNarrowPage()) element.hidden = true;
      toggle.setAttribute('aria-expanded', String(!element.hidden));
    }
  }

  isOpen(name: PanelName): boolean {
    return !this.panels.get(name)!.element.hidden;
  }

  /** Top edge of the highest open panel in CSS pixels; Infinity if none is open. */
  highestTop(): number {
    let top = Infinity;
    for (const {element} of this.panels.values()) {
      if (!element.hidden) top = Math.min(top, element.getBoundingClientRect().top);
    }
    return top;
  }
}
