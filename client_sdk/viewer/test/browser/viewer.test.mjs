// The viewer page in a browser with a server. Run by run.mjs. Environment:
// STRIDEWIRE_BIN          folder of stridewired and web_pose_dump
// STRIDEWIRE_SCREENSHOTS  folder for screenshots
// CHROMIUM                path of the browser
// STRIDEWIRE_PAUSE_S      how long a browser is paused; 5 by default, 60 for a long test
// STRIDEWIRE_MEMORY_S     how long memory use is watched; 10 by default, 180 for a long test

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {createCrowdPose} from '@stridewire/client';

import {launch} from '../browser.mjs';
import {
  PrefixProxy, Proxy, Server, Walkers, changedShare, dumpPoses, numberFrom, openInContext, openPage,
  saveScreenshot, sleep, waitFor, waitForAvatars, waitForCamera, waitForFrames,
} from './support.mjs';

const pauseS = numberFrom('STRIDEWIRE_PAUSE_S', 5);
const memoryS = numberFrom('STRIDEWIRE_MEMORY_S', 10);
const walkerCount = 6;
/** Size of pages for screenshots. Other pages are smaller, so that software rendering is faster. */
const large = {width: 1280, height: 720};

let server;
let proxy;
let walkers;
let browser;
/** A page that stays open during all tests, and a promise of its memory use. */
let longRunningPage;
let memoryUse;

before(async () => {
  server = await Server.start();
  proxy = await Proxy.start(server.httpPort);
  walkers = new Walkers(server, 'plaza', walkerCount);
  await walkers.start();
  browser = await launch();
  longRunningPage = await openPage(
    browser, server.httpPort, 'world=plaza', {viewport: {width: 480, height: 320}});
  memoryUse = watchMemory(longRunningPage);
  memoryUse.catch(() => {});  // The memory test awaits the promise and reports errors.
});

after(async () => {
  await browser?.close();
  walkers?.stop();
  proxy?.stop();
  await server?.kill();
});

const scene = (page) => page.evaluate(() => {
  const {x, y, width, height} = window.stridewire.worlds[0].view.freeArea;
  return {x: Math.ceil(x), y: Math.ceil(y), width: Math.floor(width), height: Math.floor(height)};
});

/** Root of an avatar as drawn, or null. */
const rootOf = (page, avatar) => page.evaluate((id) => {
  const {avatars, rootsM, timeS} = window.stridewire.sampled()[0];
  const i = avatars.indexOf(id);
  return i < 0 ? null : {timeS, rootM: rootsM.slice(3 * i, 3 * i + 3)};
}, avatar);

const distanceM = (a, b) => Math.hypot(a[0] - b[0], a[2] - b[2]);

/** Clicks on an avatar until it is selected; others that walk by may be hit first. */
async function clickAvatar(page, avatar) {
  await waitFor(`avatar ${avatar} is selected`, async () => {
    const at = await page.evaluate((id) => {
      const {view} = window.stridewire.worlds[0];
      const {x, y, width, height} = view.freeArea;
      for (let row = y + 4; row < y + height; row += 6) {
        for (let column = x + 4; column < x + width; column += 6) {
          if (view.pick(column, row, 6) === id) return {x: column, y: row};
        }
      }
      return null;
    }, avatar);
    if (at) await page.mouse.click(at.x, at.y);
    return page.evaluate((id) => window.stridewire.selection?.avatar === id, avatar);
  });
}

test('shows walking avatars with the same poses as the C++ client', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza&mode=full',
    {viewport: large});
  await waitForAvatars(page, walkerCount + 1);
  // Once the camera stands still, only avatars move. Zooming out makes them a small part of the
  // image.
  for (let i = 0; i < 5; ++i) await page.keyboard.press('-');
  await waitForCamera(page);
  const share = await waitFor('only avatars move', async () => {
    const now = await changedShare(page, await scene(page), 300);
    return now > 0.0005 && now < 0.2 ? now : 0;
  });
  const compare = async () => {
    const lines = await dumpPoses(server, 'plaza', 1, 60, 'full');
    await waitFor('the page has received the last of them', () => page.evaluate(
      (timeS) => window.stridewire.worlds[0].world.recording.lastTimeS >= timeS, lines.at(-1)[1]));
    // The recorded pose of each time, or null. It is interpolated if the server dropped the batch.
    const ours = await page.evaluate(([times, avatar]) => {
      const {world} = window.stridewire.worlds[0];
      const out = {
        count: 0, jointCount: 0, avatars: new Uint32Array(0), flags: new Uint8Array(0),
        rootsM: new Float32Array(0), rotations: new Float32Array(0),
      };
      return times.map((timeS) => {
        const count = world.recording.sampleAll(timeS, out);
        const i = out.avatars.subarray(0, count).indexOf(avatar);
        const size = 4 * out.jointCount;
        return i < 0 ? null : [
          ...out.rootsM.subarray(3 * i, 3 * i + 3),
          ...out.rotations.subarray(size * i, size * (i + 1))];
      });
    }, [lines.map((line) => line[1]), 1]);
    const theirs = lines.map(([, , ...numbers]) => numbers.map(Math.fround));
    return {lines, ours, lost: ours.filter((pose, i) => String(pose) !== String(theirs[i])).length};
  };
  const dropped = () => page.evaluate(() => window.stridewire.stats.batchesDropped);
  // On a busy machine, the server may drop a batch, which it reports. Then the test compares
  // another 60 ticks.
  let lines, ours, lost;
  for (let attempt = 1; ; ++attempt) {
    const droppedBefore = await dropped();
    ({lines, ours, lost} = await compare());
    if (lost === 0) break;
    assert.ok(attempt < 20, `the page keeps losing ticks, ${lost} of the last 60`);
    await waitFor('the server reports the dropped batches',
      async () => await dropped() > droppedBefore);
  }
  await waitFor('the avatar has moved', async () => {
    const drawn = await rootOf(page, 1);
    return drawn !== null && drawn.timeS >= lines[0][1] && distanceM(ours[0], drawn.rootM) > 0.2;
  });
  const firstMs = await page.evaluate(() => window.stridewire.stats.firstFigureMs);
  console.log(`60 ticks are equal, ${(100 * share).toFixed(2)} % of the scene changed, ` +
    `first avatars after ${firstMs.toFixed(0)} ms`);
  await saveScreenshot(page, 'avatars');
  assert.deepEqual(errors, []);
  await context.close();
});

test('a step requested by clicks is performed, and can be inspected', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza',
    {viewport: large});
  await waitForAvatars(page, walkerCount + 1);
  const {standing} = walkers;
  const before = await rootOf(page, standing);
  await clickAvatar(page, standing);
  assert.deepEqual(await page.evaluate(() => window.stridewire.selection),
    {world: 'plaza', avatar: standing});
  const from = walkers.events.length;
  const lengthM = await page.evaluate(() => Number(document.getElementById('step-length').value));
  await page.getByRole('button', {name: 'Step', exact: true}).click();
  const started = await waitFor('the step starts', () => walkers.events.slice(from).find(
    ({type, avatar, requestId}) => type === 'started' && avatar === standing && requestId !== 0n));
  assert.match(started.kind, /^step/);
  // If the page does not inspect the avatar during the step, another step is requested.
  let requested = 1;
  const movement = await waitFor('the step is inspected', async () => {
    const seen = await page.evaluate((avatar) => {
      const m = window.stridewire.inspected?.avatar === avatar &&
        window.stridewire.inspected.movement;
      return m && m.weights.length > 0 ? {
        kind: m.kind, requested: m.requested, keytimes: m.keytimesS.length,
        sum: m.weights.reduce((sum, weight) => sum + weight, 0),
      } : null;
    }, standing);
    const finished = walkers.events.slice(from).filter(({type, avatar, requestId}) =>
      type === 'finished' && avatar === standing && requestId !== 0n).length;
    if (seen || finished < requested) return seen;
    ++requested;
    await page.getByRole('button', {name: 'Step', exact: true}).click();
    return null;
  });
  assert.ok(Math.abs(movement.sum - 1) < 1e-3 && movement.keytimes > 2, JSON.stringify(movement));
  await saveScreenshot(page, 'inspected');
  await waitFor('the step is finished', () => walkers.events.slice(from).find(
    ({type, avatar, requestId}) => type === 'finished' && avatar === standing &&
      requestId === started.requestId));
  const after = await waitFor('the new position is drawn', async () => {
    const now = await rootOf(page, standing);
    return now !== null && distanceM(now.rootM, before.rootM) > lengthM / 4 ? now : null;
  });
  assert.ok(distanceM(after.rootM, before.rootM) < 2 * requested * lengthM);
  assert.deepEqual(errors, []);
  await context.close();
});

test('scrubbing shows the recording, and Live shows the present', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza');
  await waitForAvatars(page, walkerCount + 1);
  let past, again;
  for (let attempt = 1; !again; ++attempt) {
    past = await waitFor('the avatar is drawn', () => rootOf(page, 2));
    await waitFor('the avatar has moved', async () => {
      const now = await rootOf(page, 2);
      return now !== null && now.timeS - past.timeS > 1.5 && distanceM(now.rootM, past.rootM) > 0.3;
    });
    await page.evaluate((timeS) => {
      window.stridewire.playback.pause();
      window.stridewire.playback.seek(timeS);
    }, past.timeS);
    const seen = await waitFor('the past is drawn, or no longer recorded', async () => {
      const now = await rootOf(page, 2);
      if (now !== null && Math.abs(now.timeS - past.timeS) < 1e-6) return {now};
      const state = await page.evaluate(() => {
        const {client, playback, stats, worlds: [{world}]} = window.stridewire;
        return {
          firstS: world.recording.firstTimeS, lastS: world.recording.lastTimeS,
            timeS: playback.timeS,
          paused: playback.paused, live: playback.live, renderS: client.renderTimeS(),
          framesDrawn: stats.framesDrawn, reconnects: stats.reconnects};
      });
      return state.firstS > past.timeS ? {now: null, state, drawnS: now?.timeS} : null;
    });
    again = seen.now;
    if (again) break;
    // If the page could not draw for 18 s, the recording no longer contains that time.
    const text = `expected time ${past.timeS} s: ${JSON.stringify(seen)}`;
    console.log(text);
    assert.ok(attempt < 3, text);
    await page.evaluate(() => window.stridewire.playback.goLive());
  }
  // The pose equals the one that another client received. A small difference is allowed, because
  // either client may have lost a batch.
  const crowd = createCrowdPose();
  const count = walkers.world.recording.sampleAll(past.timeS, crowd);
  const index = crowd.avatars.subarray(0, count).indexOf(2);
  const expected = [...crowd.rootsM.subarray(3 * index, 3 * index + 3)];
  assert.ok(index >= 0 && distanceM(again.rootM, expected) < 0.05,
    `${again.rootM}, not ${expected}`);
  const clip = await scene(page);
  await waitForCamera(page);
  await waitFor('the paused scene does not change', async () => await changedShare(
    page, clip, 200) < 0.0005);
  await saveScreenshot(page, 'scrubbed');
  // The slider and the Live button work, too.
  await page.locator('#scrub').focus();
  await page.keyboard.press('PageDown');
  await page.getByRole('button', {name: /^Live/}).click();
  await waitFor('playback is live', () => page.evaluate(() => window.stridewire.playback.live));
  const renderS = await page.evaluate(() => window.stridewire.client.renderTimeS());
  await waitFor('the present is drawn', async () => {
    const now = await rootOf(page, 2);
    return now !== null && now.timeS >= renderS;
  });
  assert.deepEqual(errors, []);
  await context.close();
});

test('resumes the session after the connection was cut', async () => {
  const {page, context, errors} = await openPage(browser, proxy.port, 'world=plaza');
  await waitForAvatars(page, walkerCount + 1);
  for (let cut = 1; cut <= 3; ++cut) {
    proxy.cut();
    await waitFor('the session is resumed', () => page.evaluate((count) =>
      window.stridewire.stats.resumes >= count && window.stridewire.client.state === 'ready', cut));
  }
  const before = await waitFor('the avatar is drawn', () => rootOf(page, 1));
  await waitFor('avatars continue to walk', async () => {
    const now = await rootOf(page, 1);
    return now !== null && distanceM(now.rootM, before.rootM) > 0.1;
  });
  const stats = await page.evaluate(() => window.stridewire.stats);
  assert.equal(stats.resumes, stats.reconnects);
  assert.equal(stats.invalidFrames, 0);
  const other = errors.filter((text) => !/WebSocket|Failed to load resource/.test(text));
  assert.deepEqual(other, []);
  await context.close();
});

test('a paused browser costs the server little, and continues with the present', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza&mode=full');
  await waitForAvatars(page, walkerCount + 1);
  const devtools = await context.newCDPSession(page);
  await devtools.send('Debugger.enable');
  const paused = new Promise((resolve) => devtools.once('Debugger.paused', resolve));
  await devtools.send('Debugger.pause');
  await paused;
  const stoppedS = walkers.client.renderTimeS();
  const droppedBefore = await server.metric('stridewire_batches_dropped_total');
  const beforeKiB = server.residentKiB();
  let mostKiB = beforeKiB;
  for (let tenths = 0; tenths < 10 * pauseS; ++tenths) {
    await sleep(100);
    mostKiB = Math.max(mostKiB, server.residentKiB());
  }
  const dropped = await server.metric('stridewire_batches_dropped_total') - droppedBefore;
  // The server keeps at most four batches per world and mode, and the events that wait.
  assert.ok(mostKiB - beforeKiB < 16 * 1024, `${beforeKiB} KiB, then ${mostKiB}`);
  // Other clients are not affected.
  assert.ok(walkers.client.renderTimeS() - stoppedS > pauseS - 1);
  await devtools.send('Debugger.resume');
  await devtools.send('Debugger.disable');
  await waitFor('the page draws the present', async () => {
    const presentS = walkers.client.renderTimeS();
    const now = await rootOf(page, 1);
    return now !== null && now.timeS > presentS - 1;
  });
  const stats = await page.evaluate(() => window.stridewire.stats);
  assert.equal(stats.invalidFrames, 0);
  console.log(`paused for ${pauseS} s: server ${beforeKiB} KiB, at most ${mostKiB}; ` +
    `${dropped} batches dropped; ${stats.reconnects} reconnects, ${stats.resumes} resumed`);
  assert.deepEqual(errors, []);
  await context.close();
});

/** Memory of a page in bytes when its recording is full, and `memoryS` seconds later. */
async function watchMemory({page, context}) {
  await waitForAvatars(page, walkerCount + 1);
  const devtools = await context.newCDPSession(page);
  const used = async () => {
    await devtools.send('HeapProfiler.collectGarbage');
    const heap = await devtools.send('Runtime.getHeapUsage');
    return heap.usedSize + (heap.backingStorageSize ?? 0);
  };
  // The recording is full when it has dropped its oldest poses.
  const recorded = () => page.evaluate(() => {
    const {firstTimeS, lastTimeS} = window.stridewire.worlds[0].world.recording;
    return {firstS: firstTimeS, seconds: lastTimeS - firstTimeS};
  });
  const {firstS} = await recorded();
  const recordedS = await waitFor('the recording is full', async () => {
    const now = await recorded();
    if (now.firstS > firstS) return now.seconds;
    await sleep(500);
    return 0;
  });
  const before = await used();
  await sleep(1000 * memoryS);
  const after = await used();
  await context.close();
  return {recordedS, before, after};
}

test('fits on a phone, in the dark theme', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza', {
    viewport: {width: 390, height: 844}, colorScheme: 'dark', hasTouch: true, isMobile: true,
    deviceScaleFactor: 2,
  });
  await waitForAvatars(page, walkerCount + 1);
  const excess = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(excess <= 0, `${excess} pixels too wide`);
  await saveScreenshot(page, 'phone');
  assert.deepEqual(errors, []);
  await context.close();
});

test('draws uneven terrain with the shaders for a GPU', async () => {
  const context = await browser.newContext({viewport: {width: 640, height: 400}});
  // The page chooses its shaders by the name of the renderer, which this replaces.
  await context.addInitScript(() => {
    const {getParameter} = WebGL2RenderingContext.prototype;
    const unmaskedRenderer = 0x9246;
    WebGL2RenderingContext.prototype.getParameter = function(name) {
      return name === unmaskedRenderer ? 'Test GPU' : getParameter.call(this, name);
    };
  });
  const {page, errors} = await openInContext(
    context, `http://127.0.0.1:${server.httpPort}/?world=graphics&quality=high`);
  await waitFor('the page has loaded', () => page.evaluate(
    () => window.stridewire?.worlds[0]?.world.skeleton));
  assert.deepEqual(await page.evaluate(async () => {
    const {world} = window.stridewire.worlds[0];
    const spawned = await world.spawn([{positionM: [0, 0, 0], headingRad: 0}]);
    const changed = await world.setTerrain({
      heightField: {originM: [-2, -2], cellM: 2, columns: 3, rows: 3,
        heightsM: Float32Array.of(0, 0.1, 0, 0.1, 0, 0.2, 0, 0.3, 0)},
      boxes: [{minM: [1, 1], maxM: [2, 2], heightM: 0.4}],
    });
    return [window.stridewire.renderer.software, spawned.ok, changed.ok];
  }), [false, true, true]);
  await waitForAvatars(page, 1);
  await waitFor('the terrain has changed', () => page.evaluate(() =>
    !window.stridewire.worlds[0].view.terrain.isFlat));
  await waitForFrames(page, 3);
  await saveScreenshot(page, 'graphics');
  assert.equal(await page.evaluate(() => window.stridewire.draw.level), 0);
  assert.deepEqual(errors, []);
  await context.close();
});

test('reports that WebGL is missing, and that a world cannot be joined', async () => {
  const context = await browser.newContext();
  await context.addInitScript(() => {
    const {getContext} = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function(kind, ...rest) {
      return kind.startsWith('webgl') ? null : getContext.call(this, kind, ...rest);
    };
  });
  const {page} = await openInContext(context, `http://127.0.0.1:${server.httpPort}/`);
  await waitFor('the error is shown', async () =>
    /needs WebGL 2/.test(await page.locator('.fatal').textContent()));
  await context.close();

  const name = 'x'.repeat(65);
  const refused = await openPage(browser, server.httpPort, `world=${name}&world=plaza`);
  await waitFor('the problem and its reason are shown', () => refused.page.evaluate((start) => {
    const text = document.querySelector('.notice:not([hidden])')?.textContent ?? '';
    return text.startsWith(start) && text.includes('64');
  }, `Cannot join world ${name}: `));
  await waitFor('the other world is shown', () => refused.page.evaluate((count) =>
    window.stridewire.sampled().some(({world, avatars}) => world === 'plaza' && avatars.length >=
      count),
  walkerCount + 1));
  assert.deepEqual(refused.errors, []);
  await refused.context.close();
});

test('works below a path prefix of a proxy', async () => {
  const prefixProxy = await PrefixProxy.start(server.httpPort, '/walk/');
  const context = await browser.newContext({viewport: {width: 480, height: 320}});
  try {
    const base = `http://127.0.0.1:${prefixProxy.port}/walk/`;
    const {page, errors} = await openInContext(context, `${base}?frames=5&world=plaza`);
    await waitForAvatars(page, walkerCount);
    await page.click('a[href="library.html"]');
    await page.waitForURL(`${base}library.html`);
    await waitFor('the library page shows a step', () => page.evaluate(
      () => document.querySelector('canvas') !== null));
    await page.click('a.link:has-text("Worlds")');
    await page.waitForURL((url) => url.href.startsWith(base) && !url.href.includes('library'));
    await waitForAvatars(page);
    assert.deepEqual(prefixProxy.refused, []);
    assert.deepEqual(errors, []);
  } finally {
    await context.close();
    prefixProxy.stop();
  }
});

test('memory use stays constant', async () => {
  const {recordedS, before, after} = await memoryUse;
  console.log(`memory: ${(before / 1e6).toFixed(2)} MB, ${memoryS} s later ` +
    `${(after / 1e6).toFixed(2)} MB`);
  assert.ok(recordedS > 19, `${recordedS} s recorded`);
  assert.ok(after - before < 4e6, `${before} bytes, then ${after}`);
  assert.deepEqual(longRunningPage.errors, []);
});

// This test must be the last one, because it replaces the server.
test('reconnects after the server was restarted', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza');
  await waitForAvatars(page, walkerCount + 1);
  const {port, httpPort} = server;
  await server.kill();
  await waitFor('the problem is shown', () => page.evaluate(() =>
    document.querySelector('.notice:not([hidden])')?.textContent.includes('No server responds')));
  await saveScreenshot(page, 'no_server');
  server = await Server.start(port, httpPort);
  await waitFor('the avatars have been spawned again', () => walkers.world.avatars().length ===
    walkerCount + 1);
  for (let i = 1; i <= walkerCount; ++i) walkers.walk(i);
  await waitFor('the page shows them', () => page.evaluate((count) =>
    window.stridewire.client.state === 'ready' &&
    window.stridewire.sampled()[0].avatars.length === count, walkerCount + 1));
  assert.equal(await page.evaluate(() => document.querySelector('.notice:not([hidden])')), null);
  const before = await waitFor('the avatar is drawn', () => rootOf(page, 1));
  await waitFor('avatars walk', async () => {
    const now = await rootOf(page, 1);
    return now !== null && distanceM(now.rootM, before.rootM) > 0.1;
  });
  await saveScreenshot(page, 'restarted');
  const other = errors.filter((text) => !/WebSocket|Failed to load resource/.test(text));
  assert.deepEqual(other, []);
  await context.close();
});
