// Whether there is a server, in a word, and in a sentence where there is something to do about it.

import {h, setText} from './dom.js';
import type {Client} from './sdk.js';
import type {Shown} from './world_pane.js';

export class ConnectionStatus {
  private readonly word = h('span', {});
  private readonly rate = h('span', {class: 'rate'});
  readonly element = h('span', {class: 'status', role: 'status'}, this.word, this.rate);
  private readonly noticeText = h('p', {});
  readonly notice = h('div', {class: 'notice', role: 'alert'}, this.noticeText);

  constructor(
    private readonly client: Client, private readonly host: string, private readonly shown: readonly Shown[]) {
    this.notice.hidden = true;
  }

  show(): void {
    const {state} = this.client;
    const ready = state === 'ready';
    setText(this.word, ready ? 'Connected' : state === 'closed' ? 'Closed' : 'Connecting…');
    setText(this.rate, ready ? `, ${this.client.tickHz.toFixed(0)} Hz` : '');
    this.element.classList.toggle('ready', ready);
    const text = this.toDo();
    this.notice.hidden = text === '';
    setText(this.noticeText, text);
  }

  private toDo(): string {
    const {state, lastError} = this.client;
    if (state === 'waiting' || (state === 'connecting' && lastError !== '')) {
      return `No server answers at ${this.host}: start one with ./deploy/demo.sh, and this page connects ` +
        'by itself.';
    }
    if (state === 'closed') return `The server let this page go (${lastError}): reload the page to try again.`;
    const refused = state === 'ready' && this.shown.find(({world}) => world.state === 'refused');
    return refused ? `World ${refused.world.name} cannot be joined here: choose another above.` : '';
  }
}
