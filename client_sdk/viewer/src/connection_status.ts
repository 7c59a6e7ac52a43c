// Shows the state of the connection in one word, and explains problems and what to do about them.

import {h, setText} from './dom.js';
import type {Client} from './sdk.js';
import type {WorldPane} from './world_pane.js';

export class ConnectionStatus {
  private readonly stateText = h('span', {});
  private readonly rateText = h('span', {class: 'rate'});
  readonly element = h('span', {class: 'status', role: 'status'}, this.stateText, this.rateText);
  private streamMode = '';
  private readonly noticeText = h('p', {});
  readonly notice = h('div', {class: 'notice', role: 'alert'}, this.noticeText);

  constructor(
    private readonly client: Client, private readonly host: string,
    private readonly panes: readonly WorldPane[]) {
    this.notice.hidden = true;
  }

  /** Sets the label of the stream mode, for example `Movement`. */
  setStreamMode(label: string): void {
    if (this.streamMode === label) return;
    this.streamMode = label;
    this.update();
  }

  update(): void {
    const {state} = this.client;
    const ready = state === 'ready';
    setText(this.stateText,
      ready ? 'Connected' : state === 'closed' ? 'Disconnected' : 'Connecting…');
    setText(this.rateText, ready ?
      `, ${this.client.tickHz.toFixed(0)} Hz` +
        (this.streamMode && `, ${this.streamMode.toLowerCase()} mode`) : '');
    this.element.classList.toggle('ready', ready);
    const text = this.problemText();
    this.notice.hidden = text === '';
    setText(this.noticeText, text);
  }

  /** Returns the text that describes the problem; empty if there is none. */
  private problemText(): string {
    const {state, lastError} = this.client;
    if (state === 'waiting' || (state === 'connecting' && lastError !== '')) {
      return `No server responds at ${this.host}. Start one, for example with ./deploy/demo.sh; ` +
        'this page then connects automatically.';
    }
    if (state === 'closed') {
      return `The server closed the connection: ${lastError}. Reload the page to try again.`;
    }
    const refused = state === 'ready' && this.panes.find(({world}) => world.state === 'refused');
    if (!refused) return '';
    const reason = refused.refusal.replace(/\.$/, '') || 'the server refused it';
    return `Cannot join world ${refused.world.name}: ${reason}. Select another world above.`;
  }
}
