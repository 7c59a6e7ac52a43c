// Tests a page that is hidden behind another tab or frozen, and then shown again.
// Environment, besides that of viewer.test.mjs:
// STRIDEWIRE_HIDDEN_S  how long the page is hidden; 5 by default, 600 for a long test
// STRIDEWIRE_FROZEN_S  how long it is frozen; 5 by default

import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {test} from 'node:test';
import {fileURLToPath} from 'node:url';

import {DevToolsBrowser} from '../devtools_browser.mjs';
import {Server, Walkers, numberFrom, serveModule, sleep, waitFor} from './support.mjs';

const hiddenS = numberFrom('STRIDEWIRE_HIDDEN_S', 5);
const frozenS = numberFrom('STRIDEWIRE_FROZEN_S', 5);
const walkerCount = 6;
const modes = ['movement', 'quantised'];
/** No step moves an avatar faster than this, in m/s. */
const maxSpeedMS = 3;

// Samples all walkers once per frame. Keeps the samples of the last 5 s. Counts jumps: successive
// samples of the same segment that are farther apart than the highest speed allows. The client
// stores poses of about half a second. Poses of one segment can therefore differ by the motion of
// at most 0.6 s, even if more time has passed between the samples.
const script = `
  import {Client, createPose} from '@stridewire/client';
  globalThis.start = (url, mode) => {
    const client = new Client({url});
    const world = client.joinWorld('plaza', 'observer');
    world.observe({mode});
    client.connect();
    const state = {client, log: [], jumpM: 0, jumps: 0, segments: 0, shownMs: 0};
    (globalThis.states ??= {})[mode] = state;
    const pose = createPose();
    const last = new Map();
    document.addEventListener('visibilitychange', () => {
      if (document.visibilityState === 'visible') state.shownMs = Date.now();
    });
    const frame = () => {
      requestAnimationFrame(frame);
      const timeS = client.renderTimeS();
      let count = 0;
      for (let avatar = 1; timeS !== null && avatar <= ${walkerCount}; ++avatar) {
        const result = world.sample(avatar, timeS, pose);
        if (result === 'missing') continue;
        if (result !== 'held') ++count;
        const now = {timeS, segment: pose.segment, rootM: [...pose.rootM]};
        const before = last.get(avatar);
        last.set(avatar, now);
        if (!before) continue;
        if (before.segment !== now.segment) { ++state.segments; continue; }
        const movedM = Math.hypot(...now.rootM.map((x, i) => x - before.rootM[i]));
        const passedS = Math.min(Math.abs(timeS - before.timeS), 0.6);
        const jumpM = movedM - ${maxSpeedMS} * passedS;
        state.jumpM = Math.max(state.jumpM, jumpM);
        if (jumpM > 1e-3) ++state.jumps;
      }
      state.log.push({ms: Date.now(), timeS, count});
      while (state.log[0].ms < Date.now() - 5000) state.log.shift();
    };
    requestAnimationFrame(frame);
  };`;

test('a page that was hidden or frozen displays what is now', async () => {
  const served = await serveModule(script, fileURLToPath(new URL('.', import.meta.url)));
  const server = await Server.start(0, 0, ['--allowed-origins', served.origin]);
  const walkers = new Walkers(server, 'plaza', walkerCount);
  await walkers.start();
  const browser = await DevToolsBrowser.launch();
  try {
    const page = await browser.open(`${served.origin}/`, 640, 480);
    await page.waitFor(() => 'start' in globalThis);
    for (const mode of modes) {
      await page.evaluate(([url, m]) => globalThis.start(url, m),
        [`ws://127.0.0.1:${server.httpPort}/stream`, mode]);
    }
    const states = () => page.evaluate(() => Object.fromEntries(Object.entries(globalThis.states)
      .map(([mode, {client, ...state}]) => [mode, {...state, ...client.statistics}])));
    const waitForAll = (what) => waitFor(what, async () => Object.values(await states())
      .every(({log}) => (log.at(-1)?.count ?? 0) === walkerCount));
    await waitForAll('all walkers are displayed');
    await sleep(3000);
    /** Memory of the page, and the resident memory of its process. */
    const megabytes = async () => {
      const {processInfo} = await browser.send('SystemInfo.getProcessInfo');
      const residents = processInfo.filter(({type}) => type === 'renderer').map(({id}) =>
        Number(/^RssAnon:\s+(\d+)/m.exec(readFileSync(`/proc/${id}/status`, 'utf8'))[1]));
      const all = Object.values(await states());
      const buffered = all.reduce((sum, {bufferedBytes}) => sum + bufferedBytes, 0) / 1e6;
      return `${buffered.toFixed(1)} MB buffered, ${(Math.max(...residents) / 1e3).toFixed(0)} ` +
        'MB resident';
    };
    /** Waits until the page displays current poses. Returns how long that took in each mode. */
    const recovery = async () => {
      await waitFor('the page is visible', () => page.evaluate(
        () => document.visibilityState === 'visible'));
      await sleep(3000);
      await waitForAll('all walkers are displayed again');
      const offsetS = walkers.client.serverTimeS() - Date.now() / 1000;
      return Object.fromEntries(Object.entries(await states()).map(([mode, {log, shownMs}]) => {
        // From this sample on, all walkers are displayed as they were at most 0.25 s ago.
        const late = log.findLastIndex(({ms, timeS, count}) => ms >= shownMs &&
          !(count === walkerCount && ms / 1000 + offsetS - timeS < 0.25));
        return [mode, (late < 0 ? log.find(({ms}) => ms >= shownMs) : log[late + 1])?.ms - shownMs];
      }));
    };
    const check = async (what, before, after) => {
      const now = await states();
      for (const mode of modes) {
        const {jumps, jumpM, segments, invalidFrames} = now[mode];
        assert.equal(jumps, 0, `${mode}: a pose jumped by ${jumpM} m without a new segment`);
        assert.ok(segments >= walkerCount, `${mode}: ${segments} changes of segment`);
        assert.equal(invalidFrames, 0);
      }
      console.log(`${what}: current poses ${JSON.stringify(after)} ms after it was shown, ` +
        `${before} before, ${await megabytes()} after; reconnects ` +
        modes.map((mode) => now[mode].reconnects).join(', '));
    };

    let before = await megabytes();
    const other = await browser.open('about:blank', 640, 480);
    await waitFor('the page is hidden', () => page.evaluate(
      () => document.visibilityState === 'hidden'));
    for (let s = 0; s < hiddenS; s += 60) {
      if (s > 0) console.log(`hidden for ${s} s: ${await megabytes()}`);
      await sleep(1000 * Math.min(60, hiddenS - s));
    }
    await page.send('Page.bringToFront');
    await check(`hidden for ${hiddenS} s`, before, await recovery());

    before = await megabytes();
    await other.send('Page.bringToFront');
    await page.send('Page.setWebLifecycleState', {state: 'frozen'});
    await sleep(1000 * frozenS);
    await page.send('Page.setWebLifecycleState', {state: 'active'});
    await page.send('Page.bringToFront');
    await check(`frozen for ${frozenS} s`, before, await recovery());
  } finally {
    await browser.close();
    walkers.stop();
    served.stop();
    await server.kill();
  }
});
