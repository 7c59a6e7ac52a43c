// Measures the time from navigation to the first displayed pose, and to the first drawn avatar of
// the viewer, each with an empty cache and with a cached library:
//
//   STRIDEWIRE_BIN=../../build/release/bin node test/measure_load.mjs [TIMES]

import {fileURLToPath} from 'node:url';

import {Server, Walkers, serveModule} from './browser/support.mjs';
import {DevToolsBrowser} from './devtools_browser.mjs';

const times = Number(process.argv[2] || 5);
const served = await serveModule(`
  import {Client, createPose} from '@stridewire/client';
  const [, port, mode] = /port=(\\d+)&mode=(\\w+)/.exec(location.search);
  const client = new Client({url: \`ws://127.0.0.1:\${port}/stream\`});
  const world = client.joinWorld('plaza', 'observer');
  world.observe({mode});
  client.connect();
  const pose = createPose();
  const timer = setInterval(() => {
    const timeS = client.renderTimeS();
    if (timeS === null || world.sample(1, timeS, pose) === 'missing') return;
    globalThis.firstPoseMs = performance.now();
    globalThis.fetched = client.statistics.libraryBytesReceived;
    clearInterval(timer);
  }, 1);`, fileURLToPath(new URL('.', import.meta.url)));
const server = await Server.start(0, 0, ['--allowed-origins', served.origin]);
const walkers = new Walkers(server, 'plaza', 6);
await walkers.start();
const browser = await DevToolsBrowser.launch();

const hasPose = () =>
  (globalThis.firstPoseMs ?? globalThis.stridewire?.stats.firstFigureMs) > 0;

/** Opens a page repeatedly, and prints the median and the largest time. */
async function measure(what, url, isCached) {
  const found = [];
  let fetched = 0;
  let context = await browser.newContext();
  for (let i = isCached ? -1 : 0; i < times; ++i) {
    if (!isCached) context = await browser.newContext();
    const page = await browser.open(url, 1280, 720, context);
    await page.waitFor(hasPose);
    const result = await page.evaluate(() => ({
      ms: globalThis.firstPoseMs ?? globalThis.stridewire.stats.firstFigureMs,
      bytes: globalThis.fetched ?? globalThis.stridewire.stats.libraryBytesReceived,
    }));
    // Until the first page is closed, it stores the library.
    if (i < 0) await new Promise((resolve) => setTimeout(resolve, 1000));
    await page.close();
    if (i < 0) continue;
    found.push(result.ms);
    fetched = result.bytes;
  }
  found.sort((x, y) => x - y);
  console.log(`${what}, ${isCached ? 'cached' : 'empty cache'}: median ` +
    `${found[found.length >> 1].toFixed(0)} ms, largest ${found.at(-1).toFixed(0)} ms, ` +
    `${fetched} bytes of the library fetched`);
}

for (const isCached of [false, true]) {
  for (const mode of ['movement', 'quantised']) {
    await measure(`client, ${mode} mode`, `${served.origin}/?port=${server.httpPort}&mode=${mode}`,
      isCached);
  }
  await measure('viewer', `http://127.0.0.1:${server.httpPort}/?world=plaza`, isCached);
}
await browser.close();
walkers.stop();
served.stop();
await server.kill();
