// What browser tests stand on: a server, a proxy whose connections can be cut, walkers, a browser.

import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdirSync, readFileSync} from 'node:fs';
import net from 'node:net';

import {Client} from '@stridewire/client';
import WebSocket from 'ws';

import {decodePng} from './png.mjs';

export const programs = process.env.STRIDEWIRE_BIN;
const screenshots = process.env.STRIDEWIRE_SCREENSHOTS ?? '/tmp/stridewire-screenshots';

/** A whole number from the environment. */
export function numberFrom(name, otherwise) {
  const value = process.env[name] ?? '';
  if (value === '') return otherwise;
  if (!/^\d+$/.test(value)) throw new Error(`${name} is no number: ${value}`);
  return Number(value);
}

export const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Says what takes long, where STRIDEWIRE_TIMES is set. */
export function tell(beganMs, what) {
  if (process.env.STRIDEWIRE_TIMES) console.log(`${(performance.now() - beganMs).toFixed(0)} ms ${what}`);
}

/** Waits for what must come, however slow the machine is. */
export async function until(what, holds, seconds = 120) {
  const beganMs = performance.now();
  let value;
  while (!(value = await holds())) {
    if (performance.now() > beganMs + 1000 * seconds) throw new Error(`waited ${seconds} s until ${what}`);
    await sleep(20);
  }
  tell(beganMs, `until ${what}`);
  return value;
}

export class Server {
  /** On free ports, or where another one was before: that a port is taken meanwhile passes. */
  static async start(port = 0, httpPort = 0) {
    for (let attempt = 1; ; ++attempt) {
      try {
        return await this.launch(port, httpPort);
      } catch (error) {
        if (port === 0 || attempt === 20) throw error;
        await sleep(500);
      }
    }
  }

  static async launch(port, httpPort) {
    const child = spawn(`${programs}/stridewired`, [
      '--listen', `127.0.0.1:${port}`, '--http', `127.0.0.1:${httpPort}`, '--log-level', 'warning',
    ], {stdio: ['ignore', 'pipe', 'inherit']});
    let out = '';
    child.stdout.setEncoding('utf8');
    const ready = await new Promise((resolve, reject) => {
      child.on('error', reject);
      child.stdout.on('data', (text) => {
        out += text;
        const found = /ready listen=\S+:(\d+) http=\S+:(\d+)/.exec(out);
        if (found) resolve(found);
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

  /** What it keeps in memory. */
  residentKiB() {
    return Number(/^VmRSS:\s+(\d+)/m.exec(readFileSync(`/proc/${this.child.pid}/status`, 'utf8'))[1]);
  }

  /** A line of /metrics; the sum where it has labels. */
  async metric(name) {
    const text = await (await fetch(`http://127.0.0.1:${this.httpPort}/metrics`)).text();
    const lines = text.split('\n').filter(
      (line) => line.startsWith(`${name} `) || line.startsWith(`${name}{`));
    if (lines.length === 0) throw new Error(`no metric ${name}`);
    return lines.reduce((sum, line) => sum + Number(line.split(' ').at(-1)), 0);
  }
}

/** Between page and server, so that their connection can be cut. */
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

  /** Every connection there is; new ones are taken. */
  cut() {
    for (const socket of this.sockets) socket.destroy();
  }

  stop() {
    this.listener.close();
    this.cut();
  }
}

/** Avatars that walk in circles, and one (the number after theirs) that stands. */
export class Walkers {
  constructor(server, worldName, count) {
    this.count = count;
    this.still = count + 1;
    this.client = new Client({
      url: `ws://127.0.0.1:${server.httpPort}/stream`, webSocket: WebSocket, clientName: 'walkers',
      respawn: true,
    });
    this.client.connect();
    this.world = this.client.joinWorld(worldName);
    this.heard = [];
    this.world.on('event', (event) => {
      this.heard.push(event);
      if (this.heard.length > 20_000) this.heard.splice(0, 10_000);
      if (event.type === 'idle' && event.avatar <= count) this.walk(event.avatar);
    });
  }

  async start() {
    const items = [];
    for (let i = 1; i <= this.still; ++i) {
      const angle = 2 * Math.PI * i / this.still;
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

/** Poses as the C++ library has them: [tick, time, root, rotations]. */
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
  tell(beganMs, `to dump ${count} poses`);
  return out.trim().split('\n').map((line) => line.split(' ').map(Number));
}

// A frame costs a processor that draws 50 ms: as many as it manages would leave nothing to what else runs.
const framesPerS = 8;

/** A page of the viewer, and what it complained of. */
export async function openPage(browser, port, query, options = {}) {
  const context = await browser.newContext({
    viewport: {width: 960, height: 600}, colorScheme: 'light', ...options});
  return {context, ...await openIn(context, `http://127.0.0.1:${port}/?frames=${framesPerS}&${query}`)};
}

/** The same in a context that there is. */
export async function openIn(context, link) {
  context.setDefaultTimeout(120_000);  // However slow the machine is.
  const beganMs = performance.now();
  const page = await context.newPage();
  const errors = [];
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
  });
  page.on('pageerror', (error) => errors.push(String(error)));
  await page.goto(link);
  tell(beganMs, `to open ${link}`);
  return {page, errors};
}

/** So many more frames are drawn. */
export async function framesDrawn(page, count) {
  const from = await page.evaluate(() => window.stridewire.stats.framesDrawn);
  await until('frames are drawn', () => page.evaluate(
    (n) => window.stridewire.stats.framesDrawn >= n, from + count));
}

/** Figures are drawn. */
export async function figuresShown(page, count = 1) {
  await until('figures are drawn', () => page.evaluate(
    (wanted) => window.stridewire?.sampled()[0]?.avatars.length >= wanted, count));
}

export async function keep(page, name) {
  mkdirSync(screenshots, {recursive: true});
  const beganMs = performance.now();
  await page.screenshot({path: `${screenshots}/${name}.png`});
  tell(beganMs, `to keep ${name}`);
}

/** The first world's camera is where it wants to be. */
export async function cameraRests(page) {
  const where = () => page.evaluate(() => {
    const {view} = window.stridewire.worlds[0].view;
    return [...view.camera.position.toArray(), ...view.target.toArray()];
  });
  let last = await where();
  await until('the camera rests', async () => {
    await framesDrawn(page, 2);
    const now = await where();
    const rests = now.every((x, i) => Math.abs(x - last[i]) < 1e-4);
    last = now;
    return rests;
  });
}

/** Share of pixels that differ between two pictures of the scene, a moment and some frames apart. */
export async function movingShare(page, clip, apartMs) {
  const first = await page.screenshot({clip});
  await sleep(apartMs);
  await framesDrawn(page, 3);
  return differing(first, await page.screenshot({clip}));
}

/** Share of pixels that differ between two pictures of one size. */
export function differing(first, second) {
  const [a, b] = [decodePng(first), decodePng(second)];
  if (a.width !== b.width || a.height !== b.height) return 1;  // The page was laid out anew.
  let different = 0;
  for (let i = 0; i < a.width * a.height; ++i) {
    const [p, q] = [i * a.channels, i * b.channels];
    const d = Math.abs(a.pixels[p] - b.pixels[q]) + Math.abs(a.pixels[p + 1] - b.pixels[q + 1]) +
      Math.abs(a.pixels[p + 2] - b.pixels[q + 2]);
    if (d > 48) ++different;
  }
  return different / (a.width * a.height);
}
