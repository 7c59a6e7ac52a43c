// Panels to the left and right of the scene; where the page is narrow one of them at a time.

import {button, h} from '../dom.js';

export type PanelName = 'drive' | 'view' | 'inspect' | 'figures';

const narrowPx = 900;

/** Too narrow for panels beside the scene: they lie over its lower part. */
export function narrow(): boolean {
  return innerWidth < narrowPx;
}

export class SidePanels {
  readonly left = h('div', {class: 'column left'});
  readonly right = h('div', {class: 'column right'});
  /** Buttons that open and close them. */
  readonly tools = h('nav', {class: 'tools', 'aria-label': 'Panels'});
  private readonly panels = new Map<PanelName, {element: HTMLElement; toggle: HTMLButtonElement}>();

  /** `onChange`: what they leave free is about to change. */
  constructor(private readonly onChange: () => void) {}

  add(name: PanelName, title: string, iconName: string, column: 'left' | 'right', body: HTMLElement): void {
    const id = `panel-${name}`;
    const toggle = button(title, {icon: iconName, class: 'tool'}, () => {
      this.set(name, this.panels.get(name)!.element.hidden);
    });
    toggle.setAttribute('aria-controls', id);
    const close = button(`Close ${title}`, {icon: 'close', text: false, class: 'round small'}, () => {
      this.set(name, false);
      toggle.focus();
    });
    const element = h('section', {id, class: `panel ${name}`, 'aria-label': title},
      h('div', {class: 'panel-head'}, h('h2', {}, title), close), body);
    this.panels.set(name, {element, toggle});
    this.tools.append(toggle);
    this[column].append(element);
  }

  set(name: PanelName, open: boolean): void {
    this.onChange();
    for (const [other, {element, toggle}] of this.panels) {
      if (other === name) element.hidden = !open;
      else if (open && narrow()) element.hidden = true;
      toggle.setAttribute('aria-expanded', String(!element.hidden));
    }
  }

  open(name: PanelName): boolean {
    return !this.panels.get(name)!.element.hidden;
  }

  /** The highest of those that are open, where it begins on the page. */
  highestTop(): number {
    let top = Infinity;
    for (const {element} of this.panels.values()) {
      if (!element.hidden) top = Math.min(top, element.getBoundingClientRect().top);
    }
    return top;
  }
}
