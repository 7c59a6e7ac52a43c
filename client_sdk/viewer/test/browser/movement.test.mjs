// Movement mode in a browser: poses equal those of the C++ client, the page keeps libraries, and it
// uses another mode if movement mode is not possible. Environment, besides that of viewer.test.mjs:
// STRIDEWIRE_TICKS  ticks to compare; 500 by default, 10,000 for a long test

import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {dirname, join} from 'node:path';
import {after, before, test} from 'node:test';
import {fileURLToPath} from 'node:url';

import {launch} from '../browser.mjs';
import {
  Server, Walkers, numberFrom, openInContext, openPage, programs, saveScreenshot, serveModule,
  waitFor, waitForAvatars, waitForFrames,
} from './support.mjs';

const ticks = numberFrom('STRIDEWIRE_TICKS', 500);
const avatars = 64;
const seed = 2;
const walkerCount = 6;

let browser;
let server;
let walkers;

before(async () => {
  server = await Server.start();
  walkers = new Walkers(server, 'plaza', walkerCount);
  await walkers.start();
  browser = await launch();
});

after(async () => {
  await browser?.close();
  walkers?.stop();
  await server?.kill();
});

test('a page and a worker evaluate the same poses as the C++ client, to the bit', async () => {
  const folder = mkdtempSync(join(tmpdir(), 'stridewire-movement-'));
  let served;
  try {
    const stream = join(folder, 'stream');
    execFileSync(`${programs}/web_movement_stream`,
      ['builtin', `${avatars}`, `${ticks}`, `${seed}`, stream]);
    const here = dirname(fileURLToPath(import.meta.url));
    served = await serveModule(`import {replayMovements} from './movement_replay';
      globalThis.replay = async () => {
        const began = performance.now();
        const file = await (await fetch('/stream')).arrayBuffer();
        const result = await replayMovements(file);
        return {...result, ms: performance.now() - began};
      };
      if (typeof document === 'undefined') postMessage(await replay());`,
    join(here, '../../../web/test/support'),
    {'/stream': ['application/octet-stream', readFileSync(stream)]});
    const context = await browser.newContext();
    const {page, errors} = await openInContext(context, `${served.origin}/`);
    await waitFor('the script is loaded', () => page.evaluate(() => 'replay' in window));
    for (const where of ['page', 'worker']) {
      const {ms, ...result} = await page.evaluate((place) => place === 'page' ? window.replay() :
        new Promise((resolve, reject) => {
          const worker = new Worker('/script.js', {type: 'module'});
          worker.onmessage = ({data}) => resolve(data);
          worker.onerror = ({message}) => reject(new Error(message));
        }), where);
      assert.deepEqual(result, {ticks, poses: ticks * avatars, differences: []}, `seed ${seed}`);
      console.log(`${where}: ${ticks} ticks of ${avatars} avatars are equal, seed ${seed}, ` +
        `${ms.toFixed(0)} ms`);
    }
    assert.deepEqual(errors, []);
    await context.close();
  } finally {
    served?.stop();
    rmSync(folder, {recursive: true, force: true});
  }
});

const isInMovementMode = (page) => page.evaluate(() =>
  document.querySelector('.status')?.textContent.endsWith('movement mode') &&
  document.getElementById('stream-mode').textContent.includes('sends movements'));

/** Opens the viewer in a context, waits until it computes poses, and returns the bytes of its
 * library that came from the server. */
async function openInMovementMode(context) {
  const {page, errors} = await openInContext(
    context, `http://127.0.0.1:${server.httpPort}/?frames=8&world=plaza`);
  await waitFor('the page is in movement mode', () => isInMovementMode(page));
  await waitForAvatars(page, walkerCount + 1);
  await waitForFrames(page, 2);
  const stats = await page.evaluate(() => window.stridewire.stats);
  assert.equal(stats.invalidFrames, 0);
  assert.deepEqual(errors, []);
  return {page, fetched: stats.libraryBytesReceived};
}

/** Runs `work(files, uses, result)` in a transaction on the page's database of libraries. `result`
 * returns a promise of a request's result. */
const inDatabase = (page, work) => page.evaluate(`(async () => {
  const result = (request) => new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
  const database = await result(indexedDB.open('stridewire-libraries'));
  const transaction = database.transaction(['files', 'uses'], 'readwrite');
  const value = await (${work})(
    transaction.objectStore('files'), transaction.objectStore('uses'), result);
  database.close();
  return value;
})()`);

test('uses movement mode and keeps the library for the next page', async () => {
  const context = await browser.newContext({viewport: {width: 960, height: 600}});
  const first = await openInMovementMode(context);
  assert.ok(first.fetched > 100_000, `${first.fetched}`);
  // The cache stores the library in the background.
  const stored = () => inDatabase(first.page, async (files, uses, result) => ({
    hashes: await result(files.getAllKeys()), uses: await result(uses.getAll()),
  }));
  await waitFor('the library is stored', async () => (await stored()).hashes.length === 1);
  const {hashes: [hash], uses: [use]} = await stored();
  const expected =
    await first.page.evaluate(() => window.stridewire.worlds[0].world.libraryHash);
  assert.equal(hash, expected);
  assert.ok(use.hash === hash && use.bytes > 100_000 && use.bytes < first.fetched);
  await first.page.close();

  const second = await openInMovementMode(context);
  assert.equal(second.fetched, 0);

  // A damaged file is fetched again and replaced.
  await inDatabase(second.page, async (files, _uses, result) => {
    const [key] = await result(files.getAllKeys());
    const file = await result(files.get(key));
    file[file.length >> 1] ^= 1;
    await result(files.put(file, key));
  });
  await second.page.close();
  const third = await openInMovementMode(context);
  assert.equal(third.fetched, first.fetched);
  // More than 16 libraries: those that were not used for the longest time are removed.
  await inDatabase(third.page, async (files, uses, result) => {
    await result(files.clear());
    await result(uses.clear());
    for (let i = 0; i < 20; ++i) {
      await result(files.put(new Uint8Array(1000), `other-${i}`));
      await result(uses.put({hash: `other-${i}`, bytes: 1000, usedMs: 1000 + i}));
    }
  });
  await third.page.close();
  const fourth = await openInMovementMode(context);
  assert.equal(fourth.fetched, first.fetched);
  const keys = () => inDatabase(fourth.page, (files, _uses, result) => result(files.getAllKeys()));
  await waitFor('old libraries are removed', async () => (await keys()).length === 16);
  assert.deepEqual((await keys()).sort(),
    [hash, ...Array.from({length: 15}, (_, i) => `other-${i + 5}`)].sort());
  await context.close();
});

test('works where IndexedDB is missing or refused', async () => {
  for (const breakIt of [
    () => Object.defineProperty(window, 'indexedDB', {get() { throw new DOMException('no'); }}),
    () => { IDBFactory.prototype.open = () => ({}); },  // Never answers.
  ]) {
    const context = await browser.newContext({viewport: {width: 480, height: 320}});
    await context.addInitScript(breakIt);
    const {fetched} = await openInMovementMode(context);
    assert.ok(fetched > 100_000, `${breakIt}`);
    await context.close();
  }
});

test('receives quantised poses if movement mode is not possible', async () => {
  const context = await browser.newContext({viewport: {width: 960, height: 600}});
  // Damages the pieces of the library that the server sends.
  await context.addInitScript(() => {
    const piece = 75;
    const onmessage = Object.getOwnPropertyDescriptor(WebSocket.prototype, 'onmessage');
    Object.defineProperty(WebSocket.prototype, 'onmessage', {
      set(listener) {
        onmessage.set.call(this, listener && ((event) => {
          const bytes = new Uint8Array(event.data);
          if (bytes[6] === piece) bytes[bytes.length - 5000] ^= 1;
          listener(event);
        }));
      },
    });
  });
  const {page, errors} = await openInContext(
    context, `http://127.0.0.1:${server.httpPort}/?frames=8&world=plaza`);
  await waitFor('the page uses quantised poses', () => page.evaluate(() =>
    document.querySelector('.status')?.textContent.endsWith('quantised mode') &&
    document.getElementById('mode-quantised').checked));
  await waitFor('the page states the reason', () => page.evaluate(() =>
    document.body.textContent.includes('Movement mode is not available')));
  await waitForAvatars(page, walkerCount + 1);
  assert.deepEqual(errors, []);
  await context.close();
});

test('states that WebAssembly SIMD is missing', async () => {
  const context = await browser.newContext({viewport: {width: 960, height: 600}});
  await context.addInitScript(() => { WebAssembly.validate = () => false; });
  const {page} = await openInContext(context, `http://127.0.0.1:${server.httpPort}/`);
  await waitFor('the error is shown', async () =>
    /no WebAssembly SIMD.*Chrome 91/.test(await page.locator('.fatal').textContent()));
  await context.close();
});

test('all stream modes show the avatars', async () => {
  const {page, context, errors} =
    await openPage(browser, server.httpPort, 'world=plaza', {viewport: {width: 1280, height: 720}});
  await waitForAvatars(page, walkerCount + 1);
  await page.click('button[aria-controls=panel-view]');
  for (const mode of ['full', 'quantised', 'movement']) {
    await page.click(`label[for=mode-${mode}]`);
    await waitFor(`the page states mode ${mode}`, () => page.evaluate((name) =>
      document.querySelector('.status').textContent.endsWith(`${name} mode`), mode));
    const timeS = await page.evaluate(() => window.stridewire.client.serverTimeS());
    await waitFor('avatars are drawn', () => page.evaluate(([from, count]) => {
      const [{timeS: drawnS, avatars}] = window.stridewire.sampled();
      return drawnS > from && avatars.length === count;
    }, [timeS, walkerCount + 1]));
  }
  await saveScreenshot(page, 'movement_mode');
  assert.deepEqual(errors, []);
  await context.close();
});
