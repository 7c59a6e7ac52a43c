// The page in a real browser, with a real server. Environment: STRIDEWIRE_BIN (programs),
// STRIDEWIRE_SCREENSHOTS (where pictures are kept), CHROMIUM (which browser), and for the long versions
// STRIDEWIRE_PAUSE_S=60, STRIDEWIRE_MEMORY_S=180. Run by run.mjs.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {createCrowdPose} from '@stridewire/client';

import {launch} from '../browser.mjs';
import {
  Proxy, Server, Walkers, cameraRests, dumpPoses, figuresShown, framesDrawn, keep, movingShare,
  numberFrom, openIn, openPage, sleep, until,
} from './support.mjs';

const pauseS = numberFrom('STRIDEWIRE_PAUSE_S', 5);
const memoryS = numberFrom('STRIDEWIRE_MEMORY_S', 10);
const walkerCount = 6;
/** For pictures to look at; the others are smaller, for they are drawn by the processor. */
const large = {width: 1280, height: 720};

let server;
let proxy;
let walkers;
let browser;
/** A page that runs beside the others from the start, and what it keeps in memory. */
let lasting;
let remembered;

before(async () => {
  server = await Server.start();
  proxy = await Proxy.start(server.httpPort);
  walkers = new Walkers(server, 'plaza', walkerCount);
  await walkers.start();
  browser = await launch();
  lasting = await openPage(browser, server.httpPort, 'world=plaza', {viewport: {width: 480, height: 320}});
  remembered = watchMemory(lasting);
  remembered.catch(() => {});  // The test that waits for it says so.
});

after(async () => {
  await browser?.close();
  walkers?.stop();
  proxy?.stop();
  await server?.kill();
});

const scene = (page) => page.evaluate(() => {
  const {x, y, width, height} = window.stridewire.worlds[0].view.free;
  return {x: Math.ceil(x), y: Math.ceil(y), width: Math.floor(width), height: Math.floor(height)};
});

/** Root of one avatar as drawn. */
const rootOf = (page, avatar) => page.evaluate((number) => {
  const {avatars, rootsM, timeS} = window.stridewire.sampled()[0];
  const i = avatars.indexOf(number);
  return i < 0 ? null : {timeS, rootM: rootsM.slice(3 * i, 3 * i + 3)};
}, avatar);

const metres = (a, b) => Math.hypot(a[0] - b[0], a[2] - b[2]);

/** Clicks on the figure, as it is drawn, till that one is chosen: others walk by. */
async function click(page, avatar) {
  await until(`avatar ${avatar} is chosen`, async () => {
    const at = await page.evaluate((number) => {
      const {view} = window.stridewire.worlds[0];
      const {x, y, width, height} = view.free;
      for (let row = y + 4; row < y + height; row += 6) {
        for (let column = x + 4; column < x + width; column += 6) {
          if (view.pick(column, row, 6) === number) return {x: column, y: row};
        }
      }
      return null;
    }, avatar);
    if (at) await page.mouse.click(at.x, at.y);
    return page.evaluate((number) => window.stridewire.selection?.avatar === number, avatar);
  });
}

test('figures walk, and their poses are those of the C++ library', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza&mode=full',
    {viewport: large});
  await figuresShown(page, walkerCount + 1);
  // Figures move, and once the camera rests nothing else does: it looks from further away, so that they are
  // a small part of the picture.
  for (let i = 0; i < 5; ++i) await page.keyboard.press('-');
  await cameraRests(page);
  const share = await until('only figures move', async () => {
    const now = await movingShare(page, await scene(page), 300);
    return now > 0.0005 && now < 0.2 ? now : 0;
  });
  const compare = async () => {
    const lines = await dumpPoses(server, 'plaza', 1, 60, 'full');
    await until('the last of them is here', () => page.evaluate(
      (timeS) => window.stridewire.worlds[0].world.recording.lastTimeS >= timeS, lines.at(-1)[1]));
    // The pose of each time, if one of just then was received: null, and none made of those around it, else.
    const ours = await page.evaluate(([times, avatar]) => {
      const {world} = window.stridewire.worlds[0];
      const received = new Set([...world.recording.streams.values()].flatMap(
        ({moments, first}) => moments.slice(first))
        .filter(({parts}) => parts.some(({avatars}) => avatars.includes(avatar)))
        .map(({timeS}) => timeS));
      const out = {
        count: 0, jointCount: 0, avatars: new Uint32Array(0), flags: new Uint8Array(0),
        rootsM: new Float32Array(0), rotations: new Float32Array(0),
      };
      return times.map((timeS) => {
        const count = world.recording.sampleAll(timeS, out);
        const i = out.avatars.subarray(0, count).indexOf(avatar);
        const size = 4 * out.jointCount;
        return i < 0 || !received.has(timeS) ? null : [
          ...out.rootsM.subarray(3 * i, 3 * i + 3), ...out.rotations.subarray(size * i, size * (i + 1))];
      });
    }, [lines.map((line) => line[1]), 1]);
    return {lines, ours};
  };
  const dropped = () => page.evaluate(() => window.stridewire.stats.batchesDropped);
  // On a busy machine the page may lose a tick, of which it is told; then another sixty are compared.
  let lines, ours;
  for (let attempt = 1; ; ++attempt) {
    const droppedBefore = await dropped();
    ({lines, ours} = await compare());
    const lost = ours.filter((pose) => pose === null).length;
    if (lost === 0) break;
    assert.ok(attempt < 20, `the page loses ticks all the time, ${lost} of the last 60`);
    await until('the page is told of ticks that are lost', async () => await dropped() > droppedBefore);
  }
  lines.forEach(([tick, , ...theirs], i) =>
    assert.deepEqual(ours[i], theirs.map(Math.fround), `tick ${tick}`));
  await until('it walks', async () => {
    const drawn = await rootOf(page, 1);
    return drawn !== null && drawn.timeS >= lines[0][1] && metres(ours[0], drawn.rootM) > 0.2;
  });
  const firstMs = await page.evaluate(() => window.stridewire.stats.firstFigureMs);
  console.log(`60 ticks the same, ${(100 * share).toFixed(2)} % of the scene moved, first figures ` +
    `after ${firstMs.toFixed(0)} ms`);
  await keep(page, 'figures');
  assert.deepEqual(errors, []);
  await context.close();
});

test('a step commanded by clicks arrives, and the avatar can be looked into', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza',
    {viewport: large});
  await figuresShown(page, walkerCount + 1);
  const {still} = walkers;
  const before = await rootOf(page, still);
  await click(page, still);
  assert.deepEqual(await page.evaluate(() => window.stridewire.selection),
                   {world: 'plaza', avatar: still});
  const from = walkers.heard.length;
  const lengthM = await page.evaluate(() => Number(document.getElementById('step-length').value));
  await page.getByRole('button', {name: /^Step\b/}).first().click();
  const started = await until('the step starts', () => walkers.heard.slice(from).find(
    ({type, avatar, requestId}) => type === 'started' && avatar === still && requestId !== 0n));
  assert.match(started.kind, /^step/);
  // Looked into while it lasts; should the page miss that, another step is asked for.
  let asked = 1;
  const movement = await until('it is inspected', async () => {
    const seen = await page.evaluate((avatar) => {
      const m = window.stridewire.inspected?.avatar === avatar && window.stridewire.inspected.movement;
      return m && m.weights.length > 0 ? {
        kind: m.kind, requested: m.requested, keytimes: m.keytimesS.length,
        sum: m.weights.reduce((sum, weight) => sum + weight, 0),
      } : null;
    }, still);
    const finished = walkers.heard.slice(from).filter(({type, avatar, requestId}) =>
      type === 'finished' && avatar === still && requestId !== 0n).length;
    if (seen || finished < asked) return seen;
    ++asked;
    await page.getByRole('button', {name: /^Step\b/}).first().click();
    return null;
  });
  assert.ok(Math.abs(movement.sum - 1) < 1e-3 && movement.keytimes > 2, JSON.stringify(movement));
  await keep(page, 'inspected');
  await until('it is over', () => walkers.heard.slice(from).find(
    ({type, avatar, requestId}) => type === 'finished' && avatar === still &&
      requestId === started.requestId));
  const after = await until('it is drawn', async () => {
    const now = await rootOf(page, still);
    return now !== null && metres(now.rootM, before.rootM) > lengthM / 4 ? now : null;
  });
  assert.ok(metres(after.rootM, before.rootM) < 2 * asked * lengthM);
  assert.deepEqual(errors, []);
  await context.close();
});

test('scrubbing shows what was, and live is now', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza');
  await figuresShown(page, walkerCount + 1);
  let past, again;
  for (let attempt = 1; !again; ++attempt) {
    past = await until('one is drawn', () => rootOf(page, 2));
    await until('it went elsewhere', async () => {
      const now = await rootOf(page, 2);
      return now !== null && now.timeS - past.timeS > 1.5 && metres(now.rootM, past.rootM) > 0.3;
    });
    await page.evaluate((timeS) => {
      window.stridewire.playback.pause();
      window.stridewire.playback.seek(timeS);
    }, past.timeS);
    const seen = await until('the past is drawn, or recorded no more', async () => {
      const now = await rootOf(page, 2);
      if (now !== null && Math.abs(now.timeS - past.timeS) < 1e-6) return {now};
      const told = await page.evaluate(() => {
        const {client, playback, stats, worlds: [{world}]} = window.stridewire;
        return {
          firstS: world.recording.firstTimeS, lastS: world.recording.lastTimeS, timeS: playback.timeS,
          paused: playback.paused, live: playback.live, renderS: client.renderTimeS(),
          framesDrawn: stats.framesDrawn, reconnects: stats.reconnects};
      });
      return told.firstS > past.timeS ? {now: null, told, drawnS: now?.timeS} : null;
    });
    again = seen.now;
    if (again) break;
    // A page that was kept from drawing for 18 s has nothing left to go back to.
    const text = `wanted ${past.timeS} s: ${JSON.stringify(seen)}`;
    console.log(text);
    assert.ok(attempt < 3, text);
    await page.evaluate(() => window.stridewire.playback.goLive());
  }
  // As another client saw it, but for batches that this one may have lost.
  const crowd = createCrowdPose();
  const count = walkers.world.recording.sampleAll(past.timeS, crowd);
  const place = crowd.avatars.subarray(0, count).indexOf(2);
  const seen = [...crowd.rootsM.subarray(3 * place, 3 * place + 3)];
  assert.ok(place >= 0 && metres(again.rootM, seen) < 0.05, `${again.rootM}, seen ${seen}`);
  const clip = await scene(page);
  await cameraRests(page);
  await until('the past stands still', async () => await movingShare(page, clip, 200) < 0.0005);
  await keep(page, 'scrubbed');
  // The same by the slider and the button.
  await page.locator('#scrub').focus();
  await page.keyboard.press('PageDown');
  await page.getByRole('button', {name: /^Live/}).click();
  await until('it is live', () => page.evaluate(() => window.stridewire.playback.live));
  const renderS = await page.evaluate(() => window.stridewire.client.renderTimeS());
  await until('what is now is drawn', async () => {
    const now = await rootOf(page, 2);
    return now !== null && now.timeS >= renderS;
  });
  assert.deepEqual(errors, []);
  await context.close();
});

test('a connection that is cut is resumed', async () => {
  const {page, context, errors} = await openPage(browser, proxy.port, 'world=plaza');
  await figuresShown(page, walkerCount + 1);
  for (let cut = 1; cut <= 3; ++cut) {
    proxy.cut();
    await until('it is resumed', () => page.evaluate((count) =>
      window.stridewire.stats.resumes >= count && window.stridewire.client.state === 'ready', cut));
  }
  const before = await until('one is drawn', () => rootOf(page, 1));
  await until('figures walk on', async () => {
    const now = await rootOf(page, 1);
    return now !== null && metres(now.rootM, before.rootM) > 0.1;
  });
  const stats = await page.evaluate(() => window.stridewire.stats);
  assert.equal(stats.resumes, stats.reconnects);
  assert.equal(stats.invalidFrames, 0);
  const other = errors.filter((text) => !/WebSocket|Failed to load resource/.test(text));
  assert.deepEqual(other, []);
  await context.close();
});

test('a browser that stops costs little, and goes on with what is now', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza&mode=full');
  await figuresShown(page, walkerCount + 1);
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
  // Four batches a world and mode, and what events wait; far less than it would have sent.
  assert.ok(mostKiB - beforeKiB < 16 * 1024, `${beforeKiB} KiB, then ${mostKiB}`);
  // Others notice nothing.
  assert.ok(walkers.client.renderTimeS() - stoppedS > pauseS - 1);
  await devtools.send('Debugger.resume');
  await devtools.send('Debugger.disable');
  await until('what is drawn is what is now', async () => {
    const askedS = walkers.client.renderTimeS();
    const now = await rootOf(page, 1);
    return now !== null && now.timeS > askedS - 1;
  });
  const stats = await page.evaluate(() => window.stridewire.stats);
  assert.equal(stats.invalidFrames, 0);
  console.log(`stopped for ${pauseS} s: server ${beforeKiB} KiB, at most ${mostKiB}; ${dropped} batches ` +
    `dropped; ${stats.reconnects} reconnects, ${stats.resumes} resumed`);
  assert.deepEqual(errors, []);
  await context.close();
});

/** Bytes a page keeps once its recording is full, and `memoryS` later. */
async function watchMemory({page, context}) {
  await figuresShown(page, walkerCount + 1);
  const devtools = await context.newCDPSession(page);
  const used = async () => {
    await devtools.send('HeapProfiler.collectGarbage');
    const heap = await devtools.send('Runtime.getHeapUsage');
    return heap.usedSize + (heap.backingStorageSize ?? 0);
  };
  // Its oldest poses have been dropped.
  const recorded = () => page.evaluate(() => {
    const {firstTimeS, lastTimeS} = window.stridewire.worlds[0].world.recording;
    return {firstS: firstTimeS, seconds: lastTimeS - firstTimeS};
  });
  const {firstS} = await recorded();
  const recordedS = await until('the recording is full', async () => {
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

test('works on a phone, in the dark', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza', {
    viewport: {width: 390, height: 844}, colorScheme: 'dark', hasTouch: true, isMobile: true,
    deviceScaleFactor: 2,
  });
  await figuresShown(page, walkerCount + 1);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(wide <= 0, `${wide} pixels too wide`);
  await keep(page, 'phone');
  assert.deepEqual(errors, []);
  await context.close();
});

test('draws as for a graphics card, on uneven ground', async () => {
  const context = await browser.newContext({viewport: {width: 640, height: 400}});
  // Its shaders are others than those for a processor, which this is.
  await context.addInitScript(() => {
    const {getParameter} = WebGL2RenderingContext.prototype;
    const unmaskedRenderer = 0x9246;
    WebGL2RenderingContext.prototype.getParameter = function(name) {
      return name === unmaskedRenderer ? 'A card' : getParameter.call(this, name);
    };
  });
  const {page, errors} = await openIn(
    context, `http://127.0.0.1:${server.httpPort}/?world=graphics&quality=high`);
  await until('the page is there', () => page.evaluate(
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
  await figuresShown(page, 1);
  await until('the ground is there', () => page.evaluate(() =>
    !window.stridewire.worlds[0].view.ground.flat));
  await framesDrawn(page, 3);
  await keep(page, 'graphics');
  assert.equal(await page.evaluate(() => window.stridewire.draw.level), 0);
  assert.deepEqual(errors, []);
  await context.close();
});

test('says in a sentence what to do where nothing can be drawn or joined', async () => {
  const context = await browser.newContext();
  await context.addInitScript(() => {
    const {getContext} = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function(kind, ...rest) {
      return kind.startsWith('webgl') ? null : getContext.call(this, kind, ...rest);
    };
  });
  const {page} = await openIn(context, `http://127.0.0.1:${server.httpPort}/`);
  await until('it says so', async () => /no WebGL 2/.test(await page.locator('.fatal').textContent()));
  await context.close();

  const refused = await openPage(browser, server.httpPort, 'world=not%20a%20name&world=plaza');
  await until('it says so', () => refused.page.evaluate(() =>
    document.querySelector('.notice:not([hidden])')?.textContent.includes('cannot be joined')));
  await until('the other is shown', () => refused.page.evaluate((count) =>
    window.stridewire.sampled().some(({world, avatars}) => world === 'plaza' && avatars.length >= count),
  walkerCount + 1));
  assert.deepEqual(refused.errors, []);
  await refused.context.close();
});

test('memory stays as it is', async () => {
  const {recordedS, before, after} = await remembered;
  console.log(`memory: ${(before / 1e6).toFixed(2)} MB, ${memoryS} s later ` +
    `${(after / 1e6).toFixed(2)} MB`);
  assert.ok(recordedS > 19, `${recordedS} s recorded`);
  assert.ok(after - before < 4e6, `${before} bytes, then ${after}`);
  assert.deepEqual(lasting.errors, []);
});

// The last: what comes after it would have another server.
test('a server that is killed and started again is found again', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=plaza');
  await figuresShown(page, walkerCount + 1);
  const {port, httpPort} = server;
  await server.kill();
  await until('the page says so', () => page.evaluate(
    () => document.querySelector('.notice:not([hidden])')?.textContent.includes('No server answers')));
  await keep(page, 'no_server');
  server = await Server.start(port, httpPort);
  await until('the crowd is back', () => walkers.world.avatars().length === walkerCount + 1);
  for (let i = 1; i <= walkerCount; ++i) walkers.walk(i);
  await until('the page shows it', () => page.evaluate((count) =>
    window.stridewire.client.state === 'ready' &&
    window.stridewire.sampled()[0].avatars.length === count, walkerCount + 1));
  assert.equal(await page.evaluate(() => document.querySelector('.notice:not([hidden])')), null);
  const before = await until('one is drawn', () => rootOf(page, 1));
  await until('figures walk', async () => {
    const now = await rootOf(page, 1);
    return now !== null && metres(now.rootM, before.rootM) > 0.1;
  });
  await keep(page, 'restarted');
  const other = errors.filter((text) => !/WebSocket|Failed to load resource/.test(text));
  assert.deepEqual(other, []);
  await context.close();
});
