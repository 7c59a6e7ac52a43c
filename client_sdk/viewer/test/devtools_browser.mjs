// A browser that nothing watches: Playwright has every message of a page's WebSockets told to it, which
// costs as much as drawing when poses of a thousand avatars come in. For measurements.

import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

import WebSocket from 'ws';

import {findChromium, switches} from './browser.mjs';

export class BareBrowser {
  static async launch() {
    const executable = findChromium();
    if (!executable) throw new Error('there is no Chromium; on Debian: apt-get install chromium');
    const browser = new BareBrowser();
    browser.folder = mkdtempSync(join(tmpdir(), 'stridewire-browser-'));
    browser.child = spawn(executable, [
      ...switches, '--remote-debugging-port=0', `--user-data-dir=${browser.folder}`, 'about:blank',
    ], {stdio: ['ignore', 'ignore', 'pipe']});
    let said = '';
    browser.child.stderr.setEncoding('utf8');
    const link = await new Promise((resolve, reject) => {
      browser.child.stderr.on('data', (text) => {
        said += said.length < 10_000 ? text : '';
        const found = /DevTools listening on (\S+)/.exec(said);
        if (found) resolve(found[1]);
      });
      browser.child.on('error', reject);
      browser.child.on('close', () => reject(new Error(`the browser ended: ${said}`)));
    });
    browser.socket = new WebSocket(link, {maxPayload: 256 * 1024 * 1024});
    browser.asked = new Map();
    browser.last = 0;
    browser.socket.on('message', (text) => {
      const {id, result, error} = JSON.parse(text);
      const waiting = browser.asked.get(id);
      if (!waiting) return;
      browser.asked.delete(id);
      if (error) waiting.reject(new Error(error.message));
      else waiting.resolve(result);
    });
    await once(browser.socket, 'open');
    return browser;
  }

  send(method, params = {}, sessionId = undefined) {
    const id = ++this.last;
    this.socket.send(JSON.stringify({id, method, params, sessionId}));
    return new Promise((resolve, reject) => this.asked.set(id, {resolve, reject}));
  }

  /** Processor time of all its processes so far. */
  async processorS() {
    const {processInfo} = await this.send('SystemInfo.getProcessInfo');
    return processInfo.reduce((sum, {cpuTime}) => sum + cpuTime, 0);
  }

  async open(link, width, height) {
    const {targetId} = await this.send('Target.createTarget', {url: 'about:blank'});
    const {sessionId} = await this.send('Target.attachToTarget', {targetId, flatten: true});
    const send = (method, params) => this.send(method, params, sessionId);
    await send('Emulation.setDeviceMetricsOverride', {width, height, deviceScaleFactor: 1, mobile: false});
    await send('Page.navigate', {url: link});
    const evaluate = async (f, argument) => {
      const expression = `(${f})(${JSON.stringify(argument) ?? ''})`;
      const {result, exceptionDetails} = await send(
        'Runtime.evaluate', {expression, awaitPromise: true, returnByValue: true});
      if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
      return result.value;
    };
    const until = async (f, argument) => {
      while (!await evaluate(f, argument).catch(() => false)) {
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
    };
    return {
      send, evaluate, until,
      close: () => this.send('Target.closeTarget', {targetId}),
      screenshot: async (file) => writeFileSync(
        file, Buffer.from((await send('Page.captureScreenshot')).data, 'base64')),
    };
  }

  async close() {
    const ended = once(this.child, 'exit');
    await this.send('Browser.close');
    await ended;
    rmSync(this.folder, {recursive: true, force: true, maxRetries: 5});
  }
}
