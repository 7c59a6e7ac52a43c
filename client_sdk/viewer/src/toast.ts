import {h, setText} from './dom.js';

/** Time for which a message is shown. */
const shownMs = 8000;

/** A message over the scene, which disappears after a while. */
export class Toast {
  readonly element = h('div', {class: 'toast', role: 'status'});
  private untilMs = 0;

  constructor() {
    this.element.hidden = true;
  }

  show(text: string): void {
    this.untilMs = performance.now() + shownMs;
    setText(this.element, text);
  }

  /** `covered`: true if the message is already visible elsewhere. */
  update(covered: boolean): void {
    this.element.hidden = covered || performance.now() > this.untilMs;
  }
}
