// Shared by the browser tests: a server, a proxy that can cut connections, walking avatars, and
// helpers for pages.

import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdirSync, readFileSync} from 'node:fs';
import http from 'node:http';
import net from 'node:net';

import {Client} from '@stridewire/client';
import * as esbuild from 'esbuild';
import WebSocket from 'ws';

import {decodePng} from './png.mjs';

export const programs = process.env.STRIDEWIRE_BIN;
const screenshots = process.env.STRIDEWIRE_SCREENSHOTS ?? '/tmp/stridewire-screenshots';

/** A whole number from the environment. */
export function numberFrom(name, defaultValue) {
  const value = process.env[name] ?? '';
  if (value === '') return defaultValue;
  if (!/^\d+$/.test(value)) throw new Error(`${name}: expected a number, got ${value}`);
  return Number(value);
}

export const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Logs how long something took if STRIDEWIRE_TIMES is set. */
export function logDuration(beganMs, what) {
  if (!process.env.STRIDEWIRE_TIMES) return;
  console.log(`${(performance.now() - beganMs).toFixed(0)} ms: ${what}`);
}

/**
 * Polls until `condition` returns a true value, and returns that. `what` describes the condition.
 * The default limit is long, so that tests pass on slow machines.
 */
export async function waitFor(what, condition, seconds = 120) {
  const beganMs = performance.now();
  let value;
  while (!(value = await condition())) {
    if (performance.now() > beganMs + 1000 * seconds) {
      throw new Error(`not true within ${seconds} s: ${what}`);
    }
    await sleep(20);
  }
  logDuration(beganMs, what);
  return value;
}

export class Server {
  /**
   * Starts on the given ports, or on free ones. If another process has taken a given port, tries
   * again for a while. `more` are further arguments of stridewired.
   */
  static async start(port = 0, httpPort = 0, more = []) {
    for (let attempt = 1; ; ++attempt) {
      try {
        return await this.launch(port, httpPort, more);
      } catch (error) {
        if (port === 0 || attempt === 20) throw error;
        await sleep(500);
      }
    }
  }

  static async launch(port, httpPort, more) {
    const child = spawn(`${programs}/stridewired`, [
      '--listen', `127.0.0.1:${port}`, '--http', `127.0.0.1:${httpPort}`, '--log-level', 'warning',
      ...more,
    ], {stdio: ['ignore', 'pipe', 'inherit']});
    let out = '';
    child.stdout.setEncoding('utf8');
    const ready = await new Promise((resolve, reject) => {
      child.on('error', reject);
      child.stdout.on('data', (text) => {
        out += text;
        const match = /ready listen=\S+:(\d+) http=\S+:(\d+)/.exec(out);
        if (match) resolve(match);
      });
      child.on('close', () => reject(new Error(`stridewired ended: ${out}`)));
    });
    const server = new Server();
    return Object.assign(server, {child, port: Number(ready[1]), httpPort: Number(ready[2])});
  }

  async kill() {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    const ended = once(this.child, 'exit');
    this.child.kill('SIGKILL');
    await ended;
  }

  /** Resident memory of the process. */
  residentKiB() {
    const status = readFileSync(`/proc/${this.child.pid}/status`, 'utf8');
    return Number(/^VmRSS:\s+(\d+)/m.exec(status)[1]);
  }

  /** A metric from /metrics. Samples with different labels are summed. */
  async metric(name) {
    const text = await (await fetch(`http://127.0.0.1:${this.httpPort}/metrics`)).text();
    const lines = text.split('\n').filter(
      (line) => line.startsWith(`${name} `) || line.startsWith(`${name}{`));
    if (lines.length === 0) throw new Error(`/metrics has no ${name}`);
    return lines.reduce((sum, line) => sum + Number(line.split(' ').at(-1)), 0);
  }
}

/**
 * Bundles a TypeScript module and serves a page that runs it. Imports in `contents` are relative to
 * `resolveDir`. `files` is a map from further paths to their type and content.
 */
export async function serveModule(contents, resolveDir, files = {}) {
  const script = await esbuild.build({
    stdin: {contents, resolveDir, loader: 'ts'},
    bundle: true, format: 'esm', target: 'es2022', loader: {'.wasm': 'binary'}, write: false,
  });
  const all = {
    '/': ['text/html', '<!doctype html><script type="module" src="/script.js"></script>'],
    '/favicon.ico': ['image/x-icon', ''],
    '/script.js': ['text/javascript', script.outputFiles[0].contents],
    ...files,
  };
  const listener = http.createServer(({url}, response) => {
    const [type, content] = all[url.split('?')[0]] ?? ['text/plain', null];
    response.writeHead(content === null ? 404 : 200, {'Content-Type': type});
    response.end(content ?? 'not found');
  });
  listener.listen(0, '127.0.0.1');
  await once(listener, 'listening');
  return {
    origin: `http://127.0.0.1:${listener.address().port}`,
    stop: () => {
      listener.close();
      listener.closeAllConnections();
    },
  };
}

/** A TCP proxy between page and server, whose connections a test can cut. */
export class Proxy {
  static async start(target) {
    const proxy = new Proxy();
    proxy.sockets = new Set();
    proxy.listener = net.createServer((socket) => {
      const onward = net.connect(target, '127.0.0.1');
      for (const [from, to] of [[socket, onward], [onward, socket]]) {
        proxy.sockets.add(from);
        from.on('error', () => {});
        from.on('close', () => {
          proxy.sockets.delete(from);
          to.destroy();
        });
        from.pipe(to);
      }
    });
    proxy.listener.listen(0, '127.0.0.1');
    await once(proxy.listener, 'listening');
    proxy.port = proxy.listener.address().port;
    return proxy;
  }

  /** Closes all connections. New ones are accepted. */
  cut() {
    for (const socket of this.sockets) socket.destroy();
  }

  stop() {
    this.listener.close();
    this.cut();
  }
}

/** A reverse proxy that serves a server below a path, such as `/walk/`, and nothing else. */
export class PrefixProxy {
  static async start(target, prefix) {
    const proxy = new PrefixProxy();
    const onward = (request) => ({
      host: '127.0.0.1', port: target, method: request.method, headers: request.headers,
      path: request.url.slice(prefix.length - 1),
    });
    proxy.refused = [];
    proxy.listener = http.createServer((request, response) => {
      if (!request.url.startsWith(prefix)) {
        proxy.refused.push(request.url);
        response.writeHead(404).end();
        return;
      }
      http.get(onward(request), (answer) => {
        response.writeHead(answer.statusCode, answer.headers);
        answer.pipe(response);
      }).on('error', () => response.destroy());
    });
    proxy.listener.on('upgrade', (request, socket) => {
      socket.on('error', () => {});
      if (!request.url.startsWith(prefix)) {
        proxy.refused.push(request.url);
        socket.destroy();
        return;
      }
      http.get(onward(request)).on('upgrade', (answer, server, head) => {
        const headers = Object.entries(answer.headers).map(([key, value]) => `${key}: ${value}`);
        socket.write(`HTTP/1.1 101 Switching Protocols\r\n${headers.join('\r\n')}\r\n\r\n`);
        socket.write(head);
        server.on('error', () => {});
        server.pipe(socket).pipe(server);
      }).on('error', () => socket.destroy());
    });
    proxy.listener.listen(0, '127.0.0.1');
    await once(proxy.listener, 'listening');
    proxy.port = proxy.listener.address().port;
    return proxy;
  }

  stop() {
    this.listener.close();
    this.listener.closeAllConnections();
  }
}

/** Avatars 1 to `count` that walk in circles, and one more, `standing`, that stands. */
export class Walkers {
  constructor(server, worldName, count) {
    this.count = count;
    this.standing = count + 1;
    this.client = new Client({
      url: `ws://127.0.0.1:${server.httpPort}/stream`, webSocket: WebSocket, clientName: 'walkers',
      respawn: true,
    });
    this.client.connect();
    this.world = this.client.joinWorld(worldName);
    this.events = [];
    this.world.on('event', (event) => {
      this.events.push(event);
      if (this.events.length > 20_000) this.events.splice(0, 10_000);
      if (event.type === 'idle' && event.avatar <= count) this.walk(event.avatar);
    });
  }

  async start() {
    const items = [];
    for (let i = 1; i <= this.standing; ++i) {
      const angle = 2 * Math.PI * i / this.standing;
      items.push({
        avatar: i, positionM: [2.5 * Math.sin(angle), 0, 2.5 * Math.cos(angle)],
        headingRad: angle + Math.PI / 2,
      });
    }
    const reply = await this.world.spawn(items);
    if (!reply.ok || reply.accepted !== items.length) throw new Error(JSON.stringify(reply.text));
    this.world.observe({mode: 'quantised'});
  }

  walk(avatar) {
    void this.world.request(Array.from({length: 8}, () => ({
      avatar, type: 'step', lengthM: 0.6, turnRad: 0.24})));
  }

  stop() {
    this.client.close();
  }
}

/** Poses that the C++ client receives; each is [tick, time, ...root, ...rotations]. */
export async function dumpPoses(server, world, avatar, count, mode) {
  const beganMs = performance.now();
  const child = spawn(`${programs}/web_pose_dump`, [
    '127.0.0.1', `${server.port}`, world, `${avatar}`, `${count}`, mode,
  ], {stdio: ['ignore', 'pipe', 'inherit']});
  let out = '';
  child.stdout.setEncoding('utf8');
  child.stdout.on('data', (text) => out += text);
  const [code] = await once(child, 'close');
  if (code !== 0) throw new Error(`web_pose_dump ended with ${code}`);
  logDuration(beganMs, `dumped ${count} poses`);
  return out.trim().split('\n').map((line) => line.split(' ').map(Number));
}

/**
 * Frame rate limit of test pages. With software rendering a frame takes about 50 ms; at full rate,
 * pages would leave no processor time for the server and other tests.
 */
const maxFramesPerS = 8;

/** Opens the viewer in a new browser context. `errors` collects console errors and exceptions. */
export async function openPage(browser, port, query, options = {}) {
  const context = await browser.newContext({
    viewport: {width: 960, height: 600}, colorScheme: 'light', ...options});
  const url = `http://127.0.0.1:${port}/?frames=${maxFramesPerS}&${query}`;
  return {context, ...await openInContext(context, url)};
}

/** Opens a page in an existing browser context. */
export async function openInContext(context, url) {
  context.setDefaultTimeout(120_000);  // Long enough for slow machines.
  const beganMs = performance.now();
  const page = await context.newPage();
  const errors = [];
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
  });
  page.on('pageerror', (error) => errors.push(String(error)));
  await page.goto(url);
  logDuration(beganMs, `opened ${url}`);
  return {page, errors};
}

/** Waits until the page has drawn `count` more frames. */
export async function waitForFrames(page, count) {
  const from = await page.evaluate(() => window.stridewire.stats.framesDrawn);
  await waitFor(`${count} more frames are drawn`, () => page.evaluate(
    (n) => window.stridewire.stats.framesDrawn >= n, from + count));
}

/** Waits until the first world shows at least `count` avatars. */
export async function waitForAvatars(page, count = 1) {
  await waitFor(`${count} avatars are drawn`, () => page.evaluate(
    (n) => window.stridewire?.sampled()[0]?.avatars.length >= n, count));
}

export async function saveScreenshot(page, name) {
  mkdirSync(screenshots, {recursive: true});
  const beganMs = performance.now();
  await page.screenshot({path: `${screenshots}/${name}.png`});
  logDuration(beganMs, `saved screenshot ${name}`);
}

/** Waits until the camera of the first world stops moving. */
export async function waitForCamera(page) {
  const position = () => page.evaluate(() => {
    const {camera, target} = window.stridewire.worlds[0].view.viewCamera;
    return [...camera.position.toArray(), ...target.toArray()];
  });
  let last = await position();
  await waitFor('the camera stands still', async () => {
    await waitForFrames(page, 2);
    const now = await position();
    const still = now.every((x, i) => Math.abs(x - last[i]) < 1e-4);
    last = now;
    return still;
  });
}

/** Fraction of pixels that change within `apartMs` and at least three frames. */
export async function changedShare(page, clip, apartMs) {
  const first = await page.screenshot({clip});
  await sleep(apartMs);
  await waitForFrames(page, 3);
  return differingShare(first, await page.screenshot({clip}));
}

/** Fraction of pixels that differ between two screenshots; 1 if their sizes differ. */
export function differingShare(first, second) {
  const [a, b] = [decodePng(first), decodePng(second)];
  if (a.width !== b.width || a.height !== b.height) return 1;
  let different = 0;
  for (let i = 0; i < a.width * a.height; ++i) {
    const [p, q] = [i * a.channels, i * b.channels];
    const d = Math.abs(a.pixels[p] - b.pixels[q]) + Math.abs(a.pixels[p + 1] - b.pixels[q + 1]) +
      Math.abs(a.pixels[p + 2] - b.pixels[q + 2]);
    if (d > 48) ++different;
  }
  return different / (a.width * a.height);
}
