// The step and walk tools in a browser: clicks on the ground send an avatar there, on flat terrain
// and hills. The page shows the goal until the walk ends, and the reason if it is rejected.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {Client} from '@stridewire/client';
import WebSocket from 'ws';

import {launch} from '../browser.mjs';
import {
  Proxy, Server, openPage, saveScreenshot, waitFor, waitForAvatars, waitForCamera, waitForFrames,
} from './support.mjs';

let server;
let client;
let browser;

before(async () => {
  server = await Server.start();
  client = new Client({url: `ws://127.0.0.1:${server.httpPort}/stream`, webSocket: WebSocket});
  client.connect();
  browser = await launch();
});

after(async () => {
  await browser?.close();
  client?.close();
  await server?.kill();
});

/** Opens a page with one selected avatar, seen from above, and activates the walk tool. */
async function openWorld(name, options = {}, port = server.httpPort) {
  const events = [];
  const world = client.joinWorld(name);
  world.on('event', (event) => events.push(event));
  const {page, context, errors} = await openPage(
    browser, port, `world=${name}&quality=low&figures=bodies`, {hasTouch: true, ...options});
  const look = (f, argument) => page.evaluate(f, argument);
  const eventually = (what, f, argument) => waitFor(what, () => page.evaluate(f, argument));
  const key = (letter) => page.locator('canvas.scene').press(letter);
  await eventually('the page has loaded', () => window.stridewire?.worlds[0]?.world.skeleton);
  await key('b');
  const avatar = await eventually('the avatar is selected and inspected', () =>
    window.stridewire.inspected && window.stridewire.selection?.avatar);
  await key('m');
  for (let i = 0; i < 8; ++i) await key('ArrowUp');
  /** Frames all avatars, then zooms out `times` times. */
  const frameAll = async (times) => {
    await key('f');
    await waitForFrames(page, 2);  // Zooming earlier would cancel the framing.
    for (let i = 0; i < times; ++i) await key('-');
    await waitForCamera(page);
  };
  await waitForAvatars(page);
  await frameAll(3);
  /** Position of a point of the terrain on the page. Fails if a panel covers it. */
  const onPage = async (x, z) => {
    const {at, free} = await look(([a, b]) => {
      const {view} = window.stridewire.worlds[0];
      return {
        at: view.projectToPage([a, view.terrain.heightAt(a, b), b]), free: {...view.freeArea}};
    }, [x, z]);
    const visible = at.x > free.x && at.x < free.x + free.width &&
      at.y > free.y && at.y < free.y + free.height;
    assert.ok(visible, `${x}, ${z} cannot be clicked: ${JSON.stringify({at, free})}`);
    return at;
  };
  const goalsShown = (goals) => eventually(`${goals} goals are shown`, (n) =>
    window.stridewire.sampled()[0].goals === n, goals);
  const message = () => page.locator('.message').textContent();
  const messageContains = async (text) => {
    let last = '';
    const contains = async () => (last = await message()).includes(text);
    await waitFor(`the message contains: ${text}`, contains, 30).catch((error) => {
      throw new Error(`${error.message}; the message is: ${last}`);
    });
  };
  /** Waits until the inspector shows, for server time `timeS` or later, that the avatar is idle. */
  const isIdle = (timeS = 0) => eventually('the avatar is idle', (t) => {
    const {inspected} = window.stridewire;
    const idle = inspected.timeS >= t && inspected.movement === null && inspected.queueSize === 0;
    return idle ? inspected : null;
  }, timeS);
  /** Returns the walk that `act` requests, as the server has queued it. */
  const walk = async (act) => {
    const from = events.length;
    await act();
    const {requestId} = await waitFor('the walk is accepted', () => events.slice(from).find(
      (event) => event.type === 'accepted' && event.avatar === avatar));
    const item = await waitFor('the walk is queued', async () =>
      (await world.inspect(avatar)).queue.find((queued) => queued.requestId === requestId));
    assert.equal(item.type, 'walk');
    return item;
  };
  /** Checks that the avatar arrives within 1 cm and 1 degree, and that the goal disappears. */
  const arrives = async ({atM, headingRad, requestId}) => {
    const {timeS} = await waitFor('the avatar arrives', () => events.find((event) =>
      event.requestId === requestId && event.type === 'finished' && event.kind === 'stand'));
    await messageContains(`Avatar ${avatar} has arrived.`);
    await goalsShown(0);
    const {basePositionM: base, baseHeadingRad} = await isIdle(timeS);
    assert.ok(Math.hypot(base[0] - atM[0], base[2] - atM[2]) < 0.01, `${base}, not ${atM}`);
    const turn = baseHeadingRad - headingRad;
    assert.ok(Math.abs(Math.atan2(Math.sin(turn), Math.cos(turn))) < Math.PI / 180, `${turn}`);
    return base;
  };
  const near = (atM, x, z) =>
    assert.ok(Math.hypot(atM[0] - x, atM[2] - z) < 0.05, `${atM}, not ${x}, ${z}`);
  return {
    events, world, page, context, errors, avatar, frameAll, look, eventually, key, onPage,
    goalsShown, messageContains, isIdle, walk, arrives, near};
}

test('a click on flat terrain sends the avatar there', async () => {
  const {page, context, errors, look, onPage, goalsShown, walk, arrives, near} =
    await openWorld('level');
  const goal = await onPage(1.1, 1.4);
  const item = await walk(() => page.mouse.click(goal.x, goal.y));
  near(item.atM, 1.1, 1.4);
  await goalsShown(1);
  await saveScreenshot(page, 'walk_level');
  await arrives(item);

  // The avatar is sent back by touch, and then elsewhere with the keyboard only.
  const back = await onPage(0.2, 0.1);
  const second = await walk(() => page.touchscreen.tap(back.x, back.y));
  near(second.atM, 0.2, 0.1);
  await arrives(second);
  const third = await walk(async () => {
    await page.locator('#walk-x').focus();
    for (const value of ['-0.75', '0.5', '-90']) {
      await page.keyboard.press('Control+A');
      await page.keyboard.type(value);
      await page.keyboard.press('Tab');
    }
    await page.keyboard.press('Tab');
    await page.keyboard.press('Enter');
  });
  assert.deepEqual(third.atM, [-0.75, 0, 0.5]);
  assert.ok(Math.abs(third.headingRad + Math.PI / 2) < 1e-9);
  await arrives(third);
  assert.deepEqual(errors, []);
  await context.close();
});

test('a click on hills sends the avatar there, from any camera direction', async () => {
  const {
    page, context, errors, eventually, frameAll, key, look, onPage, goalsShown, walk, arrives, near,
  } = await openWorld('hilly', {colorScheme: 'dark'});
  await page.locator('#command-terrain').selectOption('hills');
  await eventually('the terrain has changed', () =>
    !window.stridewire.worlds[0].view.terrain.isFlat);
  for (const [x, z] of [[1.6, 1.3], [-0.4, 1.8]]) {
    for (let i = 0; i < 6; ++i) await key('ArrowLeft');
    await frameAll(5);
    const goal = await onPage(x, z);
    const item = await walk(() => page.mouse.click(goal.x, goal.y));
    near(item.atM, x, z);
    await goalsShown(1);
    await saveScreenshot(page, 'walk_hills');
    const base = await arrives(item);
    const height = await look(
      ([a, , b]) => window.stridewire.worlds[0].view.terrain.heightAt(a, b), base);
    assert.ok(height > 0.05 && Math.abs(base[1] - height) < 0.1,
      `base frame at ${base[1]} m, terrain at ${height} m`);
  }
  assert.deepEqual(errors, []);
  await context.close();
});

test('a new goal during a walk takes effect with the next step', async () => {
  const {events, page, context, errors, world, avatar, onPage, goalsShown, walk, arrives, near} =
    await openWorld('midway');
  const far = await onPage(1.4, 1.6);
  const first = await walk(() => page.mouse.click(far.x, far.y));
  await waitFor('two steps have started', () => events.filter((event) =>
    event.requestId === first.requestId && event.type === 'started').length >= 2);
  const other = await onPage(-1.2, 0.9);
  const second = await walk(() => page.mouse.click(other.x, other.y));
  near(second.atM, -1.2, 0.9);
  // The first walk is cancelled; only the current step is finished.
  await goalsShown(1);
  const {queue} = await world.inspect(avatar);
  assert.ok(queue.every(({requestId}) => requestId !== first.requestId));
  await arrives(second);
  const accepted = events.findIndex(
    ({type, requestId}) => type === 'accepted' && requestId === second.requestId);
  const late = events.slice(accepted).filter(({requestId}) => requestId === first.requestId);
  const dropped = late.filter(({type}) => type !== 'footStrike' && type !== 'finished');
  assert.deepEqual(dropped.map(({outcome}) => outcome), ['cancelled']);
  assert.ok(late.filter(({type}) => type === 'finished').length <= 1);
  assert.deepEqual(errors, []);
  await context.close();
});

test('shows the reason if a goal cannot be reached', async () => {
  const {events, world, page, context, errors, avatar, eventually, onPage, goalsShown, isIdle} =
    await openWorld('walled');
  const box = {minM: [-2, 0.8], maxM: [2, 2.8], heightM: 0.2};
  assert.ok((await world.setTerrain({heightField: null, boxes: [box]})).ok);
  await eventually('the box is there', () => !window.stridewire.worlds[0].view.terrain.isFlat);
  for (const closed of [false, true]) {
    // If the command panel is closed, the message appears over the scene.
    if (closed) await page.getByRole('button', {name: 'Close Commands', exact: true}).click();
    await waitForCamera(page);
    // An avatar cannot stand on the edge of the box.
    const goal = await onPage(0.1, 0.83);
    const from = events.length;
    await page.mouse.click(goal.x, goal.y);
    const {reason} = await waitFor('the walk is rejected', () => events.slice(from).find(
      (event) => event.type === 'rejected' && event.avatar === avatar));
    assert.match(reason, /too steep or too uneven/);
    const [where, other] = closed ? ['.toast', '.message'] : ['.message', '.toast'];
    await waitFor('the reason is shown', async () => await page.locator(where).isVisible() &&
      await page.locator(where).textContent() === `Avatar ${avatar} stopped: ${reason}.`);
    assert.equal(await page.locator(other).isVisible(), false);
    await saveScreenshot(page, closed ? 'walk_refused_toast' : 'walk_refused');
    await goalsShown(0);
    await isIdle();
  }
  assert.deepEqual(errors, []);
  await context.close();
});

test('outlines a requested footprint until the foot lands', async () => {
  const {events, page, context, errors, avatar, look, eventually, key, onPage, isIdle} =
    await openWorld('feet');
  await key('t');
  // The step starts immediately, so the queue is empty. Every frame is checked, because a step is
  // short. If a slow machine draws no frame during the step, the test requests another one.
  await look(() => {
    window.outlinedDuringStep = false;
    const each = () => {
      const {inspected} = window.stridewire;
      const stepping =
        inspected !== null && inspected.movement !== null && inspected.queueSize === 0;
      window.outlinedDuringStep ||= stepping && window.stridewire.sampled()[0].planned === 1;
      requestAnimationFrame(each);
    };
    each();
  });
  let x = 0.25;
  await waitFor('the outline was drawn during a step', async () => {
    const goal = await onPage(x, 0.35);
    const from = events.length;
    await page.mouse.click(goal.x, goal.y);
    const strike = await waitFor('a foot lands', () => events.slice(from).find((event) =>
      event.type === 'footStrike' && event.avatar === avatar && event.requestId !== 0n));
    const missM = Math.hypot(strike.positionM[0] - x, strike.positionM[2] - 0.35);
    assert.ok(missM < 0.03, `${strike.positionM}`);
    await eventually('the outline is gone', () => window.stridewire.sampled()[0].planned === 0);
    await isIdle();
    x = -x;
    return look(() => window.outlinedDuringStep);
  });
  assert.deepEqual(errors, []);
  await context.close();
});

test('shows a goal again, and its end, after the connection was cut', async () => {
  const proxy = await Proxy.start(server.httpPort);
  const {page, context, look, eventually, goalsShown, messageContains} =
    await openWorld('cut', {}, proxy.port);
  await look(() => {
    window.goalWithoutConnection = false;
    const each = () => {
      const {client} = window.stridewire;
      window.goalWithoutConnection ||=
        client.state !== 'ready' && window.stridewire.sampled()[0].goals > 0;
      requestAnimationFrame(each);
    };
    each();
  });
  await page.locator('#walk-x').fill('3');
  await page.locator('#walk-x').press('Enter');
  await goalsShown(1);
  proxy.cut();
  await eventually('the session is resumed', () => window.stridewire.client.statistics.resumes ===
    1);
  await messageContains('has arrived.');
  await goalsShown(0);
  assert.equal(await look(() => window.goalWithoutConnection), false);
  await context.close();
  proxy.stop();
});

test('hides the goal when the walk, its avatar or the server ends', async () => {
  const {page, context, key, eventually, look, onPage, goalsShown, isIdle, walk} =
    await openWorld('ended');
  const far = await onPage(1.2, 1.5);
  await walk(() => page.mouse.click(far.x, far.y));
  await goalsShown(1);
  await key('x');
  await goalsShown(0);
  await isIdle();

  const back = await onPage(0, 0);
  await walk(() => page.mouse.click(back.x, back.y));
  await goalsShown(1);
  await key('Delete');
  await goalsShown(0);
  await eventually('the avatar is removed', () =>
    window.stridewire.worlds[0].world.avatars().length === 0);

  await key('b');
  await eventually('a new avatar is selected', () => window.stridewire.selection !== null);
  await key('m');
  await key('m');
  await page.locator('#walk-x').fill('40');
  await page.locator('#walk-x').press('Enter');
  await goalsShown(1);
  await server.kill();
  await goalsShown(0);
  assert.notEqual(await look(() => window.stridewire.client.state), 'ready');
  await context.close();
});
