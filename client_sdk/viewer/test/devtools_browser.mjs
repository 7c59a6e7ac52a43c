// Controls Chromium over the DevTools protocol, for measurements. Playwright would distort them: it
// receives a copy of every WebSocket message, which for a thousand avatars costs as much as
// drawing.

import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

import WebSocket from 'ws';

import {findChromium, switches} from './browser.mjs';

export class DevToolsBrowser {
  static async launch() {
    const executable = findChromium();
    if (!executable) throw new Error('Chromium not found; on Debian: apt-get install chromium');
    const browser = new DevToolsBrowser();
    browser.folder = mkdtempSync(join(tmpdir(), 'stridewire-browser-'));
    browser.child = spawn(executable, [
      ...switches, '--remote-debugging-port=0', `--user-data-dir=${browser.folder}`, 'about:blank',
    ], {stdio: ['ignore', 'ignore', 'pipe']});
    let output = '';
    browser.child.stderr.setEncoding('utf8');
    const url = await new Promise((resolve, reject) => {
      browser.child.stderr.on('data', (text) => {
        output += output.length < 10_000 ? text : '';
        const match = /DevTools listening on (\S+)/.exec(output);
        if (match) resolve(match[1]);
      });
      browser.child.on('error', reject);
      browser.child.on('close', () => reject(new Error(`the browser ended: ${output}`)));
    });
    browser.socket = new WebSocket(url, {maxPayload: 256 * 1024 * 1024});
    browser.pending = new Map();
    browser.lastId = 0;
    browser.socket.on('message', (text) => {
      const {id, result, error} = JSON.parse(text);
      const request = browser.pending.get(id);
      if (!request) return;
      browser.pending.delete(id);
      if (error) request.reject(new Error(error.message));
      else request.resolve(result);
    });
    await once(browser.socket, 'open');
    return browser;
  }

  send(method, params = {}, sessionId = undefined) {
    const id = ++this.lastId;
    this.socket.send(JSON.stringify({id, method, params, sessionId}));
    return new Promise((resolve, reject) => this.pending.set(id, {resolve, reject}));
  }

  /** Total processor time of all browser processes. */
  async processorS() {
    const {processInfo} = await this.send('SystemInfo.getProcessInfo');
    return processInfo.reduce((sum, {cpuTime}) => sum + cpuTime, 0);
  }

  /** Returns the id of a new browser context, which has no cookies, caches or databases. */
  async newContext() {
    return (await this.send('Target.createBrowserContext')).browserContextId;
  }

  /** Opens a page of this size. `evaluate(f, argument)` calls f in the page. */
  async open(url, width, height, browserContextId = undefined) {
    const {targetId} =
      await this.send('Target.createTarget', {url: 'about:blank', browserContextId});
    const {sessionId} = await this.send('Target.attachToTarget', {targetId, flatten: true});
    const send = (method, params) => this.send(method, params, sessionId);
    await send('Emulation.setDeviceMetricsOverride',
      {width, height, deviceScaleFactor: 1, mobile: false});
    await send('Page.navigate', {url});
    const evaluate = async (f, argument) => {
      const expression = `(${f})(${JSON.stringify(argument) ?? ''})`;
      const {result, exceptionDetails} = await send(
        'Runtime.evaluate', {expression, awaitPromise: true, returnByValue: true});
      if (!exceptionDetails) return result.value;
      throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    };
    const waitFor = async (f, argument) => {
      while (!await evaluate(f, argument).catch(() => false)) {
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
    };
    return {
      send, evaluate, waitFor,
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
