// Measures movement mode in Chromium without drawing: a page that observes walking avatars and
// samples all of them 30 times per second. Prints processor time per frame, bytes per pose, and
// memory at intervals: the heap of JavaScript and the memory of the WebAssembly module.
//
//   STRIDEWIRE_BIN=../../build/release/bin node test/measure_movement.mjs [AVATARS [MINUTES]]
//
// Processor time is that of the page's process, which receives, evaluates, records and samples.

import {spawn} from 'node:child_process';
import {once} from 'node:events';
import http from 'node:http';
import {fileURLToPath} from 'node:url';

import * as esbuild from 'esbuild';

import {DevToolsBrowser} from './devtools_browser.mjs';

const programs = process.env.STRIDEWIRE_BIN;
const avatars = Number(process.argv[2] || 1000);
const minutes = Number(process.argv[3] || 1);
const mode = process.env.STRIDEWIRE_MODE || 'movement';
const recordingS = Number(process.env.STRIDEWIRE_RECORDING_S || 20);
const everyNTicks = Number(process.env.STRIDEWIRE_EVERY || 1);
const sleep = (seconds) => new Promise((resolve) => setTimeout(resolve, 1000 * seconds));

const script = await esbuild.build({
  stdin: {
    contents: `import {Client, createCrowdPose} from '@stridewire/client';
      globalThis.start = (url, mode, recordingS, everyNTicks) => {
        const client = new Client({url, recordingS});
        const world = client.joinWorld('load-0', 'observer');
        world.observe({mode, everyNTicks});
        client.connect();
        const crowd = createCrowdPose();
        Object.assign(globalThis, {client, world, crowd, frames: 0});
        setInterval(() => {
          const timeS = client.renderTimeS();
          if (timeS !== null && world.sampleAll(timeS, crowd) > 0) ++globalThis.frames;
        }, 1000 / 30);
      };`,
    resolveDir: fileURLToPath(new URL('.', import.meta.url)), loader: 'ts',
  },
  bundle: true, format: 'esm', target: 'es2022', write: false,
});
// The first script finds the memory of the client's WebAssembly module, which is not exported.
const pageHtml = `<script>
  WebAssembly.Instance = new Proxy(WebAssembly.Instance, {construct(target, args) {
    const instance = new target(...args);
    globalThis.moduleMemory ??= instance.exports.memory;
    return instance;
  }});
</script><script type="module" src="/s.js"></script>`;
const listener = http.createServer(({url}, response) => {
  response.writeHead(200, {'Content-Type': url === '/' ? 'text/html' : 'text/javascript'});
  response.end(url === '/' ? pageHtml :
    url === '/s.js' ? script.outputFiles[0].contents : '');
});
listener.listen(0, '127.0.0.1');
await once(listener, 'listening');
const origin = `http://127.0.0.1:${listener.address().port}`;

const server = spawn(`${programs}/stridewired`, [
  '--listen', '127.0.0.1:0', '--http', '127.0.0.1:0', '--log-level', 'warning',
  '--allowed-origins', origin,
], {stdio: ['ignore', 'pipe', 'inherit']});
const [, port, httpPort] = await new Promise((resolve) => {
  let out = '';
  server.stdout.on('data', (text) => {
    out += text;
    const match = /ready listen=\S+:(\d+) http=\S+:(\d+)/.exec(out);
    if (match) resolve(match);
  });
});
const load = spawn(`${programs}/stridewire-load`, [
  '--connect', `127.0.0.1:${port}`, '--http', `127.0.0.1:${httpPort}`, '--avatars', `${avatars}`,
  '--observers', '0', '--wander', '--seed', '1', '--seconds', '3600',
], {stdio: 'ignore'});
const browser = await DevToolsBrowser.launch();
try {
  const page = await browser.open(`${origin}/`, 800, 600);
  await page.waitFor(() => 'start' in globalThis);
  /** Returns the processor times of all renderers by process number. */
  const rendererTimesS = async () => {
    const {processInfo} = await browser.send('SystemInfo.getProcessInfo');
    return new Map(processInfo.filter(({type}) => type === 'renderer')
      .map(({id, cpuTime}) => [id, cpuTime]));
  };
  // Other renderers belong to no page. The renderer of this one is the one that the loop uses. If
  // another one is busy at the same time, for example because it starts, the loop is repeated.
  let pageProcess;
  for (let attempt = 1; pageProcess === undefined; ++attempt) {
    const idleS = await rendererTimesS();
    await page.evaluate(() => {
      const endMs = performance.now() + 1000;
      while (performance.now() < endMs);
    });
    const used = [...await rendererTimesS()].map(([id, time]) => [id, time - (idleS.get(id) ?? 0)])
      .sort(([, a], [, b]) => b - a);
    if (used[0][1] > 0.3 && (used.length === 1 || used[1][1] < 0.5 * used[0][1])) {
      [[pageProcess]] = used;
    } else if (attempt === 20) {
      throw new Error(`cannot find the page's renderer: ${JSON.stringify(used)}`);
    }
  }
  await sleep(3);
  await page.evaluate((a) => globalThis.start(...a),
    [`ws://127.0.0.1:${httpPort}/stream`, mode, recordingS, everyNTicks]);
  await page.waitFor((n) => globalThis.crowd.count === n, avatars);
  await sleep(25);  // The recording is full.
  /** Processor time of the page's process. */
  const processorS = async () => (await rendererTimesS()).get(pageProcess);
  const state = () => page.evaluate(() => ({
    ...globalThis.client.statistics, frames: globalThis.frames, ms: performance.now()}));
  const memory = async () => {
    await page.send('HeapProfiler.collectGarbage');
    const {usedSize, backingStorageSize = 0} = await page.send('Runtime.getHeapUsage');
    const moduleBytes = await page.evaluate(() => globalThis.moduleMemory.buffer.byteLength);
    const text = (bytes) => (bytes / 1e6).toFixed(1);
    return `${text(usedSize + backingStorageSize)} + ${text(moduleBytes)} MB`;
  };
  console.log(`${avatars} avatars, mode ${mode}: ${await memory()}`);
  for (let minute = 1; minute <= minutes; ++minute) {
    const [before, usedS] = [await state(), await processorS()];
    await sleep(60);
    const [after, used] = [await state(), await processorS() - usedS];
    const frames = after.frames - before.frames;
    const poses = after.posesReceived - before.posesReceived;
    console.log(`minute ${minute}: ${(1000 * used / frames).toFixed(2)} ms per frame, ` +
      `${(1000 * frames / (after.ms - before.ms)).toFixed(1)} frames/s, ` +
      `${((after.poseBytesReceived - before.poseBytesReceived) / poses).toFixed(2)} bytes/pose, ` +
      `${(1000 * poses / (after.ms - before.ms)).toFixed(0)} poses/s, ` +
      await memory());
  }
} finally {
  await browser.close();
  load.kill();
  server.kill();
  listener.close();
}
