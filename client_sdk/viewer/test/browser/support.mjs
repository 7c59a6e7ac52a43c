// What browser tests stand on: a server, a proxy whose connections can be cut, walkers, a browser.

import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdirSync, readFileSync} from 'node:fs';
import net from 'node:net';

import {Client} from '@stridewire/client';
import WebSocket from 'ws';

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

/** Waits for what must come, however slow the machine is. */
export async function until(what, holds, seconds = 60) {
  const endMs = performance.now() + 1000 * seconds;
  let value;
  while (!(value = await holds())) {
    if (performance.now() > endMs) throw new Error(`waited ${seconds} s until ${what}`);
    await sleep(50);
  }
  return value;
}

export class Server {
  static async start(port = 0, httpPort = 0) {
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
  const child = spawn(`${programs}/web_pose_dump`, [
    '127.0.0.1', `${server.port}`, world, `${avatar}`, `${count}`, mode,
  ], {stdio: ['ignore', 'pipe', 'inherit']});
  let out = '';
  child.stdout.setEncoding('utf8');
  child.stdout.on('data', (text) => out += text);
  const [code] = await once(child, 'close');
  if (code !== 0) throw new Error(`web_pose_dump ended with ${code}`);
  return out.trim().split('\n').map((line) => line.split(' ').map(Number));
}

/** A page of the viewer, and what it complained of. */
export async function openPage(browser, port, query, options = {}) {
  const context = await browser.newContext({
    viewport: {width: 1280, height: 720}, colorScheme: 'light', ...options});
  const page = await context.newPage();
  const errors = [];
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
  });
  page.on('pageerror', (error) => errors.push(String(error)));
  await page.goto(`http://127.0.0.1:${port}/?${query}`);
  return {page, context, errors};
}

/** Figures are drawn. */
export async function figuresShown(page, count = 1) {
  await until('figures are drawn', () => page.evaluate(
    (wanted) => window.stridewire?.sampled()[0]?.avatars.length >= wanted, count));
}

export async function keep(page, name) {
  mkdirSync(screenshots, {recursive: true});
  await page.screenshot({path: `${screenshots}/${name}.png`});
}

/** Share of pixels that differ between two pictures of the scene, a moment apart. */
export async function movingShare(page, clip, apartMs) {
  const first = await page.screenshot({clip});
  await sleep(apartMs);
  return differing(page, first, await page.screenshot({clip}));
}

/** Share of pixels that differ between two pictures of one size. */
export function differing(page, first, second) {
  return page.evaluate(async (pictures) => {
    const pixels = await Promise.all(pictures.map(async (text) => {
      const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes], {type: 'image/png'}));
      const canvas = new OffscreenCanvas(image.width, image.height);
      const drawing = canvas.getContext('2d');
      drawing.drawImage(image, 0, 0);
      return drawing.getImageData(0, 0, image.width, image.height).data;
    }));
    const [a, b] = pixels;
    let different = 0;
    for (let i = 0; i < a.length; i += 4) {
      const d = Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) + Math.abs(a[i + 2] - b[i + 2]);
      if (d > 48) ++different;
    }
    return different / (a.length / 4);
  }, [first.toString('base64'), second.toString('base64')]);
}
